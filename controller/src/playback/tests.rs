//! The desired pose moves forward on its path, and comes to rest where requested.

use masseter_model::geometry::{MechanismConfig, Vec3};
use masseter_scenario::JawConfig;
use proptest::prelude::*;

use super::*;

const PERIOD_S: f64 = 1e-3;
const EASE_S: f64 = 0.8;
const RAMP_S: f64 = 0.3;
const DURATION_S: f64 = 3.0;

fn trajectory() -> Trajectory {
    let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
    Trajectory::new(&MotionConfig::default(), &JawConfig::default(), &mechanism, Some(DURATION_S)).unwrap()
}

fn playback() -> Playback {
    Playback::new(trajectory(), EASE_S, RAMP_S, 1.0)
}

/// A pose at the start: shifted and turned against the first pose of the motion.
fn start() -> Pose {
    trajectory().pose(0.0) * Pose::new(Vec3::new(2e-3, -3e-3, 4e-3), Vec3::new(0.05, -0.04, 0.03))
}

/// Lets about that time pass, in cycles.
fn advance(playback: &mut Playback, time_s: f64) {
    (0..(time_s / PERIOD_S).round() as u64).for_each(|_| playback.advance(PERIOD_S));
}

fn are_near(a: &Pose, b: &Pose) -> bool {
    (a.translation.vector - b.translation.vector).norm() < 1e-9 && a.rotation.angle_to(&b.rotation) < 1e-7
}

/// A motion that has played for some time.
fn playing(time_s: f64) -> Playback {
    let mut playback = playback();
    playback.play();
    advance(&mut playback, time_s);
    playback
}

#[test]
fn a_stopped_motion_slows_down_evenly_to_rest_within_its_ramp() {
    let mut playback = playing(1.0);
    playback.stop();
    let (began_s, mut last_s, mut last_step_s) = (playback.elapsed_s, playback.elapsed_s, PERIOD_S);
    let cycles = (RAMP_S / PERIOD_S).round() as u64;
    for cycle in 1..=cycles {
        playback.advance(PERIOD_S);
        let step_s = playback.elapsed_s - last_s;
        assert!((0.0..last_step_s).contains(&step_s), "cycle {cycle}: {step_s} s after {last_step_s} s");
        let is_at_rest = playback.rate < 1e-9;
        assert_eq!(is_at_rest, cycle == cycles, "cycle {cycle}");
        (last_s, last_step_s) = (playback.elapsed_s, step_s);
    }
    assert!((last_s - began_s - RAMP_S / 2.0).abs() < 1e-9, "half the ramp's time: {}", last_s - began_s);
    let rests_at = playback.pose_ahead(0.0);
    assert!(are_near(&rests_at, &trajectory().pose(last_s)), "on its own path");
    advance(&mut playback, 0.5);
    assert!(playback.is_at_rest() && !playback.is_over());
    assert!(are_near(&playback.pose_ahead(0.0), &rests_at));
    assert!(are_near(&playback.pose_ahead(0.1), &rests_at), "a clock at rest has nothing ahead");
}

#[test]
fn what_lies_ahead_of_a_slowing_motion_comes_nearer() {
    let mut playback = playing(1.0);
    let ahead_s = |playback: &Playback| playback.time_ahead_s(0.01) - playback.time_ahead_s(0.0);
    assert!((ahead_s(&playback) - 0.01).abs() < 1e-12);
    playback.stop();
    advance(&mut playback, RAMP_S / 2.0);
    assert!((ahead_s(&playback) - 0.005).abs() < 1e-9);
}

#[test]
fn a_motion_that_nobody_stops_plays_at_full_speed_to_its_end() {
    let mut playback = playing(DURATION_S - 2.0 * PERIOD_S);
    assert!(!playback.is_over() && !playback.is_at_rest());
    assert!((playback.elapsed_s - (DURATION_S - 2.0 * PERIOD_S)).abs() < 1e-9);
    advance(&mut playback, 3.0 * PERIOD_S);
    assert!(playback.is_over() && playback.is_at_rest());
    assert!(are_near(&playback.pose_ahead(0.0), &trajectory().pose(DURATION_S)));
}

