//! Distance of the platform from its desired pose. The actual pose is the true one where the mechanism is emulated,
//! and forward kinematics' estimate on the robot, whose true pose is unknown.

use masseter_shared::clock::SECOND_NS;
use masseter_shared::geometry::Pose;
use masseter_shared::messages::codes::ControllerState;
use masseter_shared::messages::{State, Truth, pose_from_fields};
use serde::Serialize;

use super::by_cycle::ByCycle;
use super::noise::standard_error;
use super::series::{Curve, Extremes, Series};

/// States in which the platform has a desired pose.
pub const MOVING: [ControllerState; 3] =
    [ControllerState::Easing, ControllerState::Running, ControllerState::Holding];

/// Where the actual pose comes from, which the desired pose is compared with.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PoseSource {
    /// The emulated mechanism's pose.
    #[default]
    Truth,
    /// The pose found by forward kinematics.
    Estimate,
}

impl PoseSource {
    /// Whether it is the true pose.
    pub fn is_truth(self) -> bool {
        self == Self::Truth
    }

    /// The word for a pose of this kind.
    pub fn adjective(self) -> &'static str {
        match self {
            Self::Truth => "true",
            Self::Estimate => "estimated",
        }
    }
}

/// Errors of the platform's pose while the motion played.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct TrackingFigures {
    /// Where the actual pose came from, which the desired pose was compared with.
    #[serde(rename = "reference")]
    pub actual_source: PoseSource,
    /// Cycles compared.
    pub samples: u64,
    /// Root mean square distance of the platform's origin, actual against desired, mm; none without samples, as the
    /// others.
    pub rms_mm: Option<f64>,
    /// Standard error of that figure, by its seconds, mm; none with less than three of them.
    pub rms_noise_mm: Option<f64>,
    /// Largest distance, mm.
    pub max_mm: Option<f64>,
    /// Root mean square angle, actual against desired, degrees.
    pub rms_deg: Option<f64>,
    /// Largest angle, degrees.
    pub max_deg: Option<f64>,
    /// Root mean square distance, estimated by forward kinematics against true, mm; none without truth.
    pub estimate_rms_mm: Option<f64>,
}

/// One cycle of the track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackingSample {
    /// When, ns.
    pub sampled_ns: u64,
    /// The desired pose.
    pub desired: Pose,
    /// The pose estimated by forward kinematics.
    pub estimated: Pose,
    /// The actual pose.
    pub actual: Pose,
}

/// The platform from the first easing to the last hold; times in seconds since the first sample.
#[derive(Debug, Clone, Default)]
pub struct Track {
    /// Cycles from the first on, as many as a screen shows; of a long run not to its end.
    pub samples: Vec<TrackingSample>,
    /// How long it went on, s.
    pub duration_s: f64,
    /// Desired displacement along x, y and z, from the first desired pose, m: lowest and highest of each stretch of time.
    pub desired_m: [Curve; 3],
    /// The same of the actual pose.
    pub actual_m: [Curve; 3],
    /// Largest distance from the desired position in each stretch of time, m.
    pub distance_m: Curve,
}

/// Indices of the displacements along x, y and z, desired and actual, and of the distance between the two.
const DESIRED: usize = 0;
const ACTUAL: usize = 3;
const DISTANCE: usize = 6;

/// Time between two samples of the track, ns: the 60 Hz of a screen.
const SAMPLE_NS: u64 = SECOND_NS / 60;
/// Samples of the track: half a minute.
const MOST_SAMPLES: usize = 2048;

/// Joins desired, estimated and, where there are any, true poses of the same sample.
#[derive(Debug, Default)]
pub(super) struct Tracking {
    source: PoseSource,
    /// By the plant's cycle, until the other of the two comes.
    states: ByCycle<State>,
    truths: ByCycle<Truth>,
    distances: Accumulator,
    angles: Accumulator,
    estimates: Accumulator,
    track: Vec<TrackingSample>,
    next_sample_ns: u64,
    /// When and where the motion began.
    began: Option<(u64, Pose)>,
    ended_ns: u64,
    /// Desired and actual displacement along x, y and z, and the distance between the two.
    moved_m: Series<Extremes<{ DISTANCE + 1 }>>,
    second: Accumulator,
    second_ends_ns: u64,
    seconds: Vec<f64>,
}

