//! Motions whose cycles are known.

use std::f64::consts::{PI, TAU};

use super::*;

/// Figures of a motion of the incisal point, mm anterior, left and up from the closed jaw, with a force, N, for so many seconds
/// at 1 kHz.
fn found(seconds: f64, motion: impl Fn(f64) -> ([f64; 3], f64)) -> JawCycleFigures {
    found_of(StudyConfig::default(), seconds, |_| MotionSpeed::Full, motion)
}

fn found_of(
    study: StudyConfig,
    seconds: f64,
    speed: impl Fn(f64) -> MotionSpeed,
    motion: impl Fn(f64) -> ([f64; 3], f64),
) -> JawCycleFigures {
    let scenario = Scenario { study: Some(study), ..Scenario::default() };
    let mut cycles = JawCycles { has_force: true, ..JawCycles::new(&scenario) };
    let closed = closed_incisal_m(&scenario).unwrap() - Vec3::from(scenario.jaw.reference_point_m);
    for cycle in 0..(seconds * 1e3) as u64 {
        let t_s = cycle as f64 / 1e3;
        let ([x, y, z], force_n) = motion(t_s);
        let pose = Pose::translation(closed.x + x / 1e3, closed.y + y / 1e3, closed.z + z / 1e3);
        cycles.add_pose(cycle * 1_000_000, &pose, force_n, speed(t_s));
    }
    cycles.into_figures()
}

fn smooth(share: f64) -> f64 {
    (1.0 - (PI * share.clamp(0.0, 1.0)).cos()) / 2.0
}

/// A cycle: 0.3 s down by 18 mm, 0.28 s up, closed for 0.12 s; 4 mm to the left while it closes; a bite of 80 N.
fn chewing(t_s: f64) -> ([f64; 3], f64) {
    let in_cycle_s = t_s.rem_euclid(0.7);
    let down = smooth(in_cycle_s / 0.3) - smooth((in_cycle_s - 0.3) / 0.28);
    let closing = ((in_cycle_s - 0.3) / 0.28).clamp(0.0, 1.0);
    let bite = ((in_cycle_s - 0.58) / 0.12).clamp(0.0, 1.0);
    ([-5.0 * down, 4.0 * (PI * closing).sin(), -18.0 * down], 80.0 * (PI * bite).sin())
}

/// Out, a hold and back, in seconds: the share of the way.
fn excursion(t_s: f64, [out_s, hold_s, back_s]: [f64; 3]) -> f64 {
    smooth(t_s / out_s) - smooth((t_s - out_s - hold_s) / back_s)
}

