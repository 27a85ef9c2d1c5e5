//! How much of the scenario's motion was played, and what stopped the drives.
//!
//! The played motion shows in the jaw. The true jaw is ahead of the motion where the motion at a later time explains the jaw's
//! distance from its path. A stop shows in drives and master, whatever the controller reports.

use std::fmt::{self, Display, Formatter};

use masseter_model::geometry::{AXES, Pose, Vec3};
use masseter_recording::jaw_points;
use masseter_runtime::messages::codes::{ControllerState, DriveState, NO_DRIVE_STATE, drive_state};
use masseter_runtime::messages::{Reading, State};
use masseter_scenario::Scenario;
use serde::Serialize;

use crate::poses::{are_enabled, is_moving, is_running, way};
use crate::{events::EventRecord, tracking::PathSample};

/// The played part of the scenario's motion.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct MotionFigures {
    /// The way of the jaw in the whole motion, mm: root of the sum of squares over the incisal point and both condyles. `None` if
    /// the motion is the controller's own.
    pub way_mm: Option<f64>,
    /// The share of it that the jaw went, in the direction of the motion; none of a motion without a way.
    pub played: Option<f64>,
    /// How long the motion still lasted when the controller ended it, s; `None` if the motion is the controller's own.
    #[serde(skip)]
    pub rest_s: Option<f64>,
    /// By how much the motion was late at most, ms; `None` if it never began.
    pub lag_ms: Option<f64>,
    /// When it was first late by more than `checks.motion_lag_ms`, ns of the run's clock.
    #[serde(skip)]
    pub late_ns: Option<u64>,
    /// By how much the true jaw was ahead of the motion at most, ms; only beyond `checks.motion_lag_ms`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ahead_ms: Option<f64>,
    /// By how much the motion began late, and by how much the controller's time ran back, ms.
    #[serde(skip)]
    pub lag_causes_ms: [f64; 2],
    /// Cycles of the motion without a new command.
    pub missed_commands: u64,
    /// The most of them in a row.
    pub missed_in_a_row: u64,
    /// Commands that the plant used a cycle or more after their own.
    pub late_commands: u64,
}

/// A shorter way counts as no motion, m.
const NO_WAY_M: f64 = 1e-5;

/// The way is measured in steps of at least this length, m.
const LEAST_STEP_M: f64 = 1e-5;

/// Follows the jaw on its way.
#[derive(Debug, Clone, Default)]
pub(super) struct PlayedWatch {
    points_m: Points,
    /// The poses of both at the last step, desired and actual.
    before: Option<[Pose; 2]>,
    progress_s: f64,
    way_m: f64,
    gone_m: f64,
    /// The limit of lag and lead.
    most_s: f64,
    ahead: AheadWatch,
    /// The cycle of the last reading.
    cycle: u64,
    answered: u64,
    /// Cycles in a row without a new command.
    in_a_row: u64,
    figures: MotionFigures,
    /// Cycles in which the controller ran its motion with all drives enabled.
    running_cycles: u64,
}

impl PlayedWatch {
    pub(super) fn new(scenario: &Scenario) -> Self {
        Self {
            points_m: jaw_points(&scenario.jaw),
            most_s: scenario.checks.motion_lag_ms / 1e3,
            progress_s: f64::NEG_INFINITY,
            ..Self::default()
        }
    }

