//! The last gate before the wire: no target passes that a drive must not be sent to, whoever commands.
//!
//! Strokes, velocities and accelerations are those of targets that drives follow; others are not sent. The gate only
//! judges; a command passes as a whole or not at all.

use masseter_shared::config::Scenario;
use masseter_shared::geometry::AXES;
use masseter_shared::messages::codes::{Cause, DriveRequest};
use masseter_shared::messages::{Command, LAYOUT_VERSION};

use super::events::Subject;
use super::failure::Failure;

/// Standard deviations of the encoder by which a position held at the end of a stroke may be beyond it.
const NOISE_DEVIATIONS: f64 = 6.0;

/// The target that a drive follows.
#[derive(Debug, Clone, Copy)]
struct Followed {
    target_m: f64,
    velocity_m_s: f64,
    /// That of the motion, even while it waits.
    motion_m_s: f64,
}

/// What one axis may be asked for.
#[derive(Debug, Clone, Copy)]
struct AxisGate {
    stroke_m: [f64; 2],
    max_velocity_m_s: f64,
    max_acceleration_m_s2: f64,
    followed: Option<Followed>,
}

/// The gate.
#[derive(Debug, Clone)]
pub(super) struct Gate {
    period_s: f64,
    axes: [AxisGate; AXES],
    /// Of the last command that passed: the controller's cycle and the master's.
    passed: [u64; 2],
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
                followed: None,
            }
        });
        Self { period_s: scenario.period_s(), axes, passed: [0; 2] }
    }

    /// Judges the command that comes in a cycle of the master. `following_m` has the position of every drive that would
    /// follow its target.
    pub(super) fn pass(
        &mut self,
        cycle: u64,
        command: &Command,
        following_m: [Option<f64>; AXES],
    ) -> Result<(), (Subject, Failure)> {
        let request = check_message(command)?;
        let periods = self.periods(cycle, command.cycle);
        let mut followed = [None; AXES];
        for (axis, position_m) in following_m.into_iter().enumerate() {
            let Some(position_m) = position_m.filter(|_| request == DriveRequest::Enable) else { continue };
            let next = self.axes[axis].follow(command.target_m[axis], position_m, periods, self.period_s);
            followed[axis] = Some(next.map_err(|failure| (Subject::Axis(axis), failure))?);
        }
        self.axes.iter_mut().zip(followed).for_each(|(axis, followed)| axis.followed = followed);
        self.passed = [command.cycle, cycle];
        Ok(())
    }

    /// The target that passed last for each drive that follows targets, m.
    pub(super) fn targets_m(&self) -> [Option<f64>; AXES] {
        self.axes.map(|axis| axis.followed.map(|followed| followed.target_m))
    }

    /// Periods since the last command by the controller's count, but at most one more than by the master's: a command
    /// may be one cycle late.
    fn periods(&self, cycle: u64, command_cycle: u64) -> u64 {
        let [last_command_cycle, last_cycle] = self.passed;
        let most = cycle.saturating_sub(last_cycle) + 1;
        command_cycle.saturating_sub(last_command_cycle).clamp(1, most)
    }
}

/// The request of a command, if its version is this program's, its targets are finite, and its request is known.
fn check_message(command: &Command) -> Result<DriveRequest, (Subject, Failure)> {
    let bad = |subject, value, limit| Err((subject, Failure::with(Cause::BadMessage, [value, limit])));
    if command.version != LAYOUT_VERSION {
        return bad(Subject::Rig, command.version as f64, LAYOUT_VERSION as f64);
    }
    if let Some(axis) = command.target_m.iter().position(|target_m| !target_m.is_finite()) {
        return bad(Subject::Axis(axis), command.target_m[axis], 0.0);
    }
    let request = DriveRequest::try_from(command.request);
    request.or_else(|_| bad(Subject::Rig, f64::from(command.request), 0.0))
}

