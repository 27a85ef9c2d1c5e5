//! Distance of the platform from its desired pose. The actual pose is the true one where the mechanism is emulated,
//! and forward kinematics' estimate on the robot, whose true pose is unknown.

use masseter_model::geometry::{Deviation, Pose};
use masseter_runtime::{clock::SECOND_NS, messages::codes::ControllerState};
use serde::Serialize;

use crate::poses::{desired_pose, deviation, estimated_pose, is_moving, is_running, true_pose, worse};
use crate::{measured::standard_error, signals::Sample, statistic::Sums};

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
    /// Those of them in which the controller stated no desired pose, but other numbers.
    #[serde(skip)]
    pub without_pose: u64,
    /// When that was first, ns of the run's clock.
    #[serde(skip)]
    pub without_pose_ns: Option<u64>,
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

/// A cycle's desired pose, and the actual pose's distance from it.
#[derive(Debug, Clone, Copy)]
pub(super) struct PathSample {
    pub(super) sampled_ns: u64,
    pub(super) desired: Option<Pose>,
    pub(super) actual: Option<Pose>,
    pub(super) deviation: Deviation,
}

/// Compares desired, estimated and, where there are any, true poses of the same sample.
#[derive(Debug, Clone, Default)]
pub(super) struct Tracking {
    /// The incisal point in the platform frame.
    incisal_m: [f64; 3],
    was_moving: bool,
    /// The plant's cycle in which the drives were stopped: no desired pose counts any more.
    stopped: Option<u64>,
    errors: Errors,
    undisturbed: Errors,
    estimates: Sums,
    figures: TrackingFigures,
    track: Vec<TrackingSample>,
    next_sample_ns: u64,
    /// How often the time between two samples of the track has doubled.
    halvings: u32,
    second: Sums,
    second_ends_ns: u64,
    seconds: Vec<f64>,
}

impl Tracking {
    pub(super) fn new(source: PoseSource, incisal_m: [f64; 3]) -> Self {
        let figures = TrackingFigures { actual_source: source, ..TrackingFigures::default() };
        Self { incisal_m, figures, ..Self::default() }
    }

    /// The drives are stopped at the sample of this cycle of the plant.
    pub(super) fn stop(&mut self, cycle: u64) {
        self.stopped.get_or_insert(cycle);
    }

    /// The deviation from the path in a cycle, where there is one. Every cycle with an actual pose counts, also one whose
    /// sample the controller did not use.
    pub(super) fn add_sample(&mut self, sample: &Sample) -> Option<PathSample> {
        let (messages, sampled_ns) = (&sample.messages, sample.time_ns);
        let state = messages.controller_state;
        // Nor may the jaw leave its path while a controller puts off its motion.
        let is_moving = (is_moving(state) || messages.is_awaited)
            && self.stopped.is_none_or(|stopped| messages.cycle < stopped);
        let on_path = match std::mem::replace(&mut self.was_moving, is_moving) {
            _ if is_moving => OnPath::Moving,
            true => OnPath::End,
            false => OnPath::Off,
        };
        let (desired, is_disturbed, is_used) =
            (messages.desired, messages.is_disturbed, messages.solution.is_some());
        let estimated = messages.solution.as_ref().and_then(estimated_pose);
        let actual = match self.figures.actual_source {
            PoseSource::Truth => true_pose(messages.truth.as_ref()?),
            PoseSource::Estimate if is_used => estimated,
            PoseSource::Estimate => return None,
        };
        let error = deviation(desired.as_ref(), actual.as_ref(), self.incisal_m);
        let is_counted = on_path == OnPath::Moving && is_running(state);
        let take = if is_counted { Sums::add } else { Sums::peak };
        if is_counted {
            self.add_to_second(error.origin_m, sampled_ns);
        }
        if on_path != OnPath::Off {
            self.errors(is_disturbed).for_each(|errors| errors.actual.each(&error, take));
        }
        if on_path == OnPath::Moving && is_used {
            let solution = messages
                .solution
                .as_ref()
                .filter(|state| crate::poses::is_moving(Some(state.controller_state)));
            if solution.is_some_and(|state| desired_pose(state).is_none()) {
                self.figures.without_pose += 1;
                self.figures.without_pose_ns.get_or_insert(sampled_ns);
            }
            let estimate = deviation(desired.as_ref(), estimated.as_ref(), self.incisal_m);
            self.errors(is_disturbed).for_each(|errors| errors.estimated.each(&estimate, take));
            if is_counted {
                let apart = deviation(actual.as_ref(), estimated.as_ref(), self.incisal_m);
                self.estimates.add(worse(apart.origin_m, 0.0));
            }
        }
        if is_used && (is_moving || state == Some(ControllerState::SafeStop.code())) {
            self.draw(sampled_ns, [desired, estimated, actual]);
        }
        (on_path != OnPath::Off).then_some(PathSample { sampled_ns, desired, actual, deviation: error })
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
            self.second = Sums::default();
            self.second_ends_ns = sampled_ns + SECOND_NS;
        }
        self.second.add(worse(distance_m, 0.0));
    }

    pub(super) fn into_figures(self) -> (TrackingFigures, Vec<TrackingSample>) {
        let UndisturbedFigures { samples, actual, estimated } = self.errors.figures();
        let has_truth = self.figures.actual_source.is_truth();
        let figures = TrackingFigures {
            samples,
            actual,
            rms_noise_mm: standard_error(&self.seconds),
            estimated,
            estimate_rms_mm: (self.estimates.samples > 0 && has_truth).then(|| self.estimates.rms() * 1e3),
            undisturbed: self.undisturbed.figures(),
            ..self.figures
        };
        (figures, self.track)
    }
}

/// Errors of a pose while the motion played; none without samples. The peaks also count the moves to its beginning, the
/// hold at its end, the sample at which a safe stop began, and cycles without a fresh reading.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct PoseErrors {
    /// Cycles compared.
    #[serde(skip)]
    pub samples: u64,
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

/// Errors of the actual and of the estimated pose against the desired one.
#[derive(Debug, Clone, Default)]
struct Errors {
    actual: PoseErrorSums,
    estimated: PoseErrorSums,
}

impl Errors {
    fn figures(&self) -> UndisturbedFigures {
        let (actual, estimated) = (self.actual.figures(), self.estimated.figures());
        UndisturbedFigures { samples: self.actual.origin.samples, actual, estimated }
    }
}

/// Collects [`PoseErrors`].
#[derive(Debug, Clone, Default)]
struct PoseErrorSums {
    origin: Sums,
    incisal: Sums,
    angle: Sums,
}

impl PoseErrorSums {
    /// What is no number is infinitely far.
    fn each(&mut self, deviation: &Deviation, take: fn(&mut Sums, f64)) {
        take(&mut self.origin, worse(deviation.origin_m * 1e3, 0.0));
        take(&mut self.incisal, worse(deviation.incisal_m * 1e3, 0.0));
        take(&mut self.angle, worse(deviation.angle_rad.to_degrees(), 0.0));
    }

    fn figures(&self) -> PoseErrors {
        let rms = |sums: &Sums| Some(sums.rms()).filter(|_| sums.samples > 0);
        let max = |sums: &Sums| sums.range.map(|[_, most]| most);
        PoseErrors {
            samples: self.origin.samples,
            rms_mm: rms(&self.origin),
            max_mm: max(&self.origin),
            incisal_rms_mm: rms(&self.incisal),
            incisal_max_mm: max(&self.incisal),
            rms_deg: rms(&self.angle),
            max_deg: max(&self.angle),
        }
    }
}

#[cfg(test)]
mod tests;
