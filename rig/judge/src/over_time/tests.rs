use super::*;

mod over_time {
    use masseter_can::TappedFrame;
    use masseter_can::{Bitrate, CanId, Frame};
    use masseter_model::geometry::Deviation;

    use super::*;

    #[test]
    fn a_bus_that_is_half_full_is_said_to_be_where_anything_was_recorded() {
        let frame = Frame::fixed(CanId::standard(0x123).unwrap(), [0x55; 8]);
        let bits = wire::frame_bits(&frame);
        let mut collector = OverTimeCollector::new([0.0; 3], Some(Bitrate::new(2 * 1000 * bits).unwrap()));
        for millisecond in (0..400).chain(600..1000) {
            let time_ns = millisecond * 1_000_000;
            collector.wake_up(PLANT, time_ns, time_ns + 1);
            collector.apply_frame(
                time_ns,
                0,
                &Tapped::Frame(TappedFrame { frame, time_ns, queued_ns: None }),
            );
        }
        let over_time = collector.into_figures(0);
        let [load] = &over_time.bus_load[..] else { panic!("{:?}", over_time.bus_load) };
        assert!(load.iter().all(|(_, share)| (share - 0.5).abs() < 1e-3), "{load:?}");
        let is_lost = |(at_s, _): &&(f64, f64)| (0.4..0.6).contains(at_s);
        assert_eq!((load.len(), load.iter().filter(is_lost).count()), (80, 0));
    }

    /// The platform moves by 1 mm a cycle, and from cycle 20 on without a desired pose.
    #[test]
    fn the_incisal_point_is_followed_in_the_whole_run_and_its_path_to_its_end() {
        let mut collector = OverTimeCollector::new([0.03, 0.0, -0.01], None);
        for cycle in 0..40_u64 {
            let sampled_ns = 5_000_000 + cycle * 1_000_000;
            let x = cycle as f64 * 1e-3;
            let pose = Pose::translation(x, 0.0, 0.0);
            collector.incisal(Place::Actual, sampled_ns, Some(&pose));
            if cycle < 20 {
                let desired = Some(Pose::translation(x + 1e-3, 0.0, 0.0));
                let deviation = Deviation { origin_m: 9.0, incisal_m: 1e-3, angle_rad: 9.0 };
                collector.apply_path(&PathSample { sampled_ns, desired, actual: None, deviation });
            }
        }
        let over_time = collector.into_figures(0);
        assert!((over_time.duration_s - 0.039).abs() < 1e-12);
        let ends = |curve: &Curve| [curve[0], curve[curve.len() - 1]];
        assert_eq!(ends(&over_time.actual_incisal_m[0]), [(0.0, 0.03), (0.039, 0.069)]);
        assert_eq!(ends(&over_time.desired_incisal_m[0]), [(0.0, 0.031), (0.019, 0.05)]);
        assert_eq!(ends(&over_time.actual_incisal_m[2]), [(0.0, -0.01), (0.039, -0.01)]);
        assert!(over_time.distance_m.iter().all(|(_, distance_m)| (distance_m - 1e-3).abs() < 1e-12));
    }
}

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
        let mut watch = ContactWatch::default();
        for (tenth, forces_n) in [(1, [5.0, 0.0]), (2, [30.0, 20.0]), (3, [40.0, 1.0])] {
            let at_ns = tenth * 100_000;
            watch.add_contact(&contact(at_ns, forces_n), Some(at_ns));
        }
        let figures = watch.into_figures().unwrap();
        assert_eq!((figures.total_max_n, figures.total_max_at_ns), (50.0, 200_000));
        let found: Vec<_> =
            figures.teeth.iter().map(|tooth| (tooth.number, tooth.max_n, tooth.at_total_max_n[2])).collect();
        assert_eq!(found, [(36, 40.0, -30.0), (46, 20.0, -20.0)]);
        assert_eq!(figures.teeth[0].course_n, [(0.0003, 40.0)]);
        // The three messages share a frame of a screen.
        let moments: Vec<_> =
            figures.moments.iter().map(|moment| (moment.at_s, moment.forces_n.len())).collect();
        assert_eq!(moments, [(0.0002, 2)]);
        assert_eq!(ContactWatch::default().into_figures(), None);
    }
}

mod axes {
    use super::*;

    /// A drive that lags by 1 µm, and by 1 mm just after a lost reading.
    #[test]
    fn targets_are_compared_with_the_positions_two_cycles_later_unless_a_cycle_was_lost() {
        let mut watch = AxisWatch::new(&Scenario::default());
        let controller_state = ControllerState::Running.code();
        for cycle in 1..=60_u64 {
            let target_m = [cycle as f64 * 1e-3; AXES];
            watch.apply_command(&Command { cycle, target_m, controller_state, ..Command::default() });
            let late_m = if (31..40).contains(&cycle) { 1e-3 } else { 1e-6 };
            let position_m = [cycle.saturating_sub(2) as f64 * 1e-3 - late_m; AXES];
            if cycle != 30 {
                watch.apply_reading(&Reading {
                    cycle,
                    position_m,
                    force_n: [-7.0; AXES],
                    ..Reading::default()
                });
            }
        }
        let [figures, ..] = watch.figures;
        assert!((figures.following_error_m - 1e-6).abs() < 1e-12, "{figures:?}");
        assert!((figures.force_n - 7.0).abs() < 1e-12);
    }
}
