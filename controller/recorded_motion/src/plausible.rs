//! Whether a recording can be the motion of a jaw: ways, turns, speeds and steps over all rows, each by itself.
//!
//! A wrong unit is found by what does not fit together: a jaw that turns by 12° lowers its incisal point by about 20 mm.
//! The likely unit is one in which everything fits. The bounds are wide: they are for wrong units, points and angles,
//! not for illness. Not found: a wrong unit of a recording that is plausible in several units.

use masseter_scenario::{FileConfig, IfImplausible, JawConfig, LengthUnit, TimeUnit};

use super::TrajectoryError;
use super::doubts::{GLIDE_M, NOTHING_M, TURN_DEG_PER_M, largest, quantile};
use super::frames::Frames;
use super::import::Source;
use super::recording::Recording;
use super::row::{Located, Sample};
use super::units::Unit;
use Cause::{Length, Time, Turn};

/// Largest ways, mm. Incisal point: 44 mm in the mean, 56 mm at the 95th percentile; condyles: 22 mm (Kordass 2014).
const WIDEST_MM: f64 = 80.0;
const CONDYLES_MM: f64 = 35.0;
/// Largest turn, °: 42° at the 95th percentile.
const WIDEST_DEG: f64 = 60.0;
/// From this turn on the way to the turn is judged, °.
const TURNED_DEG: f64 = 4.0;
/// Least way to the turn, m/rad. The axis of opening lies some 32 mm below the condyles (Mehl 2025), and nobody's runs
/// through them all the time.
const NEAREST_M: f64 = 0.005;
/// The same, as a share of the distance between the condyles and the point that the file follows.
const LEAST_SHARE: f64 = 0.4;
/// Below both a jaw stands still. A file without any way is at rest in every unit.
const STILL_MM: f64 = 0.1;
const STILL_DEG: f64 = 0.115;
/// Largest usual speeds, mm/s and °/s: chewing reaches some 150 mm/s.
const FASTEST_MM_S: f64 = 600.0;
const FASTEST_DEG_S: f64 = 500.0;
/// Least largest speed of a way above 5 mm, mm/s.
const SLOWEST_MM_S: f64 = 1.0;
const WAY_MM: f64 = 5.0;
/// Usual time between rows, s.
const STEP_S: [f64; 2] = [1e-4, 0.25];
/// Longest side of a carrier's markers, mm.
const CARRIER_MM: [f64; 2] = [10.0, 500.0];

/// The units that are tried for a recording which is implausible in the stated ones. In micrometres many an impossible
/// motion is a small one of a jaw.
const TRIED: [Unit; 5] = [
    Unit::Length(LengthUnit::Mm),
    Unit::Length(LengthUnit::Cm),
    Unit::Length(LengthUnit::M),
    Unit::Time(TimeUnit::S),
    Unit::Time(TimeUnit::Ms),
];

/// What a wrong value comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cause {
    Length,
    Time,
    Turn,
}

/// A quantity of a recording that no jaw has.
#[derive(Debug, Clone, PartialEq, serde::Serialize, thiserror::Error)]
#[error("line {line}: {quantity}: {} {unit}, plausible is {} {} {unit}; {remedy}", short(*value), if *value < *limit { "at least" } else { "at most" }, short(*limit))]
pub struct Implausible {
    /// The quantity.
    pub quantity: &'static str,
    /// Its value.
    pub value: f64,
    /// The bound beyond which the value is.
    pub limit: f64,
    /// The unit of both.
    pub unit: &'static str,
    /// The line of the row that shows the value.
    pub line: u64,
    /// What to set or to look at.
    pub remedy: String,
    #[serde(skip)]
    cause: Cause,
}