/// Refuses a value above its limit.
fn check_limit(cause: Cause, value: f64, limit: f64) -> Result<(), Failure> {
    if value <= limit { Ok(()) } else { Err(Failure::with(cause, [value, limit])) }
}

impl Followed {
    fn standing(target_m: f64) -> Self {
        Self { target_m, velocity_m_s: 0.0, motion_m_s: 0.0 }
    }

    /// Change of velocity that no waiting explains: a target may stop at once and go on as before, since the motion waits
    /// while the drives cannot follow.
    fn unexplained_m_s(&self, velocity_m_s: f64) -> f64 {
        let waiting_m_s = velocity_m_s.clamp(self.motion_m_s.min(0.0), self.motion_m_s.max(0.0));
        (velocity_m_s - waiting_m_s).abs().min((velocity_m_s - self.velocity_m_s).abs())
    }
}

impl AxisGate {
    /// The motion after a target that comes so many periods after the last. The first target is compared with the drive's
    /// position.
    fn follow(
        &self,
        target_m: f64,
        position_m: f64,
        periods: u64,
        period_s: f64,
    ) -> Result<Followed, Failure> {
        self.check_stroke(target_m)?;
        let before = self.followed.unwrap_or(Followed::standing(position_m));
        let duration_s = periods as f64 * period_s;
        let velocity_m_s = (target_m - before.target_m) / duration_s;
        check_limit(Cause::VelocityLimit, velocity_m_s.abs(), self.max_velocity_m_s)?;
        if self.followed.is_none() {
            return Ok(Followed::standing(target_m));
        }
        let acceleration_m_s2 = before.unexplained_m_s(velocity_m_s) / duration_s;
        check_limit(Cause::AccelerationLimit, acceleration_m_s2, self.max_acceleration_m_s2)?;
        let change_m_s = self.max_acceleration_m_s2 * duration_s;
        let is_smooth = (velocity_m_s - before.velocity_m_s).abs() <= change_m_s;
        let is_motion = is_smooth && periods == 1 && velocity_m_s.abs() > change_m_s;
        let motion_m_s = if is_motion { velocity_m_s } else { before.motion_m_s };
        Ok(Followed { target_m, velocity_m_s, motion_m_s })
    }

