//! The figures of one cycle of the jaw, its kind and its side. [docs/jaw-cycles.md](../../../../docs/jaw-cycles.md) has the rule
//! in words, with its sources.

use std::fmt;

use masseter_model::geometry::Vec3;
use serde::Serialize;

use crate::statistic::Statistic;

/// Points of a course.
pub const COURSE_POINTS: usize = 51;
/// A velocity is the way of so many samples.
const VELOCITY_SAMPLES: usize = 5;
/// Nearer to the most closed place the jaw counts as closed, m.
pub(super) const CLOSED_M: f64 = 0.0005;
/// The jaw returns if it comes so near to where it began, m, or within this share of the way out.
const RETURN_M: f64 = 0.001;
const RETURN_SHARE: f64 = 0.2;
/// The teeth meet so near to the closed place, m.
const MEET_M: f64 = 0.001;
/// The least way of a glide to a side or forward, mm; a glide's way is at least this share of its way down, and it goes down
/// by at most so much, mm: guidance of 63° or less.
const GLIDE_MM: f64 = 2.0;
const GLIDE_SHARE: f64 = 0.5;
const GLIDE_DOWN_MM: f64 = 10.0;
/// The least and the greatest opening of chewing, mm, and its longest way there and back, s.
const CHEW_MM: [f64; 2] = [5.0, 30.0];
const CHEW_S: f64 = 2.0;
/// The least opening for the sake of opening, mm.
const OPENING_MM: f64 = 10.0;
/// A side is where the jaw goes by so much, mm.
const SIDE_MM: f64 = 1.0;
/// A stay near the farthest place, within this share of the way or within [`CLOSED_M`], is a hold if it takes long: a longer share
/// of the time than in smooth movements.
const HOLD_WAY_SHARE: f64 = 0.05;
const HOLD_TIME_SHARE: f64 = 1.0 / 3.0;

/// A sample of the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sample {
    /// Since the motion began, s.
    pub at_s: f64,
    /// The incisal point from its closed place: anterior, left, up, m.
    pub place_m: [f64; 3],
    /// The greatest vertical force on the jaw since the sample before, N.
    pub force_n: f64,
    /// Whether the clock of the motion has its full speed.
    pub speed: MotionSpeed,
}

/// The speed of the motion's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum MotionSpeed {
    Full,
    /// On the way to full speed, or to the stop.
    Ramped,
}

impl Sample {
    /// Distance from the closed place, m.
    pub(super) fn away_m(&self) -> f64 {
        Vec3::from(self.place_m).norm()
    }

    fn distance_m(&self, other: &Self) -> f64 {
        (Vec3::from(self.place_m) - Vec3::from(other.place_m)).norm()
    }

    fn height_m(&self) -> f64 {
        self.place_m[2]
    }
}

/// What a cycle is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum JawCycleKind {
    /// Chewing.
    Chew,
    /// Opening for its own sake.
    Opening,
    /// To a side, along the teeth.
    Lateral,
    /// Forward, along the teeth.
    Protrusive,
    /// None of these, or without a return.
    Unclear,
}

/// Where chewing closes from, and where a lateral movement goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum JawSide {
    /// The person's left.
    Left,
    /// The person's right.
    Right,
    /// Both or neither.
    Both,
}

/// Why a cycle does not count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LeftOut {
    /// The rig starts or stops the motion meanwhile.
    Ramp,
    /// It lies outside of `study.window_s`.
    Window,
    /// `study.leave_out` names it.
    ByHand,
}

/// In words they are what a summary has.
macro_rules! words_of_the_summary {
    ($($of:ty),+) => { $(
        impl fmt::Display for $of {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.serialize(f)
            }
        }
    )+ };
}

words_of_the_summary!(JawCycleKind, JawSide, LeftOut);

/// A cycle of the jaw.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JawCycle {
    /// Its number, from 1.
    pub number: u64,
    /// What it is.
    pub kind: JawCycleKind,
    /// Its side, of chewing and lateral movements.
    pub side: Option<JawSide>,
    /// Why it does not count; none of one that counts.
    pub left_out: Option<LeftOut>,
    /// When it begins, s since the motion began.
    pub began_s: f64,
    /// From its beginning to that of the next one, s; none of the last cycle of a bout.
    pub duration_s: Option<f64>,
    /// From its beginning to the farthest place, or to the hold there, s.
    pub opening_s: f64,
    /// Stay at the farthest place, s; 0 where the jaw turns at once.
    pub hold_s: f64,
    /// From there until the jaw is closed, s.
    pub closing_s: f64,
    /// From there to the next beginning, s; none where the teeth do not meet, and of the last cycle of a bout.
    pub occlusal_s: Option<f64>,
    /// How far the incisal point goes down from the most closed place, mm.
    pub opening_mm: f64,
    /// From the rightmost to the leftmost place, mm.
    pub lateral_mm: f64,
    /// How far it goes forward from the most closed place, mm.
    pub forward_mm: f64,
    /// The greatest velocity downwards, mm/s.
    pub opening_mm_s: f64,
    /// The greatest velocity upwards, mm/s.
    pub closing_mm_s: f64,
    /// The greatest vertical force on the jaw, N; none where the jaws cannot touch, and on the robot.
    pub force_n: Option<f64>,
}

