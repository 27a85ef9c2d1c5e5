//! Progress of the motion: the move to its first pose, the motion itself, and the ramp to rest at a stop halfway. Time
//! comes in as the steps of the motion, so that the motion waits while the drives cannot follow. Rate and amplitude may
//! change during the motion. The controller plays one [`Playback`], the judge of a run another.

use std::sync::Arc;

use masseter_model::geometry::{AXES, Mechanism, Pose};
use masseter_runtime::messages::codes::{Cause, ControllerState};
use masseter_scenario::{ControllerConfig, MotionConfig, Scenario, TrajectoryLimitsConfig};

use crate::trajectory::{self, Trajectory, TrajectoryReport, interpolate, minimum_jerk};
use crate::{safety::Fault, sequencer::Sequencer};

/// Time between two looks at the motion for its margins, s.
const MARGINS_EVERY_S: f64 = 0.005;
/// Most cycles until the reading that answers a command: the next cycle, and one more if either the command or the
/// reading is late.
const LATEST_ANSWER_CYCLES: u64 = 2;
/// Shortest and longest time of a change from 0 to 1, s.
const SHORTEST_S: f64 = 1.0;
const LONGEST_S: f64 = 60.0;
/// A change accelerates and brakes for a third of its time each.
const SPEED: f64 = 1.5;
const ACCELERATION: f64 = 4.5;
/// Time after a cycle that a loop lost in which a wait is no sign of the bus, s.
const AFTER_LOST_S: f64 = 0.1;
/// Largest difference of equal times of a motion, s.
const SAME_TIME_S: f64 = 1e-9;
/// Largest way of the axes by the share, relative to a proportional way.
const BEND: f64 = 1.25;

/// The motion under way: its playback, which waits for the drives, and the time of the jaw at rest.
#[derive(Debug, Clone)]
pub(crate) struct Progress {
    pub(crate) playback: Playback,
    acknowledgement: CommandAcknowledgement,
    lag: Lag,
    /// Cycles in this state since the desired pose no longer changes.
    cycles_at_rest: u64,
}

impl Progress {
    pub(crate) fn new(scenario: &Scenario, mechanism: &Mechanism, trajectory: Trajectory) -> Self {
        Self {
            playback: Playback::of_scenario(scenario, mechanism, trajectory),
            acknowledgement: CommandAcknowledgement::default(),
            lag: Lag { limit_s: scenario.checks.motion_lag_ms / 1e3, ..Lag::default() },
            cycles_at_rest: 0,
        }
    }

    /// Begins a cycle. After a wait the motion goes on at full speed from the drives' held target, by one period as
    /// always.
    pub(crate) fn advance(&mut self, sequencer: &Sequencer, cycle: u64) {
        let answered_cycle = sequencer.estimate.map_or(0, |estimate| estimate.answers_cycle);
        let steps = self.acknowledgement.takes_step(cycle, answered_cycle);
        if steps {
            self.playback.advance(sequencer.period_s);
        }
        let waited_s = if steps { 0.0 } else { sequencer.period_s * self.playback.speed() };
        self.lag.add(waited_s, sequencer, cycle);
    }

    /// Whether the motion has waited for no longer than it may.
    pub(crate) fn check_lag(&self) -> Result<(), Fault> {
        let Lag { total_s: lag_s, limit_s, .. } = self.lag;
        if lag_s <= limit_s + SAME_TIME_S {
            Ok(())
        } else {
            Err(Fault::new(Cause::MotionLate, lag_s, limit_s))
        }
    }

    /// Whether the motion of this state is over.
    pub(crate) fn is_over(&self, sequencer: &Sequencer) -> bool {
        if sequencer.state == ControllerState::Holding {
            self.cycles_at_rest as f64 * sequencer.period_s >= sequencer.config.hold_s
        } else {
            self.playback.is_over()
        }
    }

    /// Prepares the playback for the state that has been entered.
    pub(crate) fn enter_state(&mut self, sequencer: &Sequencer) {
        match (sequencer.state, &sequencer.estimate) {
            (ControllerState::Enabling, Some(estimate)) => self.playback.hold(estimate.solution.pose),
            (ControllerState::Easing, _) => self.playback.ease(),
            (ControllerState::Running, _) => self.playback.play(),
            (ControllerState::Holding, _) => self.playback.stop(),
            _ => {}
        }
        (self.cycles_at_rest, self.lag.total_s) = (0, 0.0);
    }

