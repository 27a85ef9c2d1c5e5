//! Distance of the platform from its desired pose. The actual pose is the true one where the mechanism is emulated,
//! and forward kinematics' estimate on the robot, whose true pose is unknown.

use masseter_model::geometry::{Deviation, Pose};
use masseter_runtime::clock::SECOND_NS;
use masseter_runtime::messages::codes::ControllerState;
use masseter_runtime::messages::{State, Truth};
use serde::Serialize;

use super::by_cycle::ByCycle;
use super::noise::standard_error;
use super::pose_errors::{Accumulator, PoseErrorSums, PoseErrors, deviation, pose};

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
    /// The same without the time in which a lost cycle may have acted on the jaw.
    pub undisturbed: UndisturbedFigures,
}

/// Errors of the platform's pose where no lost cycle may have acted on the jaw.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct UndisturbedFigures {
    /// Cycles compared.
    pub samples: u64,
    /// Errors of the actual pose against the desired one.
    #[serde(flatten)]
    pub actual: PoseErrors,
    /// Errors of the pose estimated by forward kinematics against the desired one.
    pub estimated: PoseErrors,
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

/// The platform from the first easing to the last hold, or to the standstill of a safe stop. From the stop on, its desired
/// pose is the last one.
#[derive(Debug, Clone, Default)]
pub struct Track {
    /// Cycles from the first to the last, as many as a screen shows; fewer of a long run.
    pub samples: Vec<TrackingSample>,
}

/// Time between two samples of the track at first, ns: the 60 Hz of a screen.
const SAMPLE_NS: u64 = SECOND_NS / 60;
/// Most samples of the track: of more than half a minute every second, fourth … sample stays.
const MOST_SAMPLES: usize = 2048;

/// Whether the platform has a desired pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum OnPath {
    Moving,
    /// Only because this cycle ended the motion.
    End,
    Off,
}

/// The state of a cycle, and its sample.
#[derive(Debug, Clone, Copy)]
struct Sample {
    state: State,
    /// Of the plant.
    cycle: u64,
    /// Whether the state is the first to use its reading.
    is_fresh: bool,
    on_path: OnPath,
    /// Whether a lost cycle may have acted on the jaw.
    is_disturbed: bool,
}

/// A cycle's desired pose, and the actual pose's distance from it.
#[derive(Debug, Clone, Copy)]
pub(super) struct PathSample {
    pub(super) sampled_ns: u64,
    pub(super) desired: Option<Pose>,
    pub(super) deviation: Deviation,
}

/// Joins desired, estimated and, where there are any, true poses of the same sample.
#[derive(Debug, Clone, Default)]
pub(super) struct Tracking {
    source: PoseSource,
    /// The incisal point in the platform frame.
    incisal_m: [f64; 3],
    /// By the controller's cycle, until their truths come.
    waiting: ByCycle<Sample>,
    /// Time and pose of the truths, by the plant's cycle.
    truths: ByCycle<(u64, Option<Pose>)>,
    was_moving: bool,
    /// The plant's cycle in which the drives were stopped: no desired pose counts any more.
    stopped: Option<u64>,
    actual: PoseErrorSums,
    estimated: PoseErrorSums,
    undisturbed_actual: PoseErrorSums,
    undisturbed_estimated: PoseErrorSums,
    estimates: Accumulator,
    track: Vec<TrackingSample>,
    next_sample_ns: u64,
    /// How often the time between two samples of the track has doubled.
    halvings: u32,
    /// The last one before a stop.
    desired: Option<Pose>,
    second: Accumulator,
    second_ends_ns: u64,
    seconds: Vec<f64>,
}

impl Tracking {
    pub(super) fn new(source: PoseSource, incisal_m: [f64; 3]) -> Self {
        Self { source, incisal_m, ..Self::default() }
    }

    /// The drives are stopped at the sample of this cycle of the plant.
    pub(super) fn stop(&mut self, cycle: u64) {
        self.stopped.get_or_insert(cycle);
    }

    /// The state of a cycle. In one without a fresh reading, the desired pose is that of the sample that failed to come.
    /// `is_disturbed`: a lost cycle may have acted on the jaw.
    pub(super) fn state(&mut self, state: &State, is_fresh: bool, is_disturbed: bool) -> Option<PathSample> {
        let cycle = if is_fresh { state.reading_cycle } else { state.cycle.saturating_sub(1) };
        let is_moving = is_moving(state) && self.stopped.is_none_or(|stopped| cycle < stopped);
        let on_path = match std::mem::replace(&mut self.was_moving, is_moving) {
            _ if is_moving => OnPath::Moving,
            true => OnPath::End,
            false => OnPath::Off,
        };
        let sample = Sample { state: *state, cycle, is_fresh, on_path, is_disturbed };
        if self.source == PoseSource::Estimate {
            let estimated = pose(state.estimated_position_m, state.estimated_quaternion_wxyz);
            return is_fresh.then(|| self.compare(&sample, state.sampled_ns, estimated)).flatten();
        }
        let Some(&(sampled_ns, actual)) = self.truths.get(cycle) else {
            self.waiting.insert(state.cycle, sample);
            return None;
        };
        self.compare(&sample, sampled_ns, actual)
    }

