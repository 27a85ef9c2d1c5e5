//! The pose that the jaw should have at each sample, and by how much the motion is late.
//!
//! While the motion plays, the pose is the scenario's, computed here. With force control its height follows the controller's within
//! the reach; with lateral control its position does while something is between the teeth. The motion begins with the first sample in which the controller says `running`, but no later than its
//! [lead-in](StateOrder) allows. It goes on by a period with each cycle, but for those that the controller's loop lost. A
//! controller waits where commands or readings are lost: its motion is then
//! late, and the pose here is as late, up to the limit of `checks`. What was late stays late, but for what cycles without
//! SYNC and the machine's lost cycles cost. Before the motion, and in an own motion, the controller's desired pose counts. After the motion the last pose
//! stays. Where the machine loses cycles while the rate of the motion changes, the pose is not exactly the controller's.

use std::fmt::{self, Display, Formatter};

use masseter_controller::{playback::Playback, trajectory::Trajectory};
use masseter_model::geometry::{AXES, Mechanism, Pose, Vec3};
use masseter_runtime::messages::codes::{Cause, ControllerState};
use masseter_runtime::messages::{Parameters, Reading, State, pose_fields};
use masseter_runtime::named::{Declared, PlayedMotion};
use masseter_scenario::Scenario;

use crate::poses::{MOVING, are_enabled, desired_pose, is_moving, is_running};
use crate::{events::EventRecord, jaw_cycles::MotionSpeed};

/// What the messages of a sample say of the motion.
#[derive(Debug, Clone, Copy)]
#[expect(clippy::struct_excessive_bools, reason = "facts that are independent of each other")]
pub(crate) struct Progress<'a> {
    pub(crate) cycle: u64,
    /// Whether SYNC was sent.
    pub(crate) has_sync: bool,
    /// False in a cycle that the controller's loop lost. One without a state counts all the same if the loop did not lose it.
    pub(crate) has_run: bool,
    pub(crate) reading: Option<&'a Reading>,
    /// The controller's, as a code.
    pub(crate) state: Option<u32>,
    /// Whether a cycle that the machine lost may act on this one.
    pub(crate) is_disturbed: bool,
    /// What the controller made of this sample, or else of the next one that it used, or what it states without any.
    pub(crate) next_use: Option<&'a State>,
    /// Whether that is this sample.
    pub(crate) is_used: bool,
    /// Whether the truth has nothing between the teeth.
    pub(crate) is_open: bool,
    pub(crate) parameters: Option<&'a Parameters>,
}

/// Plays the scenario's motion beside the controller.
#[derive(Debug, Clone, Default)]
pub(crate) struct Reference {
    /// None for an own motion, and where the motion's file is gone since the run.
    playback: Option<Playback>,
    period_s: f64,
    /// The speed of the motion's clock between its ramps.
    full_speed: f64,
    most_lag_s: f64,
    /// How far force control may lead the jaw up or down from the motion, and to a side, m.
    reach_m: f64,
    lateral_reach_m: f64,
    detour_m: Vec3,
    order: StateOrder,
    /// Places of the parameters for rate and amplitude, and a value that is the controller's own alone: it changes nothing.
    places: [Option<(usize, Option<f64>)>; 2],
    /// The controller's cycle in which somebody asked for a stop.
    stop_cycle: Option<u64>,
    has_begun: bool,
    /// In the sample before, and in any.
    is_moving: bool,
    was_moving: bool,
    lag_s: f64,
    /// The part of it that does not count.
    excused_s: f64,
    /// By how much the motion began late, how far the controller said that it came, and by how much it went back at most.
    began_late_s: f64,
    farthest_s: f64,
    ran_back_s: f64,
    progress_s: f64,
    pose: Option<Pose>,
}

/// The desired pose of a sample, and by how much the motion is late, s; no lag but while the scenario's motion plays.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Desired {
    pub(crate) pose: Option<Pose>,
    pub(crate) lag_s: Option<f64>,
    /// Whether the motion plays already, and the controller has not begun it.
    pub(crate) is_awaited: bool,
    /// How far the pose has come on the motion, s, from any instant. It goes back where a loop lost cycles.
    pub(crate) progress_s: f64,
}

