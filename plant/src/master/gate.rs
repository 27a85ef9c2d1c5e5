//! The last gate before the wire: no forbidden target passes, from any sender.
//!
//! Strokes, velocities and accelerations are those of targets that drives follow; the master sends no other targets.
//! The gate only judges; a command passes as a whole or not at all. Only forces are cut, to the limit of the drive.
//! [`Commands`] has the newest passed command, and the silence since.
//!
//! A motion waits while a process stalls. So targets may stop at once and go on as before, within twice the time-out of
//! commands; after that they start from rest.

#[cfg(test)]
mod tests;

use masseter_model::geometry::AXES;
use masseter_runtime::messages::codes::{Cause, DriveRequest};
use masseter_runtime::messages::{Command, LAYOUT_VERSION, Reading};
use masseter_scenario::Scenario;

use super::events::{Failure, Subject};

/// Standard deviations of the encoder by which a position held at the end of a stroke may be beyond it.
const NOISE_DEVIATIONS: f64 = 6.0;
/// Most periods of one target, for any number of missed commands: a motion may go on for one of them, then the motion
/// waits.
const MOST_PERIODS: u64 = 2;
/// Periods that targets may have left: a late cycle of the master may take a command that came early, after late ones.
const MOST_FREE_PERIODS: u64 = 3;

/// The demand on a drive that follows targets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Target {
    pub(super) position_m: f64,
    /// Force that the drive adds to its position control, N.
    pub(super) force_offset_n: f64,
}

/// The target that a drive follows.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Followed {
    target_m: f64,
    /// Within the force limit of the drive.
    force_offset_n: f64,
    velocity_m_s: f64,
    recent: RecentVelocities,
}

/// The recent velocities: between these a motion may stop at once and go on.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
struct RecentVelocities {
    /// Beginning of the newer of two stretches of cycles.
    since_cycle: u64,
    /// The lowest and highest of each stretch, the newer first; rest is always among them.
    ranges_m_s: [[f64; 2]; 2],
}

/// The limits of one axis.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct AxisGate {
    stroke_m: [f64; 2],
    max_velocity_m_s: f64,
    max_acceleration_m_s2: f64,
    max_force_n: f64,
    /// Largest distance of a drive at rest from its first target, m.
    standing_m: f64,
    followed: Option<Followed>,
}

/// A step to the next target.
#[derive(Debug, Clone, Copy)]
struct Step {
    cycle: u64,
    duration_s: f64,
}

/// The gate.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Gate {
    period_s: f64,
    timeout_cycles: u64,
    axes: [AxisGate; AXES],
    /// The controller's cycle of the last command that passed.
    passed_cycle: u64,
    /// The master's cycle.
    cycle: u64,
    /// Periods without a target so far.
    free_periods: u64,
}

impl Gate {
    /// The gate of a scenario's drives and strokes.
    pub(super) fn new(scenario: &Scenario) -> Self {
        let axes = std::array::from_fn(|axis| {
            let drive = scenario.drives.of_axis(axis);
            let [low_m, high_m] = scenario.mechanism.strokes.of_axis(axis);
            let margin_m = drive.encoder_resolution_m + NOISE_DEVIATIONS * drive.encoder_noise_m;
            AxisGate {
                stroke_m: [low_m - margin_m, high_m + margin_m],
                max_velocity_m_s: drive.max_velocity_m_s,
                max_acceleration_m_s2: drive.max_acceleration_m_s2,
                max_force_n: scenario.max_force_n(axis),
                standing_m: scenario.can.following_limit_m.min(drive.max_velocity_m_s * scenario.period_s()),
                followed: None,
            }
        });
        let timeout_cycles = scenario.can.command_timeout_cycles.into();
        Self {
            period_s: scenario.period_s(),
            timeout_cycles,
            axes,
            passed_cycle: 0,
            cycle: 0,
            free_periods: MOST_FREE_PERIODS,
        }
    }

    /// Begins a cycle of the master. A drive without a position follows no target, and loses its last target.
    pub(super) fn begin_cycle(&mut self, cycle: u64, following_m: [Option<f64>; AXES]) {
        self.free_periods = (self.free_periods + cycle.saturating_sub(self.cycle)).min(MOST_FREE_PERIODS);
        self.cycle = cycle;
        for (axis, position_m) in self.axes.iter_mut().zip(following_m) {
            axis.followed = axis.followed.filter(|_| position_m.is_some());
        }
    }

