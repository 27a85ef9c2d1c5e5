use super::*;

mod answer {
    use super::*;

    #[test]
    fn a_command_is_answered_once_and_was_sent_only_after_it_was_received() {
        let mut answers = Answers::default();
        let mut sent_of = |[answers_cycle, command_received_ns, command_sent_ns]: [u64; 3]| {
            let reading =
                Reading { answers_cycle, command_received_ns, command_sent_ns, ..Default::default() };
            answers.new_answer(&reading).map(|answer| answer.sent_ns)
        };
        // Nothing has gone out yet; then one does, the next does not, and the old targets go out once more.
        assert_eq!(sent_of([0, 0, 0]), None);
        assert_eq!(sent_of([3, 900, 0]), Some(None));
        assert_eq!(sent_of([4, 1900, 2100]), Some(Some(2100)));
        assert_eq!(sent_of([5, 2900, 2100]), Some(None));
        assert_eq!(sent_of([5, 2900, 3100]), None);
    }
}

mod intervals {
    use super::*;

    const PERIOD_NS: u64 = 1_000_000;

    fn intervals() -> Intervals {
        Intervals::new(PERIOD_NS)
    }

    /// Samples and largest value of each interval.
    fn found(intervals: Intervals) -> Vec<(&'static str, u64, Option<u64>)> {
        let figures = intervals.into_figures();
        figures.iter().map(|interval| (interval.name, interval.n, interval.max_ns)).collect()
    }

    /// Samples and largest value of one interval.
    fn only(name: &str, intervals: Intervals) -> (u64, Option<u64>) {
        let (_, n, max_ns) = found(intervals).into_iter().find(|(other, ..)| *other == name).unwrap();
        (n, max_ns)
    }

    /// Reading 4 came too late for cycle 4: cycle 5 used it.
    fn reading() -> Reading {
        let (sampled_ns, complete_ns, published_ns) = (130, 530, 600);
        Reading { cycle: 4, woke_ns: 30, sampled_ns, complete_ns, published_ns, ..Reading::default() }
    }

    fn state() -> State {
        let (received_ns, solved_ns, commanded_ns) = (1010, 1020, 1050);
        State { cycle: 5, reading_cycle: 4, received_ns, solved_ns, commanded_ns, ..State::default() }
    }

    fn command() -> Command {
        Command { cycle: 5, reading_cycle: 4, published_ns: 1060, ..Command::default() }
    }

    fn answer() -> Reading {
        let (command_received_ns, command_sent_ns) = (1100, 1400);
        Reading { cycle: 6, answers_cycle: 5, command_received_ns, command_sent_ns, ..Reading::default() }
    }

    #[test]
    fn a_late_reading_is_followed_to_the_wire_in_whatever_order_the_topics_are_recorded() {
        let expected = [
            ("process data", 1, Some(400)),
            ("reading transport", 1, Some(410)),
            ("forward kinematics", 1, Some(10)),
            ("control", 1, Some(30)),
            ("controller cycle", 1, Some(50)),
            ("command transport", 1, Some(40)),
            ("command to wire", 1, Some(300)),
            ("sample to wire", 1, Some(1270)),
            // SYNC to the reading's publication 570, its reception to the command's 90.
            ("round trip", 1, Some(660)),
        ];
        let take = |intervals: &mut Intervals, message: char| match message {
            'r' => intervals.apply_reading(&reading(), 0),
            's' => intervals.apply_state(&state(), true, 0),
            'c' => intervals.apply_command(&command()),
            _ => intervals.apply_reading(&answer(), 0),
        };
        for order in ["rsca", "rsac", "rcsa", "rcas", "rasc", "racs", "srca", "crsa", "scra", "csra"] {
            let mut intervals = intervals();
            order.chars().for_each(|message| take(&mut intervals, message));
            let found = found(intervals);
            for expected in expected {
                assert!(found.contains(&expected), "{order}: {expected:?} in {found:?}");
            }
        }
    }

    #[test]
    fn the_longest_round_trip_was_when_the_plant_had_the_command() {
        let mut intervals = intervals();
        intervals.apply_reading(&reading(), 0);
        intervals.apply_state(&state(), true, 0);
        intervals.apply_reading(&answer(), 0);
        let figures = intervals.into_figures();
        let trip = figures.iter().find(|interval| interval.name == "round trip").unwrap();
        assert_eq!((trip.max_ns, trip.max_at_ns), (Some(660), Some(1100)));
    }

    #[test]
    fn a_reading_used_again_gives_no_samples() {
        let mut intervals = intervals();
        intervals.apply_reading(&reading(), 0);
        intervals.apply_state(&state(), true, 0);
        intervals.apply_state(&State { cycle: 6, ..state() }, false, 0);
        assert_eq!(only("forward kinematics", intervals), (1, Some(10)));
    }

    #[test]
    fn a_command_that_never_reached_the_wire_has_no_way_there() {
        let mut intervals = intervals();
        intervals.apply_reading(&reading(), 0);
        intervals.apply_command(&command());
        intervals.apply_reading(&Reading { command_sent_ns: 400, ..answer() }, 0);
        let found = found(intervals);
        for expected in
            [("command transport", 1, Some(40)), ("command to wire", 0, None), ("sample to wire", 0, None)]
        {
            assert!(found.contains(&expected), "{expected:?} in {found:?}");
        }
    }

    #[test]
    fn a_skipped_deadline_counts_in_the_corrected_wake_up_only() {
        let states = || {
            let mut intervals = intervals();
            intervals.apply_state(&State::default(), false, 0);
            // Woken 200 µs after deadline 5; 2 to 4 were skipped.
            let late = State { due_ns: 5 * PERIOD_NS, woke_ns: 5_200_000, ..State::default() };
            intervals.apply_state(&late, false, 3);
            intervals
        };
        assert_eq!(only("controller wake-up", states()), (2, Some(200_000)));
        assert_eq!(only("controller wake-up corrected", states()), (5, Some(3_200_000)));
    }
}