/// The shortest step, s, and the most steps, in which the rest of a motion is measured.
const STEP_S: f64 = 0.005;
const MOST_STEPS: f64 = 20_000.0;

/// Time over which the speed of the motion's clock is taken, s, and the share of its full speed that counts as full.
const SPEED_S: f64 = 1e-4;
const FULL_SHARE: f64 = 0.999;

impl Reference {
    pub(crate) fn new(scenario: &Scenario, declared: &Declared) -> Self {
        let is_of_scenario = declared.motion == PlayedMotion::Scenario;
        let lateral = scenario.force_control.and_then(|control| control.lateral);
        let place = |name: &str| {
            let place = declared.place_of(name).ok()?;
            let own = (!scenario.parameters.contains_key(name)).then(|| declared.parameters[place].value);
            Some((place, own))
        };
        Self {
            playback: is_of_scenario.then(|| playback(scenario)).flatten(),
            period_s: scenario.period_s(),
            full_speed: scenario.dry.speed_now(),
            most_lag_s: scenario.checks.motion_lag_ms / 1e3,
            reach_m: scenario.force_control.map_or(0.0, |config| config.reach_m),
            lateral_reach_m: lateral.map_or(0.0, |lateral| lateral.reach_m),
            order: StateOrder::new(scenario, declared),
            places: ["motion_rate", "motion_amplitude"].map(place),
            ..Self::default()
        }
    }

    /// A stop by request, whoever asked, lets the motion come to rest; the check `sequence` judges whether it was expected.
    pub(crate) fn apply_event(&mut self, event: &EventRecord) {
        if event.cause == Cause::StopRequested {
            self.stop_cycle = Some(self.stop_cycle.map_or(event.cycle, |cycle| cycle.min(event.cycle)));
        }
    }

    /// Goes on to the next sample.
    pub(crate) fn advance(&mut self, of: &Progress<'_>) -> Desired {
        self.order.advance(of.state, of.reading, of.has_run && !of.is_disturbed);
        let is_moving = is_moving(of.state);
        // A sample comes before the state that it leads to: the motion has its part in the sample that ends it.
        let goes_on = std::mem::replace(&mut self.is_moving, is_moving) || is_moving;
        let is_overdue = self.order.is_overdue() && self.stop_cycle.is_none();
        let has_begun = self.has_begun || is_running(of.state) || is_overdue;
        let goes_on = goes_on || (has_begun && self.order.is_before_motion());
        if has_begun && self.playback.is_some() {
            if goes_on {
                self.play(of);
            }
        } else if let Some(used) = of.next_use.filter(|_| of.is_used && (goes_on || !self.was_moving)) {
            self.pose = desired_pose(used);
        }
        self.was_moving |= is_moving;
        let lag_s = (self.lag_s - self.excused_s).max(0.0);
        let lag_s = (self.has_begun && goes_on).then_some(lag_s);
        let is_awaited = self.has_begun && self.order.is_before_motion();
        Desired { pose: self.pose, lag_s, is_awaited, progress_s: self.progress_s }
    }