/// With four digits.
fn short(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// A recording judged as the motion of a jaw.
#[derive(Debug, Clone, Default)]
pub(super) struct Judgement {
    pub implausible: Vec<Implausible>,
    /// The unit in which the recording is plausible; none where the stated ones are, or none is.
    pub likely: Option<Unit>,
    /// The frames in the likely unit, or else in the stated ones; none without an opening.
    pub frames: Option<Frames>,
}

impl Judgement {
    pub(super) fn new(
        source: &Source,
        samples: &[Sample],
        config: &FileConfig,
        jaw: &JawConfig,
    ) -> Result<Self, TrajectoryError> {
        let mut implausible = implausible(source, samples, jaw)?;
        if implausible.is_empty() {
            return Ok(Self { frames: Frames::new(source, config, jaw)?, ..Self::default() });
        }
        let (likely, frames) = match in_likely_unit(config, jaw) {
            Some((unit, frames)) => (Some(unit), frames),
            None => (None, Frames::new(source, config, jaw)?),
        };
        for found in &mut implausible {
            found.remedy = remedy(found.cause, likely);
        }
        Ok(Self { implausible, likely, frames })
    }

    /// Why the recording is no jaw's motion.
    pub(super) fn refusal(&self) -> Option<String> {
        let wrong = self.frames.as_ref().filter(|frames| frames.is_wrong()).and_then(Frames::doubt);
        self.implausible.first().map(Implausible::to_string).or(wrong)
    }

    /// All doubts.
    pub(super) fn doubts(&self) -> impl Iterator<Item = String> {
        self.implausible
            .iter()
            .map(Implausible::to_string)
            .chain(self.frames.as_ref().and_then(Frames::doubt))
    }
}

/// Reads, converts to the jaw frame and smooths. What is no motion of a jaw is refused, or played with a warning.
///
/// # Errors
/// For a file that cannot be read, a value out of its range, and a motion that is none of a jaw.
pub fn import(config: &FileConfig, jaw: &JawConfig) -> Result<Recording, TrajectoryError> {
    let source = Source::read(config, jaw)?;
    let samples = source.samples()?;
    let mut recording = source.recording(&samples)?;
    let judgement = Judgement::new(&source, &samples, config, jaw)?;
    let refusal = judgement.refusal().filter(|_| config.if_implausible == IfImplausible::Refuse);
    if let Some(problem) = refusal {
        let override_with = "motion.if_implausible = \"warn\" plays the file as it is";
        return Err(Located::whole(format!("{problem} ({override_with})")).in_file(&config.path));
    }
    recording.doubts.extend(judgement.doubts());
    Ok(recording)
}

/// The unit in which everything is plausible, and the frames in this unit.
fn in_likely_unit(config: &FileConfig, jaw: &JawConfig) -> Option<(Unit, Option<Frames>)> {
    let in_unit = |unit: Unit| -> Result<_, TrajectoryError> {
        let changed = unit.applied(config);
        let source = Source::read(&changed, jaw)?;
        let is_plausible = implausible(&source, &source.samples()?, jaw)?.is_empty();
        let frames = is_plausible.then(|| Frames::new(&source, &changed, jaw)).transpose()?;
        Ok(frames.map(|frames| (unit, frames)))
    };
    TRIED.into_iter().find_map(|unit| in_unit(unit).ok().flatten())
}

fn remedy(cause: Cause, likely: Option<Unit>) -> String {
    if let Some(unit) = likely {
        let quantity = if matches!(unit, Unit::Time(_)) { "time" } else { "length" };
        return format!("the unit of {quantity} seems to be {}: set motion.{unit}", unit.parts().0);
    }
    let check = match cause {
        Length => {
            "check motion.length_unit and the point that the file follows (motion.reference_point_mm or \
             motion.marker_origin_mm)"
        }
        Time => "check motion.time_unit",
        Turn => {
            "check that quaternions have the order qw,qx,qy,qz and angles the right unit, and that poses are relative to \
             the closed jaw"
        }
    };
    check.to_owned()
}

fn implausible(
    source: &Source,
    samples: &[Sample],
    jaw: &JawConfig,
) -> Result<Vec<Implausible>, TrajectoryError> {
    let [incisal, right, left] = super::jaw::points_in_jaw_frame(jaw)?;
    let middle = (right + left) / 2.0;
    let is_of_poses = source.table.format == super::table::Format::Poses;
    let point = if is_of_poses { source.reference } else { incisal };
    let way_mm = |point: &masseter_model::geometry::Vec3| {
        largest(&samples.iter().map(|sample| sample.way(point).norm() * 1e3).collect::<Vec<_>>())
    };
    let turns_deg = samples.iter().map(|sample| sample.displacement.rotation.angle().to_degrees());
    let turn_deg = largest(&turns_deg.collect::<Vec<_>>());
    let way = way_mm(&incisal);
    let mut found = Vec::new();
    let mut judge = |cause, quantity, (row, value): (usize, f64), unit, [least, most]: [f64; 2]| {
        if (least..=most).contains(&value) {
            return;
        }
        let limit = if value < least { least } else { most };
        let line = samples[row].line;
        found.push(Implausible { quantity, value, limit, unit, line, remedy: String::new(), cause });
    };
    let any = f64::INFINITY;
    judge(Turn, "turn from the closed jaw", turn_deg, "°", [0.0, WIDEST_DEG]);
    let is_still = way.1 < STILL_MM && turn_deg.1 < STILL_DEG && way.1 > NOTHING_M * 1e3;
    let least_mm = if is_still { STILL_MM } else { 0.0 };
    judge(Length, "way of the incisal point", way, "mm", [least_mm, WIDEST_MM]);
    if turn_deg.1 >= TURNED_DEG {
        if source.shows_condyles() {
            judge(Length, "way of the condyles", way_mm(&middle), "mm", [0.0, CONDYLES_MM]);
        }
        let distance_m = if is_of_poses { (point - middle).norm() } else { 0.0 };
        let least_mm_deg = NEAREST_M.max(LEAST_SHARE * distance_m).to_radians() * 1e3;
        let (row, followed_mm) = way_mm(&point);
        let to_turn = (row, followed_mm / turn_deg.1);
        judge(Length, "way of the followed point to the turn", to_turn, "mm/°", [least_mm_deg, any]);
    }
    if is_of_poses && way.1 > GLIDE_M * 1e3 {
        let (quantity, least_deg) =
            ("turn of a jaw that moves its incisal point so far", TURN_DEG_PER_M * way.1 / 1e3);
        judge(Turn, quantity, (way.0, turn_deg.1), "°", [least_deg, any]);
    }
    let steps_s: Vec<f64> = samples.windows(2).map(|pair| pair[1].time_s - pair[0].time_s).collect();
    let rate = |of: &dyn Fn(&[Sample]) -> f64| -> Vec<f64> {
        samples.windows(2).zip(&steps_s).map(|(pair, step_s)| of(pair) / step_s).collect()
    };
    let speeds_mm_s = rate(&|pair| (pair[1].way(&incisal) - pair[0].way(&incisal)).norm() * 1e3);
    let speeds_deg_s =
        rate(&|pair| pair[0].displacement.rotation.angle_to(&pair[1].displacement.rotation).to_degrees());
    // The second row of a step shows the step.
    let second = |(row, value): (usize, f64)| (row + 1, value);
    let twentieth = |speeds: &[f64]| second(quantile(speeds, steps_s.len() / 20 + 2));
    let step_s = second(quantile(&steps_s, steps_s.len() / 2));
    let fastest_mm_s = twentieth(&speeds_mm_s);
    judge(Time, "usual time between rows", step_s, "s", STEP_S);
    judge(Time, "usual greatest speed of the incisal point", fastest_mm_s, "mm/s", [0.0, FASTEST_MM_S]);
    judge(Time, "usual greatest speed of the turn", twentieth(&speeds_deg_s), "°/s", [0.0, FASTEST_DEG_S]);
    if way.1 > WAY_MM {
        let fastest = second(largest(&speeds_mm_s));
        judge(Time, "greatest speed of the incisal point", fastest, "mm/s", [SLOWEST_MM_S, any]);
    }
    if let Some(side_mm) = source.longest_side_mm() {
        judge(Length, "longest side of the markers' triangle", (0, side_mm), "mm", CARRIER_MM);
    }
    Ok(found)
}

#[cfg(test)]
mod tests;