/// Uniform in ±1, without a pattern that cycles have.
fn noise(t_s: f64) -> f64 {
    let mut bits = ((t_s * 1e3).round() as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits ^= bits >> 29;
    bits = bits.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (bits >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

fn statistic(group: &JawCycleGroup, name: &str) -> Statistic {
    group.quantities.iter().find(|quantity| quantity.of.name == name).unwrap().statistic
}

#[track_caller]
fn assert_mean(group: &JawCycleGroup, name: &str, expected: f64, within: f64) {
    let mean = statistic(group, name).mean.unwrap();
    assert!((mean - expected).abs() < within, "{name}: {mean} for {expected}");
}

fn names(figures: &JawCycleFigures) -> Vec<(&str, u64)> {
    figures.groups.iter().map(|group| (group.name.as_str(), group.count)).collect()
}

#[test]
fn chewing_is_cut_into_its_cycles_with_their_known_figures() {
    let figures = found(7.0, chewing);
    assert_eq!((figures.count, names(&figures)), (10, vec![("chew left", 10)]));
    let chew = &figures.groups[0];
    assert_eq!(statistic(chew, "duration_s").count, 9);
    assert!(statistic(chew, "duration_s").sd.unwrap() < 0.003);
    for (name, expected, within) in [
        ("duration_s", 0.7, 0.002),
        ("opening_mm", 18.0, 0.02),
        ("lateral_mm", 4.0, 0.05),
        ("forward_mm", 0.0, 0.01),
        ("hold_s", 0.0, 1e-9),
        ("closing_mm_s", 9.0 * PI / 0.28, 1.5),
        ("opening_mm_s", 9.0 * PI / 0.3, 1.5),
        ("force_n", 80.0, 0.1),
        // Half a millimetre of the way out and back is not counted.
        ("opening_s", 0.3, 0.04),
        ("closing_s", 0.28, 0.04),
        ("occlusal_s", 0.12, 0.08),
    ] {
        assert_mean(chew, name, expected, within);
    }
    let opening = statistic(chew, "opening_mm");
    assert!(opening.mean_low.unwrap() <= opening.median.unwrap() && opening.cv.unwrap() < 1e-3);
}

#[test]
fn noise_and_drift_of_a_tracker_change_no_cycle() {
    let figures = found(14.0, |t_s| {
        let ([x, y, z], force_n) = chewing(t_s);
        ([x, y + 0.05 * noise(t_s + 40.0), z + 0.1 * noise(t_s) - 0.2 * t_s], force_n)
    });
    assert_eq!(names(&figures), [("chew left", 20)]);
    let chew = &figures.groups[0];
    assert_mean(chew, "duration_s", 0.7, 0.01);
    assert_mean(chew, "lateral_mm", 4.1, 0.1);
    assert_mean(chew, "closing_mm_s", 101.0, 8.0);
}

#[test]
fn unlike_movements_are_never_pooled_and_left_and_right_never_cancel() {
    let mirrored = |t_s: f64| {
        let ([x, y, z], force_n) = chewing(t_s);
        ([x, -y, z], force_n)
    };
    let figures = found(28.0, |t_s| match t_s {
        t_s if t_s < 3.5 => chewing(t_s),
        t_s if t_s < 5.0 => ([0.0; 3], 0.0),
        t_s if t_s < 8.5 => mirrored(t_s - 5.0),
        t_s if t_s < 10.0 => ([0.0; 3], 0.0),
        t_s if t_s < 14.0 => {
            let share = excursion(t_s - 10.0, [1.5, 0.0, 1.5]);
            ([-8.0 * share, 0.5 * share, -42.0 * share], 0.0)
        }
        t_s if t_s < 18.0 => {
            let share = excursion(t_s - 14.0, [1.0, 0.5, 1.0]);
            ([7.0 * share, 0.0, -3.0 * share], 0.0)
        }
        t_s if t_s < 22.0 => {
            let share = excursion(t_s - 18.0, [1.0, 0.5, 1.0]);
            ([-share, -9.0 * share, -4.0 * share], 0.0)
        }
        t_s if t_s < 26.0 => {
            let share = excursion(t_s - 22.0, [1.0, 0.5, 1.0]);
            ([-share, 8.0 * share, -7.0 * share], 0.0)
        }
        _ => ([0.0; 3], 0.0),
    });
    assert_eq!(
        names(&figures),
        [
            ("chew left", 5),
            ("chew right", 5),
            ("opening", 1),
            ("lateral left", 1),
            ("lateral right", 1),
            ("protrusive", 1)
        ]
    );
    let middle = |group: usize| figures.groups[group].mean_course[COURSE_POINTS * 3 / 5][0].lateral_mm;
    assert!(middle(0) > 2.0 && middle(1) < -2.0, "{} and {}", middle(0), middle(1));
    assert_mean(&figures.groups[2], "opening_mm", 42.0, 0.05);
    assert_mean(&figures.groups[5], "forward_mm", 7.0, 0.05);
    // The border is what was reached: 9 mm to the right near closure, and the wide opening.
    let most = |of: fn(&BorderStep) -> f64| figures.border.iter().map(of).fold(0.0, f64::max);
    assert!(
        (most(|step| -step.right_mm) - 9.0).abs() < 0.05 && (most(|step| step.front_mm) - 7.0).abs() < 0.05
    );
    assert!((most(|step| step.opening_mm) - 42.0).abs() < 1.0);
}

#[test]
fn a_hold_is_neither_opening_nor_closing() {
    let figures = found(8.0, |t_s| {
        let share = excursion(t_s - 1.0, [1.0, 3.0, 0.8]);
        ([0.0, 0.0, -30.0 * share - 0.1 * share * (t_s - 3.5)], 0.0)
    });
    let [cycle] = &figures.cycles[..] else { panic!("{:?}", figures.cycles) };
    assert_eq!(cycle.kind, JawCycleKind::Opening);
    assert!((cycle.hold_s - 3.0).abs() < 0.4, "{cycle:?}");
    assert!(cycle.closing_s < 0.8 && cycle.opening_s < 1.0, "{cycle:?}");
}

#[test]
fn what_does_not_return_is_unclear_and_in_no_group() {
    // Each movement ends 6 mm lower than it began.
    let figures = found(6.0, |t_s| {
        let steps = [0.0, 2.0, 4.0]
            .map(|begin_s| 18.0 * smooth((t_s - begin_s) / 0.5) - 12.0 * smooth((t_s - begin_s - 0.5) / 0.5));
        ([0.0, 0.0, -steps.iter().sum::<f64>()], 0.0)
    });
    assert_eq!((figures.count, figures.unclear, figures.groups.len()), (3, 3, 0));
}

#[test]
fn a_jaw_that_stays_open_has_no_occlusal_phase() {
    let figures = found(7.0, |t_s| {
        let ([x, y, z], force_n) = chewing(t_s);
        ([x, y, z - 10.0], force_n)
    });
    assert_eq!(names(&figures), [("chew left", 10)]);
    assert!((figures.most_closed_mm.unwrap() - 10.0).abs() < 0.01, "{:?}", figures.most_closed_mm);
    assert!(figures.cycles.iter().all(|cycle| cycle.occlusal_s.is_none()));
    assert!(figures.groups[0].quantities.iter().all(|quantity| quantity.of.name != "occlusal_s"));
}

#[test]
fn ramps_a_window_and_cycles_by_hand_leave_cycles_out() {
    let ramped = |t_s: f64| if (0.5..=6.5).contains(&t_s) { MotionSpeed::Full } else { MotionSpeed::Ramped };
    let choice = |study: StudyConfig| found_of(study, 7.0, ramped, chewing);
    let why =
        |figures: &JawCycleFigures| figures.cycles.iter().map(|cycle| cycle.left_out).collect::<Vec<_>>();
    let all = choice(StudyConfig::default());
    assert_eq!((all.count, all.left_out, names(&all)), (10, 2, vec![("chew left", 8)]));
    assert_eq!([why(&all)[0], why(&all)[1], why(&all)[9]], [Some(LeftOut::Ramp), None, Some(LeftOut::Ramp)]);
    let chosen =
        choice(StudyConfig { window_s: Some([1.0, 5.0]), leave_out: vec![4], ..StudyConfig::default() });
    let [window, hand] = [Some(LeftOut::Window), Some(LeftOut::ByHand)];
    assert_eq!(why(&chosen)[..5], [window, window, None, hand, None]);
    assert_eq!(names(&chosen), [("chew left", 4)]);
    assert_eq!(LeftOut::ByHand.to_string(), "by_hand");
}

#[test]
fn a_course_is_that_of_a_cycle_from_opening_to_opening() {
    let figures = found(7.0, chewing);
    let chew = &figures.groups[0];
    assert_eq!((chew.courses.len(), chew.mean_course.len()), (9, COURSE_POINTS));
    let mean = |point: usize| chew.mean_course[point][0];
    // The lowest place comes after 0.27 s of 0.7 s, counted from half a millimetre below the closed jaw.
    let lowest = (0..COURSE_POINTS).max_by(|&a, &b| mean(a).opening_mm.total_cmp(&mean(b).opening_mm));
    assert!((18..22).contains(&lowest.unwrap()), "{lowest:?}");
    assert!((mean(lowest.unwrap()).opening_mm - 18.0).abs() < 0.1);
    assert!(mean(0).opening_mm < 0.55 && mean(COURSE_POINTS - 1).opening_mm < 0.55);
    let bite = (0..COURSE_POINTS).map(|point| mean(point).force_n).fold(0.0, f64::max);
    assert!((75.0..80.5).contains(&bite), "{bite}");
    assert!(chew.mean_course.iter().all(|[_, sd]| sd.opening_mm < 0.5));
}

#[test]
fn bouts_of_chewing_with_a_rest_between_do_not_stretch_the_cycle_before_the_rest() {
    let figures = found(12.0, |t_s| match t_s {
        t_s if t_s < 2.1 => chewing(t_s),
        t_s if t_s < 6.3 => ([0.0; 3], 0.0),
        t_s if t_s < 8.4 => chewing(t_s),
        _ => ([0.0; 3], 0.0),
    });
    assert_eq!((figures.count, statistic(&figures.groups[0], "duration_s").count), (6, 4));
    assert_mean(&figures.groups[0], "duration_s", 0.7, 0.002);
}

#[test]
fn what_does_not_move_away_and_back_is_no_cycle() {
    let spoken = found(10.0, |t_s| ([0.0, 0.0, -2.5 * (TAU * t_s).sin().abs()], 0.0));
    let lowered = found(10.0, |t_s| ([0.0, 0.0, -3.0 * t_s], 0.0));
    let held = found(30.0, |t_s| ([0.0, 0.0, if (2.0..28.0).contains(&t_s) { -20.0 } else { 0.0 }], 0.0));
    assert_eq!([spoken.count, lowered.count, held.count], [0; 3]);
}

#[test]
fn a_long_run_keeps_all_cycles_and_its_summary_lists_the_first() {
    let figures = found(400.0, |t_s| {
        let ([x, y, z], force_n) = chewing(t_s);
        ([x, y, z], if t_s > 300.0 { 0.0 } else { force_n })
    });
    let chew = &figures.groups[0];
    assert_eq!((chew.count, figures.cycles.len(), chew.courses.len()), (571, 571, MOST_COURSES));
    let listed = serde_json::to_value(&figures).unwrap();
    assert_eq!(listed["cycles"].as_array().unwrap().len(), MOST_CYCLES);
    assert_eq!(statistic(chew, "force_n").count, 571);
}