/// A point of a course, from the most closed place before the cycle.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CoursePoint {
    /// Downwards, mm.
    pub opening_mm: f64,
    /// To the left, mm.
    pub lateral_mm: f64,
    /// Vertical force on the jaw, N.
    pub force_n: f64,
}

/// A quantity of a cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct CycleQuantity {
    /// Its key in a summary, and its column in a table.
    pub name: &'static str,
    /// What it is.
    pub about: &'static str,
    /// Its unit.
    pub unit: &'static str,
}

type ValueOfCycle = fn(&JawCycle) -> Option<f64>;

const fn quantity(
    name: &'static str,
    unit: &'static str,
    about: &'static str,
    value: ValueOfCycle,
) -> (CycleQuantity, ValueOfCycle) {
    (CycleQuantity { name, about, unit }, value)
}

/// The quantities of a cycle that have statistics, with their values in a cycle.
pub const QUANTITIES: [(CycleQuantity, ValueOfCycle); 11] = [
    quantity("duration_s", "s", "duration, beginning to beginning", |of| of.duration_s),
    quantity("opening_s", "s", "duration of the opening", |of| Some(of.opening_s)),
    quantity("hold_s", "s", "hold at the farthest place", |of| Some(of.hold_s)),
    quantity("closing_s", "s", "duration of the closing", |of| Some(of.closing_s)),
    quantity("occlusal_s", "s", "occlusal phase", |of| of.occlusal_s),
    quantity("opening_mm", "mm", "opening", |of| Some(of.opening_mm)),
    quantity("lateral_mm", "mm", "lateral width", |of| Some(of.lateral_mm)),
    quantity("forward_mm", "mm", "way forward", |of| Some(of.forward_mm)),
    quantity("opening_mm_s", "mm/s", "peak opening velocity", |of| Some(of.opening_mm_s)),
    quantity("closing_mm_s", "mm/s", "peak closing velocity", |of| Some(of.closing_mm_s)),
    quantity("force_n", "N", "peak bite force", |of| of.force_n),
];

/// Mean and standard deviation of courses, point by point; empty without a course.
pub fn mean_course(courses: &[&Course]) -> Vec<[CoursePoint; 2]> {
    let statistic = |point: usize, of: fn(&CoursePoint) -> f64| {
        let values: Vec<_> = courses.iter().map(|course| of(&course[point])).collect();
        let Statistic { mean, sd, .. } = Statistic::of(&values);
        [mean, sd].map(Option::unwrap_or_default)
    };
    let mean_and_sd = |point: usize| {
        let opening = statistic(point, |at| at.opening_mm);
        let lateral = statistic(point, |at| at.lateral_mm);
        let force = statistic(point, |at| at.force_n);
        [0, 1].map(|of| CoursePoint { opening_mm: opening[of], lateral_mm: lateral[of], force_n: force[of] })
    };
    let points = if courses.is_empty() { 0 } else { COURSE_POINTS };
    (0..points).map(mean_and_sd).collect()
}

/// Points at even shares of a cycle: of chewing until the next cycle begins, of others until the jaw is closed.
pub type Course = [CoursePoint; COURSE_POINTS];

/// The samples of a cycle, from its beginning on.
pub(super) struct Part<'a> {
    /// The most closed sample before.
    pub home: Sample,
    pub samples: &'a [Sample],
    /// The farthest sample, that with which the jaw is closed again, and that with which the next cycle begins.
    pub far: usize,
    pub closed: usize,
    pub next: Option<usize>,
}

impl JawCycle {
    pub(super) fn new(of: &Part<'_>) -> Self {
        let at_s = |sample: usize| of.samples[sample].at_s;
        let [left, right, forward, down] =
            [(1, 1.0), (1, -1.0), (0, 1.0), (2, -1.0)].map(|(axis, sign)| of.farthest_mm(0, axis, sign));
        let [hold, held] = of.hold();
        let is_ramped = of.samples[..=of.next.unwrap_or(of.closed)]
            .iter()
            .any(|sample| sample.speed == MotionSpeed::Ramped);
        let mut cycle = Self {
            number: 0,
            kind: JawCycleKind::Unclear,
            side: None,
            left_out: is_ramped.then_some(LeftOut::Ramp),
            began_s: at_s(0),
            duration_s: of.next.map(|next| at_s(next) - at_s(0)),
            opening_s: at_s(hold) - at_s(0),
            hold_s: at_s(held) - at_s(hold),
            closing_s: at_s(of.closed) - at_s(held),
            occlusal_s: of.next.filter(|_| of.teeth_meet()).map(|next| at_s(next) - at_s(of.closed)),
            opening_mm: down,
            lateral_mm: left + right,
            forward_mm: forward,
            opening_mm_s: fastest(&of.samples[..=of.far], -1.0),
            closing_mm_s: fastest(&of.samples[of.far..=of.closed], 1.0),
            force_n: Some(of.samples.iter().map(|sample| sample.force_n).fold(0.0, f64::max)),
        };
        if of.returns() {
            cycle.kind = cycle.kind_by_ways(left.max(right));
            cycle.side = match cycle.kind {
                JawCycleKind::Chew => {
                    Some(side(of.farthest_mm(of.far, 1, 1.0), of.farthest_mm(of.far, 1, -1.0)))
                }
                JawCycleKind::Lateral => Some(if left > right { JawSide::Left } else { JawSide::Right }),
                _ => None,
            };
        }
        cycle
    }

