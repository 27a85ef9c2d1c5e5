use super::*;

mod played {
    use masseter_runtime::messages::codes::ControllerState;
    use masseter_runtime::messages::pose_fields;
    use masseter_runtime::named::Parameter;

    use super::*;

    fn watch(declared: &Declared) -> (PlayedWatch, Arc<Trajectory>) {
        let scenario = Scenario { duration_s: Some(2.0), ..Scenario::default() };
        (PlayedWatch::new(&scenario, declared), trajectory(&scenario).unwrap())
    }

    /// A state in the scenario's pose at this time.
    fn state(motion: &Trajectory, cycle: u64, motion_time_s: f64) -> State {
        let (desired_position_m, desired_quaternion_wxyz) =
            pose_fields(&motion.pose_in_motion(motion_time_s));
        let controller_state = ControllerState::Running.code();
        State {
            cycle,
            motion_time_s,
            desired_position_m,
            desired_quaternion_wxyz,
            controller_state,
            ..State::default()
        }
    }

    /// How far a motion with these cycles and times came, s.
    fn reached_s(times: &[(u64, f64)]) -> Option<f64> {
        let (mut watch, motion) = watch(&Declared::default());
        for (cycle, time_s) in times {
            watch.apply_state(&state(&motion, *cycle, *time_s));
        }
        watch.into_figures().0
    }

    #[test]
    fn the_motions_time_passes_no_faster_than_the_cycles() {
        type Case = (&'static [(u64, f64)], Option<f64>);
        let cases: [Case; 9] = [
            (&[], None),
            (&[(1, -1.0), (2, f64::NAN)], None),
            (&[(7, 0.0), (8, 0.001), (9, 0.002)], Some(0.002)),
            // A late reading has the time of the sample before.
            (&[(7, 0.0), (8, 0.0), (9, 0.002)], Some(0.002)),
            // Twice as fast, and at rest.
            (&[(7, 0.0), (8, 0.002), (9, 0.004), (10, 0.006), (20, 0.006)], Some(0.004)),
            // A wait earns nothing.
            (&[(7, 0.0), (8, 0.0), (9, 0.0), (10, 0.0), (11, 0.004)], Some(0.0)),
            // The time vanishes.
            (&[(7, 0.0), (8, f64::NAN), (9, 0.002)], Some(0.0)),
            (&[(7, 0.0), (8, 1.0), (9, 1.001), (1100, 1.5)], Some(0.0)),
            (&[(7, 1.5), (2000, 1.5)], Some(0.0)),
        ];
        for (times, expected) in cases {
            assert_eq!(reached_s(times), expected, "{times:?}");
        }
    }

    #[test]
    fn few_lost_cycles_pass_unseen_and_many_are_not_played() {
        let (mut few, mut many) = (Vec::new(), Vec::new());
        for cycle in 0..=1000_u32 {
            let time = (u64::from(cycle), f64::from(cycle) * 1e-3);
            few.extend((!(500..530).contains(&cycle)).then_some(time));
            many.extend((!(300..800).contains(&cycle)).then_some(time));
        }
        assert_eq!(reached_s(&few), Some(1.0));
        let seen_s = reached_s(&many).unwrap();
        assert!((seen_s - 0.502).abs() < 1e-6, "{seen_s}");
    }

    #[test]
    fn a_state_without_motion_ends_it() {
        let (mut watch, motion) = watch(&Declared::default());
        let off = State { controller_state: ControllerState::Disabling.code(), ..state(&motion, 2, 0.001) };
        for state in [off, state(&motion, 3, 0.0), state(&motion, 4, 0.001), off, state(&motion, 6, 0.002)] {
            watch.apply_state(&state);
        }
        assert_eq!(watch.into_figures().0, Some(0.001));
    }

    #[test]
    fn another_pose_than_the_scenarios_is_a_departure_with_its_time() {
        let (mut watch, motion) = watch(&Declared::default());
        for cycle in 0..1000 {
            let mut state = state(&motion, cycle, cycle as f64 * 1e-3);
            if cycle == 700 {
                state.desired_position_m[2] += 2e-3;
            }
            watch.apply_state(&state);
        }
        let departure = watch.into_figures().1.unwrap();
        assert!((departure.incisal_mm - 2.0).abs() < 1e-6 && departure.deg < 1e-4, "{departure:?}");
        assert!((departure.at_s - 0.7).abs() < 1e-9);
    }

    #[test]
    fn own_motions_and_set_amplitudes_have_poses_of_their_own() {
        let amplitude = Declared { parameters: vec![Parameter::new(AMPLITUDE, 1.0)], ..Declared::default() };
        let own = Declared { motion: PlayedMotion::Own, ..amplitude.clone() };
        let set = Event { object: 0, cause: Cause::ParameterSet.code(), ..Event::default() };
        for (declared, event, is_compared) in
            [(&amplitude, None, true), (&own, None, false), (&amplitude, Some(set), false)]
        {
            let (mut watch, motion) = watch(declared);
            watch.apply_state(&state(&motion, 1, 0.0));
            if let Some(event) = event {
                watch.apply_event(&event);
            }
            let controller_state = ControllerState::Running.code();
            watch.apply_state(&State {
                cycle: 2,
                motion_time_s: 0.001,
                controller_state,
                ..State::default()
            });
            let departure = watch.into_figures().1;
            assert_eq!(departure.is_some_and(|departure| departure.is_partial), event.is_some());
            assert_eq!(departure.is_some_and(|departure| departure.incisal_mm.is_infinite()), is_compared);
        }
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
