//! Motions whose cycles are known.

use std::f64::consts::{PI, TAU};

use super::*;

const INCISAL_M: [f64; 3] = [0.03, 0.0, -0.01];

/// Figures of a motion of the incisal point, mm anterior, left and up, with a force, N, for so many seconds at 1 kHz.
fn found(seconds: f64, motion: impl Fn(f64) -> ([f64; 3], f64)) -> JawCycleFigures {
    let mut cycles = JawCycles::new(INCISAL_M, true);
    for cycle in 0..(seconds * 1e3) as u64 {
        let ([x, y, z], force_n) = motion(cycle as f64 / 1e3);
        let pose = Pose::translation(x / 1e3, y / 1e3, 0.2 + z / 1e3);
        cycles.add_pose(cycle * 1_000_000, &pose, force_n);
    }
    cycles.into_figures()
}

/// A cycle: 0.3 s down by 18 mm, 0.28 s up, closed for 0.12 s; 4 mm to the left while it closes; a bite of 80 N.
fn chewing(t_s: f64) -> ([f64; 3], f64) {
    let in_cycle_s = t_s.rem_euclid(0.7);
    let smooth = |share: f64| (1.0 - (PI * share).cos()) / 2.0;
    let down = match in_cycle_s {
        t_s if t_s < 0.3 => smooth(t_s / 0.3),
        t_s if t_s < 0.58 => 1.0 - smooth((t_s - 0.3) / 0.28),
        _ => 0.0,
    };
    let closing = ((in_cycle_s - 0.3) / 0.28).clamp(0.0, 1.0);
    let bite = ((in_cycle_s - 0.58) / 0.12).clamp(0.0, 1.0);
    ([-5.0 * down, 4.0 * (PI * closing).sin(), -18.0 * down], 80.0 * (PI * bite).sin())
}

/// Uniform in ±1, without a pattern that cycles have.
fn noise(t_s: f64) -> f64 {
    let mut bits = ((t_s * 1e3).round() as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits ^= bits >> 29;
    bits = bits.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (bits >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

fn is_near(statistic: Statistic, expected: f64, within: f64) -> bool {
    statistic.mean.is_some_and(|mean| (mean - expected).abs() < within)
}

#[test]
fn chewing_is_cut_into_its_cycles_with_their_known_figures() {
    let figures = found(7.0, chewing);
    assert_eq!((figures.count, figures.cycles.len(), figures.duration_s.count), (10, 10, 9));
    assert!(is_near(figures.duration_s, 0.7, 0.002) && figures.duration_s.sd.unwrap() < 0.003, "{figures:?}");
    assert!(is_near(figures.opening_mm, 18.0, 0.5) && is_near(figures.lateral_mm, 4.0, 0.05), "{figures:?}");
    assert!(is_near(figures.closing_mm_s, 9.0 * PI / 0.28, 1.5), "{:?}", figures.closing_mm_s);
    assert!(is_near(figures.opening_mm_s, 9.0 * PI / 0.3, 1.5), "{:?}", figures.opening_mm_s);
    assert!(is_near(figures.force_n, 80.0, 0.1), "{:?}", figures.force_n);
    // Half a millimetre of the way down and up is not counted.
    assert!(is_near(figures.opening_s, 0.3, 0.04) && is_near(figures.closing_s, 0.28, 0.04), "{figures:?}");
}

#[test]
fn noise_and_drift_of_a_tracker_change_no_cycle() {
    let figures = found(14.0, |t_s| {
        let ([x, y, z], force_n) = chewing(t_s);
        ([x, y + 0.05 * noise(t_s + 40.0), z + 0.1 * noise(t_s) - 0.2 * t_s], force_n)
    });
    assert_eq!(figures.count, 20);
    assert!(is_near(figures.duration_s, 0.7, 0.01) && is_near(figures.lateral_mm, 4.1, 0.1), "{figures:?}");
    assert!(is_near(figures.closing_mm_s, 101.0, 8.0), "{:?}", figures.closing_mm_s);
}

#[test]
fn a_course_is_that_of_a_cycle_from_opening_to_opening() {
    let figures = found(7.0, chewing);
    assert_eq!((figures.courses.len(), figures.mean_course.len()), (9, COURSE_POINTS));
    let mean = |point: usize| figures.mean_course[point][0];
    // The lowest place comes after 0.27 s of 0.7 s, counted from half a millimetre below the closed jaw.
    let lowest = (0..COURSE_POINTS).max_by(|&a, &b| mean(a).opening_mm.total_cmp(&mean(b).opening_mm));
    assert!((18..22).contains(&lowest.unwrap()), "{lowest:?}");
    assert!(mean(0).opening_mm.abs() < 0.1 && mean(COURSE_POINTS - 1).opening_mm.abs() < 0.1);
    let bite = (0..COURSE_POINTS).map(|point| mean(point).force_n).fold(0.0, f64::max);
    assert!((75.0..80.5).contains(&bite), "{bite}");
    assert!(figures.mean_course.iter().all(|[_, sd]| sd.opening_mm < 0.5));
}

#[test]
fn bouts_of_chewing_with_a_rest_between_do_not_stretch_the_cycle_before_the_rest() {
    let figures = found(12.0, |t_s| match t_s {
        t_s if t_s < 2.1 => chewing(t_s),
        t_s if t_s < 6.3 => ([0.0; 3], 0.0),
        t_s if t_s < 8.4 => chewing(t_s),
        _ => ([0.0; 3], 0.0),
    });
    assert_eq!((figures.count, figures.duration_s.count), (6, 4));
    assert!(is_near(figures.duration_s, 0.7, 0.002), "{:?}", figures.duration_s);
}

#[test]
fn what_neither_opens_nor_closes_again_is_no_cycle() {
    let aside = found(10.0, |t_s| ([0.0, 8.0 * (TAU * t_s).sin(), -1.4 * (TAU * t_s).sin().abs()], 0.0));
    let lowered = found(10.0, |t_s| ([0.0, 0.0, -3.0 * t_s], 0.0));
    let held = found(30.0, |t_s| ([0.0, 0.0, if (2.0..28.0).contains(&t_s) { -20.0 } else { 0.0 }], 0.0));
    assert_eq!([aside.count, lowered.count, held.count], [0; 3]);
    assert_eq!(aside.opening_mm, Statistic::default());
}

#[test]
fn an_hour_takes_no_more_memory_than_a_minute() {
    let figures = found(3600.0, |t_s| {
        let ([x, y, z], force_n) = chewing(t_s);
        ([x, y, z], if t_s > 3000.0 { 0.0 } else { force_n })
    });
    assert_eq!(
        (figures.count, figures.cycles.len(), figures.courses.len()),
        (5143, MOST_CYCLES, MOST_COURSES)
    );
}
