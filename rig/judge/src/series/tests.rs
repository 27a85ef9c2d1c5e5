use super::*;

mod by_cycle {
    use super::*;

    #[test]
    fn values_are_found_by_their_own_cycle_only() {
        let mut values = ByCycle::default();
        values.insert(5, 'a');
        assert_eq!(values.get(5), Some(&'a'));
        assert_eq!(values.get(6), None);
        assert_eq!(values.remove(5), Some('a'));
        assert_eq!(values.get(5), None);
    }

    #[test]
    fn as_many_cycles_as_a_queue_holds_are_kept_and_no_more() {
        let mut values = ByCycle::default();
        for cycle in 0..=MOST_CYCLES as u64 {
            values.insert(cycle, cycle);
        }
        assert_eq!(values.get(0), None);
        assert!((1..=MOST_CYCLES as u64).all(|cycle| values.remove(cycle) == Some(cycle)));
    }

    #[test]
    fn values_that_stay_and_older_ones_that_come_late_are_kept() {
        let mut values = ByCycle::default();
        values.insert(10_064, 'b');
        values.insert(10_000, 'a');
        values.insert(10_000, 'c');
        for cycle in 10_065..10_500 {
            values.insert(cycle, '-');
        }
        assert_eq!((values.remove(10_064), values.remove(10_000)), (Some('b'), Some('c')));
    }
}

mod series {
    use super::*;

    #[test]
    fn a_long_run_keeps_its_extremes_at_their_times() {
        let mut series = Band::default();
        for millisecond in 0..100_000u64 {
            let value = if millisecond == 54_321 { 99.0 } else { (millisecond % 7) as f64 };
            series.add(millisecond * 1_000_000, value);
        }
        let band = series.curve();
        assert!(band.len() <= 2 * MOST_STRETCHES && band.is_sorted_by(|a, b| a.0 < b.0));
        assert_eq!(band.iter().filter(|(_, value)| *value > 98.0).collect::<Vec<_>>(), [&(54.321, 99.0)]);
        assert!(series.highest().iter().all(|(_, value)| *value >= 6.0));
        assert_eq!(series.0.values.len(), band.iter().filter(|(_, value)| *value < 0.5).count());
    }

    /// Chewing, with flanks that fall through many stretches of time.
    #[test]
    fn every_point_of_a_curve_is_a_point_of_its_signal() {
        let signal = |at_s: f64| 20.0 * (std::f64::consts::TAU * at_s / 0.7).cos();
        let mut series = Band::default();
        for millisecond in 0..60_000u64 {
            series.add(millisecond * 1_000_000, signal(millisecond as f64 / 1e3));
        }
        let band = series.curve();
        assert!(series.0.width_ns > 4 * FIRST_WIDTH_NS, "each stretch holds many values");
        for (at_s, value) in &band {
            assert!((value - signal(*at_s)).abs() < 1e-9, "{value} at {at_s} s");
        }
        // No line between two points leaves the signal further than one across a turn of it does.
        for ends in band.windows(2) {
            let [(from_s, from), (to_s, to)] = [ends[0], ends[1]];
            let off = (from.midpoint(to) - signal(from_s.midpoint(to_s))).abs();
            assert!(off < 2.5, "{off} between {from_s} s and {to_s} s");
        }
        let turns = band.iter().filter(|(_, value)| value.abs() > 19.99).count();
        assert!(turns >= 2 * 85, "{turns} turns");
    }

    #[test]
    fn a_curve_of_one_value_is_a_straight_line_and_no_number_is_left_out() {
        let mut series = Band::default();
        for (microsecond, value) in [(0, 1.0), (1, f64::NAN), (2, f64::INFINITY), (3, 1.0), (1000, 1.0)] {
            series.add(microsecond * 1000, value);
        }
        assert_eq!(series.curve(), [(0.0, 1.0), (0.001, 1.0)]);
    }

    #[test]
    fn nothing_is_lost_from_a_sum() {
        let mut series = Stretches::<u64>::default();
        (0..50_000u64).for_each(|millisecond| *series.at(millisecond * 1_000_000) += 3);
        assert_eq!(series.iter().map(|(_, sum)| sum).sum::<u64>(), 150_000);
    }
}

mod smoothing {
    use super::*;

    #[test]
    fn a_ramp_stays_a_ramp_and_a_ripple_goes() {
        let mut smoothing = Smoothing::default();
        let mut means = 0;
        for millisecond in 0..100_u64 {
            let ripple = if millisecond % 2 == 0 { 1.0 } else { -1.0 };
            if let Some((at_ns, [ramp, rippled])) =
                smoothing.add(millisecond * 1_000_000, [millisecond as f64, ripple])
            {
                assert!((ramp - at_ns as f64 / 1e6).abs() < 1e-9 && rippled.abs() < 1e-9, "{ramp} {rippled}");
                means += 1;
            }
        }
        assert_eq!(means, 80);
    }
}
