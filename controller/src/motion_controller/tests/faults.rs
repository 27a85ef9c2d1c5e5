//! The controller stops for every disturbance, with its cause.

use masseter_runtime::messages::explain;

use super::*;

#[test]
fn a_stop_for_want_of_a_pose_says_why_there_is_none() {
    let cases = [
        ([0.03, -0.03, 0.0, 0.3, 0.24, 0.24], "cannot be assembled"),
        ([0.0, 0.0, 0.0, 0.29, 0.0, 0.29], "axis l2: the leg has no length"),
    ];
    for (position_m, reason) in cases {
        let mut bench = Bench::new();
        bench.run_until(ControllerState::Running);
        bench.cycle(|reading| Some(Reading { position_m, ..reading }));
        let said = explain(bench.events.last().unwrap(), &[]).unwrap_or_default();
        assert!(said.contains(reason) && said.contains("[mechanism]"), "{said}");
    }
}

/// Every disturbance of the playing motion, with its cause.
#[test]
fn whatever_goes_wrong_while_moving_ends_in_a_safe_stop_with_its_cause() {
    type Disturbance = fn(Reading) -> Option<Reading>;
    let cases: [(Cause, Disturbance); 9] = [
        (Cause::StaleReading, |_| None),
        (Cause::StaleReading, |reading| Some(Reading { fresh_axes: ALL_AXES - 1, ..reading })),
        (Cause::DriveFault, |mut reading| {
            reading.drive_state[2] = DriveState::Fault.code();
            Some(reading)
        }),
        (Cause::DriveFault, |mut reading| {
            reading.drive_state[4] = DriveState::SwitchOnDisabled.code();
            Some(reading)
        }),
        (Cause::MasterFault, |reading| Some(Reading { master_fault: 1, ..reading })),
        (Cause::BadMessage, |mut reading| {
            reading.position_m[0] = f64::NAN;
            Some(reading)
        }),
        (Cause::ForeignCommand, |reading| Some(Reading { answers_cycle: u64::MAX, ..reading })),
        (Cause::ForwardKinematics, |mut reading| {
            reading.position_m = [0.03, -0.03, 0.0, 0.3, 0.24, 0.24];
            Some(reading)
        }),
        (Cause::TrackingLost, |mut reading| {
            reading.position_m[LEGS..].iter_mut().for_each(|leg_m| *leg_m -= 0.006);
            Some(reading)
        }),
    ];
    for (cause, disturb) in cases {
        let mut bench = Bench::new();
        bench.run_until(ControllerState::Running);
        for _ in 0..200 {
            bench.cycle(Some);
        }
        let limit = u64::from(ControllerConfig::default().stale_cycles) + 1;
        for _ in 0..limit {
            bench.cycle(disturb);
        }
        assert_eq!(bench.controller.state(), ControllerState::SafeStop, "{cause}");
        assert_eq!(bench.last_cause(), cause);
        let mut command = Command::default();
        bench.controller.fill_command(&mut command);
        assert_eq!(command.request, DriveRequest::QuickStop.code());
        for _ in 0..100 {
            bench.cycle(Some);
        }
        assert_eq!(bench.controller.state(), ControllerState::SafeStop, "{cause}: it moved again");
    }
}

#[test]
fn a_bad_reading_is_reported_with_its_bad_value() {
    type Spoil = fn(&mut Reading);
    let cases: [(Spoil, u32, f64); 3] = [
        (|reading| reading.position_m[1] = f64::NEG_INFINITY, 1, f64::NEG_INFINITY),
        (|reading| reading.force_n[5] = f64::INFINITY, 5, f64::INFINITY),
        (|reading| reading.drive_state[3] = 99, 3, 99.0),
    ];
    for (spoil, axis, value) in cases {
        let mut bench = Bench::new();
        bench.run_until(ControllerState::Running);
        bench.cycle(|mut reading| {
            spoil(&mut reading);
            Some(reading)
        });
        assert_eq!(bench.last_cause(), Cause::BadMessage);
        let told = bench.events.last().unwrap();
        assert_eq!((told.axis, told.value.to_bits()), (axis, value.to_bits()), "{}", told.value);
    }
}

/// The quick stop of the drive may still be under way, and the command must keep requesting the stop.
#[test]
fn a_safe_stop_waits_for_a_lost_drive_until_its_time_is_over() {
    let mut bench = Bench::new();
    bench.run_until(ControllerState::Running);
    let lose = |mut reading: Reading| {
        reading.drive_state[3] = NO_DRIVE_STATE;
        Some(reading)
    };
    let waits = (SAFE_STOP_S / bench.controller.sequencer.period_s) as u64;
    for _ in 1..waits {
        bench.cycle(lose);
        assert_eq!(bench.controller.state(), ControllerState::SafeStop);
        assert!(bench.controller.outcome().is_none());
    }
    bench.cycle(lose);
    assert!(bench.controller.outcome().is_some());
}

#[test]
fn drives_that_never_get_ready_are_not_waited_for_forever() {
    let mut bench = Bench::new();
    for _ in 0..20_000 {
        bench.cycle(|mut reading| {
            reading.drive_state = [DriveState::ReadyToSwitchOn.code(); AXES];
            Some(reading)
        });
    }
    assert_eq!(bench.controller.state(), ControllerState::SafeStop);
    assert_eq!(bench.last_cause(), Cause::EnableTimeout);
}