    /// Ends a cycle.
    pub(crate) fn count_rest(&mut self) {
        self.cycles_at_rest = if self.playback.is_at_rest() { self.cycles_at_rest + 1 } else { 0 };
    }
}

/// By how much the motion is late, since it waited for lost or late frames. Waits for a loop that lost cycles do not count:
/// such a loop sends neither readings nor commands. A reading that comes late looks the same, so its waits do not count either.
#[derive(Debug, Clone, Default)]
struct Lag {
    total_s: f64,
    limit_s: f64,
    /// The last cycle without a reading of its own, or after one that the controller lost.
    gap_cycle: u64,
}

impl Lag {
    fn add(&mut self, waited_s: f64, sequencer: &Sequencer, cycle: u64) {
        if sequencer.heard_cycle != cycle || cycle > sequencer.cycle + 1 {
            self.gap_cycle = cycle;
        }
        let since_gap_s = cycle.saturating_sub(self.gap_cycle) as f64 * sequencer.period_s;
        if sequencer.state == ControllerState::Running && since_gap_s > AFTER_LOST_S {
            self.total_s += waited_s;
        }
    }
}

/// The present part.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Part {
    /// Holds a pose.
    Hold(Pose),
    /// From a pose to the first pose of the motion.
    Ease(Pose),
    /// The motion.
    Motion,
}

/// The desired pose, as a function of the time since playing began.
#[derive(Debug, Clone)]
pub struct Playback {
    trajectory: Arc<Trajectory>,
    ease_s: f64,
    stop_ramp_s: f64,
    part: Part,
    elapsed_s: f64,
    /// Speed of all clocks: 1, or less while the part comes to rest.
    rate: f64,
    /// Speed of the motion's own clock beside that.
    tempo: Slew,
    /// Share of the motion's way that is played.
    amplitude: Slew,
    /// For how long the motion plays, s.
    played_s: f64,
    stopping: bool,
}

impl Playback {
    /// The playback of a scenario's motion on its mechanism. Its limits bound the changes of rate and amplitude.
    pub fn of_scenario(scenario: &Scenario, mechanism: &Mechanism, trajectory: Trajectory) -> Self {
        let limits = scenario.limits.within(&scenario.drives);
        // The plan has checked every cycle, so a coarser look is enough for the margins of a change.
        let period_s = scenario.period_s().max(MARGINS_EVERY_S);
        let demands = trajectory::check(&trajectory, mechanism, &limits, period_s).ok();
        let ControllerConfig { ease_s, stop_ramp_s, .. } = scenario.controller;
        Self::new(trajectory, ease_s, stop_ramp_s, Slew::change_s(demands.as_ref(), &limits))
    }

    /// A change of rate or amplitude by 1 takes `change_s`.
    pub(crate) fn new(trajectory: Trajectory, ease_s: f64, stop_ramp_s: f64, change_s: f64) -> Self {
        Self {
            part: Part::Hold(trajectory.pose(0.0)),
            trajectory: Arc::new(trajectory),
            ease_s,
            stop_ramp_s,
            elapsed_s: 0.0,
            rate: 1.0,
            tempo: Slew::of(change_s),
            amplitude: Slew::of(change_s),
            played_s: 0.0,
            stopping: false,
        }
    }

    /// Sets the rate of the motion, 0 to 1.
    pub fn set_motion_rate(&mut self, rate: f64) {
        self.tempo.target = rate;
    }

    /// Sets the share of the way from the motion's first pose that is played, 0 to 1.
    pub fn set_motion_amplitude(&mut self, amplitude: f64) {
        self.amplitude.target = amplitude;
    }

    /// The first pose of the motion.
    pub(crate) fn first_pose(&self) -> Pose {
        self.trajectory.pose(0.0)
    }

    /// Holds `pose`.
    pub(crate) fn hold(&mut self, pose: Pose) {
        self.begin(Part::Hold(pose));
    }

    /// Begins the move from the present pose to the first pose of the motion.
    pub(crate) fn ease(&mut self) {
        self.begin(Part::Ease(self.pose_ahead(0.0)));
    }

    /// Begins the motion.
    pub fn play(&mut self) {
        self.begin(Part::Motion);
    }

    /// Lets the part come to rest on its own path.
    pub fn stop(&mut self) {
        self.stopping = true;
    }