    /// Judges the command of this cycle; returns its request. `following_m` has the position of every drive that would
    /// follow its target.
    pub(super) fn pass(
        &mut self,
        command: &Command,
        following_m: [Option<f64>; AXES],
    ) -> Result<DriveRequest, (Subject, Failure)> {
        let request = check_message(command)?;
        let periods = self.periods(command.cycle);
        let step = Step { cycle: self.cycle, duration_s: periods as f64 * self.period_s };
        let mut followed = [None; AXES];
        for (axis, position_m) in following_m.into_iter().enumerate() {
            let Some(position_m) = position_m.filter(|_| request == DriveRequest::Enable) else { continue };
            let next = self.axes[axis].follow(command.target_m[axis], position_m, step, self.timeout_cycles);
            let next = next.map_err(|failure| (Subject::Axis(axis), failure))?;
            let most_n = self.axes[axis].max_force_n;
            let force_offset_n = command.force_offset_n[axis].clamp(-most_n, most_n);
            followed[axis] = Some(Followed { force_offset_n, ..next });
        }
        self.axes.iter_mut().zip(followed).for_each(|(axis, followed)| axis.followed = followed);
        (self.passed_cycle, self.free_periods) = (command.cycle, self.free_periods.saturating_sub(periods));
        Ok(request)
    }

    /// The last passed target of each drive that follows targets.
    pub(super) fn targets(&self) -> [Option<Target>; AXES] {
        let target =
            |Followed { target_m, force_offset_n, .. }| Target { position_m: target_m, force_offset_n };
        self.axes.map(|axis| axis.followed.map(target))
    }

    /// Periods of the step to a command's target: those since the last command by the controller's count. The count
    /// alone proves nothing, so all steps together get no more periods than the master's cycles.
    fn periods(&self, command_cycle: u64) -> u64 {
        let most = self.free_periods.clamp(1, MOST_PERIODS);
        command_cycle.saturating_sub(self.passed_cycle).clamp(1, most)
    }
}

/// The request of a command, if its version is this program's, its numbers are finite, and its request is known.
fn check_message(command: &Command) -> Result<DriveRequest, (Subject, Failure)> {
    let bad = |subject, value, limit| Err((subject, Failure::with(Cause::BadMessage, value, limit)));
    if command.version != LAYOUT_VERSION {
        return bad(Subject::Rig, command.version as f64, LAYOUT_VERSION as f64);
    }
    for numbers in [command.target_m, command.force_offset_n] {
        if let Some(axis) = numbers.iter().position(|number| !number.is_finite()) {
            return bad(Subject::Axis(axis), numbers[axis], 0.0);
        }
    }
    let request = DriveRequest::try_from(command.request);
    request.or_else(|_| bad(Subject::Rig, f64::from(command.request), 0.0))
}

/// Refuses a value above its limit.
fn check_limit(cause: Cause, value: f64, limit: f64) -> Result<(), Failure> {
    if value <= limit { Ok(()) } else { Err(Failure::with(cause, value, limit)) }
}

impl RecentVelocities {
    /// The velocities still recent in a cycle: those of the present stretch of `length` cycles, and of the one before.
    fn at(self, cycle: u64, length: u64) -> Self {
        let [newer, _] = self.ranges_m_s;
        match cycle.saturating_sub(self.since_cycle) {
            elapsed if elapsed < length => self,
            elapsed if elapsed < 2 * length => {
                Self { since_cycle: self.since_cycle + length, ranges_m_s: [[0.0; 2], newer] }
            }
            _ => Self { since_cycle: cycle, ranges_m_s: [[0.0; 2]; 2] },
        }
    }

    /// The nearest velocity within the range of the recent velocities.
    fn nearest(&self, velocity_m_s: f64) -> f64 {
        let [[low, high], [older_low, older_high]] = self.ranges_m_s;
        velocity_m_s.clamp(low.min(older_low), high.max(older_high))
    }

    /// The velocities with one more. A motion that has turned back does not go on in its old direction. During a wait,
    /// pose control moves the targets by less than `slow_m_s`.
    fn with(mut self, velocity_m_s: f64, slow_m_s: f64) -> Self {
        for range_m_s in &mut self.ranges_m_s {
            if velocity_m_s > slow_m_s {
                range_m_s[0] = 0.0;
            } else if velocity_m_s < -slow_m_s {
                range_m_s[1] = 0.0;
            }
        }
        let [low, high] = self.ranges_m_s[0];
        self.ranges_m_s[0] = [low.min(velocity_m_s), high.max(velocity_m_s)];
        self
    }
}