    /// Takes a sample of the motion, which is late by that much and has come so far. Where it goes back, its way is in the sum
    /// already.
    pub(super) fn add_sample(
        &mut self,
        lag_s: f64,
        progress_s: f64,
        &PathSample { sampled_ns, desired, actual, .. }: &PathSample,
    ) {
        let most_ms = self.figures.lag_ms.get_or_insert(lag_s * 1e3);
        *most_ms = most_ms.max(lag_s * 1e3);
        if lag_s > self.most_s {
            self.figures.late_ns.get_or_insert(sampled_ns);
        }
        let Some(now) = desired.zip(actual).map(|(desired, actual)| [desired, actual]) else { return };
        self.ahead.add_sample(lag_s, progress_s, now.each_ref(), |from, to| step(&self.points_m, from, to));
        let before = self.before.get_or_insert(now);
        let [desired, actual] = [0, 1].map(|of| step(&self.points_m, &before[of], &now[of]));
        let length_m = length(&desired);
        // While the motion waits for lost cycles, the jaw goes on to where it was sent: this belongs to the next step.
        if length_m >= LEAST_STEP_M && progress_s > self.progress_s {
            *before = now;
            self.progress_s = progress_s;
            self.way_m += length_m;
            self.gone_m +=
                desired.iter().zip(&actual).map(|(one, other)| one.dot(other)).sum::<f64>() / length_m;
        }
    }

    /// Takes the reading of a sample, with the controller's state in that cycle. The reading answers a command that came in time by
    /// the cycle of the reading before, unless the machine excuses the command.
    pub(super) fn add_reading(&mut self, reading: &Reading, state: Option<u32>, is_excused: bool) {
        let is_new = reading.answers_cycle > std::mem::replace(&mut self.answered, reading.answers_cycle);
        let before = std::mem::replace(&mut self.cycle, reading.cycle);
        if is_running(state) && are_enabled(reading) {
            self.running_cycles += reading.cycle.saturating_sub(before);
        }
        let is_moving = is_moving(state) && !is_excused;
        self.figures.late_commands += u64::from(is_moving && is_new && reading.answers_cycle < before);
        self.in_a_row = if is_new || !is_moving { 0 } else { self.in_a_row + 1 };
        self.figures.missed_commands += u64::from(self.in_a_row > 0);
        self.figures.missed_in_a_row = self.figures.missed_in_a_row.max(self.in_a_row);
    }

    /// In how many cycles the controller ran its motion with all drives enabled.
    pub(super) fn running_cycles(&self) -> u64 {
        self.running_cycles
    }

    /// How far the jaw's points move from one pose to another, m.
    pub(super) fn distance_m(&self, from: &Pose, to: &Pose) -> f64 {
        length(&step(&self.points_m, from, to))
    }

    /// `rest_m`: the rest of the motion; `None` if the motion is not the scenario's.
    pub(super) fn into_figures(self, rest_m: Option<f64>) -> MotionFigures {
        let way_m = rest_m.map(|rest_m| self.way_m + rest_m);
        MotionFigures {
            way_mm: way_m.map(|way_m| way_m * 1e3),
            played: way_m.filter(|way_m| *way_m > NO_WAY_M).map(|way_m| self.gone_m / way_m),
            ahead_ms: Some(self.ahead.in_s()).filter(|s| *s > self.most_s).map(|s| s * 1e3),
            ..self.figures
        }
    }
}

/// How each point moves from one pose to another, m.
fn step(points_m: &Points, from: &Pose, to: &Pose) -> Points {
    points_m.each_ref().map(|point| way(from, to, point))
}

fn length(step: &Points) -> f64 {
    step.iter().map(Vec3::norm_squared).sum::<f64>().sqrt()
}

/// Three points of the jaw, or how they move.
type Points = [Vec3; 3];

/// The length of a window of the motion, s. The whole motion counts as well.
const WINDOW_S: f64 = 1.0;
/// Fewer samples show nothing.
const FEWEST_SAMPLES: f64 = 10.0;
/// A shorter distance (rms, m) is noise: a slow motion would make a long time of it.
const LEAST_DISTANCE_M: f64 = 20e-6;
/// The share of the distance that a later time must explain.
const EXPLAINED: f64 = 0.95;

/// Sums over samples, of which the covariances are taken: a constant distance is no lead.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    samples: f64,
    distance: Points,
    speed: Points,
    distance_squares: f64,
    speed_squares: f64,
    products: f64,
    lag_s: f64,
}

