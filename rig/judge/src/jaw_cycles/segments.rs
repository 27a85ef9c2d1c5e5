//! Cuts the path of the incisal point into movements away from the closed jaw and back.
//!
//! A movement is a way of 3 mm from the most closed place since the last movement. Its beginning is the last sample within
//! 0.5 mm of that place. The return is a way back by 3 mm, and by half of the way out, from the farthest place; its end is the
//! first sample within 0.5 mm of the most closed place that follows. The cycle lasts until the next movement begins, so the
//! time in which the jaw stays closed belongs to the cycle before. After a rest of more than half a second, or at the end of the
//! motion, there is no such movement.

use super::cycle::{CLOSED_M, Course, JawCycle, Part, Sample, course};

/// A cycle with its course, if it has one.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cycle {
    pub figures: JawCycle,
    pub course: Option<Course>,
}

/// The least movement and return, m: chewing has 16 to 20 mm, noise of a tracker 0.03 mm, and a jaw that speaks less than 3.
const LEAST_M: f64 = 0.003;
/// The share of the way out that a return takes back.
const LEAST_SHARE: f64 = 0.5;
/// A longer rest between the teeth ends a bout of chewing, s: pauses within a bout take 0.1 to 0.2 s.
const LONGEST_REST_S: f64 = 0.5;
/// A longer cycle is none, s.
const LONGEST_S: f64 = 10.0;
/// Samples in which the beginning of a movement is looked for, s.
const LOOK_BACK_S: f64 = 2.0;

/// Where the jaw is in its cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    /// Closed, or on the way there after this farthest sample of a cycle.
    Closed { far: Option<usize> },
    /// Moved beyond the least way; the farthest sample so far.
    Moved { far: usize },
}

/// The cutter: it holds the samples of one cycle.
#[derive(Debug, Clone)]
pub(super) struct Segments {
    samples: Vec<Sample>,
    phase: Phase,
    /// The least distance since the last farthest sample, m.
    least_m: f64,
    /// The most closed sample before the movement.
    home: Option<Sample>,
}

impl Default for Segments {
    fn default() -> Self {
        Self { samples: Vec::new(), phase: Phase::Closed { far: None }, least_m: f64::INFINITY, home: None }
    }
}

impl Segments {
    /// Takes the next sample; returns the cycle that it ends.
    pub(super) fn add_sample(&mut self, sample: Sample) -> Option<Cycle> {
        self.samples.push(sample);
        let newest = self.samples.len() - 1;
        let away_m = sample.away_m();
        match self.phase {
            Phase::Closed { far } => {
                self.least_m = self.least_m.min(away_m);
                if away_m > self.least_m + LEAST_M {
                    return self.begin(far, newest);
                }
                self.wait(far)
            }
            Phase::Moved { far } => {
                let far = if away_m > self.samples[far].away_m() { newest } else { far };
                self.phase = Phase::Moved { far };
                let far_m = self.samples[far].away_m();
                let back_m = LEAST_M.max(LEAST_SHARE * (far_m - self.least_m));
                if away_m < far_m - back_m {
                    self.phase = Phase::Closed { far: Some(far) };
                    self.least_m = away_m;
                } else if self.lasts_s() > LONGEST_S {
                    *self = Self::default();
                }
                None
            }
        }
    }

    /// The last cycle, if the jaw has returned.
    pub(super) fn last_cycle(mut self) -> Option<Cycle> {
        match self.phase {
            Phase::Closed { far: Some(far) } => Some(self.cycle(far, None)),
            _ => None,
        }
    }

    /// Begins a movement, which may end a cycle.
    fn begin(&mut self, far: Option<usize>, newest: usize) -> Option<Cycle> {
        let begin = self.last_closed();
        let rested = &self.samples[far.unwrap_or_default()..=begin];
        let home = rested.iter().min_by(|a, b| a.away_m().total_cmp(&b.away_m())).copied();
        let cycle = far.map(|far| self.cycle(far, Some(begin)));
        self.home = home;
        self.samples.drain(..begin);
        self.phase = Phase::Moved { far: newest - begin };
        cycle
    }

    /// The jaw stays closed: a rest ends the cycle, and old samples go.
    fn wait(&mut self, far: Option<usize>) -> Option<Cycle> {
        let Some(far) = far else {
            self.forget();
            return None;
        };
        let closed = self.closed(far, self.samples.len() - 1);
        let rests_s = self.samples[self.last_closed()].at_s - self.samples[closed].at_s;
        if rests_s <= LONGEST_REST_S && self.lasts_s() <= LONGEST_S {
            return None;
        }
        let cycle = self.cycle(far, None);
        self.phase = Phase::Closed { far: None };
        self.samples.drain(..closed);
        Some(cycle)
    }

    /// Drops what is too old to be the beginning of a movement; half of the samples at a time.
    fn forget(&mut self) {
        if self.lasts_s() > 2.0 * LOOK_BACK_S {
            let newest_s = self.samples[self.samples.len() - 1].at_s;
            self.samples.retain(|sample| sample.at_s > newest_s - LOOK_BACK_S);
            self.least_m = self.samples.iter().map(Sample::away_m).fold(f64::INFINITY, f64::min);
        }
    }

    fn lasts_s(&self) -> f64 {
        self.samples[self.samples.len() - 1].at_s - self.samples[0].at_s
    }

    /// The last sample at which the jaw is closed: a movement may begin there.
    fn last_closed(&self) -> usize {
        let is_closed = |sample: &Sample| sample.away_m() <= self.least_m + CLOSED_M;
        self.samples.iter().rposition(is_closed).unwrap_or_default()
    }

    /// The first sample from the farthest one to `end` at which the jaw is closed.
    fn closed(&self, far: usize, end: usize) -> usize {
        let part = &self.samples[far..=end];
        let least_m = part.iter().map(Sample::away_m).fold(f64::INFINITY, f64::min);
        let first = part.iter().position(|sample| sample.away_m() <= least_m + CLOSED_M);
        far + first.unwrap_or_default()
    }

    /// The cycle of the samples until the next movement, or until the last one.
    fn cycle(&mut self, far: usize, next: Option<usize>) -> Cycle {
        let end = next.unwrap_or(self.samples.len() - 1);
        let closed = self.closed(far, end);
        let rests_s = self.samples[end].at_s - self.samples[closed].at_s;
        let next = next.filter(|_| rests_s <= LONGEST_REST_S);
        let part = Part {
            home: self.home.unwrap_or(self.samples[0]),
            samples: &self.samples[..=end],
            far,
            closed,
            next,
        };
        let figures = JawCycle::new(&part);
        Cycle { course: course(&part, figures.kind), figures }
    }
}