    /// The kind of a movement that returns, with its way to the farther side, mm.
    fn kind_by_ways(&self, aside_mm: f64) -> JawCycleKind {
        let (down_mm, forward_mm) = (self.opening_mm, self.forward_mm);
        let is_glide =
            |way_mm: f64| way_mm >= GLIDE_MM && way_mm >= GLIDE_SHARE * down_mm && down_mm <= GLIDE_DOWN_MM;
        let is_quick = self.hold_s == 0.0 && self.opening_s + self.closing_s <= CHEW_S;
        let [least_mm, most_mm] = CHEW_MM;
        if is_glide(aside_mm) && aside_mm >= forward_mm {
            JawCycleKind::Lateral
        } else if is_glide(forward_mm) {
            JawCycleKind::Protrusive
        } else if is_quick && (least_mm..most_mm).contains(&down_mm) {
            JawCycleKind::Chew
        } else if down_mm >= OPENING_MM {
            JawCycleKind::Opening
        } else {
            JawCycleKind::Unclear
        }
    }
}

fn side(left_mm: f64, right_mm: f64) -> JawSide {
    match (left_mm >= SIDE_MM, right_mm >= SIDE_MM) {
        (true, false) => JawSide::Left,
        (false, true) => JawSide::Right,
        _ => JawSide::Both,
    }
}

impl Part<'_> {
    /// The way from the most closed sample along an axis in a direction, from a sample on, mm; at least 0.
    fn farthest_mm(&self, from: usize, axis: usize, sign: f64) -> f64 {
        let ways = self.samples[from..].iter().map(|sample| sample.place_m[axis] - self.home.place_m[axis]);
        ways.map(|way_m| sign * way_m * 1e3).fold(0.0, f64::max)
    }

    /// Whether the jaw comes back to where it began.
    fn returns(&self) -> bool {
        let out_m = self.samples[self.far].distance_m(&self.home);
        let after = self.samples[self.closed..].iter().map(|sample| sample.distance_m(&self.home));
        after.fold(f64::INFINITY, f64::min) <= RETURN_M.max(RETURN_SHARE * out_m)
    }

    /// Whether the jaw is closed after the cycle, not only as far as it was before.
    fn teeth_meet(&self) -> bool {
        self.samples[self.closed..].iter().any(|sample| sample.place_m[2].abs() <= MEET_M)
    }

    /// First and last sample of the hold at the farthest place; twice that place without one.
    fn hold(&self) -> [usize; 2] {
        let far = &self.samples[self.far];
        let within_m = CLOSED_M.max(HOLD_WAY_SHARE * far.distance_m(&self.home));
        let is_off = |sample: &Sample| sample.distance_m(far) > within_m;
        let before = self.samples[..self.far].iter().rposition(is_off).map_or(0, |off| off + 1);
        let after = self.samples[self.far..=self.closed].iter().position(is_off);
        let after = after.map_or(self.closed, |off| self.far + off - 1);
        let lasts_s = |from: usize, to: usize| self.samples[to].at_s - self.samples[from].at_s;
        let is_hold = lasts_s(before, after) > HOLD_TIME_SHARE * lasts_s(0, self.closed);
        if is_hold { [before, after] } else { [self.far; 2] }
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

/// None of a last chew of a bout, whose end is unknown.
pub(super) fn course(of: &Part<'_>, kind: JawCycleKind) -> Option<Course> {
    let end = if kind == JawCycleKind::Chew { of.next? } else { of.closed };
    let samples = &of.samples[..=end];
    let first = samples[0];
    let length_s = samples[samples.len() - 1].at_s - first.at_s;
    Some(std::array::from_fn(|point| {
        let at_s = first.at_s + length_s * point as f64 / (COURSE_POINTS - 1) as f64;
        let after = samples.partition_point(|sample| sample.at_s < at_s).clamp(1, samples.len() - 1);
        let (before, after) = (samples[after - 1], samples[after]);
        let share = ((at_s - before.at_s) / (after.at_s - before.at_s)).clamp(0.0, 1.0);
        let between = |from: f64, to: f64| from + share * (to - from);
        let moved_mm =
            |axis: usize| (between(before.place_m[axis], after.place_m[axis]) - of.home.place_m[axis]) * 1e3;
        CoursePoint {
            opening_mm: -moved_mm(2),
            lateral_mm: moved_mm(1),
            force_n: between(before.force_n, after.force_n),
        }
    }))
}
