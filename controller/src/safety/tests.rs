//! Every check fires beyond its limit and not before it, for every axis, and reports its value.

use masseter_runtime::messages::codes::{EventKind, NO_DRIVE_STATE, Source};

use super::*;
use crate::kinematics::Condition;

fn good_reading() -> Reading {
    Reading { drive_state: [DriveState::OperationEnabled.code(); AXES], ..Reading::default() }
}

#[test]
fn the_velocity_limit_of_each_axis_holds_in_both_directions() {
    // Powers of two, so that the limit is met exactly.
    let limit_m_s: [f64; AXES] = std::array::from_fn(|axis| 0.125 * (axis + 1) as f64);
    let (before_m, period_s) = ([0.125, -0.25, 0.25, 0.375, 0.5, 0.625], 1.0 / 512.0);
    for axis in 0..AXES {
        for direction in [1.0, -1.0] {
            let check = |share: f64| {
                let mut target_m = before_m;
                target_m[axis] += direction * share * limit_m_s[axis] * period_s;
                let [target, before] = [target_m, before_m].map(Actuators::from_axes);
                check_velocity(&target, &before, &limit_m_s, period_s)
            };
            assert_eq!([0.99, 1.0].map(check), [Ok(()); 2], "axis {axis}, direction {direction}");
            let fault = check(1.01).unwrap_err();
            assert_eq!((fault.cause, fault.axis), (Cause::VelocityLimit, Some(axis)));
            assert_eq!((fault.limit, fault.no_pose), (limit_m_s[axis], None));
            assert!((fault.value / limit_m_s[axis] - 1.01).abs() < 1e-6, "{}", fault.value);
        }
    }
}

#[test]
fn every_value_of_a_reading_must_be_a_number_and_every_code_known() {
    type Spoil = fn(&mut Reading, usize, f64);
    let spoils: [(Spoil, f64); 5] = [
        (|reading, axis, value| reading.position_m[axis] = value, f64::NAN),
        (|reading, axis, value| reading.position_m[axis] = value, f64::INFINITY),
        (|reading, axis, value| reading.force_n[axis] = value, f64::NEG_INFINITY),
        (|reading, axis, value| reading.drive_state[axis] = value as u32, 9.0),
        (|reading, axis, value| reading.drive_state[axis] = value as u32, f64::from(u32::MAX)),
    ];
    assert_eq!(check_reading(&good_reading()), Ok(()));
    for axis in 0..AXES {
        for (spoil, value) in spoils {
            let mut reading = good_reading();
            spoil(&mut reading, axis, value);
            let fault = check_reading(&reading).unwrap_err();
            assert_eq!((fault.cause, fault.axis, fault.limit), (Cause::BadMessage, Some(axis), 0.0));
            assert_eq!(fault.value.to_bits(), value.to_bits());
        }
    }
    for load_cell_n in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let fault = check_reading(&Reading { load_cell_n, ..good_reading() }).unwrap_err();
        assert_eq!((fault.cause, fault.axis, fault.limit), (Cause::BadMessage, None, 0.0));
        assert_eq!(fault.value.to_bits(), load_cell_n.to_bits());
    }
}

#[test]
fn a_command_that_was_not_sent_yet_is_another_controllers() {
    let answers = |answers_cycle| check_commander(&Reading { answers_cycle, ..good_reading() }, 7);
    assert_eq!([0, 6, 7].map(answers), [Ok(()); 3]);
    assert_eq!(answers(8), Err(Fault::new(Cause::ForeignCommand, 8.0, 7.0)));
}

/// Codes of a drive: whether the code is a fault at rest, and in motion. A lost drive has code 0.
#[test]
fn a_drive_in_fault_is_one_always_and_any_that_is_not_enabled_while_moving() {
    for axis in 0..AXES {
        for code in NO_DRIVE_STATE..=DriveState::Fault.code() {
            let mut reading = good_reading();
            reading.drive_state[axis] = code;
            let is_faulty =
                matches!(drive_state(code), Ok(Some(DriveState::Fault | DriveState::FaultReactionActive)));
            let enabled = DriveState::OperationEnabled.code();
            let fault = Err(Fault::for_axis(Cause::DriveFault, axis, f64::from(code), f64::from(enabled)));
            let expected = |is_fault: bool| if is_fault { fault } else { Ok(()) };
            assert_eq!(check_drives(&reading, false), expected(is_faulty), "axis {axis}, state {code}");
            assert_eq!(check_drives(&reading, true), expected(code != enabled), "axis {axis}, state {code}");
        }
    }
}

