//! The recorded motion as data for the 3-D view of the page.

use masseter_model::geometry::{LEGS, Mechanism, Pose};
use masseter_runtime::messages::pose_fields;
use masseter_scenario::{Scenario, ToothConfig};
use serde::Serialize;
use serde_json::Value;

use masseter_analysis::{Figures, PoseSource, ToothLoads, TrackingSample};
use masseter_controller::trajectory::closed_pose;
use masseter_recording::jaw_points;

/// Positions to the micrometre and quaternions to a millionth are finer than any screen.
const DIGITS: f64 = 1e6;

/// Mechanism and motion; metres, base frame.
#[derive(Serialize)]
struct Animation {
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
    /// The platform when the jaw is closed, x y z, w x y z.
    closed: Vec<f64>,
    /// Numbers and places of the lower teeth in the platform frame.
    teeth: Vec<(u8, [f64; 3])>,
    /// Forces on the teeth. A row begins with the time since the run's first SYNC, s. Four numbers follow for each
    /// tooth with a force: the place in `teeth`, and the force along x, y and z of the base, N.
    forces: Vec<Vec<f64>>,
    /// What the actual pose is called.
    actual_name: &'static str,
    /// Time since the run's first SYNC, s, then the actual and the desired pose of the platform, each as x y z, w x y z.
    /// The estimated pose follows where the actual one is the true one.
    frames: Vec<Vec<f64>>,
}

/// The animation; none without a motion or without a mechanism.
pub(super) fn data(scenario: &Scenario, figures: &Figures) -> Option<Value> {
    let mechanism = Mechanism::new(&scenario.mechanism).ok()?;
    let samples = &figures.track.samples;
    samples.first()?;
    let source = figures.tracking.actual_source;
    let frame = |sample| frame(sample, figures.over_time.began_ns, source);
    let contact = figures.contact.as_ref();
    let tooth = |tooth: &ToothConfig| (tooth.number, tooth.point_m.map(rounded));
    let animation = Animation {
        centres: std::array::from_fn(|leg| mechanism.hinge(leg, 0.0).into()),
        along: std::array::from_fn(|leg| mechanism.slide_direction(leg).into()),
        slide_ends: mechanism.strokes().slide_m,
        corners: mechanism.platform_corners().map(Into::into),
        jaw: jaw_points(&scenario.jaw).map(Into::into),
        closed: numbers(&closed_pose(&scenario.jaw, &mechanism).ok()?).collect(),
        teeth: scenario.arch().iter().map(tooth).collect(),
        forces: contact.map(|contact| contact.moments.iter().map(forces).collect()).unwrap_or_default(),
        actual_name: source.adjective(),
        frames: samples.iter().map(frame).collect(),
    };
    serde_json::to_value(&animation).ok()
}

fn frame(sample: &TrackingSample, began_ns: u64, source: PoseSource) -> Vec<f64> {
    let mut frame = vec![rounded(sample.sampled_ns.saturating_sub(began_ns) as f64 / 1e9)];
    frame.extend(numbers(&sample.actual).chain(numbers(&sample.desired)));
    if source == PoseSource::Truth {
        frame.extend(numbers(&sample.estimated));
    }
    frame
}

fn forces(moment: &ToothLoads) -> Vec<f64> {
    let to_tenth = |force_n: f64| (force_n * 10.0).round() / 10.0;
    let forces = moment.forces_n.iter();
    let of_teeth =
        forces.flat_map(|(place, force_n)| [*place as f64].into_iter().chain(force_n.map(to_tenth)));
    [rounded(moment.at_s)].into_iter().chain(of_teeth).collect()
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
        let sample = TrackingSample { sampled_ns: 7, desired: still, estimated: still, actual: still };
        let numbers = |reference| frame(&sample, 0, reference).len();
        assert_eq!((numbers(PoseSource::Truth), numbers(PoseSource::Estimate)), (1 + 3 * 7, 1 + 2 * 7));
    }
}
