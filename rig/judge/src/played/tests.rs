use super::*;

mod played {
    use masseter_model::geometry::Deviation;
    use masseter_runtime::messages::codes::ControllerState;

    use super::*;

    fn sample(desired: Option<Pose>, actual: Option<Pose>) -> PathSample {
        PathSample { sampled_ns: 7, desired, actual, deviation: Deviation::default() }
    }

    /// How far the jaw goes, where its place along x at each sample is this share of the desired one, mm.
    fn played(samples: u32, place_mm: impl Fn(f64) -> f64, rest_m: f64) -> MotionFigures {
        let mut watch = PlayedWatch::new(&Scenario::default());
        let pose = |mm: f64| Some(Pose::translation(mm * 1e-3, 0.0, 0.0));
        for at in 0..=samples {
            let wanted_mm = 10.0 * (f64::from(at) * 0.1).sin();
            watch.add_sample(0.0, f64::from(at), &sample(pose(wanted_mm), pose(place_mm(wanted_mm))));
        }
        watch.into_figures(Some(rest_m))
    }

    #[test]
    fn what_the_jaw_goes_in_the_direction_of_the_motion_is_played() {
        let share = |place_mm: fn(f64) -> f64| played(500, place_mm, 0.0).played.unwrap();
        for (place_mm, expected) in [
            ((|mm| mm) as fn(f64) -> f64, 1.0),
            (|_| 0.0, 0.0),
            (|mm| 0.5 * mm, 0.5),
            (|mm| mm + 3.0, 1.0),
            (|mm| -mm, -1.0),
        ] {
            assert!((share(place_mm) - expected).abs() < 1e-9, "{expected}");
        }
        let whole = played(500, |mm| mm, 0.0);
        let half = played(500, |mm| mm, whole.way_mm.unwrap() / 1e3);
        assert!((half.played.unwrap() - 0.5).abs() < 1e-9, "the rest was not played: {half:?}");
    }

    /// After lost cycles the motion stands for a while, and the jaw goes on to its last target.
    #[test]
    fn a_jaw_that_catches_up_while_the_motion_waits_has_played_all() {
        let mut watch = PlayedWatch::new(&Scenario::default());
        let pose = |mm: f64| Some(Pose::translation(mm * 1e-3, 0.0, 0.0));
        for (wanted_mm, is_mm) in (0..200).flat_map(|at| {
            let wanted_mm = f64::from(at) * 0.1;
            // In the third sample the motion goes back a little, as after lost cycles.
            [(wanted_mm, wanted_mm - 0.05), (wanted_mm, wanted_mm), (wanted_mm - 0.05, wanted_mm)]
        }) {
            watch.add_sample(0.0, wanted_mm, &sample(pose(wanted_mm), pose(is_mm)));
        }
        let share = watch.into_figures(Some(0.0)).played.unwrap();
        assert!((share - 1.0).abs() < 0.02, "{share}");
    }

    #[test]
    fn a_motion_that_is_not_the_scenarios_or_moves_nothing_has_no_share() {
        let own = PlayedWatch::new(&Scenario::default()).into_figures(None);
        assert_eq!((own.way_mm, own.played, own.lag_ms), (None, None, None));
        let still = PlayedWatch::new(&Scenario::default()).into_figures(Some(0.0));
        assert_eq!((still.way_mm, still.played), (Some(0.0), None));
        let never_moved = PlayedWatch::new(&Scenario::default()).into_figures(Some(0.9));
        assert_eq!(never_moved.played, Some(0.0));
    }

    #[test]
    fn the_greatest_lag_and_the_cycles_without_a_new_command_are_counted() {
        let mut watch = PlayedWatch::new(&Scenario::default());
        for lag_s in [0.0, 0.003, 0.002] {
            watch.add_sample(lag_s, 0.0, &sample(None, None));
        }
        let moving = Some(ControllerState::Running.code());
        for answers_cycle in [1, 2, 2, 2, 3, 3, 5, 6] {
            watch.add_reading(&Reading { answers_cycle, ..Reading::default() }, moving, false);
        }
        watch.add_reading(&Reading { answers_cycle: 6, ..Reading::default() }, None, false);
        let found = watch.into_figures(None);
        assert_eq!((found.missed_commands, found.missed_in_a_row), (3, 2));
        assert!((found.lag_ms.unwrap() - 3.0).abs() < 1e-12);
    }

