//! A recorded motion against the played one: how far the jaw was from the file's own rows, and why.
//!
//! At the same instant of the motion, the filter leads the desired path away from the recorded one, and the robot leads
//! the jaw away from the desired path. Both add up to the whole error. The clock of a motion starts and stops slowly:
//! these ramps change no path, and their error is the distance to an even pace. Only rows count, not the time between.
//! Not judged: cycles outside the motion, and whether a deviation matters.

use std::sync::Arc;

use hdrhistogram::Histogram;
use masseter_controller::trajectory::Trajectory;
use masseter_model::geometry::{Mechanism, Pose, Vec3};
use masseter_recording::jaw_points;
use masseter_scenario::{JawConfig, MotionConfig, Scenario};
use serde::Serialize;

use crate::poses::{turn, way};
use crate::statistic::Sums;

/// Incisal point, left and right condyle, then the jaw's orientation.
const PLACES: [&str; 4] = ["incisal point", "left condyle", "right condyle", "orientation"];
/// Parts of an error, and the unit in which a histogram counts: a nanometre or a microdegree.
const SOURCES: [&str; 4] = ["all", "filter", "robot", "ramps"];
const COUNTED: f64 = 1e-6;
/// The largest value in a percentile, mm or °.
const MOST: f64 = 1e6;
/// Digits of a percentile.
const DIGITS: u8 = 2;

/// Errors of the played motion against the recorded one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecordedFigures {
    /// Rows compared.
    pub rows: u64,
    /// Each place with each source.
    pub errors: Vec<RecordedError>,
    /// Largest distance of the incisal point from the closed jaw, mm: recorded, played.
    pub opening_mm: [f64; 2],
    /// Inclination of the left and the right condyle's path below the horizontal, at its farthest place, °: recorded,
    /// played.
    pub condylar_inclination_deg: [[f64; 2]; 2],
    /// Angle between the recorded and the played axis of the jaw's largest turn, °; none of a jaw that does not turn.
    pub hinge_axis_deg: Option<f64>,
}

/// An error of one place by one source.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RecordedError {
    /// Incisal point, a condyle, or the orientation.
    pub place: &'static str,
    /// `all`, or the part of `filter`, `robot` or `ramps`.
    pub source: &'static str,
    /// `mm` or `°`.
    pub unit: &'static str,
    /// Root mean square.
    pub rms: f64,
    /// 95th percentile.
    pub p95: f64,
    /// The largest.
    pub max: f64,
    /// Share of the mean square of the whole error; none of the ramps, which are no part of it.
    pub share: Option<f64>,
}

/// Compares the jaw with the rows of the scenario's file.
#[derive(Debug, Clone)]
pub struct RecordedWatch {
    trajectory: Arc<Trajectory>,
    /// In the platform frame.
    points_m: [Vec3; 3],
    /// Instant of the motion, and the platform's pose.
    before: Option<(f64, Pose)>,
    rows: u64,
    sums: [[Sum; 4]; 4],
    opening_m: [f64; 2],
    /// Recorded and played ways of the condyles, each where the recorded one is longest.
    condyles_m: [[Vec3; 2]; 2],
    turns_rad: [Vec3; 2],
}

#[derive(Debug, Clone)]
struct Sum {
    lengths: Sums,
    /// Of the products with the whole error.
    with_whole: f64,
    values: Histogram<u64>,
}

impl RecordedFigures {
    /// The jaw's figures, recorded and played, in a sentence.
    pub fn in_words(&self) -> String {
        let [left, right] = self.condylar_inclination_deg;
        let pair = |[recorded, played]: [f64; 2], unit: &str| {
            format!("{recorded:.2} {unit} recorded, {played:.2} {unit} played")
        };
        let axis =
            self.hinge_axis_deg.map_or_else(String::new, |deg| format!("; hinge axis {deg:.3}° apart"));
        format!(
            "Opening {}; condylar inclination left {}, right {}{axis}.",
            pair(self.opening_mm, "mm"),
            pair(left, "°"),
            pair(right, "°"),
        )
    }
}

