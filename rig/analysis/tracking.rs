//! How far the platform was from where it should have been, against the plant's truth.

use masseter_shared::geometry::Pose;
use masseter_shared::messages::codes::ControllerState;
use masseter_shared::messages::{State, Truth, pose_of_fields};
use serde::Serialize;

use super::join::ByCycle;

/// States in which the platform is asked to be somewhere.
const MOVING: [ControllerState; 3] =
    [ControllerState::Easing, ControllerState::Running, ControllerState::Holding];

/// Errors of the platform's pose while the motion played.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct TrackingFigures {
    /// Cycles compared.
    pub samples: u64,
    /// Root mean square distance of the platform's origin, true against wanted, mm.
    pub rms_mm: f64,
    /// Largest distance, mm.
    pub max_mm: f64,
    /// Root mean square angle, true against wanted, degrees.
    pub rms_deg: f64,
    /// Largest angle, degrees.
    pub max_deg: f64,
    /// Root mean square distance, estimated by forward kinematics against true, mm.
    pub estimate_rms_mm: f64,
}

/// One cycle of the track, from the first easing to the last hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackingSample {
    /// When, ns.
    pub sampled_ns: u64,
    /// Wanted position of the platform's origin, m.
    pub desired_m: [f64; 3],
    /// True position, m.
    pub true_m: [f64; 3],
}

#[derive(Debug, Clone, Copy)]
struct Wanted {
    desired: Pose,
    estimated: Pose,
    state: u32,
}

/// Joins wanted, estimated and true poses of the same sample.
#[derive(Debug, Default)]
pub(super) struct Tracking {
    last_reading: u64,
    wanted: ByCycle<Wanted>,
    true_poses: ByCycle<(u64, Pose)>,
    distances: Accumulator,
    angles: Accumulator,
    estimates: Accumulator,
    track: Vec<TrackingSample>,
}

#[derive(Debug, Default)]
struct Accumulator {
    samples: u64,
    squares: f64,
    largest: f64,
}

impl Accumulator {
    fn add(&mut self, value: f64) {
        self.samples += 1;
        self.squares += value * value;
        self.largest = self.largest.max(value);
    }

    fn rms(&self) -> f64 {
        (self.squares / self.samples.max(1) as f64).sqrt()
    }
}

impl Tracking {
    pub(super) fn state(&mut self, state: &State) {
        // A repeated reading was compared when it was fresh.
        if state.reading_cycle <= self.last_reading {
            return;
        }
        self.last_reading = state.reading_cycle;
        let wanted = Wanted {
            desired: pose_of_fields(state.desired_position_m, state.desired_quaternion_wxyz),
            estimated: pose_of_fields(state.estimated_position_m, state.estimated_quaternion_wxyz),
            state: state.controller_state,
        };
        match self.true_poses.take(state.reading_cycle) {
            Some(truth) => self.compare(&wanted, truth),
            None => self.wanted.insert(state.reading_cycle, wanted),
        }
    }

    pub(super) fn truth(&mut self, truth: &Truth) {
        let pose = pose_of_fields(truth.position_m, truth.quaternion_wxyz);
        match self.wanted.take(truth.cycle) {
            Some(wanted) => self.compare(&wanted, (truth.sampled_ns, pose)),
            None => self.true_poses.insert(truth.cycle, (truth.sampled_ns, pose)),
        }
    }

    fn compare(&mut self, wanted: &Wanted, (sampled_ns, truth): (u64, Pose)) {
        let position = truth.translation.vector;
        if wanted.state == ControllerState::Running.code() {
            self.distances.add((wanted.desired.translation.vector - position).norm());
            self.angles.add(wanted.desired.rotation.angle_to(&truth.rotation));
            self.estimates.add((wanted.estimated.translation.vector - position).norm());
        }
        if MOVING.iter().any(|state| state.code() == wanted.state) {
            self.track.push(TrackingSample {
                sampled_ns,
                desired_m: wanted.desired.translation.vector.into(),
                true_m: position.into(),
            });
        }
    }

    pub(super) fn finish(self) -> (TrackingFigures, Vec<TrackingSample>) {
        let figures = TrackingFigures {
            samples: self.distances.samples,
            rms_mm: self.distances.rms() * 1e3,
            max_mm: self.distances.largest * 1e3,
            rms_deg: self.angles.rms().to_degrees(),
            max_deg: self.angles.largest.to_degrees(),
            estimate_rms_mm: self.estimates.rms() * 1e3,
        };
        (figures, self.track)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(cycle: u64, x: f64) -> State {
        State {
            cycle,
            reading_cycle: cycle,
            desired_position_m: [x, 0.0, 0.0],
            desired_quaternion_wxyz: [1.0, 0.0, 0.0, 0.0],
            estimated_quaternion_wxyz: [1.0, 0.0, 0.0, 0.0],
            controller_state: ControllerState::Running.code(),
            ..Default::default()
        }
    }

    fn truth(cycle: u64, x: f64) -> Truth {
        Truth {
            cycle,
            position_m: [x, 0.0, 0.0],
            quaternion_wxyz: [1.0, 0.0, 0.0, 0.0],
            ..Default::default()
        }
    }

    #[test]
    fn poses_are_compared_by_cycle_in_whatever_order_they_come() {
        let mut tracking = Tracking::default();
        tracking.state(&state(1, 0.003));
        tracking.state(&state(2, 0.000));
        tracking.truth(&truth(2, 0.004));
        tracking.truth(&truth(1, 0.000));
        tracking.truth(&truth(3, 9.000));
        let (figures, track) = tracking.finish();
        assert_eq!((figures.samples, track.len()), (2, 2));
        assert!((figures.max_mm - 4.0).abs() < 1e-9);
        assert!((figures.rms_mm - (12.5f64).sqrt()).abs() < 1e-9);
    }
}
