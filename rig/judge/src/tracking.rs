//! Distance of the platform from its desired pose. The actual pose is the true one where the mechanism is emulated,
//! and forward kinematics' estimate on the robot, whose true pose is unknown. A pose with a value that is no number
//! is infinitely far.

use masseter_model::geometry::{Deviation, Pose};
use masseter_runtime::clock::SECOND_NS;
use masseter_runtime::messages::codes::ControllerState;
use masseter_runtime::messages::{State, Truth, pose_from_fields};
use serde::Serialize;

use crate::measured::standard_error;
use crate::series::ByCycle;

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
    errors: Errors,
    undisturbed: Errors,
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
    pub(super) fn apply_state(
        &mut self,
        state: &State,
        is_fresh: bool,
        is_disturbed: bool,
    ) -> Option<PathSample> {
        let cycle = if is_fresh { state.reading_cycle } else { state.cycle.saturating_sub(1) };
        let is_moving = is_moving(state) && self.stopped.is_none_or(|stopped| cycle < stopped);
        let on_path = match std::mem::replace(&mut self.was_moving, is_moving) {
            _ if is_moving => OnPath::Moving,
            true => OnPath::End,
            false => OnPath::Off,
        };
        let sample = Sample { state: *state, cycle, is_fresh, on_path, is_disturbed };
        if self.source == PoseSource::Estimate {
            return is_fresh
                .then(|| self.compare(&sample, state.sampled_ns, estimated_pose(state)))
                .flatten();
        }
        let Some(&(sampled_ns, actual)) = self.truths.get(cycle) else {
            self.waiting.insert(state.cycle, sample);
            return None;
        };
        self.compare(&sample, sampled_ns, actual)
    }

    /// The true pose of a sample, with the states that wait for it: its own cycle's and its neighbours'.
    pub(super) fn apply_truth(&mut self, truth: &Truth) -> [Option<PathSample>; 3] {
        let actual = true_pose(truth);
        self.truths.insert(truth.cycle, (truth.sampled_ns, actual));
        let cycles = [truth.cycle.saturating_sub(1), truth.cycle, truth.cycle + 1];
        cycles.map(|cycle| {
            self.waiting.get(cycle).filter(|sample| sample.cycle == truth.cycle)?;
            let sample = self.waiting.remove(cycle)?;
            self.compare(&sample, truth.sampled_ns, actual)
        })
    }

    /// The deviation from the path, where there is one.
    fn compare(&mut self, sample: &Sample, sampled_ns: u64, actual: Option<Pose>) -> Option<PathSample> {
        let Sample { ref state, is_fresh, on_path, is_disturbed, .. } = *sample;
        let is_on_path = on_path != OnPath::Off;
        let (desired, estimated) = (desired_pose(state), estimated_pose(state));
        let error = deviation(desired.as_ref(), actual.as_ref(), self.incisal_m);
        if is_on_path {
            self.desired = desired;
            self.errors(is_disturbed).for_each(|errors| errors.actual.peak(&error));
        }
        if on_path == OnPath::Moving && is_fresh {
            let to_estimate =
                |from: Option<Pose>| deviation(from.as_ref(), estimated.as_ref(), self.incisal_m);
            let (estimate, estimate_error) = (to_estimate(desired), to_estimate(actual));
            self.errors(is_disturbed).for_each(|errors| errors.estimated.peak(&estimate));
            if is_running(state) {
                self.errors(is_disturbed).for_each(|errors| errors.add(&error, &estimate));
                self.estimates.add(estimate_error.origin_m);
                self.add_to_second(error.origin_m, sampled_ns);
            }
        }
        if is_fresh && (is_moving(state) || state.controller_state == ControllerState::SafeStop.code()) {
            self.draw(sampled_ns, [self.desired, estimated, actual]);
        }
        is_on_path.then_some(PathSample { sampled_ns, desired, deviation: error })
    }

    /// What a cycle counts for: all errors, and the undisturbed ones unless a lost cycle may have acted on the jaw.
    fn errors(&mut self, is_disturbed: bool) -> impl Iterator<Item = &mut Errors> {
        let undisturbed = (!is_disturbed).then_some(&mut self.undisturbed);
        [&mut self.errors].into_iter().chain(undisturbed)
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

    pub(super) fn into_figures(self) -> (TrackingFigures, Track) {
        let UndisturbedFigures { samples, actual, estimated } = self.errors.figures();
        let has_truth = self.source == PoseSource::Truth;
        let figures = TrackingFigures {
            actual_source: self.source,
            samples,
            actual,
            rms_noise_mm: standard_error(&self.seconds),
            estimated,
            estimate_rms_mm: (samples > 0 && has_truth).then(|| self.estimates.rms() * 1e3),
            undisturbed: self.undisturbed.figures(),
        };
        (figures, Track { samples: self.track })
    }
}

pub(super) fn is_moving(state: &State) -> bool {
    MOVING.iter().any(|moving| moving.code() == state.controller_state)
}

pub(super) fn is_running(state: &State) -> bool {
    state.controller_state == ControllerState::Running.code()
}

