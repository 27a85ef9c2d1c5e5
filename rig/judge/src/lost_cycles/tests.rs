use super::*;

mod freshness {
    use super::*;

    #[test]
    fn every_cycle_is_counted_by_the_reading_it_used() {
        let mut freshness = Freshness::default();
        // The controller's cycle, the reading's, and whether that is fresh. Reading 7 is there before cycle 6, late
        // itself, looks for its own.
        let cycles = [
            (1, 0, false),
            (2, 0, false),
            (3, 3, true),
            (4, 3, false),
            (5, 4, true),
            (6, 7, true),
            (7, 7, false),
            (8, 8, true),
        ];
        for (cycle, reading_cycle, is_fresh) in cycles {
            let state = State { cycle, reading_cycle, ..State::default() };
            assert_eq!(freshness.is_first_use(&state), is_fresh, "cycle {cycle}");
        }
        let expected = ReadingFigures { in_time: 3, late: 1, none: 2, before_first: 2 };
        assert_eq!(freshness.figures, expected);
    }
}

mod disturbance {
    use super::*;

    const PERIOD_NS: u64 = 1_000_000;

    /// States of a run whose cycle 500 is changed, and how many cycles are disturbed.
    fn disturbed(change: fn(&mut State)) -> usize {
        let mut disturbance = Disturbance::default();
        let mut skipped_cycles = 0;
        let states = (1..=1000).map(|cycle| {
            let mut state = State { cycle, woke_ns: cycle * PERIOD_NS, skipped_cycles, ..State::default() };
            state.reading_cycle = if cycle > 10 { cycle } else { 0 };
            if cycle == 500 {
                change(&mut state);
            }
            skipped_cycles = state.skipped_cycles;
            state
        });
        states
            .filter(|state| disturbance.may_act_in(state, state.reading_cycle >= state.cycle.min(499), false))
            .count()
    }

    #[test]
    fn a_lost_cycle_disturbs_a_tenth_of_a_second() {
        assert_eq!(disturbed(|_| ()), 0, "the boot of the drives is none");
        assert_eq!(disturbed(|state| state.skipped_cycles += 1), 100);
        assert_eq!(disturbed(|state| state.reading_cycle = 499), 100, "a late reading");
        assert_eq!(disturbed(|state| state.reading_cycle = 1), 100, "no fresh reading");
    }
}

mod outage {
    use super::*;

    const PERIOD_NS: u64 = 1_000_000;

    /// When deadlines were missed, ms, and how many.
    type Missed<'a> = &'a [(u64, u64)];

    /// A run that stops safely at one second, and whose plant misses deadlines.
    fn outage(missed: Missed) -> Option<Outage> {
        let mut watch = OutageWatch::default();
        let mut skipped_cycles = 0;
        for &(at_ms, missed) in missed {
            skipped_cycles += missed;
            watch.apply_reading(
                &Reading { woke_ns: at_ms * PERIOD_NS, skipped_cycles, ..Reading::default() },
                false,
            );
        }
        let controller_state = ControllerState::SafeStop.code();
        watch.apply_state(&State { woke_ns: 1000 * PERIOD_NS, controller_state, ..State::default() }, false);
        watch.outage(PERIOD_NS)
    }

    #[test]
    fn only_what_is_missed_just_before_the_stop_explains_it() {
        let cases: [(Missed, u64, bool); 9] = [
            (&[], 0, false),
            (&[(980, 30)], 30, true),
            (&[(920, 4), (960, 6)], 10, true),
            (&[(920, 4), (960, 5)], 9, false),
            (&[(500, 80)], 0, false),
            (&[(950, 80)], 50, true),
            (&[(950, u64::MAX)], 50, true),
            // Counted in the message after the stop, however late it comes.
            (&[(1005, 25)], 20, true),
            (&[(1150, 170), (1500, 200)], 20, true),
        ];
        for (missed, expected, explains) in cases {
            let outage = outage(missed).unwrap();
            assert_eq!(outage, Outage { missed: expected, of: 100 }, "{missed:?}");
            assert_eq!(outage.explains_the_stop(), explains, "{missed:?}");
            assert_eq!(outage.explains_a_deviation(), expected > 0, "{missed:?}");
        }
    }

    #[test]
    fn the_first_stop_counts_whichever_message_comes_first() {
        let mut watch = OutageWatch::default();
        watch.apply_reading(
            &Reading { woke_ns: 980 * PERIOD_NS, skipped_cycles: 30, ..Reading::default() },
            false,
        );
        for at_ms in [1200, 1000, 1100] {
            watch.stop(at_ms * PERIOD_NS);
        }
        assert_eq!(watch.outage(PERIOD_NS), Some(Outage { missed: 30, of: 100 }));
    }

    #[test]
    fn a_run_that_did_not_stop_has_no_outage() {
        let mut watch = OutageWatch::default();
        watch.apply_reading(&Reading { skipped_cycles: 50, ..Reading::default() }, false);
        assert_eq!(watch.outage(PERIOD_NS), None);
    }
}

mod scenario_stalls {
    use super::*;

    #[test]
    fn a_stall_takes_the_cycles_of_its_own_loop_until_the_skips_behind_it() {
        let mut stalls = ScenarioStalls::default();
        let fault = |ended_ns| ProcessFault { number: 1, struck_ns: 5_000_000, ended_ns };
        stalls.add(Kind::PlantStall.into(), &fault(Some(25_000_000)));
        stalls.add(Kind::RecorderStall.into(), &fault(None));
        let mut reading = |woke_ns| stalls.apply_reading(&Reading { woke_ns, ..Reading::default() });
        assert_eq!(
            [4_500_000, 5_000_000, 26_000_000, 27_000_000, 35_000_000, 36_000_000].map(&mut reading),
            [false, false, true, true, true, false]
        );
        let mut state = |woke_ns| stalls.apply_state(&State { woke_ns, ..State::default() });
        assert_eq!(
            [4_000_000, 6_000_000, 40_000_000].map(&mut state),
            [(false, false), (false, true), (false, false)]
        );
        stalls.add(Kind::CoreStall.into(), &fault(None));
        assert_eq!(stalls.apply_state(&State { woke_ns: u64::MAX - 1, ..State::default() }), (true, true));
    }
}
