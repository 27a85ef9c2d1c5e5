//! Whole trajectories: smoothness, rest at the ends, the check, and the examples' two recordings of a session.

use std::path::Path;

use masseter_model::geometry::{AXES, Conditioning, Jacobian, Mechanism, MechanismConfig};
use masseter_scenario::{
    ChewingConfig, FileConfig, JawConfig, JawSide, LateralConfig, MotionConfig, OpeningConfig,
    ProtrusionConfig, TrajectoryLimitsConfig,
};
use nalgebra::SVector;

use super::*;

const PERIOD_S: f64 = 0.001;

fn mechanism() -> Mechanism {
    Mechanism::new(&MechanismConfig::default()).unwrap()
}

fn build(motion: &MotionConfig, duration_s: Option<f64>) -> Trajectory {
    Trajectory::new(motion, &JawConfig::default(), &mechanism(), duration_s).unwrap()
}

fn judge(trajectory: &Trajectory) -> Result<TrajectoryReport, TrajectoryError> {
    check(trajectory, &mechanism(), &TrajectoryLimitsConfig::default(), PERIOD_S)
}

fn generators() -> [MotionConfig; 6] {
    [
        MotionConfig::default(),
        MotionConfig::Chewing(ChewingConfig {
            cycle_rate_hz: 2.17,
            side: JawSide::Right,
            ..Default::default()
        }),
        MotionConfig::Opening(OpeningConfig::default()),
        MotionConfig::Opening(OpeningConfig { amplitude_mm: 56.1, ..Default::default() }),
        MotionConfig::Protrusion(ProtrusionConfig::default()),
        MotionConfig::Lateral(LateralConfig::default()),
    ]
}

/// The actuators over the whole trajectory.
fn axes(trajectory: &Trajectory, period_s: f64) -> Vec<SVector<f64, AXES>> {
    let samples = (trajectory.duration_s() / period_s) as u32;
    let at = |sample| mechanism().inverse(&trajectory.pose(f64::from(sample) * period_s)).unwrap();
    (0..=samples).map(|sample| at(sample).actuators.to_axes().into()).collect()
}

fn differences(values: &[SVector<f64, AXES>], period_s: f64) -> Vec<SVector<f64, AXES>> {
    values.windows(2).map(|pair| (pair[1] - pair[0]) / period_s).collect()
}

fn largest(values: &[SVector<f64, AXES>]) -> f64 {
    values.iter().map(SVector::amax).fold(0.0, f64::max)
}

/// A jump of the acceleration shows as a jerk that grows as the period shrinks.
#[test]
fn generated_motions_are_twice_continuously_differentiable() {
    for motion in generators() {
        let trajectory = build(&motion, Some(3.0));
        let jerk = |period_s| {
            let velocity = differences(&axes(&trajectory, period_s), period_s);
            largest(&differences(&differences(&velocity, period_s), period_s))
        };
        assert!(jerk(0.0005) < 1.1 * jerk(0.001), "{motion:?}");
    }
}

#[test]
fn trajectories_start_and_end_at_rest_in_the_closed_pose() {
    for motion in generators() {
        let trajectory = build(&motion, None);
        assert!((trajectory.duration_s() - 10.0).abs() < 1e-12);
        for t_s in [-1.0, 0.0, 10.0, 12.0] {
            let away = trajectory.pose(t_s).translation.vector - trajectory.closed_pose().translation.vector;
            assert!(away.norm() < 1e-12, "{motion:?} at {t_s} s");
        }
    }
}

#[test]
fn a_duration_cuts_a_motion_and_still_lets_it_come_to_rest() {
    let trajectory = build(&MotionConfig::default(), Some(0.6));
    let speed = |t_s: f64| {
        let step_s = 1e-4;
        let way = trajectory.pose(t_s + step_s).translation.vector - trajectory.pose(t_s).translation.vector;
        way.norm() / step_s
    };
    assert!(speed(0.3) > 0.01);
    assert!(speed(0.0) < 1e-6 && speed(0.6 - 1e-4) < 1e-6 && speed(0.6) < 1e-12);
}

#[test]
fn a_motion_whose_duration_holds_no_whole_cycle_is_known_to_be_cut() {
    let opening = MotionConfig::Opening(OpeningConfig::default());
    for (duration_s, whole_s) in [(None, None), (Some(2.5), None), (Some(2.6), None), (Some(1.0), Some(2.5))]
    {
        assert_eq!(build(&opening, duration_s).cut_from_s(), whole_s, "{duration_s:?}");
    }
}