pub(super) fn desired_pose(state: &State) -> Option<Pose> {
    pose(state.desired_position_m, state.desired_quaternion_wxyz)
}

pub(super) fn estimated_pose(state: &State) -> Option<Pose> {
    pose(state.estimated_position_m, state.estimated_quaternion_wxyz)
}

pub(super) fn true_pose(truth: &Truth) -> Option<Pose> {
    pose(truth.position_m, truth.quaternion_wxyz)
}

/// A quaternion's length may differ from 1 by so much: single precision and more.
const LENGTH_TOLERANCE: f64 = 1e-3;

/// The pose in a message; none where a number is not finite or the quaternion is no rotation.
fn pose(position_m: [f64; 3], quaternion_wxyz: [f64; 4]) -> Option<Pose> {
    let length = quaternion_wxyz.iter().map(|part| part * part).sum::<f64>().sqrt();
    let is_pose = position_m.iter().all(|x| x.is_finite()) && (length - 1.0).abs() <= LENGTH_TOLERANCE;
    is_pose.then(|| pose_from_fields(position_m, quaternion_wxyz))
}

/// How far two poses are apart.
pub(super) fn deviation(a: Option<&Pose>, b: Option<&Pose>, incisal_m: [f64; 3]) -> Deviation {
    const NOWHERE: Deviation =
        Deviation { origin_m: f64::INFINITY, incisal_m: f64::INFINITY, angle_rad: f64::INFINITY };
    a.zip(b).map_or(NOWHERE, |(a, b)| Deviation::between(a, b, incisal_m))
}

/// The worse of two errors; what is no number is infinite.
pub(super) fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::INFINITY } else { a.max(b) }
}

/// Errors of a pose while the motion played; none without samples. The peaks also count the moves to its beginning, the
/// hold at its end, the sample at which a safe stop began, and cycles without a fresh reading.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct PoseErrors {
    /// Root mean square distance of the platform's origin, mm.
    pub rms_mm: Option<f64>,
    /// Largest distance, mm.
    pub max_mm: Option<f64>,
    /// Root mean square distance of the incisal point, mm.
    pub incisal_rms_mm: Option<f64>,
    /// Largest distance, mm.
    pub incisal_max_mm: Option<f64>,
    /// Root mean square angle, degrees.
    pub rms_deg: Option<f64>,
    /// Largest angle, degrees.
    pub max_deg: Option<f64>,
}

/// Root mean square and maximum of what is added.
#[derive(Debug, Clone, Default)]
struct Accumulator {
    samples: u64,
    squares: f64,
    largest: Option<f64>,
}

impl Accumulator {
    /// Takes a value.
    fn add(&mut self, value: f64) {
        self.samples += 1;
        self.squares += worse(value, 0.0).powi(2);
        self.peak(value);
    }

    /// Takes a value that counts for the maximum alone.
    fn peak(&mut self, value: f64) {
        self.largest = Some(worse(self.largest.unwrap_or(0.0), value));
    }

    /// The root of the mean square; 0 without values.
    fn rms(&self) -> f64 {
        (self.squares / self.samples.max(1) as f64).sqrt()
    }
}

/// Errors of the actual and of the estimated pose against the desired one.
#[derive(Debug, Clone, Default)]
struct Errors {
    actual: PoseErrorSums,
    estimated: PoseErrorSums,
}

impl Errors {
    fn add(&mut self, actual: &Deviation, estimated: &Deviation) {
        self.actual.add(actual);
        self.estimated.add(estimated);
    }

    fn figures(&self) -> UndisturbedFigures {
        let (actual, estimated) = (self.actual.figures(), self.estimated.figures());
        UndisturbedFigures { samples: self.actual.origin.samples, actual, estimated }
    }
}

/// Collects [`PoseErrors`].
#[derive(Debug, Clone, Default)]
struct PoseErrorSums {
    origin: Accumulator,
    incisal: Accumulator,
    angle: Accumulator,
}

impl PoseErrorSums {
    fn add(&mut self, deviation: &Deviation) {
        self.each(deviation, Accumulator::add);
    }

    fn peak(&mut self, deviation: &Deviation) {
        self.each(deviation, Accumulator::peak);
    }

    fn each(&mut self, deviation: &Deviation, take: fn(&mut Accumulator, f64)) {
        take(&mut self.origin, deviation.origin_m * 1e3);
        take(&mut self.incisal, deviation.incisal_m * 1e3);
        take(&mut self.angle, deviation.angle_rad.to_degrees());
    }

    fn figures(&self) -> PoseErrors {
        let rms = |sum: &Accumulator| (sum.samples > 0).then(|| sum.rms());
        PoseErrors {
            rms_mm: rms(&self.origin),
            max_mm: self.origin.largest,
            incisal_rms_mm: rms(&self.incisal),
            incisal_max_mm: self.incisal.largest,
            rms_deg: rms(&self.angle),
            max_deg: self.angle.largest,
        }
    }
}

#[cfg(test)]
mod tests;
