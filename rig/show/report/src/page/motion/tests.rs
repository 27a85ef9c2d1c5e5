use super::*;

mod animation {
    use super::*;

    #[test]
    fn without_truth_there_is_one_outline_less() {
        let still = Pose::identity();
        let sample = TrackingSample { sampled_ns: 7, desired: still, estimated: still, actual: still };
        let numbers = |reference| frame(&sample, 0, reference).len();
        assert_eq!((numbers(PoseSource::Truth), numbers(PoseSource::Estimate)), (1 + 3 * 7, 1 + 2 * 7));
    }
}

mod jaw {
    use super::*;

    #[test]
    fn quantities_without_a_value_have_no_row() {
        let one = Statistic { count: 1, mean: Some(18.0), sd: None };
        let found = JawCycleFigures { count: 1, opening_mm: one, ..JawCycleFigures::default() };
        let cycles = cycles(&found);
        let names: Vec<_> = cycles.statistics.iter().map(|quantity| quantity.name).collect();
        assert_eq!((names, cycles.has_force), (vec!["opening"], false));
    }
}
