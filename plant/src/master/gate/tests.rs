use super::*;

type Judgement = Result<(), (Subject, Failure)>;
/// A motion with this multiple of its limit.
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

    /// Sends the command of the next cycle with a change. A refused command leaves the targets unchanged.
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
        self.gate.begin_cycle(self.cycle, MIDDLE_M.map(Some));
        self.gate.pass(&command, MIDDLE_M.map(Some))?;
        self.target_m = command.target_m;
        Ok(())
    }

    fn step(&mut self, axis: usize, velocity_m_s: f64) -> Judgement {
        self.send(|command| command.target_m[axis] += velocity_m_s * PERIOD_S)
    }

    /// Brings an axis to a velocity as fast as allowed.
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
        let start = |factor: f64| Bench::new().step(axis, factor * direction * acceleration_m_s2 * PERIOD_S);
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
                let mut gate = Gate::new(&scenario);
                gate.begin_cycle(1, positions_m.map(Some));
                gate.pass(&command, positions_m.map(Some))
            };
            assert_eq!([hold(0.0), hold(2e-6)], [Ok(DriveRequest::Enable); 2], "axis {axis}");
            let (subject, failure) = hold(3e-6).unwrap_err();
            assert_eq!((subject, failure.cause), (Subject::Axis(axis), Cause::StrokeLimit));
        }
    }
}

#[test]
fn the_first_target_starts_from_the_position_at_rest() {
    let limits = scenario();
    let standing_m = limits.can.following_limit_m;
    let farthest_m = standing_m + limits.drives.leg.max_acceleration_m_s2 * PERIOD_S * PERIOD_S;
    for direction in [-1.0, 1.0] {
        let first = |factor: f64| {
            let mut bench = Bench { gate: Gate::new(&limits), cycle: 0, target_m: MIDDLE_M };
            bench.send(|command| command.target_m[4] += factor * direction * farthest_m)
        };
        assert_eq!(first(0.99), Ok(()));
        assert_eq!(first(1.01).map_err(|(_, failure)| failure.cause), Err(Cause::AccelerationLimit));
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
    for (change, subject, [value, limit]) in cases {
        let refused = Bench::new().send(change).unwrap_err();
        assert_eq!(refused, (subject, Failure::with(Cause::BadMessage, value, limit)));
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

/// The targets of a motion during a stall of a process.
#[test]
fn a_motion_may_wait_and_go_on_as_before_but_not_faster() {
    for waited in [1, 3, 15] {
        let mut bench = Bench::new();
        bench.reach(4, 0.1);
        (0..waited).for_each(|_| bench.step(4, 0.0).unwrap());
        assert!(bench.step(4, 0.15).is_err());
        assert_eq!(bench.step(4, 0.05), Ok(()), "for a part of a period");
        assert_eq!(bench.step(4, 0.1), Ok(()));
        assert_eq!(bench.step(4, 0.1), Ok(()));
    }
}

/// The waits of a motion with repeatedly late readings. The velocity is beyond a start within the limit of
/// acceleration.
#[test]
fn a_motion_may_wait_in_every_second_cycle() {
    for (direction, end) in [(-1.0, 45), (-1.0, 100), (1.0, 45), (1.0, 100)] {
        let mut bench = Bench::new();
        for part in (1..=end).chain((1..end).rev()) {
            let velocity_m_s = direction * 1e-3 * f64::from(part);
            // Pose control goes on.
            assert_eq!(bench.step(4, -direction * 0.002), Ok(()), "waits at {velocity_m_s}");
            assert_eq!(bench.step(4, velocity_m_s), Ok(()), "goes on with {velocity_m_s}");
        }
        assert!(bench.step(4, -direction * 0.09).is_err(), "backwards at once");
    }
}

#[test]
fn a_motion_that_waited_for_longer_than_the_time_out_starts_from_rest() {
    let timeout_cycles = scenario().can.command_timeout_cycles;
    let resume_after = |waited: u32| {
        let mut bench = Bench::new();
        bench.reach(4, 0.1);
        (0..waited).for_each(|_| bench.step(4, 0.0).unwrap());
        bench.step(4, 0.1).map_err(|(_, failure)| failure.cause)
    };
    assert_eq!(resume_after(timeout_cycles), Ok(()));
    assert_eq!(resume_after(2 * timeout_cycles), Err(Cause::AccelerationLimit));
}

#[test]
fn a_target_is_two_periods_away_at_most_however_many_commands_were_missed() {
    for missed in [1, 2, 19] {
        let resume = |velocity_m_s: f64| {
            let mut bench = Bench::new();
            bench.reach(4, 0.35);
            bench.cycle += missed;
            bench.step(4, velocity_m_s).map_err(|(_, failure)| failure.cause)
        };
        assert_eq!(resume(2.0 * 0.39), Ok(()), "{missed} missed");
        assert_eq!(resume(2.0 * 0.41), Err(Cause::VelocityLimit), "{missed} missed");
    }
}

#[test]
fn a_late_command_leaves_two_periods_for_the_next() {
    let mut bench = Bench::new();
    bench.reach(4, 0.3);
    bench.send(|command| command.cycle -= 1).unwrap();
    assert_eq!(bench.step(4, 0.6), Ok(()));
    assert_eq!(bench.step(4, 0.6).unwrap_err().1.cause, Cause::VelocityLimit);
}

/// Each command would have two periods by its own count.
#[test]
fn a_count_that_runs_ahead_of_the_masters_gives_no_more_than_its_cycles() {
    let mut bench = Bench::new();
    bench.reach(4, 0.3);
    let passed = (1..=50u64).take_while(|ahead| {
        let judged = bench.send(|command| {
            command.cycle += ahead;
            command.target_m[4] += 0.6 * PERIOD_S;
        });
        judged.is_ok()
    });
    assert_eq!(passed.count(), 2);
    let jump = bench.send(|command| {
        command.cycle += 100;
        command.target_m[4] += 0.9 * PERIOD_S;
    });
    assert_eq!(jump.unwrap_err().1.cause, Cause::VelocityLimit);
}

/// After a legal reversal, at once or with a stop between.
#[test]
fn a_motion_turns_back_only_as_fast_as_it_may() {
    for direction in [-1.0, 1.0] {
        for stops in [0, 1, 3] {
            let mut bench = Bench::new();
            bench.reach(4, direction * 0.3);
            for part in 1..=20 {
                bench.step(4, direction * (0.3 - 0.6 * f64::from(part) / 20.0)).unwrap();
            }
            (0..stops).for_each(|_| bench.step(4, 0.0).unwrap());
            let back = bench.step(4, direction * 0.3).unwrap_err();
            assert_eq!(back.1.cause, Cause::AccelerationLimit, "{direction} {stops}");
            assert_eq!(bench.step(4, -direction * 0.3), Ok(()));
        }
    }
}

#[test]
fn a_drive_that_stopped_following_without_a_command_needs_a_new_target() {
    let mut bench = Bench::new();
    let mut others_m = MIDDLE_M.map(Some);
    others_m[3] = None;
    bench.gate.begin_cycle(2, others_m);
    bench.gate.begin_cycle(3, MIDDLE_M.map(Some));
    assert_eq!(bench.gate.targets().map(|target| Some(target?.position_m)), others_m);
}

#[test]
fn targets_that_no_drive_follows_may_be_anywhere() {
    let mut bench = Bench::new();
    let off = |command: &mut Command| (command.request, command.target_m) = (0, [9.0; AXES]);
    assert_eq!(bench.send(off), Ok(()));
    bench.target_m = MIDDLE_M;
    assert_eq!(bench.step(3, 0.1), Ok(()), "compared with the position again");
}
