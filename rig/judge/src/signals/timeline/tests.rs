use super::*;

mod timeline {
    use masseter_runtime::messages::{Event, Reading, State};

    use super::*;

    fn reading(cycle: u64) -> Recorded {
        Recorded::Reading(Reading { cycle, sampled_ns: cycle * 1000, ..Reading::default() })
    }

    #[test]
    fn messages_of_a_cycle_come_together_in_the_order_of_time_with_the_events_before_them() {
        let mut timeline = Timeline::default();
        for cycle in [1, 2, 4] {
            assert!(timeline.take(&reading(cycle)).is_none());
        }
        for cycle in 1..=4 {
            timeline.take(&Recorded::State(State { cycle, due_ns: cycle * 1000 + 500, ..State::default() }));
        }
        for time_ns in [2000, 1500, 9000] {
            timeline.event(&EventRecord::from(&Event { time_ns, ..Event::default() }));
        }
        let samples: Vec<_> = std::iter::from_fn(|| timeline.finish()).collect();
        let times: Vec<_> = samples.iter().map(|sample| sample.time_ns).collect();
        assert_eq!(times, [1000, 2000, 3500, 4000, 9000], "cycle 3 has no reading; the last one closes");
        let (closing, cycles) = samples.split_last().unwrap();
        assert!(closing.is_closing);
        assert!(cycles.iter().all(|sample| sample.messages.state.unwrap().cycle == sample.messages.cycle));
        let events: Vec<Vec<_>> =
            samples.iter().map(|sample| sample.events.iter().map(|event| event.time_ns).collect()).collect();
        assert_eq!(events, [vec![], vec![1500, 2000], vec![], vec![], vec![9000]]);
    }

    #[test]
    fn a_state_belongs_to_the_sample_that_it_was_computed_from() {
        let mut timeline = Timeline::default();
        (1..=4).for_each(|cycle| drop(timeline.take(&reading(cycle))));
        // Reading 2 comes too late for cycle 2: cycle 3 uses it, and cycle 4 has its own again.
        for (cycle, reading_cycle) in [(1, 1), (2, 1), (3, 2), (4, 4)] {
            timeline.take(&Recorded::State(State { cycle, reading_cycle, ..State::default() }));
        }
        let found: Vec<_> = std::iter::from_fn(|| timeline.finish())
            .map(|Sample { messages, .. }| {
                [messages.state, messages.solution].map(|of| of.map(|state| state.cycle))
            })
            .collect();
        let [first, second, third, fourth] =
            [[Some(1), Some(1)], [Some(2), Some(3)], [Some(3), None], [Some(4), Some(4)]];
        assert_eq!(found, [first, second, third, fourth, [None, None]]);
    }

    #[test]
    fn a_long_run_is_handed_out_while_it_goes_on() {
        let mut timeline = Timeline::default();
        let total = 3 * KEPT as u64;
        let early = (1..=total).filter_map(|cycle| timeline.take(&reading(cycle))).count() as u64;
        assert_eq!(early, total - KEPT as u64);
        assert!(timeline.take(&reading(1)).is_none(), "too old");
        assert_eq!(std::iter::from_fn(|| timeline.finish()).count(), KEPT + 1);
    }
}

mod cpu_share {
    use super::*;

    #[test]
    fn a_share_is_of_the_time_since_the_message_before() {
        let mut share = CpuShare::default();
        let accounts =
            [None, Some([1000, 500]), Some([2000, 750]), None, Some([4000, 1250]), Some([4000, 1300])];
        assert_eq!(
            accounts.map(|account| share.of_next(account)),
            [None, None, Some(0.25), None, Some(0.25), None]
        );
        assert_eq!(CpuShare::default().of_next(Some([1000, 0])), None, "simulated time");
    }
}
