//! Distance of the platform from its desired pose. The actual pose is the true one where the mechanism is emulated,
//! and forward kinematics' estimate on the robot, whose true pose is unknown.

use masseter_shared::clock::SECOND_NS;
use masseter_shared::geometry::{Deviation, Pose};
use masseter_shared::messages::codes::ControllerState;
use masseter_shared::messages::{State, Truth, pose_from_fields};
use serde::Serialize;

use super::by_cycle::ByCycle;
use super::noise::standard_error;
use super::pose_errors::{Accumulator, PoseErrorSums, PoseErrors};
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
    /// Errors of the actual pose against the desired one.
    #[serde(flatten)]
    pub actual: PoseErrors,
    /// Standard error of `rms_mm`, by its seconds, mm; none with less than three of them.
    pub rms_noise_mm: Option<f64>,
    /// Errors of the pose estimated by forward kinematics against the desired one.
    pub estimated: PoseErrors,
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

/// The state of a cycle, and its sample.
#[derive(Debug, Clone, Copy)]
struct Sample {
    state: State,
    /// Of the plant.
    cycle: u64,
    /// Whether the state is the first to use its reading.
    is_fresh: bool,
    /// Whether the platform had a desired pose, also in the cycle that ended the motion.
    is_on_path: bool,
}

/// A cycle's distance from the desired path, by the actual pose.
#[derive(Debug, Clone, Copy)]
pub(super) struct PathSample {
    pub(super) sampled_ns: u64,
    pub(super) deviation: Deviation,
}

/// Joins desired, estimated and, where there are any, true poses of the same sample.
#[derive(Debug, Default)]
pub(super) struct Tracking {
    source: PoseSource,
    /// The incisal point in the platform frame.
    incisal_m: [f64; 3],
    /// By the controller's cycle, until their truths come.
    waiting: ByCycle<Sample>,
    truths: ByCycle<Truth>,
    was_moving: bool,
    actual: PoseErrorSums,
    estimated: PoseErrorSums,
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

impl Tracking {
    pub(super) fn new(source: PoseSource, incisal_m: [f64; 3]) -> Self {
        Self { source, incisal_m, ..Self::default() }
    }

    /// The state of a cycle. In one without a fresh reading, the desired pose is that of the sample that failed to come.
    pub(super) fn state(&mut self, state: &State, is_fresh: bool) -> Option<PathSample> {
        let is_moving = is_moving(state);
        let is_on_path = is_moving || self.was_moving;
        self.was_moving = is_moving;
        let cycle = if is_fresh { state.reading_cycle } else { state.cycle.saturating_sub(1) };
        let sample = Sample { state: *state, cycle, is_fresh, is_on_path };
        if self.source == PoseSource::Estimate {
            let estimated = pose_from_fields(state.estimated_position_m, state.estimated_quaternion_wxyz);
            return is_fresh.then(|| self.compare(&sample, state.sampled_ns, estimated)).flatten();
        }
        let Some(truth) = self.truths.get(cycle) else {
            self.waiting.insert(state.cycle, sample);
            return None;
        };
        self.compare_with_truth(&sample, &truth)
    }

    /// The true pose of a sample, with the states that wait for it: its own cycle's and its neighbours'.
    pub(super) fn truth(&mut self, truth: &Truth) -> [Option<PathSample>; 3] {
        self.truths.insert(truth.cycle, *truth);
        let cycles = [truth.cycle.saturating_sub(1), truth.cycle, truth.cycle + 1];
        cycles.map(|cycle| {
            self.waiting.get(cycle).filter(|sample| sample.cycle == truth.cycle)?;
            let sample = self.waiting.take(cycle)?;
            self.compare_with_truth(&sample, truth)
        })
    }

    fn compare_with_truth(&mut self, sample: &Sample, truth: &Truth) -> Option<PathSample> {
        let actual = pose_from_fields(truth.position_m, truth.quaternion_wxyz);
        self.compare(sample, truth.sampled_ns, actual)
    }

    /// The deviation from the path, where there is one.
    fn compare(&mut self, sample: &Sample, sampled_ns: u64, actual: Pose) -> Option<PathSample> {
        let Sample { state, is_fresh, is_on_path, .. } = sample;
        let desired = pose_from_fields(state.desired_position_m, state.desired_quaternion_wxyz);
        let deviation = Deviation::between(&desired, &actual, self.incisal_m);
        if is_moving(state) {
            self.actual.peak(&deviation);
            if *is_fresh {
                self.solution(state, sampled_ns, desired, actual, &deviation);
            }
        }
        is_on_path.then_some(PathSample { sampled_ns, deviation })
    }

