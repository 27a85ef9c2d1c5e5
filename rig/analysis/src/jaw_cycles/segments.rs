//! Cuts the path of the incisal point into cycles, by its height alone.
//!
//! An opening is a fall by 3 mm from the highest place since the last opening. Its beginning is the last sample within
//! 0.5 mm of that place. A closing is a rise by 3 mm, and by half of the fall, from the lowest place; its end is the first
//! sample within 0.5 mm of the highest place that follows. The cycle lasts until the next opening begins, so the time in
//! which the teeth are together belongs to the cycle before. After a rest of more than a second, or at the end of the
//! run, there is no such opening.

use super::cycle::{Cycle, Place, Sample};

/// The least opening and closing, m: chewing has 16 to 20 mm, noise of a tracker 0.03 mm, and a jaw that speaks less than 3.
const LEAST_M: f64 = 0.003;
/// The share of the opening that a closing takes back.
const LEAST_SHARE: f64 = 0.5;
/// Nearer to the highest place the jaw counts as closed, m.
const CLOSED_M: f64 = 0.0005;
/// A longer rest between the teeth ends a bout of chewing, s.
const LONGEST_REST_S: f64 = 1.0;
/// A longer cycle is none, s.
const LONGEST_S: f64 = 10.0;
/// Samples in which the beginning of an opening is looked for, s.
const LOOK_BACK_S: f64 = 2.0;

/// Where the jaw is in its cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    /// Closed, or on the way there after this lowest sample of a cycle.
    Closed { bottom: Option<usize> },
    /// Opened beyond the least opening; the lowest sample so far.
    Opened { bottom: usize },
}

/// The cutter: it holds the samples of one cycle.
#[derive(Debug, Clone)]
pub(super) struct Segments {
    samples: Vec<Sample>,
    phase: Phase,
    /// The highest since the last lowest sample, m.
    top_m: f64,
}

impl Default for Segments {
    fn default() -> Self {
        Self { samples: Vec::new(), phase: Phase::Closed { bottom: None }, top_m: f64::NEG_INFINITY }
    }
}

impl Segments {
    /// Takes the next sample; returns the cycle that it ends.
    pub(super) fn take(&mut self, sample: Sample) -> Option<Cycle> {
        self.samples.push(sample);
        let newest = self.samples.len() - 1;
        let height_m = sample.height_m();
        match self.phase {
            Phase::Closed { bottom } => {
                self.top_m = self.top_m.max(height_m);
                if height_m < self.top_m - LEAST_M {
                    return self.open(bottom, newest);
                }
                self.wait(bottom)
            }
            Phase::Opened { bottom } => {
                let lowest = if height_m < self.samples[bottom].height_m() { newest } else { bottom };
                self.phase = Phase::Opened { bottom: lowest };
                let lowest_m = self.samples[lowest].height_m();
                let rise_m = LEAST_M.max(LEAST_SHARE * (self.top_m - lowest_m));
                if height_m > lowest_m + rise_m {
                    self.phase = Phase::Closed { bottom: Some(lowest) };
                    self.top_m = height_m;
                } else if self.lasts_s() > LONGEST_S {
                    *self = Self::default();
                }
                None
            }
        }
    }

    /// The last cycle, if it has closed.
    pub(super) fn finish(mut self) -> Option<Cycle> {
        match self.phase {
            Phase::Closed { bottom: Some(bottom) } => Some(self.cycle(bottom, None)),
            _ => None,
        }
    }

    /// Begins an opening, which may end a cycle.
    fn open(&mut self, bottom: Option<usize>, newest: usize) -> Option<Cycle> {
        let is_closed = |sample: &Sample| sample.height_m() >= self.top_m - CLOSED_M;
        let begin = self.samples.iter().rposition(is_closed).unwrap_or_default();
        let cycle = bottom.map(|bottom| self.cycle(bottom, Some(begin)));
        self.samples.drain(..begin);
        self.phase = Phase::Opened { bottom: newest - begin };
        self.top_m = self.samples[0].height_m();
        cycle
    }

    /// The jaw stays closed: a rest ends the cycle, and old samples go.
    fn wait(&mut self, bottom: Option<usize>) -> Option<Cycle> {
        let Some(bottom) = bottom else {
            self.forget();
            return None;
        };
        let newest = self.samples.len() - 1;
        let closed = self.closed(bottom, newest);
        let rests_s = self.samples[newest].at_s - self.samples[closed].at_s;
        if rests_s <= LONGEST_REST_S && self.lasts_s() <= LONGEST_S {
            return None;
        }
        let cycle = self.cycle(bottom, None);
        self.phase = Phase::Closed { bottom: None };
        self.samples.drain(..closed);
        Some(cycle)
    }

    /// Drops what is too old to be the beginning of an opening; half of the samples at a time.
    fn forget(&mut self) {
        if self.lasts_s() > 2.0 * LOOK_BACK_S {
            let newest_s = self.samples[self.samples.len() - 1].at_s;
            self.samples.retain(|sample| sample.at_s > newest_s - LOOK_BACK_S);
            self.top_m = self.samples.iter().map(Sample::height_m).fold(f64::NEG_INFINITY, f64::max);
        }
    }

    fn lasts_s(&self) -> f64 {
        self.samples[self.samples.len() - 1].at_s - self.samples[0].at_s
    }

    /// The first sample from the lowest one to `end` at which the jaw is closed.
    fn closed(&self, bottom: usize, end: usize) -> usize {
        let part = &self.samples[bottom..=end];
        let top_m = part.iter().map(Sample::height_m).fold(f64::NEG_INFINITY, f64::max);
        let first = part.iter().position(|sample| sample.height_m() >= top_m - CLOSED_M);
        bottom + first.unwrap_or_default()
    }

    /// The cycle of the samples until the next opening, or until the last one.
    fn cycle(&mut self, bottom: usize, next: Option<usize>) -> Cycle {
        let end = next.unwrap_or(self.samples.len() - 1);
        let closed = self.closed(bottom, end);
        let rests_s = self.samples[end].at_s - self.samples[closed].at_s;
        let next = next.filter(|_| rests_s <= LONGEST_REST_S);
        Cycle::new(&self.samples[..=end], &Place { bottom, closed, next })
    }
}
