use super::*;

mod hops {
    use super::*;

    /// Process data and forward kinematics take as long as given, the other hops no time.
    fn path(data_ns: u64, solving_ns: u64) -> CyclePath {
        let reading = Reading { complete_ns: data_ns, published_ns: data_ns, ..Default::default() };
        let solved_ns = data_ns + solving_ns;
        let state = State { received_ns: data_ns, solved_ns, commanded_ns: solved_ns, ..Default::default() };
        let (published_ns, received_ns, sent_ns) = (solved_ns, solved_ns, solved_ns);
        CyclePath { reading, state, published_ns, received_ns, sent_ns, stalled_ns: 0 }
    }

    #[test]
    fn not_the_longest_hop_is_to_blame_but_the_one_furthest_above_its_median() {
        let mut typical = TypicalHops::default();
        (0..9).for_each(|_| typical.add(&path(400, 10)));
        let expected = HopTime { name: "forward kinematics", took_ns: 100, p50_ns: 10 };
        assert_eq!(typical.furthest_above_median(&path(450, 100)), expected);
    }
}

mod kernel_counts {
    use super::*;

    #[test]
    fn what_was_counted_is_that_between_the_samples_before_and_behind() {
        let samples = [(0, 0, 1), (50, 3_000, 3), (100, 3_000, 3)].map(|(time_ns, stolen_ns, switches)| {
            let involuntary_switches = [switches, 0];
            Machine { time_ns, stolen_ns, involuntary_switches, ..Default::default() }
        });
        let told = |stolen_ns, switches| KernelCounts {
            looked_over_ns: Some(50),
            stolen_ns: Some(stolen_ns),
            involuntary_switches: Some(switches),
            page_faults: Some(0),
        };
        assert_eq!(KernelCounts::around(&samples, 40, 41), told(3_000, 2));
        assert_eq!(KernelCounts::around(&samples, 70, 71), told(0, 0));
        assert_eq!(KernelCounts::around(&samples, 100, 101), KernelCounts::default());
    }
}

mod longest_cycles {
    use super::*;
    use crate::longest_cycles::hop_names;

    type HopTimes = [u64; 10];

    const PERIOD_NS: u64 = 1_000_000;
    const SYNC_NS: u64 = 48_000;
    const CONTROLLER_AT_NS: u64 = 540_000;
    /// The reading is there 90 µs before the controller wakes.
    const TYPICAL_NS: HopTimes = [0, 360_000, 42_000, 0, 1_000, 2_000, 500, 500, 2_000, 280_000];

    /// Cycles as the time table has them.
    #[derive(Default)]
    struct Rig {
        longest: LongestCycles,
        /// Command's cycle, reception and end.
        answer: [u64; 3],
        plant_stalled_ns: u64,
        controller_stalled_ns: u64,
    }

    impl Rig {
        /// The messages of a cycle with these hop times.
        fn cycle(&mut self, cycle: u64, hops_ns: HopTimes) {
            let [wake_up, data, publication, late, pick_up, solving, control, publishing, transport, to_wire] =
                hops_ns;
            let due_ns = cycle * PERIOD_NS;
            let sampled_ns = due_ns + wake_up + SYNC_NS;
            let complete_ns = sampled_ns + data;
            let reading = Reading {
                cycle,
                due_ns,
                woke_ns: due_ns + wake_up,
                sampled_ns,
                complete_ns,
                published_ns: complete_ns + publication,
                stalled_ns: self.plant_stalled_ns,
                ..Default::default()
            };
            // Readings are drained first: the answer may be there before the state that explains it.
            let [answers_cycle, command_received_ns, command_sent_ns] = self.answer;
            self.longest.apply_reading(&Reading {
                answers_cycle,
                command_received_ns,
                command_sent_ns,
                ..reading
            });

            let woke_ns = due_ns + CONTROLLER_AT_NS + late;
            let received_ns = reading.published_ns.max(woke_ns) + pick_up;
            let commanded_ns = received_ns + solving + control;
            let published_ns = commanded_ns + publishing;
            self.longest.apply_command(&Command { cycle, published_ns, ..Default::default() });
            let state = State {
                cycle,
                reading_cycle: cycle,
                due_ns: due_ns + CONTROLLER_AT_NS,
                woke_ns,
                received_ns,
                solved_ns: received_ns + solving,
                commanded_ns,
                stalled_ns: self.controller_stalled_ns,
                ..Default::default()
            };
            self.longest.apply_state(&state, true);
            let plant_has_it_ns = published_ns + transport;
            self.answer = [cycle, plant_has_it_ns, plant_has_it_ns + to_wire];
        }
    }