impl RecordedWatch {
    /// None where the scenario plays no file, or the file is gone.
    pub fn of_scenario(scenario: &Scenario) -> Option<Self> {
        let MotionConfig::File(_) = &scenario.motion else { return None };
        let mechanism = Mechanism::new(&scenario.mechanism).ok()?;
        let trajectory =
            Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism, scenario.duration_s).ok()?;
        Some(Self::new(trajectory, &scenario.jaw))
    }

    /// For a motion on a jaw.
    pub fn new(trajectory: Trajectory, jaw: &JawConfig) -> Self {
        let empty = Sum {
            lengths: Sums::default(),
            with_whole: 0.0,
            values: Histogram::new(DIGITS).expect("two digits are allowed"),
        };
        Self {
            trajectory: Arc::new(trajectory),
            points_m: jaw_points(jaw),
            before: None,
            rows: 0,
            sums: std::array::from_fn(|_| std::array::from_fn(|_| empty.clone())),
            opening_m: [0.0; 2],
            condyles_m: [[Vec3::zeros(); 2]; 2],
            turns_rad: [Vec3::zeros(); 2],
        }
    }

    /// Takes the platform's pose at an instant of the motion. The rows since the instant before count.
    pub fn add(&mut self, motion_s: f64, actual: &Pose) {
        let Some((before_s, before)) = self.before.replace((motion_s, *actual)) else { return };
        let trajectory = Arc::clone(&self.trajectory);
        for &row_s in trajectory.rows_between(before_s, motion_s) {
            let share = (row_s - before_s) / (motion_s - before_s);
            self.add_row(&trajectory, row_s, &before.lerp_slerp(actual, share));
        }
    }

    fn add_row(&mut self, of: &Trajectory, motion_s: f64, actual: &Pose) {
        let [Some(recorded), Some(even)] =
            [motion_s, of.even_time_s(motion_s)].map(|at_s| of.recorded_pose(at_s))
        else {
            return;
        };
        let (desired, closed) = (of.pose_in_motion(motion_s), of.closed_pose());
        self.rows += 1;
        let parts = [[&recorded, actual], [&recorded, &desired], [&desired, actual], [&even, &recorded]];
        for (place, sums) in self.sums.iter_mut().enumerate() {
            let errors = parts.map(|[from, to]| match self.points_m.get(place) {
                Some(point) => way(from, to, point) * 1e3,
                None => turn(from, to).map(f64::to_degrees),
            });
            for (sum, error) in sums.iter_mut().zip(&errors) {
                sum.add(error, &errors[0]);
            }
        }
        let both = [&recorded, actual];
        for (opening_m, pose) in self.opening_m.iter_mut().zip(both) {
            *opening_m = opening_m.max(way(&closed, pose, &self.points_m[0]).norm());
        }
        for (farthest_m, point) in self.condyles_m.iter_mut().zip(&self.points_m[1..]) {
            keep_longest(farthest_m, both.map(|pose| way(&closed, pose, point)));
        }
        keep_longest(&mut self.turns_rad, both.map(|pose| turn(&closed, pose)));
    }

    /// None without a row.
    pub fn into_figures(self) -> Option<RecordedFigures> {
        let rows = (self.rows > 0).then_some(self.rows)?;
        let errors = self.sums.iter().enumerate().flat_map(|(place, sums)| {
            let whole = sums[0].lengths.squares;
            sums.iter().enumerate().map(move |(source, sum)| RecordedError {
                place: PLACES[place],
                source: SOURCES[source],
                unit: if place < 3 { "mm" } else { "°" },
                rms: sum.lengths.rms(),
                p95: sum.values.value_at_quantile(0.95) as f64 * COUNTED,
                max: sum.lengths.range.map_or(0.0, |[_, most]| most),
                share: (source < 3 && whole > 0.0).then(|| sum.with_whole / whole),
            })
        });
        let [recorded, played] = self.turns_rad;
        Some(RecordedFigures {
            rows,
            errors: errors.collect(),
            opening_mm: self.opening_m.map(|m| m * 1e3),
            condylar_inclination_deg: self
                .condyles_m
                .map(|ways| ways.map(|way| (-way.z).atan2(way.x).to_degrees())),
            hinge_axis_deg: (recorded.norm() > 1e-3).then(|| recorded.angle(&played).to_degrees()),
        })
    }
}

impl Sum {
    fn add(&mut self, error: &Vec3, whole: &Vec3) {
        let length = error.norm();
        self.lengths.add(length);
        self.with_whole += error.dot(whole);
        // With automatic growth, no value below the cap is refused.
        let _ = self.values.record((length.min(MOST) / COUNTED) as u64);
    }
}

