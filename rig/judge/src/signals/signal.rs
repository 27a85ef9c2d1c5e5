//! A signal: its name, its unit, its meaning, and how its value follows from the messages of a cycle. The jaw is here
//! too, since many signals follow from its pose.

use std::fmt;

use masseter_model::geometry::{Pose, Vec3};
use masseter_recording::jaw_points;
use masseter_scenario::{Scenario, Unit};
use serde::Serialize;

use super::timeline::CycleMessages;
use crate::poses::{closed_platform, place, turn, way};

/// How a signal's value follows from a cycle. None if the cycle lacks it.
type Extract = Box<dyn Fn(&CycleMessages) -> Option<f64> + Send + Sync>;

/// The names of the values of a state.
type StateNames = fn() -> Vec<(&'static str, u32)>;

/// A signal.
#[derive(Serialize)]
pub struct NamedSignal {
    /// Its name, such as `incisal.error`.
    pub name: String,
    /// The name of the unit in which it is shown.
    pub unit: String,
    /// What it is.
    pub about: String,
    #[serde(skip)]
    shown: Unit,
    #[serde(skip)]
    states: Option<StateNames>,
    /// Why it may have no value in a whole run; empty where nothing is known.
    #[serde(skip)]
    pub(crate) absence: &'static str,
    /// Whether it is a motion or a load of the mechanism that no controller states.
    #[serde(skip)]
    pub(crate) is_truth: bool,
    #[serde(skip)]
    extract: Extract,
}

impl fmt::Debug for NamedSignal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} [{}]", self.name, self.unit)
    }
}

impl NamedSignal {
    /// Its value in a cycle.
    pub(super) fn value(&self, messages: &CycleMessages) -> Option<f64> {
        (self.extract)(messages)
    }

    /// Says whether it shows the mechanism itself, and not what a controller states of it.
    pub(super) fn truth_if(&mut self, is_truth: bool) {
        self.is_truth = is_truth;
    }

    /// The unit in which it is shown.
    pub fn shown(&self) -> Unit {
        self.shown
    }

    /// The names of its values, where it is a state.
    pub fn states(&self) -> Option<Vec<(&'static str, u32)>> {
        self.states.map(|names| names())
    }
}

/// Signals, in the order in which they are listed.
#[derive(Debug, Default)]
pub(super) struct SignalList(pub(super) Vec<NamedSignal>);

impl SignalList {
    /// Adds a signal.
    pub(super) fn add(
        &mut self,
        name: impl Into<String>,
        shown: Unit,
        about: impl Into<String>,
        extract: impl Fn(&CycleMessages) -> Option<f64> + Send + Sync + 'static,
    ) -> &mut NamedSignal {
        let (name, unit, about, extract) =
            (name.into(), shown.name.to_owned(), about.into(), Box::new(extract));
        let (states, absence, is_truth) = (None, "", false);
        self.0.push(NamedSignal { name, unit, about, shown, states, absence, is_truth, extract });
        self.0.last_mut().expect("it was just added")
    }

    /// Adds what a controller declares, with values in its unit. Where that is none of Masseter's, the value counts as a
    /// number.
    pub(super) fn add_declared(
        &mut self,
        name: String,
        unit: &str,
        about: &str,
        value: impl Fn(&CycleMessages) -> Option<f64> + Send + Sync + 'static,
    ) {
        let shown = Unit::named(unit).unwrap_or(Unit::ONE);
        unit.clone_into(&mut self.add(name, shown, about, move |of| Some(value(of)? * shown.si)).unit);
    }

    /// Adds a state, whose values have these names.
    pub(super) fn add_state(
        &mut self,
        name: impl Into<String>,
        about: &str,
        states: StateNames,
        extract: impl Fn(&CycleMessages) -> Option<u32> + Send + Sync + 'static,
    ) {
        let extract = move |messages: &CycleMessages| extract(messages).map(f64::from);
        self.add(name, Unit::ONE, about, extract).states = Some(states);
    }
}

/// A point of the jaw.
#[derive(Debug, Clone, Copy)]
pub(super) enum JawPoint {
    Incisal,
    LeftCondyle,
    RightCondyle,
}

/// The jaw on the platform, and where its pose comes from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Jaw {
    /// Its points in the platform frame, m.
    points_m: [Vec3; 3],
    /// The platform when the jaw is closed; none for a scenario without that pose, which no run has.
    closed: Option<Pose>,
    pub(super) has_truth: bool,
}

/// A turn below which a hinge axis is noise, rad, and the least share of the axis across the midsagittal plane.
const LEAST_TURN_RAD: f64 = 0.035;
const LEAST_ACROSS: f64 = 0.2;

impl Jaw {
    pub(super) fn new(scenario: &Scenario) -> Self {
        let (points_m, has_truth) = (jaw_points(&scenario.jaw), scenario.can.is_virtual());
        Self { points_m, closed: closed_platform(scenario), has_truth }
    }

    /// The incisal point from its closed place, base frame, m.
    pub(super) fn way(&self, pose: &Pose) -> Option<Vec3> {
        Some(way(&self.closed?, pose, &self.points_m[JawPoint::Incisal as usize]))
    }

    /// The turn from the closed jaw: an angle, rad, along its axis, base frame.
    pub(super) fn turn(&self, pose: &Pose) -> Option<Vec3> {
        Some(turn(&self.closed?, pose))
    }

    /// Where the finite helical axis from the closed jaw meets the midsagittal plane, from the closed incisal point, m. None for
    /// a small turn, or an axis along the plane. The formula is that of docs/jaw-cycles.md.
    pub(super) fn hinge(&self, pose: &Pose) -> Option<Vec3> {
        let (moved, turn) = (self.way(pose)?, self.turn(pose)?);
        let angle = turn.norm();
        let axis = turn / angle;
        if angle.is_nan() || angle < LEAST_TURN_RAD || axis.y.abs() < LEAST_ACROSS {
            return None;
        }
        let across = moved - axis * axis.dot(&moved);
        let point = 0.5 * (across + axis.cross(&across) / (angle / 2.0).tan());
        Some(point - axis * (point.y / axis.y))
    }

    /// The pose that the jaw has.
    pub(super) fn actual(&self, messages: &CycleMessages) -> Option<Pose> {
        messages.actual(self.has_truth)
    }

    /// Where a point is in the base frame, m.
    pub(super) fn place(&self, point: JawPoint, pose: &Pose) -> Vec3 {
        place(pose, &self.points_m[point as usize])
    }

    /// How far a point is in one pose from where it is in another, m.
    pub(super) fn distance(&self, point: JawPoint, a: &Pose, b: &Pose) -> f64 {
        way(a, b, &self.points_m[point as usize]).norm()
    }
}