    #[test]
    fn of_the_worst_cycles_the_hop_that_took_unusually_long_is_to_blame_and_no_other() {
        let mut rig = Rig::default();
        for cycle in 1..100 {
            let mut hops_ns = TYPICAL_NS;
            // Every ninth cycle, one hop after the other; the later ones a little longer.
            if cycle % 9 == 0 && cycle / 9 <= TYPICAL_NS.len() as u64 {
                hops_ns[cycle as usize / 9 - 1] += 200_000 + cycle * 1000;
            }
            rig.cycle(cycle, hops_ns);
        }
        let worst = rig.longest.into_figures();
        assert_eq!(worst.len(), WORST);
        assert!(worst.windows(2).all(|pair| pair[0].total_ns >= pair[1].total_ns));
        for told in worst {
            let hop = told.cycle as usize / 9 - 1;
            let expected = (hop_names().nth(hop).unwrap(), TYPICAL_NS[hop] + 200_000 + told.cycle * 1000);
            assert_eq!((told.hop, told.hop_ns), expected, "cycle {}", told.cycle);
            assert!(told.hop_p50_ns.abs_diff(TYPICAL_NS[hop]) <= TYPICAL_NS[hop] / 500, "{told:?}");
        }
    }

    #[test]
    fn time_lost_before_the_next_wake_up_is_attributed_to_the_long_cycle() {
        let mut rig = Rig::default();
        for cycle in 1..20 {
            let mut hops_ns = TYPICAL_NS;
            match cycle {
                5 => hops_ns[8] += 300_000,
                // Counters are read in the next wake-up.
                6 => rig.plant_stalled_ns += 300_000,
                10 => hops_ns[4] += 200_000,
                11 => rig.controller_stalled_ns += 200_000,
                // A late wake-up is known at once.
                15 => {
                    hops_ns[0] += 250_000;
                    rig.plant_stalled_ns += 250_000;
                }
                _ => {}
            }
            rig.cycle(cycle, hops_ns);
        }
        let told: Vec<_> =
            rig.longest.into_figures().iter().map(|worst| (worst.cycle, worst.stalled_ns)).take(4).collect();
        assert_eq!(told, [(5, 300_000), (10, 200_000), (15, 250_000), (1, 0)]);
    }

    #[test]
    fn a_command_that_was_overtaken_ends_with_the_first_later_one_on_the_wire() {
        let mut rig = Rig::default();
        (1..7).for_each(|cycle| rig.cycle(cycle, TYPICAL_NS));
        // The plant stands still behind reading 7, and takes the newest of three commands then.
        rig.cycle(7, TYPICAL_NS);
        for cycle in [8, 9] {
            rig.longest.apply_command(&Command {
                cycle,
                published_ns: cycle * PERIOD_NS,
                ..Default::default()
            });
            rig.longest.apply_state(&State { cycle, reading_cycle: 7, ..Default::default() }, false);
        }
        let [command_received_ns, command_sent_ns] = [10_300_000, 10_500_000];
        let reading = Reading { cycle: 10, command_received_ns, command_sent_ns, ..Default::default() };
        rig.longest.apply_reading(&Reading { answers_cycle: 9, ..reading });
        let worst = rig.longest.into_figures();
        assert_eq!((worst[0].cycle, worst[0].total_ns, worst[0].hop), (7, 3_500_000, "command transport"));
        assert_eq!(worst.len(), 7);
    }

    #[test]
    fn a_cycle_that_used_a_late_reading_is_among_the_longest() {
        let mut longest = LongestCycles::default();
        let late = Reading { cycle: 7, due_ns: 7_000_000, complete_ns: 7_900_000, ..Default::default() };
        longest.apply_reading(&late);
        longest.apply_state(&State { cycle: 8, reading_cycle: 7, ..Default::default() }, true);
        longest.apply_command(&Command { cycle: 8, ..Default::default() });
        let (answers_cycle, command_sent_ns) = (8, 8_900_000);
        longest.apply_reading(&Reading { cycle: 9, answers_cycle, command_sent_ns, ..Default::default() });
        longest.apply_state(&State { cycle: 9, reading_cycle: 7, ..Default::default() }, false);
        let worst = longest.into_figures();
        assert_eq!((worst[0].cycle, worst[0].due_ns, worst[0].total_ns), (8, 7_000_000, 1_900_000));
    }

    #[test]
    fn a_stall_counts_before_a_deadline_but_for_what_made_the_wake_up_late() {
        let mut stalls = Stalls::default();
        // What was counted in a wake-up, how late that was, and what was counted at its deadline.
        for (counted_ns, late_ns, when_due_ns) in
            [(0, 20, 0), (300, 0, 300), (1000, 700, 300), (1000, 20, 1000), (1500, 400, 1100)]
        {
            assert_eq!(stalls.when_due_ns(counted_ns, late_ns), when_due_ns, "{counted_ns} ns");
        }
    }
}