#[test]
fn every_generator_passes_the_check_with_its_defaults() {
    for motion in generators() {
        let trajectory = build(&motion, None);
        let report = judge(&trajectory).unwrap_or_else(|error| panic!("{motion:?}: {error}"));
        assert!(report.margin_m(mechanism().strokes()).iter().all(|&margin_m| margin_m > 0.0));
        // A cycle that is left out of a movement shows as a jump of the speed.
        let ways = axes(&trajectory, PERIOD_S);
        let speeds = differences(&ways, PERIOD_S);
        let most = |values: &[SVector<f64, AXES>]| {
            values.iter().fold(SVector::zeros(), |most, value| value.abs().sup(&most))
        };
        for (found, expected) in [
            (report.lowest_m, ways.iter().fold(ways[0], |least, way| least.inf(way))),
            (report.highest_m, ways.iter().fold(ways[0], |most, way| most.sup(way))),
            (report.velocity_m_s, most(&speeds)),
            (report.acceleration_m_s2, most(&differences(&speeds, PERIOD_S))),
        ] {
            assert!((SVector::from(found) - expected).amax() < 1e-9, "{motion:?}: {found:?}, {expected}");
        }
    }
}

#[test]
fn the_closed_pose_follows_the_jaws_configuration() {
    let jaw = JawConfig { closed_leg_m: 0.28, closed_offset_m: [0.004, 0.0, 0.0], ..Default::default() };
    let trajectory = Trajectory::new(&MotionConfig::default(), &jaw, &mechanism(), None).unwrap();
    let legs =
        mechanism().inverse(&(nalgebra::Translation3::new(-0.004, 0.0, 0.0) * trajectory.closed_pose()));
    assert!(legs.unwrap().actuators.leg_m.iter().all(|leg_m| (leg_m - 0.28).abs() < 1e-12));
    let jaw = JawConfig { closed_leg_m: 0.01, ..Default::default() };
    let error = Trajectory::new(&MotionConfig::default(), &jaw, &mechanism(), None).unwrap_err();
    assert!(error.to_string().contains("closed_leg_m"));
}

#[test]
fn what_exceeds_a_limit_is_refused_with_time_axis_and_limit() {
    let chewing = build(&MotionConfig::default(), None);
    let refuse =
        |limits: TrajectoryLimitsConfig| check(&chewing, &mechanism(), &limits, PERIOD_S).unwrap_err();
    let default = TrajectoryLimitsConfig::default();
    let table = [
        (TrajectoryLimitsConfig { leg_velocity_m_s: 0.05, ..default }, "axis l1 would move"),
        (TrajectoryLimitsConfig { slide_velocity_m_s: 0.01, ..default }, "limit 0.01 m/s"),
        (TrajectoryLimitsConfig { leg_acceleration_m_s2: 0.5, ..default }, "axis l1 would accelerate"),
        (TrajectoryLimitsConfig { max_condition: 2.0, ..default }, "condition number"),
    ];
    for (limits, reason) in table {
        let error = refuse(limits).to_string();
        assert!(error.contains(reason), "{error}");
        let time_s = error.strip_prefix("motion at ").unwrap().split(" s: ").next().unwrap();
        assert!(time_s.parse::<f64>().unwrap() < 1.5, "{error}");
    }
    let low = JawConfig { closed_leg_m: 0.245, ..Default::default() };
    let trajectory = Trajectory::new(&MotionConfig::default(), &low, &mechanism(), None).unwrap();
    let refused = judge(&trajectory).unwrap_err().to_string();
    assert!(refused.contains("is outside its stroke"), "{refused}");
}

/// The check computes few condition numbers, and finds the same first pose as all of them.
#[test]
fn the_first_pose_beyond_the_condition_limit_is_refused() {
    let mechanism = mechanism();
    let chewing = build(&MotionConfig::default(), None);
    let conditions: Vec<_> = (0..=10_000)
        .map(|sample| {
            let legs = mechanism.legs(&chewing.pose(f64::from(sample) * PERIOD_S)).unwrap();
            Conditioning::new(&Jacobian::of_legs(&mechanism, &legs)).number()
        })
        .collect();
    let largest = conditions.iter().copied().fold(0.0, f64::max);
    for share in [0.01, 0.3, 0.9, 0.999_999] {
        let max_condition = conditions[0] + share * (largest - conditions[0]);
        let limits = TrajectoryLimitsConfig { max_condition, ..Default::default() };
        let first = conditions.iter().position(|condition| *condition > max_condition).unwrap();
        assert!(first > 0, "{share}");
        let error = check(&chewing, &mechanism, &limits, PERIOD_S).unwrap_err().to_string();
        assert!(
            error.starts_with(&format!("motion at {:.3} s: condition", first as f64 * PERIOD_S)),
            "{error}"
        );
    }
    let limits = TrajectoryLimitsConfig { max_condition: largest, ..Default::default() };
    assert!(check(&chewing, &mechanism, &limits, PERIOD_S).is_ok());
}