/// Keeps the recorded and the played vector where the recorded one is longest.
fn keep_longest(kept: &mut [Vec3; 2], now: [Vec3; 2]) {
    if now[0].norm() > kept[0].norm() {
        *kept = now;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use masseter_scenario::FileConfig;

    /// Two seconds of opening by 10°, with a jump that only a filter moves.
    fn trajectory(lowpass_hz: f64) -> Trajectory {
        let row = |row: u32| {
            let share = (1.0 - (std::f64::consts::PI * f64::from(row) / 100.0).cos()) / 2.0;
            let half = 5.0_f64.to_radians() * share;
            let (x, z) = (4.0 * share, -3.0 * share - if row == 50 { 0.5 } else { 0.0 });
            format!("{},{x},0,{z},{},0,{},0\n", f64::from(row) / 100.0, half.cos(), half.sin())
        };
        let text: String = (0..=200).map(row).collect();
        // Tests of one process run side by side.
        let name = format!("masseter-recorded-{}-{:?}.csv", std::process::id(), std::thread::current().id());
        let path = std::env::temp_dir().join(name);
        std::fs::write(&path, "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n".to_owned() + &text).unwrap();
        let scenario = Scenario::default();
        let mechanism = Mechanism::new(&scenario.mechanism).unwrap();
        let motion = MotionConfig::File(FileConfig { lowpass_hz, ..FileConfig::new(&path) });
        let trajectory = Trajectory::new(&motion, &scenario.jaw, &mechanism, None).unwrap();
        std::fs::remove_file(&path).unwrap();
        trajectory
    }

    /// Of a jaw that is moved from the desired path by `off`.
    fn figures(lowpass_hz: f64, off: impl Fn(Pose) -> Pose) -> RecordedFigures {
        let trajectory = trajectory(lowpass_hz);
        let mut watch = RecordedWatch::new(trajectory.clone(), &Scenario::default().jaw);
        for cycle in 0..=2500 {
            let motion_s = trajectory.motion_time_s(f64::from(cycle) / 1000.0);
            watch.add(motion_s, &off(trajectory.pose_in_motion(motion_s)));
        }
        watch.into_figures().unwrap()
    }

    fn error<'a>(figures: &'a RecordedFigures, place: &str, source: &str) -> &'a RecordedError {
        figures.errors.iter().find(|error| (error.place, error.source) == (place, source)).unwrap()
    }

    #[test]
    fn a_jaw_beside_an_unfiltered_path_is_the_robots_error_alone() {
        let turn = Pose::rotation(Vec3::new(0.0, 0.0, 0.01)).rotation;
        let found = figures(0.0, |pose| {
            let turned = Pose::from_parts(pose.translation, turn * pose.rotation);
            Pose::translation(0.0, 0.001, 0.0) * turned
        });
        assert!(found.rows >= 199, "{}", found.rows);
        for place in PLACES {
            let [all, filter, robot] =
                ["all", "filter", "robot"].map(|source| error(&found, place, source).rms);
            assert!(filter < 1e-9 && (all - robot).abs() < 1e-9, "{place}: {found:?}");
        }
        let angle = error(&found, "orientation", "all");
        let deg = 0.01_f64.to_degrees();
        assert!((angle.rms - deg).abs() < 1e-4 && (angle.p95 / deg - 1.0).abs() < 0.01, "{angle:?}");
        assert!((error(&found, "incisal point", "robot").share.unwrap() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_filters_and_the_robots_parts_add_up() {
        let found = figures(12.0, |pose| Pose::translation(0.0, 0.0001, 0.0) * pose);
        for place in &PLACES[..3] {
            let share = |source| error(&found, place, source).share.unwrap();
            assert!((share("filter") + share("robot") - 1.0).abs() < 1e-9, "{place}: {found:?}");
        }
        let filter = error(&found, "incisal point", "filter");
        assert!(filter.max > 0.2 && filter.max < 0.5 && filter.p95 < 0.1, "{filter:?}");
        assert!((error(&found, "left condyle", "robot").rms - 0.1).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn the_jaws_figures_are_those_of_the_motion() {
        let found = figures(0.0, |pose| pose);
        let [left, right] = found.condylar_inclination_deg;
        for inclination_deg in [left, right].concat() {
            assert!((inclination_deg - 36.87).abs() < 1.0, "{found:?}");
        }
        assert!((found.opening_mm[0] - found.opening_mm[1]).abs() < 1e-3, "{found:?}");
        assert!(found.hinge_axis_deg.unwrap() < 1e-3, "{found:?}");
        let ramps = error(&found, "incisal point", "ramps");
        assert!(ramps.max > 0.02 && ramps.share.is_none(), "{ramps:?}");
    }
}