    fn begin(&mut self, part: Part) {
        (self.part, self.elapsed_s, self.rate, self.stopping) = (part, 0.0, 1.0, false);
        // No part begins on the motion's way, so neither jump moves the pose.
        self.tempo.jump();
        self.amplitude.jump();
        self.played_s = 0.0;
    }

    /// Lets `dt_s` pass.
    pub fn advance(&mut self, dt_s: f64) {
        let (before, speed_before) = (self.rate, self.speed());
        if self.stopping {
            self.rate = (before - dt_s / self.stop_ramp_s).max(0.0);
        }
        if self.part == Part::Motion {
            self.played_s += dt_s;
            // A stop also slows these changes down, so that the pose keeps its course while it comes to rest.
            let passed_s = dt_s * (before + self.rate) / 2.0;
            self.tempo.advance(passed_s);
            self.amplitude.advance(passed_s);
        }
        self.elapsed_s += dt_s * (speed_before + self.speed()) / 2.0;
    }

    /// Speed of the part's own clock.
    fn speed(&self) -> f64 {
        if self.part == Part::Motion { self.rate * self.tempo.value } else { self.rate }
    }

    /// The part's own time `ahead_s` from now, s.
    fn time_ahead_s(&self, ahead_s: f64) -> f64 {
        self.elapsed_s + self.speed() * ahead_s
    }

    /// The desired pose `ahead_s` from now.
    pub(crate) fn pose_ahead(&self, ahead_s: f64) -> Pose {
        let time_s = self.time_ahead_s(ahead_s);
        match self.part {
            Part::Hold(pose) => pose,
            Part::Ease(from) => interpolate(&from, &self.first_pose(), minimum_jerk(time_s / self.ease_s)),
            Part::Motion => self.trajectory.scaled_pose(time_s, self.amplitude.ahead(self.rate * ahead_s)),
        }
    }

    /// The motion.
    pub fn trajectory(&self) -> &Trajectory {
        &self.trajectory
    }

    /// The rest of the motion, s of the trajectory's time.
    pub fn rest_s(&self) -> f64 {
        (self.trajectory.duration_s() - self.elapsed_s).max(0.0)
    }

    /// Whether the current part has reached its end, or a motion has taken too long.
    pub(crate) fn is_over(&self) -> bool {
        let most_s = MotionConfig::MOST_DURATIONS * self.trajectory.duration_s();
        self.is_at_end() || (self.part == Part::Motion && self.played_s >= most_s)
    }

    fn is_at_end(&self) -> bool {
        match self.part {
            Part::Hold(_) => true,
            Part::Ease(_) => self.elapsed_s >= self.ease_s,
            Part::Motion => self.elapsed_s >= self.trajectory.duration_s(),
        }
    }

    /// Whether the desired pose no longer changes.
    pub(crate) fn is_at_rest(&self) -> bool {
        let is_changing = self.part == Part::Motion && !self.amplitude.is_settled();
        self.rate == 0.0 || (self.is_at_end() && !is_changing)
    }

    /// Lag of a motion at `motion_s` behind this one, s of the trajectory's time. Negative for a motion ahead, by at
    /// most `most_ahead_s`.
    pub fn lag_s(&self, motion_s: f64, most_ahead_s: f64) -> f64 {
        let is_beyond = |at_s: f64| self.trajectory.motion_time_s(at_s) > motion_s + SAME_TIME_S;
        let latest_s = self.elapsed_s + most_ahead_s;
        if !is_beyond(latest_s) {
            return -most_ahead_s;
        }
        let (mut before_s, mut after_s) = (0.0, latest_s);
        while after_s - before_s > SAME_TIME_S {
            let middle_s = f64::midpoint(before_s, after_s);
            if is_beyond(middle_s) { after_s = middle_s } else { before_s = middle_s }
        }
        self.elapsed_s - after_s
    }

    /// The pose of the motion by this lag before, or later if negative, s of the trajectory's time.
    pub fn earlier_pose(&self, lag_s: f64) -> Pose {
        self.trajectory.scaled_pose(self.elapsed_s - lag_s, self.amplitude.value)
    }

    /// Progress of the motion `ahead_s` from now, as [`Trajectory::motion_time_s`]; negative before its beginning.
    pub(crate) fn motion_time_ahead_s(&self, ahead_s: f64) -> f64 {
        let is_motion = self.part == Part::Motion;
        if is_motion { self.trajectory.motion_time_s(self.time_ahead_s(ahead_s)) } else { -1.0 }
    }
}

