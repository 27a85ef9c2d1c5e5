//! The recorded motion as data for the page's 3-D view.

use masseter_shared::config::Scenario;
use masseter_shared::geometry::{LEGS, Mechanism, Pose};
use masseter_shared::messages::pose_fields;
use serde::Serialize;

use masseter_analysis::{Figures, Reference, TrackingSample};
use masseter_recording::jaw_points;

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
    /// Time in s, then the platform's pose by the reference, the wanted one and, where the reference is the truth, the
    /// estimated one, each as x y z, w x y z.
    frames: Vec<Vec<f64>>,
}

/// The film as JSON; none without a motion or without a mechanism.
pub(super) fn of_run(scenario: &Scenario, figures: &Figures) -> Option<String> {
    let mechanism = Mechanism::new(&scenario.mechanism).ok()?;
    let samples = &figures.track.samples;
    let first = samples.first()?;
    let frame = |sample| frame(sample, first.sampled_ns, figures.tracking.reference);
    let film = Film {
        centres: std::array::from_fn(|leg| mechanism.hinge(leg, 0.0).into()),
        along: std::array::from_fn(|leg| mechanism.slide_direction(leg).into()),
        slide_ends: mechanism.strokes().slide_m,
        corners: mechanism.platform_corners().map(Into::into),
        jaw: jaw_points(&scenario.jaw).map(Into::into),
        frames: samples.iter().map(frame).collect(),
    };
    serde_json::to_string(&film).ok()
}

fn frame(sample: &TrackingSample, began_ns: u64, reference: Reference) -> Vec<f64> {
    let mut frame = vec![rounded(sample.sampled_ns.saturating_sub(began_ns) as f64 / 1e9)];
    frame.extend(numbers(&sample.found).chain(numbers(&sample.desired)));
    if reference == Reference::Truth {
        frame.extend(numbers(&sample.estimated));
    }
    frame
}

fn numbers(pose: &Pose) -> impl Iterator<Item = f64> {
    let (position_m, quaternion) = pose_fields(pose);
    position_m.into_iter().chain(quaternion).map(rounded)
}

fn rounded(value: f64) -> f64 {
    (value * DIGITS).round() / DIGITS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_truth_there_is_one_outline_less() {
        let still = Pose::identity();
        let sample = TrackingSample { sampled_ns: 7, desired: still, estimated: still, found: still };
        let numbers = |reference| frame(&sample, 0, reference).len();
        assert_eq!((numbers(Reference::Truth), numbers(Reference::Estimate)), (1 + 3 * 7, 1 + 2 * 7));
    }
}