#[test]
fn a_master_that_serves_no_longer_is_a_fault_before_its_drives() {
    let mut reading = Reading { master_fault: 1, ..good_reading() };
    reading.drive_state[0] = DriveState::Fault.code();
    for moving in [false, true] {
        assert_eq!(check_drives(&reading, moving), Err(Fault::new(Cause::MasterFault, 1.0, 0.0)));
    }
}

#[test]
fn a_stroke_that_was_passed_names_its_axis_and_the_end() {
    let passed = |value_m| Fault::from(LimitViolation { axis: 4, value_m, lowest_m: 0.2, highest_m: 0.3 });
    for (value_m, end_m) in [(0.31, 0.3), (0.19, 0.2)] {
        let fault = passed(value_m);
        assert_eq!((fault.cause, fault.axis), (Cause::StrokeLimit, Some(4)));
        assert_eq!((fault.value, fault.limit, fault.no_pose), (value_m, end_m, None));
    }
}

#[test]
fn want_of_a_pose_is_a_fault_with_its_reason_leg_and_residual() {
    let violated = Condition::LegAboveBase { leg: 0 };
    let forward = [
        (ForwardError::NotFinite, NoPose::NotFinite, None, None),
        (ForwardError::NoLength { leg: 2, leg_m: -0.1 }, NoPose::NoLength, Some(5), None),
        (ForwardError::Unassemblable, NoPose::Unassemblable, None, None),
        (ForwardError::WrongAssembly { violated }, NoPose::WrongAssembly, None, None),
        (ForwardError::Ambiguous { count: 2, separation_rad: 0.1 }, NoPose::Ambiguous, None, None),
        (ForwardError::Undecided { solutions: 8 }, NoPose::Undecided, None, None),
        (ForwardError::NoConvergence { residual_m: 0.5, iterations: 9 }, NoPose::NotFound, None, Some(0.5)),
        (ForwardError::Stalled { residual_m: 0.25, iterations: 9 }, NoPose::NotFound, None, Some(0.25)),
        (ForwardError::Singular { determinant: 0.0, residual_m: 0.125 }, NoPose::NotFound, None, Some(0.125)),
    ];
    let forward = forward.map(|(error, reason, axis, residual_m)| {
        (Fault::from(&error), Cause::ForwardKinematics, reason, axis, residual_m)
    });
    let inverse = [
        (InverseError::NotFinite, NoPose::NotFinite, None),
        (InverseError::NoLength { leg: 1, leg_m: 0.0 }, NoPose::NoLength, Some(4)),
    ];
    let inverse = inverse
        .map(|(error, reason, axis)| (Fault::from(error), Cause::InverseKinematics, reason, axis, None));
    for (fault, cause, reason, axis, residual_m) in forward.into_iter().chain(inverse) {
        let found = (fault.cause, fault.no_pose, fault.axis, fault.limit);
        assert_eq!(found, (cause, Some(reason), axis, 0.0));
        assert_eq!(Some(fault.value).filter(|value| !value.is_nan()), residual_m);
    }
}

#[test]
fn an_event_says_what_the_fault_says() {
    let explained = |fault: Fault| {
        let mut event = Event::new(Source::Controller, EventKind::Fault, Cause::Sequence);
        fault.explain(&mut event);
        (event.cause, event.axis, event.object, event.value, event.limit)
    };
    let of_rig = Fault::new(Cause::TrackingLost, 4e-3, 3e-3);
    assert_eq!(explained(of_rig), (Cause::TrackingLost.code(), NO_AXIS, 0, 4e-3, 3e-3));
    let of_leg = Fault::for_kinematics(Cause::ForwardKinematics, NoPose::NoLength, Some(1), 0.5);
    let code = NoPose::NoLength.code();
    assert_eq!(explained(of_leg), (Cause::ForwardKinematics.code(), 4, code, 0.5, 0.0));
}