/// Acknowledgement of commands: the motion makes its next step after the drives have received the last one.
///
/// While either process stalls, the drives hold their last target. A motion that continues meanwhile has to catch up in
/// one cycle.
#[derive(Debug, Clone, Default)]
#[doc(alias("flow control", "stop-and-wait"))]
struct CommandAcknowledgement {
    /// The cycle of the last step of the motion.
    step_cycle: u64,
}

impl CommandAcknowledgement {
    /// Whether the motion makes a step in this cycle, when a fresh reading last acknowledged the command of
    /// `answered_cycle`. Without an acknowledgement the motion waits and repeats its last target until the drives
    /// acknowledge a later command.
    fn takes_step(&mut self, cycle: u64, answered_cycle: u64) -> bool {
        let is_answered = answered_cycle >= self.step_cycle;
        let is_under_way = cycle.saturating_sub(answered_cycle) <= LATEST_ANSWER_CYCLES;
        let steps = is_answered || is_under_way;
        if steps {
            self.step_cycle = cycle;
        }
        steps
    }
}

/// A share, 0 to 1, that follows its target with limited speed and acceleration.
#[derive(Debug, Clone)]
struct Slew {
    /// The present share.
    value: f64,
    target: f64,
    per_s: f64,
    most_per_s: f64,
    most_per_s2: f64,
}

impl Slew {
    /// The share 1. Its change to 0 takes `change_s`.
    fn of(change_s: f64) -> Self {
        let (most_per_s, most_per_s2) = (SPEED / change_s, ACCELERATION / (change_s * change_s));
        Self { value: 1.0, target: 1.0, per_s: 0.0, most_per_s, most_per_s2 }
    }

    /// The shortest time, s, for a change of rate and amplitude from 0 to 1, also both at once. A motion with these
    /// demands then stays within its limits. Without demands the time is the longest.
    fn change_s(demands: Option<&TrajectoryReport>, limits: &TrajectoryLimitsConfig) -> f64 {
        let Some(demands) = demands else { return LONGEST_S };
        let of_axis = |axis: usize| {
            let way_m = BEND * (demands.highest_m[axis] - demands.lowest_m[axis]);
            let velocity_m_s = demands.velocity_m_s[axis];
            let left_m_s = (limits.velocity_m_s(axis) - velocity_m_s).max(0.0);
            let left_m_s2 = (limits.acceleration_m_s2(axis) - demands.acceleration_m_s2[axis]).max(0.0);
            // Twice for the amplitude's change of a moving axis, once for that of its rate.
            let moving = 3.0 * SPEED * velocity_m_s;
            let root = (moving * moving + 4.0 * left_m_s2 * ACCELERATION * way_m).sqrt();
            (SPEED * way_m / left_m_s).max((moving + root) / (2.0 * left_m_s2))
        };
        (0..AXES).map(of_axis).fold(SHORTEST_S, f64::max).min(LONGEST_S)
    }

    /// Jumps to the target.
    fn jump(&mut self) {
        (self.value, self.per_s) = (self.target, 0.0);
    }

    /// Whether the share has reached its target.
    fn is_settled(&self) -> bool {
        self.value.to_bits() == self.target.to_bits() && self.per_s == 0.0
    }

    /// The share after that time.
    fn ahead(&self, ahead_s: f64) -> f64 {
        (self.value + self.per_s * ahead_s).clamp(0.0, 1.0)
    }

    /// Lets `dt_s` pass.
    fn advance(&mut self, dt_s: f64) {
        let left = self.target - self.value;
        let step_per_s = self.most_per_s2 * dt_s;
        if left.abs() <= step_per_s * dt_s && self.per_s.abs() <= step_per_s {
            self.jump();
            return;
        }
        // Speed from which the share comes to rest exactly at the target, in steps of this length.
        let half_step = step_per_s / 2.0;
        let arriving_per_s = (half_step * half_step + 2.0 * self.most_per_s2 * left.abs()).sqrt() - half_step;
        let wanted_per_s = arriving_per_s.min(self.most_per_s).copysign(left);
        self.per_s += (wanted_per_s - self.per_s).clamp(-step_per_s, step_per_s);
        self.value += self.per_s * dt_s;
    }
}

#[cfg(test)]
mod tests;