#[test]
fn a_row_that_tells_no_pose_is_named_with_its_line() {
    let header = "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz";
    let rows = ["0.00,0,0,0,1,0,0,0", "0.01,0,0,0,1,0,0,0", "0.02,0,0,0,0.9,0,0,0", "0.03,0,0,0,1,0,0,0"];
    let path = std::env::temp_dir().join(format!("masseter-no-pose-{}.csv", std::process::id()));
    std::fs::write(&path, [&[header], &rows[..]].concat().join("\n")).unwrap();
    let motion = MotionConfig::File(FileConfig::new(&path));
    let error = Trajectory::new(&motion, &JawConfig::default(), &mechanism(), None).unwrap_err();
    std::fs::remove_file(&path).unwrap();
    assert!(error.to_string().contains(".csv:4: the quaternion's norm is 0.9"), "{error}");
}

#[test]
fn an_absent_file_is_named() {
    let motion = MotionConfig::File(FileConfig::new("no/such/jaw.csv"));
    let error = Trajectory::new(&motion, &JawConfig::default(), &mechanism(), None).unwrap_err();
    assert!(error.to_string().contains("no/such/jaw.csv"), "{error}");
}

#[test]
fn a_point_beyond_any_trackers_sight_is_refused() {
    for point_mm in [f64::MAX, f64::NAN, 1.1e5] {
        let file =
            FileConfig { reference_point_mm: Some([0.0, point_mm, 0.0]), ..FileConfig::new("jaw.csv") };
        let motion = MotionConfig::File(file);
        let error = Trajectory::new(&motion, &JawConfig::default(), &mechanism(), None).unwrap_err();
        assert!(error.to_string().contains("within ±100000 mm"), "{error}");
    }
}

fn recording(name: &str) -> FileConfig {
    FileConfig::new(Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples").join(name))
}

#[test]
fn the_patients_recording_plays_with_all_defaults() {
    let trajectory = build(&MotionConfig::File(recording("patient.csv")), None);
    assert!((trajectory.duration_s() - 16.1).abs() < 0.02, "{}", trajectory.duration_s());
    let report = judge(&trajectory).unwrap();
    // 28° about the condyles and 12 mm along their paths lower the incisal point by some 41 mm.
    assert!(report.lowest_m[3] < 0.265, "{}", report.lowest_m[3]);
}

/// A closed pose so far back that the slides do not reach the opened jaw is refused with the line of the file.
#[test]
fn the_tracker_recording_plays_with_its_axes_unless_the_closed_pose_lies_too_far_back() {
    let mut file = recording("tracker.csv");
    file.axes = ["+y", "-x", "+z"].map(String::from);
    let motion = MotionConfig::File(file);
    let displaced = |x_m, closed_leg_m| {
        let jaw = JawConfig { closed_offset_m: [x_m, 0.0, 0.0], closed_leg_m, ..Default::default() };
        Trajectory::new(&motion, &jaw, &mechanism(), None).unwrap()
    };
    let trajectory = displaced(0.005, JawConfig::default().closed_leg_m);
    judge(&trajectory).unwrap();
    let lowest_m = (0..16_000).map(|ms| trajectory.pose(f64::from(ms) / 1000.0).translation.z);
    let travel_m = trajectory.closed_pose().translation.z - lowest_m.fold(f64::INFINITY, f64::min);
    assert!((travel_m - 0.0278).abs() < 0.001, "{travel_m}");

    let refused = judge(&displaced(-0.026, 0.285)).unwrap_err().to_string();
    assert!(refused.contains("is outside its stroke"), "{refused}");
    // The wide opening lasts from 0.4 to 3.0 s.
    let (_, from_line) = refused.split_once("tracker.csv:").unwrap();
    assert!((23..153).contains(&from_line.split(')').next().unwrap().parse().unwrap()), "{refused}");
}