    /// The true pose of a sample, with the states that wait for it: its own cycle's and its neighbours'.
    pub(super) fn truth(&mut self, truth: &Truth) -> [Option<PathSample>; 3] {
        let actual = pose(truth.position_m, truth.quaternion_wxyz);
        self.truths.insert(truth.cycle, (truth.sampled_ns, actual));
        let cycles = [truth.cycle.saturating_sub(1), truth.cycle, truth.cycle + 1];
        cycles.map(|cycle| {
            self.waiting.get(cycle).filter(|sample| sample.cycle == truth.cycle)?;
            let sample = self.waiting.take(cycle)?;
            self.compare(&sample, truth.sampled_ns, actual)
        })
    }

    /// The deviation from the path, where there is one.
    fn compare(&mut self, sample: &Sample, sampled_ns: u64, actual: Option<Pose>) -> Option<PathSample> {
        let Sample { state, is_fresh, on_path, is_disturbed, .. } = sample;
        let is_on_path = *on_path != OnPath::Off;
        let desired = pose(state.desired_position_m, state.desired_quaternion_wxyz);
        let error = deviation(desired.as_ref(), actual.as_ref(), self.incisal_m);
        if is_on_path {
            self.desired = desired;
            self.actual.peak(&error);
            if !is_disturbed {
                self.undisturbed_actual.peak(&error);
            }
        }
        if *on_path == OnPath::Moving && *is_fresh {
            self.solution(sample, sampled_ns, desired, actual, &error);
        }
        if *is_fresh && (is_moving(state) || state.controller_state == ControllerState::SafeStop.code()) {
            let estimated = pose(state.estimated_position_m, state.estimated_quaternion_wxyz);
            self.draw(sampled_ns, [self.desired, estimated, actual]);
        }
        is_on_path.then_some(PathSample { sampled_ns, desired, deviation: error })
    }

    /// A cycle with an estimate of its own.
    fn solution(
        &mut self,
        Sample { state, is_disturbed, .. }: &Sample,
        sampled_ns: u64,
        desired: Option<Pose>,
        actual: Option<Pose>,
        error: &Deviation,
    ) {
        let estimated = pose(state.estimated_position_m, state.estimated_quaternion_wxyz);
        let to_estimate = |from: Option<Pose>| deviation(from.as_ref(), estimated.as_ref(), self.incisal_m);
        let (estimate, estimate_error) = (to_estimate(desired), to_estimate(actual));
        let is_running = state.controller_state == ControllerState::Running.code();
        self.estimated.peak(&estimate);
        if !is_disturbed {
            self.undisturbed_estimated.peak(&estimate);
        }
        if is_running && !is_disturbed {
            self.undisturbed_actual.add(error);
            self.undisturbed_estimated.add(&estimate);
        }
        if is_running {
            self.actual.add(error);
            self.estimated.add(&estimate);
            self.estimates.add(estimate_error.origin_m);
            self.add_to_second(error.origin_m, sampled_ns);
        }
    }

    /// Takes a sample with a desired, an estimated and an actual pose into the track.
    fn draw(&mut self, sampled_ns: u64, poses: [Option<Pose>; 3]) {
        let [Some(desired), Some(estimated), Some(actual)] = poses else { return };
        if sampled_ns < self.next_sample_ns {
            return;
        }
        if self.track.len() == MOST_SAMPLES {
            let mut place = 0..;
            self.track.retain(|_| place.next().is_some_and(|place| place % 2 == 0));
            self.halvings += 1;
        }
        self.track.push(TrackingSample { sampled_ns, desired, estimated, actual });
        self.next_sample_ns = sampled_ns + (SAMPLE_NS << self.halvings);
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
            undisturbed: UndisturbedFigures {
                samples: self.undisturbed_actual.samples(),
                actual: self.undisturbed_actual.finish(),
                estimated: self.undisturbed_estimated.finish(),
            },
        };
        (figures, Track { samples: self.track })
    }
}

pub(super) fn is_moving(state: &State) -> bool {
    MOVING.iter().any(|moving| moving.code() == state.controller_state)
}

#[cfg(test)]
mod tests;
