//! One cycle: its figures, and its course over the share of its duration.

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