    fn play(&mut self, of: &Progress<'_>) {
        let Some(playback) = &mut self.playback else { return };
        let set = |place: Option<(usize, Option<f64>)>| {
            let (place, own) = place?;
            let value = *of.parameters?.parameters.as_slice().get(place)?;
            Some(if own == Some(value) { 1.0 } else { value })
        };
        let [rate, amplitude] = self.places.map(set);
        if let Some(rate) = rate {
            playback.set_motion_rate(rate);
        }
        if let Some(amplitude) = amplitude {
            playback.set_motion_amplitude(amplitude);
        }
        if !std::mem::replace(&mut self.has_begun, true) {
            playback.play();
        } else if of.has_run {
            playback.advance(self.period_s);
            self.excused_s += if of.has_sync { 0.0 } else { self.period_s };
        }
        let stated_s = of.next_use.map(|state| state.motion_time_s).filter(|stated_s| *stated_s >= 0.0);
        let before_s = self.lag_s;
        let waits = self.order.is_before_motion();
        let found_s = match stated_s {
            _ if waits => playback.trajectory().duration_s() - playback.rest_s(),
            Some(stated_s) => playback.lag_s(stated_s, self.excused_s),
            None => before_s,
        };
        self.lag_s = found_s.max(before_s);
        if let Some(stated_s) = stated_s {
            self.farthest_s = self.farthest_s.max(stated_s);
            self.ran_back_s = self.ran_back_s.max(self.farthest_s - stated_s);
        }
        self.excused_s += if of.is_disturbed { self.lag_s - before_s } else { 0.0 };
        self.began_late_s = if waits { self.lag_s - self.excused_s } else { self.began_late_s };
        // A change of the rate goes on while the controller waits for lost cycles, here but not there.
        let waited_s = found_s.max(self.lag_s - self.excused_s).min(self.most_lag_s + self.excused_s);
        let mut pose = playback.earlier_pose(waited_s);
        self.progress_s = -playback.rest_s() - waited_s;
        if let Some(stated) = of.next_use.filter(|_| of.is_used && self.reach_m > 0.0).and_then(desired_pose)
        {
            let detour_m = stated.translation.vector - pose.translation.vector;
            // Nothing pushes an open jaw to a side: what is left of a bite may only become less.
            let most_m = if of.is_open { self.detour_m.xy().norm() } else { self.lateral_reach_m };
            let lateral_m = detour_m.xy().cap_magnitude(most_m.min(self.lateral_reach_m));
            self.detour_m = lateral_m.push(detour_m.z.clamp(-self.reach_m, self.reach_m));
        }
        pose.translation.vector += self.detour_m;
        self.pose = as_published(&pose);
        if self.stop_cycle.is_some_and(|cycle| cycle <= of.cycle) {
            playback.stop();
        }
    }

    /// What is out of order in the controller's states, and when it was.
    pub(crate) fn disorder(&self) -> Option<(Disorder, Option<u64>)> {
        self.order.disorder()
    }

    /// By how much the motion began late, and by how much the controller's time ran back, ms.
    pub(crate) fn lag_causes_ms(&self) -> [f64; 2] {
        [self.began_late_s * 1e3, self.ran_back_s * 1e3]
    }

    /// The speed of the motion's clock at this progress, s.
    pub(crate) fn speed(&self, progress_s: f64) -> MotionSpeed {
        let Some(playback) = &self.playback else { return MotionSpeed::Full };
        let motion = playback.trajectory();
        let at_s = motion.duration_s() + progress_s;
        let speed = (motion.motion_time_s(at_s) - motion.motion_time_s(at_s - SPEED_S)) / SPEED_S;
        if speed >= FULL_SHARE * self.full_speed { MotionSpeed::Full } else { MotionSpeed::Ramped }
    }

    /// How long the motion still lasts at its pace, s; nothing after a request to stop. None where the motion is not the
    /// scenario's.
    pub(crate) fn rest_s(&self) -> Option<f64> {
        let playback = self.playback.as_ref()?;
        Some(if self.stop_cycle.is_some() { 0.0 } else { playback.rest_s() })
    }

    /// What is left of the motion, as `distance` measures it from pose to pose; nothing after a request to stop. None where the
    /// motion is not the scenario's.
    pub(crate) fn rest(&self, distance: impl Fn(&Pose, &Pose) -> f64) -> Option<f64> {
        let mut playback = self.playback.clone()?;
        if self.stop_cycle.is_some() {
            return Some(0.0);
        }
        if !self.has_begun {
            playback.play();
        }
        let rest_s = playback.rest_s();
        let steps = (rest_s / STEP_S).ceil().min(MOST_STEPS);
        let (mut from, mut rest) = (playback.earlier_pose(0.0), 0.0);
        for step in 1..=steps as u32 {
            let to = playback.earlier_pose(-rest_s * f64::from(step) / steps);
            rest += distance(&from, &to);
            from = to;
        }
        Some(rest)
    }
}

/// The pose as a state carries it, so that equal poses are equal.
fn as_published(pose: &Pose) -> Option<Pose> {
    let (desired_position_m, desired_quaternion_wxyz) = pose_fields(pose);
    let mut state = State { desired_position_m, desired_quaternion_wxyz, ..State::default() };
    state.round();
    desired_pose(&state)
}

