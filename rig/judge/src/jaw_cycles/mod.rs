//! Cycles of the jaw, found in the path of the incisal point, with their figures: in one pass and in memory of a fixed size.
//!
//! [docs/jaw-cycles.md](../../../../docs/jaw-cycles.md) states the definition and its sources. Which motion was played does not
//! matter, nor do its rows: a robot's estimated path is cut like a true one.

mod segments;

use masseter_model::geometry::{Pose, Vec3};
use serde::Serialize;

use self::segments::{Cycle, Sample, Segments};

pub use segments::{COURSE_POINTS, CoursePoint, JawCycle};

/// Time between samples, ns.
const SAMPLE_NS: u64 = 4_000_000;
/// Cycles that are kept one by one, and those with their course. Statistics count all.
const MOST_CYCLES: usize = 512;
const MOST_COURSES: usize = 64;

/// The cycles of a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct JawCycleFigures {
    /// Cycles found.
    pub count: u64,
    /// Durations, s.
    pub duration_s: Statistic,
    /// Durations of the openings, s.
    pub opening_s: Statistic,
    /// Durations of the closings, s.
    pub closing_s: Statistic,
    /// How far the incisal point goes down, mm.
    pub opening_mm: Statistic,
    /// Lateral widths, mm.
    pub lateral_mm: Statistic,
    /// Greatest velocities downwards, mm/s.
    pub opening_mm_s: Statistic,
    /// Greatest velocities upwards, mm/s.
    pub closing_mm_s: Statistic,
    /// Greatest forces, N; without a value where the jaws cannot touch, and on the robot.
    pub force_n: Statistic,
    /// The first 512 cycles.
    pub cycles: Vec<JawCycle>,
    /// The courses of the first 64 cycles that have one.
    #[serde(skip)]
    pub courses: Vec<[CoursePoint; COURSE_POINTS]>,
    /// Mean and standard deviation of all courses; empty without one.
    #[serde(skip)]
    pub mean_course: Vec<[CoursePoint; 2]>,
}

/// Collects them.
#[derive(Debug, Clone)]
pub(super) struct JawCycles {
    /// The incisal point in the platform frame.
    incisal_m: Vec3,
    has_force: bool,
    segments: Segments,
    next_ns: u64,
    /// The greatest force since the last sample, N.
    force_n: f64,
    moments: [Moments; QUANTITIES],
    courses: Box<[[Moments; 3]; COURSE_POINTS]>,
    found: JawCycleFigures,
}

/// Quantities with a statistic.
const QUANTITIES: usize = 8;

impl JawCycles {
    /// For a jaw with this incisal point in the platform frame. `has_force`: whether forces between the jaws are known.
    pub(super) fn new(incisal_m: [f64; 3], has_force: bool) -> Self {
        Self {
            incisal_m: incisal_m.into(),
            has_force,
            segments: Segments::default(),
            next_ns: 0,
            force_n: 0.0,
            moments: Default::default(),
            courses: Box::new([[Moments::default(); 3]; COURSE_POINTS]),
            found: JawCycleFigures::default(),
        }
    }

    /// The pose of the platform at a time since the first SYNC, with the vertical force on the jaw.
    pub(super) fn add_pose(&mut self, since_ns: u64, pose: &Pose, force_n: f64) {
        self.force_n = self.force_n.max(force_n);
        let place = pose.translation.vector + pose.rotation * self.incisal_m;
        if since_ns < self.next_ns || !place.iter().all(|coordinate| coordinate.is_finite()) {
            return;
        }
        self.next_ns = (since_ns / SAMPLE_NS + 1) * SAMPLE_NS;
        let force_n = std::mem::take(&mut self.force_n);
        let sample = Sample { at_s: since_ns as f64 / 1e9, place_m: place.into(), force_n };
        if let Some(cycle) = self.segments.add_sample(sample) {
            self.add_cycle(cycle);
        }
    }

    fn add_cycle(&mut self, Cycle { mut figures, course }: Cycle) {
        figures.force_n = figures.force_n.filter(|_| self.has_force);
        self.found.count += 1;
        for (moments, value) in self.moments.iter_mut().zip(quantities(&figures)) {
            if let Some(value) = value {
                moments.add(value);
            }
        }
        if self.found.cycles.len() < MOST_CYCLES {
            self.found.cycles.push(figures);
        }
        let Some(course) = course else { return };
        for (moments, point) in self.courses.iter_mut().zip(&course) {
            let values = [point.opening_mm, point.lateral_mm, point.force_n];
            moments.iter_mut().zip(values).for_each(|(moments, value)| moments.add(value));
        }
        if self.found.courses.len() < MOST_COURSES {
            self.found.courses.push(course);
        }
    }

    /// The figures of all cycles.
    pub(super) fn into_figures(mut self) -> JawCycleFigures {
        if let Some(last) = std::mem::take(&mut self.segments).last_cycle() {
            self.add_cycle(last);
        }
        let has_course = !self.found.courses.is_empty();
        let [duration_s, opening_s, closing_s, opening_mm, lateral_mm, opening_mm_s, closing_mm_s, force_n] =
            self.moments.map(Moments::statistic);
        JawCycleFigures {
            duration_s,
            opening_s,
            closing_s,
            opening_mm,
            lateral_mm,
            opening_mm_s,
            closing_mm_s,
            force_n,
            mean_course: if has_course { self.courses.iter().map(mean_and_sd).collect() } else { Vec::new() },
            ..self.found
        }
    }
}

/// In the order of the statistics.
fn quantities(cycle: &JawCycle) -> [Option<f64>; QUANTITIES] {
    [
        cycle.duration_s,
        Some(cycle.opening_s),
        Some(cycle.closing_s),
        Some(cycle.opening_mm),
        Some(cycle.lateral_mm),
        Some(cycle.opening_mm_s),
        Some(cycle.closing_mm_s),
        cycle.force_n,
    ]
}

fn mean_and_sd(moments: &[Moments; 3]) -> [CoursePoint; 2] {
    let [opening, lateral, force] = moments.map(Moments::statistic);
    let point = |of: fn(Statistic) -> Option<f64>| CoursePoint {
        opening_mm: of(opening).unwrap_or_default(),
        lateral_mm: of(lateral).unwrap_or_default(),
        force_n: of(force).unwrap_or_default(),
    };
    [point(|statistic| statistic.mean), point(|statistic| statistic.sd)]
}

/// Mean and standard deviation.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Statistic {
    /// Values.
    pub count: u64,
    /// Their mean; none without a value.
    pub mean: Option<f64>,
    /// Their standard deviation, as of a sample; none with fewer than two.
    pub sd: Option<f64>,
}

/// Collects them (Welford 1962).
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moments {
    count: u64,
    mean: f64,
    squares: f64,
}

impl Moments {
    pub(super) fn add(&mut self, value: f64) {
        self.count += 1;
        let from_mean = value - self.mean;
        self.mean += from_mean / self.count as f64;
        self.squares += from_mean * (value - self.mean);
    }

    fn statistic(self) -> Statistic {
        let sd = (self.count > 1).then(|| (self.squares / (self.count - 1) as f64).sqrt());
        Statistic { count: self.count, mean: (self.count > 0).then_some(self.mean), sd }
    }
}

#[cfg(test)]
mod tests;