impl AxisGate {
    /// The motion after a step to a target.
    fn follow(
        &self,
        target_m: f64,
        position_m: f64,
        step: Step,
        timeout_cycles: u64,
    ) -> Result<Followed, Failure> {
        self.check_stroke(target_m)?;
        let before = self.followed.unwrap_or_else(|| self.standing(target_m, position_m));
        let velocity_m_s = (target_m - before.target_m) / step.duration_s;
        check_limit(Cause::VelocityLimit, velocity_m_s.abs(), self.max_velocity_m_s)?;
        let recent = before.recent.at(step.cycle, timeout_cycles);
        let change_m_s = (velocity_m_s - before.velocity_m_s).abs();
        let unexplained_m_s = (velocity_m_s - recent.nearest(velocity_m_s)).abs().min(change_m_s);
        let acceleration_m_s2 = unexplained_m_s / step.duration_s;
        check_limit(Cause::AccelerationLimit, acceleration_m_s2, self.max_acceleration_m_s2)?;
        Ok(Followed {
            target_m,
            force_offset_n: 0.0,
            velocity_m_s,
            recent: recent.with(velocity_m_s, self.max_acceleration_m_s2 * step.duration_s),
        })
    }

    /// A drive at rest at its first target, or as near as its position allows.
    fn standing(&self, target_m: f64, position_m: f64) -> Followed {
        let target_m = target_m.clamp(position_m - self.standing_m, position_m + self.standing_m);
        Followed { target_m, force_offset_n: 0.0, velocity_m_s: 0.0, recent: RecentVelocities::default() }
    }

    fn check_stroke(&self, target_m: f64) -> Result<(), Failure> {
        let [low_m, high_m] = self.stroke_m;
        check_limit(Cause::StrokeLimit, target_m, high_m)?;
        if target_m >= low_m { Ok(()) } else { Err(Failure::with(Cause::StrokeLimit, target_m, low_m)) }
    }
}

/// The received commands.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Commands {
    timeout_cycles: u32,
    pub(super) gate: Gate,
    /// Request of the newest valid command.
    pub(super) request: DriveRequest,
    /// Its cycle; none before the first.
    cycle: Option<u64>,
    received_ns: u64,
    /// Cycles since the last command.
    pub(super) silent_cycles: u32,
}

impl Commands {
    /// Without a command.
    pub(super) fn new(scenario: &Scenario) -> Self {
        Self {
            timeout_cycles: scenario.can.command_timeout_cycles,
            gate: Gate::new(scenario),
            request: DriveRequest::Off,
            cycle: None,
            received_ns: 0,
            silent_cycles: 0,
        }
    }

    /// Whether a command of this cycle switches the drives off.
    pub(super) fn switch_off(&self) -> bool {
        self.silent_cycles == 0 && self.request == DriveRequest::Off
    }

    /// Takes the command of a cycle, if any; a stale command counts as none. Silence is a failure only with
    /// `needs_command`, and a refusal by the gate is a failure. `following_m` has the position of every drive that
    /// would follow its target.
    pub(super) fn apply_command(
        &mut self,
        cycle: u64,
        now_ns: u64,
        command: Option<&Command>,
        needs_command: bool,
        following_m: [Option<f64>; AXES],
    ) -> Result<(), (Subject, Failure)> {
        self.gate.begin_cycle(cycle, following_m);
        // A refused command counts as none.
        self.silent_cycles = self.silent_cycles.saturating_add(1);
        let Some(command) = command.filter(|command| !self.is_stale(command)) else {
            if !needs_command || self.silent_cycles <= self.timeout_cycles {
                return Ok(());
            }
            let lost = Failure::with(Cause::CommandLost, self.silent_cycles, self.timeout_cycles);
            return Err((Subject::Rig, lost));
        };
        self.request = self.gate.pass(command, following_m)?;
        (self.cycle, self.received_ns, self.silent_cycles) = (Some(command.cycle), now_ns, 0);
        Ok(())
    }

    /// Whether a command demands motion for a cycle that has had its command. Such a message may be only a repetition
    /// of the last one, while no controller runs any more. A request to stop is never stale.
    fn is_stale(&self, command: &Command) -> bool {
        self.cycle == Some(command.cycle) && command.request == DriveRequest::Enable.code()
    }

    /// Writes the answered command into a reading.
    pub(super) fn fill_reading(&self, reading: &mut Reading) {
        reading.answers_cycle = self.cycle.unwrap_or(0);
        reading.command_received_ns = self.received_ns;
    }
}
