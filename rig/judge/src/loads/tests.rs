use super::*;

mod contact {
    use super::*;

    fn contact(sampled_ns: u64, forces_n: [f64; 2]) -> Contact {
        let mut contact = Contact { sampled_ns, ..Contact::default() };
        contact.tooth[..2].copy_from_slice(&[36, 46]);
        (contact.force_n[2], contact.force_n[5]) = (-forces_n[0], -forces_n[1]);
        contact
    }

    #[test]
    fn the_greatest_of_each_tooth_and_the_greatest_sum_are_kept_with_their_moment() {
        let mut figures = ContactFigures::default();
        for (tenth, forces_n) in [(1, [5.0, 0.0]), (2, [30.0, 20.0]), (3, [40.0, 1.0])] {
            let at_ns = tenth * 100_000;
            figures.add_contact(&contact(at_ns, forces_n), Some(at_ns));
        }
        assert_eq!((figures.total_max_n, figures.total_max_at_ns), (50.0, 200_000));
        let found: Vec<_> =
            figures.teeth.iter().map(|tooth| (tooth.number, tooth.max_n, tooth.at_total_max_n[2])).collect();
        assert_eq!(found, [(36, 40.0, -30.0), (46, 20.0, -20.0)]);
        assert_eq!(figures.teeth[0].force_n.highest(), [(0.0003, 40.0)]);
        // The three messages share a frame of a screen.
        let moments: Vec<_> =
            figures.moments.iter().map(|moment| (moment.at_s, moment.forces_n.len())).collect();
        assert_eq!(moments, [(0.0002, 2)]);
    }
}

mod axes {
    use masseter_runtime::messages::codes::ControllerState;
    use masseter_runtime::messages::{Command, Reading};

    use super::*;

    /// A drive that lags by 1 µm, and by 1 mm just after a lost reading.
    #[test]
    fn targets_are_compared_with_the_positions_two_cycles_later_unless_a_cycle_was_lost() {
        let mut watch = AxisWatch::new(&Scenario::default());
        let controller_state = ControllerState::Running.code();
        for cycle in 1..=60_u64 {
            let target_m = [cycle as f64 * 1e-3; AXES];
            let late_m = if (31..40).contains(&cycle) { 1e-3 } else { 1e-6 };
            let position_m = [cycle.saturating_sub(2) as f64 * 1e-3 - late_m; AXES];
            let reading = Reading { position_m, force_n: [-7.0; AXES], ..Reading::default() };
            watch.add_cycle(&CycleMessages {
                cycle,
                command: Some(Command { target_m, controller_state, ..Command::default() }),
                reading: (cycle != 30).then_some(reading),
                ..CycleMessages::default()
            });
        }
        let [figures, ..] = watch.figures;
        assert!((figures.following_error_m - 1e-6).abs() < 1e-12, "{figures:?}");
        assert!((figures.force_n - 7.0).abs() < 1e-12);
    }
}