    /// A cycle with an estimate of its own.
    fn solution(
        &mut self,
        state: &State,
        sampled_ns: u64,
        desired: Pose,
        actual: Pose,
        deviation: &Deviation,
    ) {
        let estimated = pose_from_fields(state.estimated_position_m, state.estimated_quaternion_wxyz);
        let estimate = Deviation::between(&desired, &estimated, self.incisal_m);
        self.estimated.peak(&estimate);
        if state.controller_state == ControllerState::Running.code() {
            self.actual.add(deviation);
            self.estimated.add(&estimate);
            self.estimates.add((estimated.translation.vector - actual.translation.vector).norm());
            self.add_to_second(deviation.origin_m, sampled_ns);
        }
        let (began_ns, began_at) = *self.began.get_or_insert((sampled_ns, desired));
        let stretch = self.moved_m.at(sampled_ns.saturating_sub(began_ns));
        stretch.take(DISTANCE, deviation.origin_m);
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
        let samples = self.actual.samples();
        let has_truth = self.source == PoseSource::Truth;
        let figures = TrackingFigures {
            actual_source: self.source,
            samples,
            actual: self.actual.finish(),
            rms_noise_mm: standard_error(&self.seconds),
            estimated: self.estimated.finish(),
            estimate_rms_mm: (samples > 0 && has_truth).then(|| self.estimates.rms() * 1e3),
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

fn is_moving(state: &State) -> bool {
    MOVING.iter().any(|moving| moving.code() == state.controller_state)
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
        let mut tracking = Tracking::new(PoseSource::Estimate, [0.0; 3]);
        tracking.state(&State { estimated_position_m: [0.001, 0.0, 0.0], ..state(1, 0.003) }, true);
        let (figures, track) = tracking.finish();
        assert_eq!((figures.samples, figures.estimate_rms_mm), (1, None));
        assert!((figures.actual.rms_mm.unwrap() - 2.0).abs() < 1e-9);
        assert!((track.samples[0].actual.translation.x - 0.001).abs() < 1e-12);
    }

    #[test]
    fn a_platform_that_never_ran_has_no_tracking_error() {
        let mut tracking = Tracking::new(PoseSource::Truth, [0.0; 3]);
        tracking.state(&State { controller_state: ControllerState::Easing.code(), ..state(1, 0.0) }, true);
        tracking.truth(&truth(1, 0.0));
        let (figures, _) = tracking.finish();
        assert_eq!(figures, TrackingFigures::default());
        assert_eq!((figures.actual.rms_mm, figures.estimate_rms_mm), (None, None));
    }

    #[test]
    fn a_long_run_keeps_every_turn_of_its_motion_and_close_samples_of_its_beginning() {
        let mut tracking = Tracking::new(PoseSource::Truth, [0.0; 3]);
        for cycle in 0..100_000 {
            // To and fro in 0.7 s, as fast as chewing.
            let x = (cycle as f64 / 700.0 * std::f64::consts::TAU).sin();
            tracking.state(&state(cycle, x), true);
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
        let mut tracking = Tracking::new(PoseSource::Truth, [0.0; 3]);
        tracking.state(&state(1, 0.003), true);
        tracking.state(&state(2, 0.000), true);
        tracking.truth(&truth(2, 0.004));
        tracking.truth(&truth(1, 0.000));
        tracking.truth(&truth(3, 9.000));
        let (figures, _) = tracking.finish();
        assert_eq!(figures.samples, 2);
        assert!((figures.actual.max_mm.unwrap() - 4.0).abs() < 1e-9);
        assert!((figures.actual.rms_mm.unwrap() - (12.5f64).sqrt()).abs() < 1e-9);
    }

    /// Cycle 3 has no reading of sample 2, and the motion ends with cycle 4.
    #[test]
    fn cycles_without_a_reading_and_the_last_one_have_a_deviation_too() {
        let mut tracking = Tracking::new(PoseSource::Truth, [0.0; 3]);
        let stale = State { reading_cycle: 1, ..state(3, 0.0) };
        let stopped =
            |cycle| State { controller_state: ControllerState::SafeStop.code(), ..state(cycle, 0.0) };
        let mut deviations = Vec::new();
        let found = [
            tracking.state(&state(1, 0.0), true),
            tracking.state(&stale, false),
            tracking.state(&stopped(4), true),
            tracking.state(&stopped(5), true),
        ];
        assert!(found.iter().all(Option::is_none), "{found:?}");
        for (cycle, x) in [(1, 0.001), (2, 0.003), (4, 0.004), (5, 0.005)] {
            deviations.extend(tracking.truth(&truth(cycle, x)).into_iter().flatten());
        }
        let deviations: Vec<_> = deviations.iter().map(|sample| sample.deviation.origin_m).collect();
        assert_eq!(deviations, [0.001, 0.003, 0.004]);
        let (figures, _) = tracking.finish();
        assert_eq!((figures.samples, figures.actual.max_mm), (1, Some(3.0)));
        assert!((figures.actual.rms_mm.unwrap() - 1.0).abs() < 1e-12);
    }
}
