//! Cycles of the jaw, found in the path of the incisal point while the motion plays, with their kinds and figures, in one pass.
//! It keeps the figures of each cycle, and of the path no more than one cycle.
//!
//! [docs/jaw-cycles.md](../../../../docs/jaw-cycles.md) states the definition and its sources. Which motion was played does not
//! matter, nor do its rows: a robot's estimated path is cut like a true one.

mod cycle;
mod segments;

use std::collections::BTreeMap;

use masseter_model::geometry::{Pose, Vec3};
use masseter_scenario::{Scenario, StudyConfig};
use serde::{Serialize, Serializer};

use self::cycle::Sample;
use self::segments::{Cycle, Segments};
use crate::poses::{closed_platform, place};
use crate::statistic::Statistic;

pub(crate) use cycle::MotionSpeed;
pub use cycle::{
    COURSE_POINTS, Course, CoursePoint, CycleQuantity, JawCycle, JawCycleKind, JawSide, LeftOut, QUANTITIES,
    mean_course,
};

/// Time between samples, ns.
const SAMPLE_NS: u64 = 4_000_000;
/// Cycles in the list of a summary, and courses of a group. Statistics and tables have all cycles.
const MOST_CYCLES: usize = 512;
const MOST_COURSES: usize = 64;
/// Steps of the border, mm, and their number: wider than any mouth opens.
const BORDER_STEP_MM: f64 = 1.0;
const BORDER_STEPS: usize = 80;

/// The cycles of a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct JawCycleFigures {
    /// Cycles found.
    pub count: u64,
    /// Those that do not count: ramps of the rig, and the choice in `[study]`.
    pub left_out: u64,
    /// Those of the others whose kind is unclear: no group has them.
    pub unclear: u64,
    /// How far below its closed place the incisal point stays at the most closed place, mm; none without a motion.
    pub most_closed_mm: Option<f64>,
    /// Cycles that count, by kind and side.
    pub groups: Vec<JawCycleGroup>,
    /// The cycles; a summary and a page list the first 512.
    #[serde(serialize_with = "first_cycles")]
    pub cycles: Vec<JawCycle>,
    /// Border of the incisal point's path: what this motion reached at each opening, after Posselt.
    pub border: Vec<BorderStep>,
}

fn first_cycles<S: Serializer>(cycles: &[JawCycle], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(cycles.iter().take(MOST_CYCLES))
}

/// Cycles of one kind and one side.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JawCycleGroup {
    /// Kind and side in words: `chew left`.
    pub name: String,
    /// Their kind.
    pub kind: JawCycleKind,
    /// Their side.
    pub side: Option<JawSide>,
    /// Cycles.
    pub count: u64,
    /// Their quantities, those with a value.
    pub quantities: Vec<Quantity>,
    /// The courses of the first 64, each with the number of its cycle.
    #[serde(skip)]
    pub courses: Vec<(u64, Course)>,
    /// Their mean and standard deviation; empty without one.
    #[serde(skip)]
    pub mean_course: Vec<[CoursePoint; 2]>,
}

/// A quantity of the cycles of a group.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quantity {
    /// Its name and unit.
    #[serde(flatten)]
    pub of: CycleQuantity,
    /// Its values.
    #[serde(flatten)]
    pub statistic: Statistic,
}

/// Extreme places of the incisal point from its closed place while it is this far down, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BorderStep {
    /// Middle of the step, downwards.
    pub opening_mm: f64,
    /// Farthest back: the least way forward.
    pub back_mm: f64,
    /// Farthest forward.
    pub front_mm: f64,
    /// Farthest to the right: the least way to the left.
    pub right_mm: f64,
    /// Farthest to the left.
    pub left_mm: f64,
}

/// Place of the incisal point when the jaw is closed, base frame, m; none for a scenario without a closed pose, which no run
/// has.
pub fn closed_incisal_m(scenario: &Scenario) -> Option<Vec3> {
    Some(incisal_m(&closed_platform(scenario)?, scenario.jaw.reference_point_m))
}

/// The incisal point of a pose, base frame, m; its place in the platform frame is `jaw.reference_point_m`.
pub fn incisal_m(platform: &Pose, in_platform_m: [f64; 3]) -> Vec3 {
    place(platform, &in_platform_m.into())
}

/// What cycles of a group share.
type GroupKey = (JawCycleKind, Option<JawSide>);

/// Collects them.
#[derive(Debug, Clone, Default)]
pub(super) struct JawCycles {
    /// The incisal point in the platform frame, and its closed place.
    incisal_m: [f64; 3],
    closed_m: Vec3,
    has_force: bool,
    study: StudyConfig,
    segments: Segments,
    next_ns: u64,
    /// The greatest force since the last sample, N.
    force_n: f64,
    most_closed_mm: Option<f64>,
    cycles: Vec<JawCycle>,
    courses: BTreeMap<GroupKey, Vec<(u64, Course)>>,
    /// Back, front, right and left of each step.
    border: Vec<Option<[f64; 4]>>,
}