/// Root mean square and maximum of what is added.
#[derive(Debug, Default)]
pub struct Accumulator {
    samples: u64,
    squares: f64,
    /// The largest value.
    pub largest: f64,
}

impl Accumulator {
    /// Takes a value.
    pub fn add(&mut self, value: f64) {
        self.samples += 1;
        self.squares += value * value;
        self.largest = self.largest.max(value);
    }

    /// The root of the mean square; 0 without values.
    pub fn rms(&self) -> f64 {
        (self.squares / self.samples.max(1) as f64).sqrt()
    }
}

impl Tracking {
    pub(super) fn new(source: PoseSource) -> Self {
        Self { source, ..Self::default() }
    }

    /// The state of a cycle with a fresh reading: one used again was compared when it was fresh.
    pub(super) fn solution(&mut self, state: &State) {
        if self.source == PoseSource::Estimate {
            let estimated = pose_from_fields(state.estimated_position_m, state.estimated_quaternion_wxyz);
            return self.compare(state, state.sampled_ns, estimated);
        }
        match self.truths.take(state.reading_cycle) {
            Some(truth) => self.compare_with_truth(state, &truth),
            None => self.states.insert(state.reading_cycle, *state),
        }
    }

    pub(super) fn truth(&mut self, truth: &Truth) {
        match self.states.take(truth.cycle) {
            Some(state) => self.compare_with_truth(&state, truth),
            None => self.truths.insert(truth.cycle, *truth),
        }
    }

    fn compare_with_truth(&mut self, state: &State, truth: &Truth) {
        let actual = pose_from_fields(truth.position_m, truth.quaternion_wxyz);
        self.compare(state, truth.sampled_ns, actual);
    }

    fn compare(&mut self, state: &State, sampled_ns: u64, actual: Pose) {
        let desired = pose_from_fields(state.desired_position_m, state.desired_quaternion_wxyz);
        let estimated = pose_from_fields(state.estimated_position_m, state.estimated_quaternion_wxyz);
        let distance_m = (desired.translation.vector - actual.translation.vector).norm();
        if state.controller_state == ControllerState::Running.code() {
            self.distances.add(distance_m);
            self.angles.add(desired.rotation.angle_to(&actual.rotation));
            self.estimates.add((estimated.translation.vector - actual.translation.vector).norm());
            self.add_to_second(distance_m, sampled_ns);
        }
        if MOVING.iter().any(|moving| moving.code() == state.controller_state) {
            let (began_ns, began_at) = *self.began.get_or_insert((sampled_ns, desired));
            let stretch = self.moved_m.at(sampled_ns.saturating_sub(began_ns));
            stretch.take(DISTANCE, distance_m);
            for (first, pose) in [(DESIRED, &desired), (ACTUAL, &actual)] {
                let moved_m = pose.translation.vector - began_at.translation.vector;
                moved_m.iter().enumerate().for_each(|(axis, moved_m)| stretch.take(first + axis, *moved_m));
            }
            self.ended_ns = sampled_ns;
            if sampled_ns >= self.next_sample_ns && self.track.len() < MOST_SAMPLES {
                self.track.push(TrackingSample { sampled_ns, desired, estimated, actual });
                self.next_sample_ns = sampled_ns + SAMPLE_NS;
            }
        }
    }

    /// Seconds of the motion, each with an error of its own: how much they differ is the figure's noise.
    fn add_to_second(&mut self, distance_m: f64, sampled_ns: u64) {
        if sampled_ns >= self.second_ends_ns {
            if self.second.samples > 0 {
                self.seconds.push(self.second.rms() * 1e3);
            }
            self.second = Accumulator::default();
            self.second_ends_ns = sampled_ns + SECOND_NS;
        }
        self.second.add(distance_m);
    }