    fn check_stroke(&self, target_m: f64) -> Result<(), Failure> {
        let [low_m, high_m] = self.stroke_m;
        check_limit(Cause::StrokeLimit, target_m, high_m)?;
        if target_m >= low_m { Ok(()) } else { Err(Failure::with(Cause::StrokeLimit, [target_m, low_m])) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Judgement = Result<(), (Subject, Failure)>;
    /// A motion that reaches so many times its limit.
    type Attempt<'a> = &'a dyn Fn(f64) -> Judgement;
    type Change = fn(&mut Command);

    const PERIOD_S: f64 = 1e-3;
    /// With a limit of acceleration that is reached below the limit of velocity.
    fn scenario() -> Scenario {
        let mut scenario = Scenario::default();
        scenario.drives.slide.max_acceleration_m_s2 = 40.0;
        scenario.drives.leg.max_acceleration_m_s2 = 40.0;
        scenario
    }

    /// Of every axis, m.
    const MIDDLE_M: [f64; AXES] = [0.0, 0.0, 0.0, 0.27, 0.27, 0.27];

    /// A gate before drives that stand in the middle of their strokes.
    struct Bench {
        gate: Gate,
        cycle: u64,
        target_m: [f64; AXES],
    }

    impl Bench {
        fn new() -> Self {
            let mut bench = Self { gate: Gate::new(&scenario()), cycle: 0, target_m: MIDDLE_M };
            bench.send(|_| {}).unwrap();
            bench
        }

        /// Sends the command of the next cycle with a change; a refused one leaves the targets as they were.
        fn send(&mut self, change: impl FnOnce(&mut Command)) -> Judgement {
            self.cycle += 1;
            let mut command = Command {
                cycle: self.cycle,
                version: LAYOUT_VERSION,
                target_m: self.target_m,
                request: DriveRequest::Enable.code(),
                ..Command::default()
            };
            change(&mut command);
            self.gate.pass(self.cycle, &command, MIDDLE_M.map(Some))?;
            self.target_m = command.target_m;
            Ok(())
        }

        fn step(&mut self, axis: usize, velocity_m_s: f64) -> Judgement {
            self.send(|command| command.target_m[axis] += velocity_m_s * PERIOD_S)
        }

        /// Brings an axis to a velocity as fast as it may.
        fn reach(&mut self, axis: usize, velocity_m_s: f64) {
            (1..=20).for_each(|part| self.step(axis, velocity_m_s * f64::from(part) / 20.0).unwrap());
        }
    }

    /// For every axis and direction, a hundredth below the limit passes and a hundredth above is refused by its name.
    #[test]
    fn every_limit_of_a_motion_is_where_it_is_said_to_be() {
        let drives = scenario().drives;
        for (axis, direction) in (0..AXES).flat_map(|axis| [(axis, -1.0), (axis, 1.0)]) {
            let drive = drives.of_axis(axis);
            let (velocity_m_s, acceleration_m_s2) = (drive.max_velocity_m_s, drive.max_acceleration_m_s2);
            let reach = |factor: f64| {
                let mut bench = Bench::new();
                bench.reach(axis, 0.95 * direction * velocity_m_s);
                bench.step(axis, factor * direction * velocity_m_s)
            };
            let start =
                |factor: f64| Bench::new().step(axis, factor * direction * acceleration_m_s2 * PERIOD_S);
            let hasten = |factor: f64| {
                let mut bench = Bench::new();
                bench.reach(axis, 0.1 * direction);
                bench.step(axis, direction * (0.1 + factor * acceleration_m_s2 * PERIOD_S))
            };
            let turn_back = |factor: f64| {
                let mut bench = Bench::new();
                bench.reach(axis, 0.1 * direction);
                bench.step(axis, -factor * direction * acceleration_m_s2 * PERIOD_S)
            };
            let cases: [(Attempt<'_>, Cause, f64); 4] = [
                (&reach, Cause::VelocityLimit, velocity_m_s),
                (&start, Cause::AccelerationLimit, acceleration_m_s2),
                (&hasten, Cause::AccelerationLimit, acceleration_m_s2),
                (&turn_back, Cause::AccelerationLimit, acceleration_m_s2),
            ];
            for (at, cause, limit) in cases {
                assert_eq!(at(0.99), Ok(()), "{cause} of axis {axis}");
                let (subject, failure) = at(1.01).unwrap_err();
                assert_eq!((subject, failure.cause, failure.limit), (Subject::Axis(axis), cause, limit));
                assert!((failure.value / limit - 1.01).abs() < 1e-6, "{cause}: {}", failure.value);
            }
        }
    }

    #[test]
    fn the_ends_of_every_stroke_may_be_held_with_the_encoders_noise_and_no_more() {
        let scenario = Scenario::default();
        for axis in 0..AXES {
            for (end, outwards) in [(0, -1.0), (1, 1.0)] {
                let end_m = scenario.mechanism.strokes.of_axis(axis)[end];
                let hold = |beyond_m: f64| {
                    let position_m = end_m + outwards * beyond_m;
                    let (mut command, mut positions_m) = (Command::default(), MIDDLE_M);
                    (command.version, command.request) = (LAYOUT_VERSION, DriveRequest::Enable.code());
                    positions_m[axis] = position_m;
                    command.target_m = positions_m;
                    Gate::new(&scenario).pass(1, &command, positions_m.map(Some))
                };
                assert_eq!((hold(0.0), hold(2e-6)), (Ok(()), Ok(())), "axis {axis}");
                let (subject, failure) = hold(3e-6).unwrap_err();
                assert_eq!((subject, failure.cause), (Subject::Axis(axis), Cause::StrokeLimit));
            }
        }
    }

    #[test]
    fn the_first_target_is_compared_with_the_position() {
        for (step_m, passes) in [(0.99 * 0.4e-3, true), (1.01 * 0.4e-3, false)] {
            let mut bench = Bench { gate: Gate::new(&scenario()), cycle: 0, target_m: MIDDLE_M };
            let judged = bench.send(|command| command.target_m[4] += step_m);
            assert_eq!(
                judged.map_err(|(_, failure)| failure.cause),
                if passes { Ok(()) } else { Err(Cause::VelocityLimit) }
            );
        }
    }

    #[test]
    fn what_is_no_command_is_refused_whatever_it_asks_for() {
        let cases: [(Change, Subject, [f64; 2]); 4] = [
            (
                |command| command.version += 1,
                Subject::Rig,
                [LAYOUT_VERSION + 1, LAYOUT_VERSION].map(|v| v as f64),
            ),
            (|command| command.request = 77, Subject::Rig, [77.0, 0.0]),
            (|command| command.target_m[2] = f64::INFINITY, Subject::Axis(2), [f64::INFINITY, 0.0]),
            (
                |command| (command.request, command.target_m[5]) = (0, f64::NEG_INFINITY),
                Subject::Axis(5),
                [f64::NEG_INFINITY, 0.0],
            ),
        ];
        for (change, subject, explanation) in cases {
            let refused = Bench::new().send(change).unwrap_err();
            assert_eq!(refused, (subject, Failure::with(Cause::BadMessage, explanation)));
        }
        let nan = Bench::new().send(|command| command.target_m[0] = f64::NAN).unwrap_err();
        assert_eq!((nan.0, nan.1.cause), (Subject::Axis(0), Cause::BadMessage));
    }

    #[test]
    fn a_refused_command_leaves_no_trace() {
        let mut bench = Bench::new();
        bench.step(3, 0.9).unwrap_err();
        assert_eq!(bench.step(3, 0.0399), Ok(()));
        assert!(bench.step(3, 0.09).is_err(), "of the velocity that passed");
    }

    /// As the motion does while a process stalls.
    #[test]
    fn a_motion_may_wait_and_go_on_as_before_but_not_faster() {
        for waited in [1, 3, 20] {
            let mut bench = Bench::new();
            bench.reach(4, 0.1);
            (0..waited).for_each(|_| bench.step(4, 0.0).unwrap());
            assert!(bench.step(4, 0.15).is_err());
            assert_eq!(bench.step(4, 0.05), Ok(()), "for a part of a period");
            assert_eq!(bench.step(4, 0.1), Ok(()));
            assert_eq!(bench.step(4, 0.1), Ok(()));
        }
    }

    #[test]
    fn the_steps_of_missed_commands_are_not_one_step() {
        let mut bench = Bench::new();
        bench.reach(4, 0.3);
        bench.cycle += 1;
        assert_eq!(bench.step(4, 0.6), Ok(()), "two periods since the last command");
        assert_eq!(bench.step(4, 0.3), Ok(()));
        let after_a_late_one = bench.send(|command| {
            command.cycle += 1;
            command.target_m[4] += 0.6 * PERIOD_S;
        });
        assert_eq!(after_a_late_one, Ok(()), "the last command was one cycle late");
        let jump = bench.send(|command| {
            command.cycle += 100;
            command.target_m[4] += 0.9 * PERIOD_S;
        });
        let (_, failure) = jump.unwrap_err();
        assert_eq!(failure.cause, Cause::VelocityLimit, "a count beyond the master's own is no excuse");
    }

    #[test]
    fn targets_that_no_drive_follows_may_be_anywhere() {
        let mut bench = Bench::new();
        let off = |command: &mut Command| (command.request, command.target_m) = (0, [9.0; AXES]);
        assert_eq!(bench.send(off), Ok(()));
        bench.target_m = MIDDLE_M;
        assert_eq!(bench.step(3, 0.3), Ok(()), "compared with the position again");
    }
}