    #[test]
    fn a_command_that_is_used_after_its_cycle_is_late() {
        let late = |cycles_and_answers: &[(u64, u64)]| {
            let mut watch = PlayedWatch::new(&Scenario::default());
            for &(cycle, answers_cycle) in cycles_and_answers {
                watch.add_reading(
                    &Reading { cycle, answers_cycle, ..Reading::default() },
                    Some(ControllerState::Running.code()),
                    false,
                );
            }
            let found = watch.into_figures(None);
            (found.late_commands, found.missed_commands)
        };
        assert_eq!(late(&[(1, 0), (2, 1), (3, 2), (4, 3)]), (0, 1), "the first cycle has no command");
        assert_eq!(late(&[(5, 3), (6, 4), (7, 5), (8, 6)]), (3, 0), "each a cycle late");
        assert_eq!(late(&[(5, 4), (6, 4), (7, 5), (8, 7)]), (1, 1), "one that came late");
        assert_eq!(late(&[(5, 4), (9, 5), (10, 9)]), (0, 0), "the plant skipped cycles");
    }
}

mod stop {
    use masseter_runtime::messages::Event;
    use masseter_runtime::messages::codes::{Cause, ControllerState, EventKind, Source};

    use super::*;

    fn reading(state: DriveState, master_fault: u32) -> Reading {
        Reading { drive_state: [state.code(); AXES], master_fault, ..Reading::default() }
    }

    /// Of one reading a cycle.
    fn seen(readings: &[Reading]) -> (Option<StoppedBy>, u64) {
        let mut watch = StopWatch::default();
        for (cycle, reading) in (1..).zip(readings) {
            watch.apply_reading(&Reading { cycle, ..*reading });
        }
        watch.into_figures()
    }

    #[test]
    fn a_fault_of_the_master_and_a_quick_stop_of_enabled_drives_are_stops() {
        let enabled = reading(DriveState::OperationEnabled, 0);
        let quick = reading(DriveState::QuickStopActive, 0);
        let off = reading(DriveState::SwitchOnDisabled, 0);
        let fault = reading(DriveState::SwitchOnDisabled, 1);
        let cases: [(&[Reading], _); 6] = [
            (&[off, enabled, enabled, off], (None, 2)),
            (&[off, enabled, quick, off], (Some(StoppedBy::QuickStop), 1)),
            (&[enabled, fault, off], (Some(StoppedBy::Master), 1)),
            (&[enabled, quick, fault], (Some(StoppedBy::QuickStop), 1)),
            (&[fault], (Some(StoppedBy::Master), 0)),
            // Nothing moved before.
            (&[quick, off], (None, 0)),
        ];
        for (readings, expected) in cases {
            assert_eq!(seen(readings), expected);
        }
        let mut one_is_off = enabled;
        one_is_off.drive_state[3] = DriveState::SwitchedOn.code();
        assert_eq!(seen(&[one_is_off, quick]), (None, 0));
    }

    #[test]
    fn a_motion_runs_in_its_state_and_with_enabled_drives() {
        let (enabled, off) =
            (reading(DriveState::OperationEnabled, 0), reading(DriveState::SwitchOnDisabled, 0));
        let mut watch = PlayedWatch::new(&Scenario::default());
        let (runs, holds) = (ControllerState::Running, ControllerState::Holding);
        let cycles =
            [(1, runs, enabled), (2, runs, off), (3, holds, enabled), (4, runs, enabled), (7, runs, enabled)];
        for (cycle, state, reading) in cycles {
            watch.add_reading(&Reading { cycle, ..reading }, Some(state.code()), false);
        }
        // Of the cycles 5 and 6 there is no reading.
        assert_eq!(watch.running_cycles(), 5);
    }