    pub(super) fn finish(self) -> (TrackingFigures, Track) {
        let samples = self.distances.samples;
        let compared = |value: f64| (samples > 0).then_some(value);
        let has_truth = self.source == PoseSource::Truth;
        let figures = TrackingFigures {
            actual_source: self.source,
            samples,
            rms_mm: compared(self.distances.rms() * 1e3),
            rms_noise_mm: standard_error(&self.seconds),
            max_mm: compared(self.distances.largest * 1e3),
            rms_deg: compared(self.angles.rms().to_degrees()),
            max_deg: compared(self.angles.largest.to_degrees()),
            estimate_rms_mm: compared(self.estimates.rms() * 1e3).filter(|_| has_truth),
        };
        let began_ns = self.began.map_or(self.ended_ns, |(began_ns, _)| began_ns);
        let bands = |first: usize| std::array::from_fn(|axis| self.moved_m.band(first + axis));
        let track = Track {
            duration_s: self.ended_ns.saturating_sub(began_ns) as f64 / 1e9,
            desired_m: bands(DESIRED),
            actual_m: bands(ACTUAL),
            distance_m: self.moved_m.highest(DISTANCE),
            samples: self.track,
        };
        (figures, track)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 1_000_000;

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
    fn without_truth_the_estimate_takes_its_place() {
        let mut tracking = Tracking::new(PoseSource::Estimate);
        tracking.solution(&State { estimated_position_m: [0.001, 0.0, 0.0], ..state(1, 0.003) });
        let (figures, track) = tracking.finish();
        assert_eq!((figures.samples, figures.estimate_rms_mm), (1, None));
        assert!((figures.rms_mm.unwrap() - 2.0).abs() < 1e-9);
        assert!((track.samples[0].actual.translation.x - 0.001).abs() < 1e-12);
    }

    #[test]
    fn a_platform_that_never_ran_has_no_tracking_error() {
        let mut tracking = Tracking::new(PoseSource::Truth);
        tracking.solution(&State { controller_state: ControllerState::Easing.code(), ..state(1, 0.0) });
        tracking.truth(&truth(1, 0.0));
        let (figures, _) = tracking.finish();
        assert_eq!(figures, TrackingFigures::default());
        assert_eq!((figures.rms_mm, figures.estimate_rms_mm), (None, None));
    }

    #[test]
    fn a_long_run_keeps_every_turn_of_its_motion_and_close_samples_of_its_beginning() {
        let mut tracking = Tracking::new(PoseSource::Truth);
        for cycle in 0..100_000 {
            // To and fro in 0.7 s, as fast as chewing.
            let x = (cycle as f64 / 700.0 * std::f64::consts::TAU).sin();
            tracking.solution(&state(cycle, x));
            tracking.truth(&Truth { sampled_ns: cycle * PERIOD_NS, ..truth(cycle, x) });
        }
        let (_, track) = tracking.finish();
        let reach = track.actual_m[0].iter().map(|(_, x)| *x);
        assert!(reach.clone().filter(|x| *x > 0.99).count() > 140 && reach.fold(0.0, f64::min) < -0.99);
        assert!((track.duration_s - 99.999).abs() < 1e-9);
        assert!(
            track
                .samples
                .windows(2)
                .all(|pair| pair[1].sampled_ns - pair[0].sampled_ns <= SAMPLE_NS + PERIOD_NS)
        );
        assert_eq!(track.samples[0].sampled_ns, 0);
    }

    #[test]
    fn poses_are_compared_by_cycle_in_whatever_order_they_come() {
        let mut tracking = Tracking::new(PoseSource::Truth);
        tracking.solution(&state(1, 0.003));
        tracking.solution(&state(2, 0.000));
        tracking.truth(&truth(2, 0.004));
        tracking.truth(&truth(1, 0.000));
        tracking.truth(&truth(3, 9.000));
        let (figures, _) = tracking.finish();
        assert_eq!(figures.samples, 2);
        assert!((figures.max_mm.unwrap() - 4.0).abs() < 1e-9);
        assert!((figures.rms_mm.unwrap() - (12.5f64).sqrt()).abs() < 1e-9);
    }
}