#[test]
fn the_ease_leads_from_the_pose_held_to_the_first_of_the_motion() {
    let mut playback = playback();
    assert!(are_near(&playback.pose_ahead(0.0), &trajectory().pose(0.0)), "before a pose is known");
    playback.hold(start());
    assert!(playback.is_over() && playback.is_at_rest());
    assert!(are_near(&playback.pose_ahead(0.0), &start()));
    playback.ease();
    assert!(are_near(&playback.pose_ahead(0.0), &start()), "without a jump");
    advance(&mut playback, EASE_S / 2.0);
    let (half, first) = (playback.pose_ahead(0.0), trajectory().pose(0.0));
    let middle_m = (start().translation.vector + first.translation.vector) / 2.0;
    assert!((half.translation.vector - middle_m).norm() < 1e-9);
    let turns = [start().rotation, first.rotation].map(|rotation| rotation.angle_to(&half.rotation));
    let whole = start().rotation.angle_to(&first.rotation);
    assert!(turns.iter().all(|turn| (turn - whole / 2.0).abs() < 1e-7), "{turns:?} of {whole}");
    advance(&mut playback, EASE_S / 2.0 - 2.0 * PERIOD_S);
    assert!(!playback.is_over() && !playback.is_at_rest());
    advance(&mut playback, 3.0 * PERIOD_S);
    assert!(playback.is_over());
    assert!(are_near(&playback.pose_ahead(0.0), &first));
}

#[test]
fn a_stop_of_one_part_is_none_of_the_next() {
    let mut playback = playback();
    playback.hold(start());
    playback.ease();
    advance(&mut playback, 0.2);
    playback.stop();
    advance(&mut playback, RAMP_S + PERIOD_S);
    assert!(playback.is_at_rest() && !playback.is_over(), "an ease stops on its way too");
    playback.play();
    assert!(!playback.is_at_rest());
    advance(&mut playback, 0.7);
    assert!((playback.elapsed_s - 0.7).abs() < 1e-9);
}

#[test]
fn the_time_of_the_motion_is_negative_before_it_begins() {
    let mut playback = playback();
    assert!(playback.motion_time_ahead_s(0.0) < 0.0);
    playback.ease();
    assert!(playback.motion_time_ahead_s(0.5) < 0.0);
    let playback = playing(1.0);
    let expected_s = trajectory().motion_time_s(1.2);
    assert!((playback.motion_time_ahead_s(0.2) - expected_s).abs() < 1e-9);
}

/// Cycles until the part is over.
fn cycles_to_end(playback: &mut Playback) -> u64 {
    let cycles = (1..100_000).find(|_| {
        playback.advance(PERIOD_S);
        playback.is_over()
    });
    cycles.unwrap()
}

#[test]
fn at_half_the_rate_the_motion_takes_twice_as_long_and_ends_where_it_would() {
    let mut playback = playback();
    playback.set_motion_rate(0.5);
    playback.play();
    let cycles = cycles_to_end(&mut playback);
    assert!((cycles as f64 * PERIOD_S - 2.0 * DURATION_S).abs() < 2.0 * PERIOD_S, "{cycles}");
    assert!(playback.is_at_rest());
    assert!(are_near(&playback.pose_ahead(0.0), &trajectory().pose(DURATION_S)));
}

#[test]
fn a_motion_that_waits_is_over_after_ten_durations() {
    let mut playback = playing(1.0);
    playback.set_motion_rate(0.0);
    advance(&mut playback, 1.1);
    let waits_at = playback.pose_ahead(0.0);
    let cycles = cycles_to_end(&mut playback) as f64;
    assert!((cycles * PERIOD_S - (10.0 * DURATION_S - 2.1)).abs() < 2.0 * PERIOD_S, "{cycles}");
    assert!(are_near(&playback.pose_ahead(0.1), &waits_at));
    assert!(!playback.is_at_rest(), "it could go on");
}

