//! The recorded motion as data for the page's 3-D view.

use masseter_shared::config::Scenario;
use masseter_shared::geometry::{LEGS, Mechanism, Pose};
use masseter_shared::messages::pose_fields;
use serde::Serialize;

use crate::analysis::Track;
use crate::recording::jaw_points;

/// Positions to the micrometre and quaternions to a millionth are finer than any screen.
const DIGITS: f64 = 1e6;

/// Mechanism and motion; metres, base frame.
#[derive(Serialize)]
struct Film {
    /// Middle of each slide.
    centres: [[f64; 3]; LEGS],
    /// Direction of each slide.
    along: [[f64; 3]; LEGS],
    /// Ends of the slides' strokes.
    slide_ends: [f64; 2],
    /// Platform corners in the platform frame.
    corners: [[f64; 3]; LEGS],
    /// Incisal point and condyles in the platform frame.
    jaw: [[f64; 3]; 3],
    /// Time in s, then the platform's true, estimated and wanted pose as x y z, w x y z.
    frames: Vec<Vec<f64>>,
}

/// The film as JSON; none without a motion or without a mechanism.
pub(super) fn of_track(scenario: &Scenario, track: &Track) -> Option<String> {
    let mechanism = Mechanism::new(&scenario.mechanism).ok()?;
    let first = track.samples.first()?;
    let frames = track.samples.iter().map(|sample| {
        let mut frame = vec![rounded(sample.sampled_ns.saturating_sub(first.sampled_ns) as f64 / 1e9)];
        for pose in [&sample.found, &sample.estimated, &sample.desired] {
            frame.extend(numbers(pose));
        }
        frame
    });
    let film = Film {
        centres: std::array::from_fn(|leg| mechanism.hinge(leg, 0.0).into()),
        along: std::array::from_fn(|leg| mechanism.slide_direction(leg).into()),
        slide_ends: mechanism.strokes().slide_m,
        corners: mechanism.platform_corners().map(Into::into),
        jaw: jaw_points(&scenario.jaw).map(Into::into),
        frames: frames.collect(),
    };
    serde_json::to_string(&film).ok()
}

fn numbers(pose: &Pose) -> impl Iterator<Item = f64> {
    let (position_m, quaternion) = pose_fields(pose);
    position_m.into_iter().chain(quaternion).map(rounded)
}

fn rounded(value: f64) -> f64 {
    (value * DIGITS).round() / DIGITS
}
