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
    use masseter_judge::{COURSE_POINTS, JawCycleKind};

    use super::*;

    #[test]
    fn a_course_has_the_number_of_its_cycle() {
        let point = CoursePoint { opening_mm: 18.000_04, lateral_mm: 2.0, force_n: 0.0 };
        let group = JawCycleGroup {
            name: "chew left".to_owned(),
            kind: JawCycleKind::Chew,
            side: None,
            count: 1,
            quantities: Vec::new(),
            courses: vec![(7, [point; COURSE_POINTS])],
            mean_course: vec![[point; 2]],
        };
        let found = JawCycleFigures { count: 1, groups: vec![group], ..JawCycleFigures::default() };
        let cycles = cycles(&found);
        let [group] = &cycles.drawn[..] else { panic!("one group") };
        assert_eq!((group.courses[0].0, &group.courses[0].1[..3]), (7, &[18.0, 2.0, 0.0][..]));
        assert_eq!((group.mean[0], cycles.has_force), ([18.0, 2.0, 0.0, 18.0, 2.0, 0.0], false));
    }
}
