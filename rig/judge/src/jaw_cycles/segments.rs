//! Cuts the path of the incisal point into cycles, by its height alone.
//!
//! An opening is a fall by 3 mm from the highest place since the last opening. Its beginning is the last sample within
//! 0.5 mm of that place. A closing is a rise by 3 mm, and by half of the fall, from the lowest place; its end is the first
//! sample within 0.5 mm of the highest place that follows. The cycle lasts until the next opening begins, so the time in
//! which the teeth are together belongs to the cycle before. After a rest of more than a second, or at the end of the
//! run, there is no such opening.

use serde::Serialize;

/// Points of a course, from the beginning of the opening to that of the next one.
pub const COURSE_POINTS: usize = 51;
/// A velocity is the way of so many samples.
const VELOCITY_SAMPLES: usize = 5;

/// A sample of the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sample {
    /// Since the run's first SYNC, s.
    pub at_s: f64,
    /// The incisal point: anterior, left, up, base frame, m.
    pub place_m: [f64; 3],
    /// The greatest vertical force on the jaw since the sample before, N.
    pub force_n: f64,
}

impl Sample {
    pub(super) fn height_m(&self) -> f64 {
        self.place_m[2]
    }
}

/// Where a cycle has its lowest sample, where the jaw is closed again, and where the next opening begins.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub bottom: usize,
    pub closed: usize,
    pub next: Option<usize>,
}

/// A cycle of the jaw.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JawCycle {
    /// When the opening begins, s since the run's first SYNC.
    pub began_s: f64,
    /// From the beginning of the opening to that of the next one, s; none of the last cycle of a bout.
    pub duration_s: Option<f64>,
    /// From its beginning to the lowest place, s.
    pub opening_s: f64,
    /// From the lowest place until the jaw is closed, s.
    pub closing_s: f64,
    /// How far the incisal point goes down, mm.
    pub opening_mm: f64,
    /// From the rightmost to the leftmost place, mm.
    pub lateral_mm: f64,
    /// The greatest velocity downwards, mm/s.
    pub opening_mm_s: f64,
    /// The greatest velocity upwards, mm/s.
    pub closing_mm_s: f64,
    /// The greatest vertical force on the jaw, N; none where the jaws cannot touch, and on the robot.
    pub force_n: Option<f64>,
}

/// A point of a course, from the place and the time where the opening begins.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CoursePoint {
    /// Downwards, mm.
    pub opening_mm: f64,
    /// To the left, mm.
    pub lateral_mm: f64,
    /// Vertical force on the jaw, N.
    pub force_n: f64,
}

/// A cycle with its course; none of the last cycle of a bout.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cycle {
    pub figures: JawCycle,
    pub course: Option<[CoursePoint; COURSE_POINTS]>,
}

impl Cycle {
    /// Of samples from the beginning of the opening on.
    pub(super) fn new(samples: &[Sample], place: &Place) -> Self {
        let [first, bottom, closed] = [0, place.bottom, place.closed].map(|at| samples[at]);
        let aside = samples.iter().map(|sample| sample.place_m[1]);
        let [right, left] = aside.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], at_m| {
            [least.min(at_m), most.max(at_m)]
        });
        let figures = JawCycle {
            began_s: first.at_s,
            duration_s: place.next.map(|next| samples[next].at_s - first.at_s),
            opening_s: bottom.at_s - first.at_s,
            closing_s: closed.at_s - bottom.at_s,
            opening_mm: (first.height_m() - bottom.height_m()) * 1e3,
            lateral_mm: (left - right) * 1e3,
            opening_mm_s: fastest(&samples[..=place.bottom], -1.0),
            closing_mm_s: fastest(&samples[place.bottom..=place.closed], 1.0),
            force_n: Some(samples.iter().map(|sample| sample.force_n).fold(0.0, f64::max)),
        };
        Self { figures, course: place.next.map(|next| course(&samples[..=next])) }
    }
}

/// The greatest velocity of the incisal point upwards, or with the sign −1 downwards, mm/s.
fn fastest(samples: &[Sample], sign: f64) -> f64 {
    let steps = samples.windows(VELOCITY_SAMPLES + 1);
    let velocities = steps.map(|part| {
        let (from, to) = (part[0], part[VELOCITY_SAMPLES]);
        sign * 1e3 * (to.height_m() - from.height_m()) / (to.at_s - from.at_s)
    });
    velocities.fold(0.0, f64::max)
}

fn course(samples: &[Sample]) -> [CoursePoint; COURSE_POINTS] {
    let first = samples[0];
    let length_s = samples[samples.len() - 1].at_s - first.at_s;
    std::array::from_fn(|point| {
        let at_s = first.at_s + length_s * point as f64 / (COURSE_POINTS - 1) as f64;
        let after = samples.partition_point(|sample| sample.at_s < at_s).clamp(1, samples.len() - 1);
        let (before, after) = (samples[after - 1], samples[after]);
        let share = ((at_s - before.at_s) / (after.at_s - before.at_s)).clamp(0.0, 1.0);
        let between = |from: f64, to: f64| from + share * (to - from);
        let moved_mm =
            |axis: usize| (between(before.place_m[axis], after.place_m[axis]) - first.place_m[axis]) * 1e3;
        CoursePoint {
            opening_mm: -moved_mm(2),
            lateral_mm: moved_mm(1),
            force_n: between(before.force_n, after.force_n),
        }
    })
}

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
    pub(super) fn add_sample(&mut self, sample: Sample) -> Option<Cycle> {
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
    pub(super) fn last_cycle(mut self) -> Option<Cycle> {
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