fn dot(one: &Points, other: &Points) -> f64 {
    one.iter().zip(other).map(|(one, other)| one.dot(other)).sum()
}

impl Sums {
    fn add(&mut self, distance: &Points, speed: &Points, lag_s: f64) {
        self.samples += 1.0;
        self.distance.iter_mut().zip(distance).for_each(|(sum, distance)| *sum += distance);
        self.speed.iter_mut().zip(speed).for_each(|(sum, speed)| *sum += speed);
        self.distance_squares += dot(distance, distance);
        self.speed_squares += dot(speed, speed);
        self.products += dot(distance, speed);
        self.lag_s += lag_s;
    }

    /// How far the jaw is ahead of the motion, s; none where that does not explain its distance.
    fn ahead_s(&self) -> Option<f64> {
        let of_means = |one, other| dot(one, other) / self.samples;
        let distances = self.distance_squares - of_means(&self.distance, &self.distance);
        let speeds = self.speed_squares - of_means(&self.speed, &self.speed);
        let products = self.products - of_means(&self.distance, &self.speed);
        let is_far = distances > self.samples * LEAST_DISTANCE_M * LEAST_DISTANCE_M;
        let is_explained = products * products > EXPLAINED * distances * speeds;
        (self.samples >= FEWEST_SAMPLES && is_far && is_explained)
            .then(|| products / speeds - self.lag_s / self.samples)
    }
}

/// Follows the jaw beside its motion.
#[derive(Debug, Clone, Copy, Default)]
struct AheadWatch {
    /// The desired pose before, and how far it had come.
    before: Option<(Pose, f64)>,
    window_ends_s: Option<f64>,
    window: Sums,
    whole: Sums,
    /// Of the windows that have ended.
    most_s: f64,
}

impl AheadWatch {
    /// Takes a sample of a motion that has come so far. `between` gives how the points move from one pose to another.
    fn add_sample(
        &mut self,
        lag_s: f64,
        progress_s: f64,
        [desired, actual]: [&Pose; 2],
        between: impl Fn(&Pose, &Pose) -> Points,
    ) {
        let Some((before, before_s)) = self.before else {
            self.before = Some((*desired, progress_s));
            return;
        };
        if progress_s <= before_s {
            return;
        }
        self.before = Some((*desired, progress_s));
        let speed = between(&before, desired).map(|way| way / (progress_s - before_s));
        let distance = between(desired, actual);
        let ends_s = *self.window_ends_s.get_or_insert(progress_s + WINDOW_S);
        if progress_s >= ends_s {
            self.most_s = self.most_s.max(self.window.ahead_s().unwrap_or_default());
            (self.window, self.window_ends_s) = (Sums::default(), Some(progress_s + WINDOW_S));
        }
        self.window.add(&distance, &speed, lag_s);
        self.whole.add(&distance, &speed, lag_s);
    }

    /// How far the jaw was ahead of the motion at most, s. A motion's end counts from half a window on: a few samples of a slow jaw
    /// show nothing.
    fn in_s(&self) -> f64 {
        let left_s = self.window_ends_s.zip(self.before).map(|(ends_s, (_, now_s))| ends_s - now_s);
        let has_half = left_s.is_some_and(|left_s| left_s < WINDOW_S / 2.0);
        let has_windows = self.whole.samples > self.window.samples;
        [(has_half, &self.window), (has_half || has_windows, &self.whole)]
            .into_iter()
            .filter_map(|(is_judged, sums)| sums.ahead_s().filter(|_| is_judged))
            .fold(self.most_s, f64::max)
    }
}

/// States after the reading of a drive that left operation. The controller may miss that reading in the first.
const STILL_MOVING: u32 = 2;

/// What stopped the drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum StoppedBy {
    /// A fault that the master found: it then stops all drives.
    Master,
    /// A request for a quick stop, which the drives carry out.
    QuickStop,
    /// A drive left operation while the motion ran.
    Drives,
}