#[test]
fn half_the_amplitude_is_half_of_the_incisal_points_way() {
    let jaw = JawConfig::default();
    let incisal = |pose: &Pose| pose.transform_point(&jaw.reference_point_m.into());
    let mut playback = playback();
    playback.set_motion_amplitude(0.5);
    playback.play();
    let first = incisal(&trajectory().pose(0.0));
    for _ in 0..30 {
        advance(&mut playback, 0.1);
        let [half, whole] = [playback.pose_ahead(0.0), trajectory().pose(playback.elapsed_s)]
            .map(|pose| incisal(&pose) - first);
        assert!((half - whole * 0.5).norm() < 1e-12, "{half} of {whole}");
    }
}

/// Limits a tenth above the demands of the motion, and changes of both at all its phases.
#[test]
fn changes_of_rate_and_amplitude_keep_the_limits_of_the_axes() {
    let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
    let demands =
        crate::trajectory::check(&trajectory(), &mechanism, &TrajectoryLimitsConfig::default(), PERIOD_S)
            .unwrap();
    let most = |values: &[f64]| 1.1 * values.iter().copied().fold(0.0, f64::max);
    let limits = TrajectoryLimitsConfig {
        slide_velocity_m_s: most(&demands.velocity_m_s[..3]),
        leg_velocity_m_s: most(&demands.velocity_m_s[3..]),
        slide_acceleration_m_s2: most(&demands.acceleration_m_s2[..3]),
        leg_acceleration_m_s2: most(&demands.acceleration_m_s2[3..]),
        ..TrajectoryLimitsConfig::default()
    };
    let change_s = Slew::change_s(Some(&demands), &limits);
    assert!((1.0..20.0).contains(&change_s), "{change_s}");
    for phase in 0..15 {
        let mut playback = Playback::new(trajectory(), EASE_S, RAMP_S, change_s);
        playback.play();
        advance(&mut playback, 0.6 + 0.05 * f64::from(phase));
        let mut last: Option<([f64; AXES], [f64; AXES])> = None;
        for cycle in 0..6000 {
            if cycle % 1500 == 0 {
                let [rate, amplitude] = [[0.2, 0.0], [1.0, 0.3], [0.6, 1.0], [1.0, 0.0]][cycle / 1500];
                playback.set_motion_rate(rate);
                playback.set_motion_amplitude(amplitude);
            }
            playback.advance(PERIOD_S);
            let joints = mechanism.inverse(&playback.pose_ahead(0.0)).unwrap();
            mechanism.strokes().check(&joints.actuators).unwrap();
            let at_m = joints.actuators.to_axes();
            let Some((last_m, last_m_s)) = last else {
                last = Some((at_m, [0.0; AXES]));
                continue;
            };
            let rates = |to: &[f64; AXES], from: &[f64; AXES]| -> [f64; AXES] {
                std::array::from_fn(|axis| (to[axis] - from[axis]) / PERIOD_S)
            };
            let at_m_s = rates(&at_m, &last_m);
            let at_m_s2 = rates(&at_m_s, &last_m_s);
            for axis in 0..AXES {
                assert!(at_m_s[axis].abs() <= limits.velocity_m_s(axis), "{phase} {cycle}");
                assert!(
                    cycle < 2 || at_m_s2[axis].abs() <= limits.acceleration_m_s2(axis),
                    "{phase} {cycle}"
                );
            }
            last = Some((at_m, at_m_s));
        }
    }
}

#[test]
fn a_stop_during_changes_comes_to_rest_within_its_ramp_too() {
    let mut playback = playing(1.0);
    playback.set_motion_rate(0.3);
    playback.set_motion_amplitude(0.1);
    advance(&mut playback, 0.4);
    playback.stop();
    advance(&mut playback, RAMP_S + PERIOD_S);
    assert!(playback.is_at_rest());
    let rests_at = playback.pose_ahead(0.0);
    playback.set_motion_amplitude(1.0);
    advance(&mut playback, 1.0);
    assert!(are_near(&playback.pose_ahead(0.1), &rests_at), "nothing moves it any more");
}