    #[test]
    fn a_drive_that_leaves_operation_while_the_motion_runs_is_a_stop() {
        use ControllerState::{Disabling, Enabling, Holding, Running, SafeStop};
        type Case<'a> = (&'a [(Reading, ControllerState)], Option<StoppedBy>);
        let enabled = reading(DriveState::OperationEnabled, 0);
        let quick = reading(DriveState::QuickStopActive, 0);
        let fault = reading(DriveState::SwitchOnDisabled, 1);
        let mut left = enabled;
        left.drive_state[3] = DriveState::SwitchOnDisabled.code();
        let mut silent = enabled;
        silent.drive_state[3] = NO_DRIVE_STATE;
        let cases: [Case<'_>; 8] = [
            (&[(enabled, Running), (left, Running), (left, Running)], Some(StoppedBy::Drives)),
            (&[(enabled, Holding), (left, Holding), (enabled, Holding)], Some(StoppedBy::Drives)),
            // The controller ends the motion, one cycle late at most.
            (&[(enabled, Running), (enabled, Disabling), (left, Disabling)], None),
            (&[(enabled, Running), (left, Running), (left, SafeStop)], None),
            (&[(enabled, Enabling), (left, Enabling), (enabled, Running), (enabled, Running)], None),
            (&[(enabled, Running), (silent, Running), (enabled, Running)], None),
            // The first cause of such a state.
            (&[(enabled, Running), (left, Running), (fault, Running)], Some(StoppedBy::Master)),
            (&[(enabled, Running), (left, Running), (quick, Running)], Some(StoppedBy::QuickStop)),
        ];
        for (messages, expected) in cases {
            let mut watch = StopWatch::default();
            for (cycle, (reading, state)) in (1..).zip(messages) {
                watch.apply_reading(&Reading { cycle, due_ns: 10 * cycle, ..*reading });
                let controller_state = state.code();
                watch.apply_state(&State {
                    cycle,
                    due_ns: 10 * cycle + 5,
                    controller_state,
                    ..State::default()
                });
            }
            assert_eq!(watch.into_figures().0, expected);
        }
    }

    /// Drives that still have power when the controller says that it has finished may be stopped.
    #[test]
    fn what_comes_after_the_end_of_a_finished_controller_is_no_stop() {
        let enabled = reading(DriveState::OperationEnabled, 0);
        let off = reading(DriveState::SwitchOnDisabled, 0);
        let quick = reading(DriveState::QuickStopActive, 0);
        let fault = reading(DriveState::SwitchOnDisabled, 1);
        let cases = [
            ([enabled, off, fault], ControllerState::Finished, None),
            ([enabled, off, fault], ControllerState::SafeStop, Some(StoppedBy::Master)),
            ([enabled, fault, fault], ControllerState::Finished, Some(StoppedBy::Master)),
            ([enabled, enabled, quick], ControllerState::Finished, Some(StoppedBy::QuickStop)),
        ];
        for (readings, state, expected) in cases {
            let mut watch = StopWatch::default();
            watch.apply_state(&State { controller_state: state.code(), ..State::default() });
            for (cycle, reading) in (1..).zip(&readings) {
                watch.apply_reading(&Reading { cycle, ..*reading });
            }
            assert_eq!(watch.into_figures().0, expected);
        }
    }

    #[test]
    fn the_masters_report_counts_without_a_reading_and_no_other_report_does() {
        let stop = |source, kind| {
            let mut watch = StopWatch::default();
            watch.apply_event(&EventRecord::from(&Event::new(source, kind, Cause::BadMessage)));
            watch.into_figures().0
        };
        assert_eq!(stop(Source::Master, EventKind::Fault), Some(StoppedBy::Master));
        assert_eq!(stop(Source::Master, EventKind::Notice), None);
        assert_eq!(stop(Source::Drive, EventKind::Fault), None);
        assert_eq!(stop(Source::Controller, EventKind::Fault), None);
    }
}