impl Display for StoppedBy {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Master => "the master stopped the drives",
            Self::QuickStop => "the drives made a quick stop",
            Self::Drives => "a drive left operation while the motion ran",
        })
    }
}

/// Watches drives and master for a stop.
#[derive(Debug, Clone, Copy, Default)]
#[expect(clippy::struct_excessive_bools, reason = "facts that are independent of each other")]
pub(super) struct StopWatch {
    stopped: Option<StoppedBy>,
    was_enabled: [bool; AXES],
    /// The newest state is one of the motion.
    is_moving: bool,
    /// When a drive left operation in the motion, ns, and how many states of the motion came since.
    left: Option<(u64, u32)>,
    has_left: bool,
    last_cycle: u64,
    /// Cycles in which all drives were enabled.
    enabled_cycles: u64,
    /// Whether the newest state is that of a controller that has finished; and whether no drive had power then. What master and
    /// drives report later stops no motion.
    is_finished: bool,
    has_ended: bool,
}

impl StopWatch {
    /// Takes a reading. Returns whether it is that of a stop.
    pub(super) fn apply_reading(&mut self, reading: &Reading) -> bool {
        let states = &reading.drive_state;
        let passed = reading.cycle.saturating_sub(self.last_cycle);
        self.last_cycle = reading.cycle;
        self.enabled_cycles += if are_enabled(reading) { passed } else { 0 };
        let is_quick = self.enabled_cycles > 0 && states.contains(&DriveState::QuickStopActive.code());
        let found = match reading.master_fault {
            0 => is_quick.then_some(StoppedBy::QuickStop),
            _ => Some(StoppedBy::Master),
        };
        let is_powered = |code: &u32| matches!(drive_state(*code), Ok(Some(state)) if state.is_powered());
        self.has_ended |= self.is_finished && found.is_none() && !states.iter().any(is_powered);
        let found = found.filter(|_| !self.has_ended);
        self.stopped = self.stopped.or(found);
        self.leave(reading);
        found.is_some()
    }

    /// Notes a drive that leaves operation. One that is not heard of shows nothing.
    fn leave(&mut self, reading: &Reading) {
        for (code, was_enabled) in reading.drive_state.iter().zip(&mut self.was_enabled) {
            if *code == NO_DRIVE_STATE {
                continue;
            }
            let is_enabled = *code == DriveState::OperationEnabled.code();
            let has_left = std::mem::replace(was_enabled, is_enabled) && !is_enabled;
            if has_left && self.is_moving {
                self.left.get_or_insert((reading.due_ns, 0));
            }
        }
    }

    /// Takes a state. A controller that ends its motion with the drives is no stop of theirs.
    pub(super) fn apply_state(&mut self, state: &State) {
        self.is_moving = is_moving(Some(state.controller_state));
        self.is_finished = state.controller_state == ControllerState::Finished.code();
        let Some((left_ns, states)) = &mut self.left else { return };
        // The state of an earlier cycle may come later.
        if state.due_ns <= *left_ns {
            return;
        }
        *states += 1;
        if !self.is_moving {
            self.left = None;
        } else if *states >= STILL_MOVING {
            self.has_left = true;
        }
    }

    /// The master's own report, should the run end before the next reading.
    pub(super) fn apply_event(&mut self, event: &EventRecord) {
        let is_stop = event.is_fault_of_master() && !self.has_ended;
        self.stopped = self.stopped.or(is_stop.then_some(StoppedBy::Master));
    }

    /// What stopped the drives, and for how many cycles all of them were enabled.
    pub(super) fn into_figures(self) -> (Option<StoppedBy>, u64) {
        (self.stopped.or(self.has_left.then_some(StoppedBy::Drives)), self.enabled_cycles)
    }
}

#[cfg(test)]
mod tests;