#[test]
fn the_whole_change_takes_its_time_and_ends_exactly() {
    let mut slew = Slew::of(2.0);
    slew.target = 0.0;
    let steps = (1..10_000).find(|_| {
        slew.advance(PERIOD_S);
        slew.is_settled()
    });
    assert!((1.99..2.01).contains(&(f64::from(steps.unwrap()) * PERIOD_S)), "{steps:?}");
    assert_eq!(slew.value.to_bits(), 0.0_f64.to_bits());
}

#[test]
fn a_motion_that_uses_its_limits_changes_slowly() {
    let limits = TrajectoryLimitsConfig::default();
    let demands = |velocity_m_s: f64, acceleration_m_s2: f64| TrajectoryReport {
        lowest_m: [0.0; AXES],
        highest_m: [0.02; AXES],
        velocity_m_s: [velocity_m_s; AXES],
        acceleration_m_s2: [acceleration_m_s2; AXES],
    };
    let change_s = |velocity_m_s, acceleration_m_s2| {
        Slew::change_s(Some(&demands(velocity_m_s, acceleration_m_s2)), &limits)
    };
    assert!((change_s(0.05, 1.0) - SHORTEST_S).abs() < 1e-12);
    assert!((change_s(0.14, 1.0) - 1.5 * 1.25 * 0.02 / 0.01).abs() < 1e-9);
    assert!((1.2..1.6).contains(&change_s(0.1, 7.6)), "{}", change_s(0.1, 7.6));
    for slowest_s in [change_s(0.15, 1.0), change_s(0.05, 8.0), Slew::change_s(None, &limits)] {
        assert!((slowest_s - LONGEST_S).abs() < 1e-12);
    }
}

proptest! {
    /// Whatever the targets are, and whenever they change.
    #[test]
    fn it_stays_within_its_limits(targets in prop::collection::vec((0.0..=1.0f64, 1..800usize), 1..9)) {
        let mut slew = Slew::of(1.0);
        let mut last = (slew.value, 0.0);
        for (target, steps) in targets {
            slew.target = target;
            for _ in 0..steps {
                slew.advance(PERIOD_S);
                let per_s = (slew.value - last.0) / PERIOD_S;
                prop_assert!((-1e-9..=1.0 + 1e-9).contains(&slew.value));
                prop_assert!(per_s.abs() <= SPEED + 1e-6);
                prop_assert!((per_s - last.1).abs() / PERIOD_S <= 2.0 * ACCELERATION + 1e-6);
                last = (slew.value, per_s);
            }
        }
    }
}

/// Cycles, each with the command answered in it, if any, and whether the motion makes a step.
fn plays(cycles: &[(u64, Option<u64>, bool)]) {
    let (mut acknowledgement, mut answered_cycle) = (CommandAcknowledgement::default(), 0);
    for &(cycle, answered, steps) in cycles {
        answered_cycle = answered.unwrap_or(answered_cycle);
        assert_eq!(acknowledgement.takes_step(cycle, answered_cycle), steps, "cycle {cycle}");
    }
}

#[test]
fn a_motion_answered_in_time_or_a_cycle_late_goes_on() {
    plays(&[(1, Some(0), true), (2, Some(1), true), (3, None, true), (4, Some(2), true), (5, Some(3), true)]);
}

#[test]
fn a_step_without_answer_is_waited_for_and_made_again_when_the_drives_are_back() {
    plays(&[
        (8, Some(7), true),
        (9, None, true),
        (10, None, false),
        (11, None, false),
        (12, Some(8), false),
        (13, Some(12), true),
    ]);
}

#[test]
fn skipped_cycles_are_one_step() {
    plays(&[(8, Some(7), true), (23, Some(8), true), (24, Some(23), true)]);
}