impl JawCycles {
    pub(super) fn new(scenario: &Scenario) -> Self {
        Self {
            incisal_m: scenario.jaw.reference_point_m,
            closed_m: closed_incisal_m(scenario).unwrap_or_default(),
            has_force: scenario.has_contact(),
            study: scenario.study.clone().unwrap_or_default(),
            border: vec![None; BORDER_STEPS],
            ..Self::default()
        }
    }

    /// The pose of the platform at a time since the motion began, with the vertical force on the jaw.
    pub(super) fn add_pose(&mut self, since_ns: u64, pose: &Pose, force_n: f64, speed: MotionSpeed) {
        self.force_n = self.force_n.max(force_n);
        let place = incisal_m(pose, self.incisal_m) - self.closed_m;
        if since_ns < self.next_ns || !place.iter().all(|coordinate| coordinate.is_finite()) {
            return;
        }
        self.next_ns = (since_ns / SAMPLE_NS + 1) * SAMPLE_NS;
        let force_n = std::mem::take(&mut self.force_n);
        let sample = Sample { at_s: since_ns as f64 / 1e9, place_m: place.into(), force_n, speed };
        self.add_to_border(&sample);
        if let Some(cycle) = self.segments.add_sample(sample) {
            self.add_cycle(cycle);
        }
    }

    fn add_to_border(&mut self, sample: &Sample) {
        if sample.speed == MotionSpeed::Ramped || self.is_outside(sample.at_s, sample.at_s) {
            return;
        }
        let [x, y, z] = sample.place_m.map(|way_m| way_m * 1e3);
        self.most_closed_mm = Some(self.most_closed_mm.map_or(-z, |least| least.min(-z)));
        let step = (-z / BORDER_STEP_MM).max(0.0) as usize;
        let Some(border) = self.border.get_mut(step) else { return };
        let [back, front, right, left] = border.unwrap_or([x, x, y, y]);
        *border = Some([back.min(x), front.max(x), right.min(y), left.max(y)]);
    }

    fn is_outside(&self, from_s: f64, to_s: f64) -> bool {
        self.study.window_s.is_some_and(|[begin_s, end_s]| from_s < begin_s || to_s > end_s)
    }

    fn add_cycle(&mut self, Cycle { mut figures, course }: Cycle) {
        figures.number = self.cycles.len() as u64 + 1;
        figures.force_n = figures.force_n.filter(|_| self.has_force);
        let closed_s = figures.began_s + figures.opening_s + figures.hold_s + figures.closing_s;
        if self.study.leave_out.contains(&figures.number) {
            figures.left_out = Some(LeftOut::ByHand);
        } else if self.is_outside(figures.began_s, closed_s) {
            figures.left_out = Some(LeftOut::Window);
        }
        if let Some(course) = course.filter(|_| figures.left_out.is_none()) {
            let courses = self.courses.entry((figures.kind, figures.side)).or_default();
            if courses.len() < MOST_COURSES {
                courses.push((figures.number, course));
            }
        }
        self.cycles.push(figures);
    }

    /// The figures of all cycles.
    pub(super) fn into_figures(mut self) -> JawCycleFigures {
        if let Some(last) = std::mem::take(&mut self.segments).last_cycle() {
            self.add_cycle(last);
        }
        let counting = || self.cycles.iter().filter(|cycle| cycle.left_out.is_none());
        let mut members: BTreeMap<_, Vec<&JawCycle>> = BTreeMap::new();
        for cycle in counting().filter(|cycle| cycle.kind != JawCycleKind::Unclear) {
            members.entry((cycle.kind, cycle.side)).or_default().push(cycle);
        }
        let groups = members.into_iter().map(|(key, cycles)| {
            let courses = self.courses.remove(&key).unwrap_or_default();
            JawCycleGroup::new(key, &cycles, courses)
        });
        let groups = groups.collect();
        let counted = counting().count() as u64;
        let border = (0..).zip(&self.border).filter_map(|(step, border)| {
            let [back_mm, front_mm, right_mm, left_mm] = (*border)?;
            let opening_mm = (f64::from(step) + 0.5) * BORDER_STEP_MM;
            Some(BorderStep { opening_mm, back_mm, front_mm, right_mm, left_mm })
        });
        JawCycleFigures {
            count: self.cycles.len() as u64,
            left_out: self.cycles.len() as u64 - counted,
            unclear: counting().filter(|cycle| cycle.kind == JawCycleKind::Unclear).count() as u64,
            most_closed_mm: self.most_closed_mm,
            groups,
            border: border.collect(),
            cycles: self.cycles,
        }
    }
}

impl JawCycleGroup {
    fn new((kind, side): GroupKey, cycles: &[&JawCycle], courses: Vec<(u64, Course)>) -> Self {
        let quantities = QUANTITIES.into_iter().map(|(of, value)| {
            let values: Vec<f64> = cycles.iter().filter_map(|cycle| value(cycle)).collect();
            Quantity { of, statistic: Statistic::of(&values) }
        });
        Self {
            name: side.map_or_else(|| kind.to_string(), |side| format!("{kind} {side}")),
            kind,
            side,
            count: cycles.len() as u64,
            quantities: quantities.filter(|quantity| quantity.statistic.count > 0).collect(),
            mean_course: mean_course(&courses.iter().map(|(_, course)| course).collect::<Vec<_>>()),
            courses,
        }
    }
}

#[cfg(test)]
mod tests;