/// The scenario's motion; none where its file is gone since the run.
fn playback(scenario: &Scenario) -> Option<Playback> {
    let mechanism = Mechanism::new(&scenario.mechanism).ok()?;
    let motion = Trajectory::of_scenario(scenario, &mechanism).ok()?;
    Some(Playback::of_scenario(scenario, &mechanism, motion))
}

/// Cycles of the lead-in beside the move to the first pose.
const MORE_CYCLES: f64 = 3.0;

/// What is out of order in the states of a controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Disorder {
    /// It was never in the state `running`.
    NeverBegan,
    /// It was in the state `running` before all drives were enabled.
    BeforeDrives,
    /// After the drives were enabled it went back to an earlier state.
    Back {
        /// The state before.
        from: ControllerState,
        /// The earlier state.
        to: ControllerState,
    },
}

impl Display for Disorder {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::NeverBegan => {
                f.write_str("the controller never began the motion: it was never in the state running")
            }
            Self::BeforeDrives => {
                f.write_str("the controller began the motion before all drives were enabled")
            }
            Self::Back { from, to } => write!(f, "the controller went back from the state {from} to {to}"),
        }
    }
}

/// Follows the states, cycle by cycle.
#[derive(Debug, Clone, Default)]
struct StateOrder {
    /// An own motion may hold and go on.
    is_own: bool,
    lead_in_cycles: u64,
    /// Cycles with a complete reading of enabled drives.
    ready_cycles: u64,
    were_enabled: bool,
    state: Option<ControllerState>,
    has_run: bool,
    /// The first, and when it was, ns of the run's clock.
    disorder: Option<(Disorder, Option<u64>)>,
}

impl StateOrder {
    fn new(scenario: &Scenario, declared: &Declared) -> Self {
        let lead_in_cycles = (scenario.controller.ease_s / scenario.period_s() + MORE_CYCLES).ceil() as u64;
        Self { is_own: declared.motion == PlayedMotion::Own, lead_in_cycles, ..Self::default() }
    }

    /// Takes a cycle. `is_counted`: whether no loop lost it.
    fn advance(&mut self, state: Option<u32>, reading: Option<&Reading>, is_counted: bool) {
        let are_enabled = reading.map(are_enabled);
        self.were_enabled |= are_enabled == Some(true);
        let is_complete =
            are_enabled == Some(true) && reading.is_some_and(|of| of.fresh_axes == (1 << AXES) - 1);
        self.ready_cycles += u64::from(is_counted && is_complete);
        let Some(to) = state.and_then(|code| ControllerState::try_from(code).ok()) else { return };
        let from = self.state.replace(to).unwrap_or(to);
        self.has_run |= to == ControllerState::Running;
        let is_before_drives = to == ControllerState::Running && !self.were_enabled && are_enabled.is_some();
        let is_early = |state: ControllerState| state.code() < ControllerState::Easing.code();
        let is_pause = self.is_own && MOVING.contains(&from) && MOVING.contains(&to);
        let is_back = to.code() < from.code() && !is_early(from) && !is_pause;
        let found = is_back.then_some(Disorder::Back { from, to });
        let found = if is_before_drives { Some(Disorder::BeforeDrives) } else { found };
        self.disorder = self.disorder.or(found.map(|found| (found, reading.map(|of| of.sampled_ns))));
    }

    /// Whether the controller is in a state before the motion.
    fn is_before_motion(&self) -> bool {
        !self.has_run && self.state.is_some_and(|state| state.code() <= ControllerState::Easing.code())
    }

    /// Whether the lead-in is over, and the controller has not begun its motion.
    fn is_overdue(&self) -> bool {
        self.is_before_motion() && self.ready_cycles > self.lead_in_cycles
    }

    /// What is out of order first, and when.
    fn disorder(&self) -> Option<(Disorder, Option<u64>)> {
        self.disorder.or((!self.has_run).then_some((Disorder::NeverBegan, None)))
    }
}

#[cfg(test)]
mod tests;
