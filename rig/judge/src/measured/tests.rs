use super::*;

mod measured {
    use super::*;

    fn measured() -> Measured {
        Measured::new("control")
    }

    #[test]
    fn the_largest_value_is_exact() {
        let mut measured = measured();
        measured.add(410_123, 0);
        let figures = measured.into_figures();
        assert_eq!([figures.p50_ns, figures.p99_ns, figures.max_ns], [Some(410_123); 3]);
        assert_eq!(figures.curve.last().unwrap().1, 410_123);
    }

    #[test]
    fn without_samples_there_are_no_figures() {
        let measured = measured();
        let figures = measured.into_figures();
        assert_eq!(figures.n, 0);
        assert_eq!([figures.p50_ns, figures.p99_ns, figures.max_ns, figures.max_at_ns], [None; 4]);
    }

    #[test]
    fn the_last_seconds_stub_says_nothing_of_the_noise() {
        let mut measured = measured();
        (0..30).for_each(|tenth| measured.add(1_000, tenth * SECOND_NS / 10));
        measured.add(9_000, 3 * SECOND_NS);
        let figures = measured.into_figures();
        assert_eq!((figures.n, figures.p50_noise_ns), (31, Some(0.0)));
        let seconds: Vec<_> =
            figures.seconds.iter().map(|(began_ns, second)| (began_ns, second.len())).collect();
        assert_eq!(seconds, [(0, 10), (SECOND_NS, 10), (2 * SECOND_NS, 10), (3 * SECOND_NS, 1)]);
    }

    #[test]
    fn any_number_of_steps_is_recorded_in_bounded_time() {
        let mut measured = measured();
        measured.add_steps(7, 1_000_000, 20_000, 0);
        assert_eq!(measured.into_figures().n, 20_001);
        let mut measured = self::measured();
        measured.add_steps(7, 1_000_000, u64::MAX, u64::MAX);
        assert!(measured.into_figures().max_ns > Some(u64::MAX - 1_100_000));
    }
}

mod noise {
    use super::*;

    #[test]
    fn equal_seconds_have_no_noise_and_few_tell_nothing() {
        assert_eq!(standard_error(&[4.0; 5]), Some(0.0));
        assert_eq!(standard_error(&[1.0, 2.0]), None);
        // Variance 1, three seconds.
        assert!((standard_error(&[1.0, 2.0, 3.0]).unwrap() - (1.0f64 / 3.0).sqrt()).abs() < 1e-12);
    }
}
