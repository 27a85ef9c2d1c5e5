//! Whether a recording can be the motion of a jaw: ways, turns, speeds and steps over all rows, each by itself.
//!
//! A wrong unit is found by what does not fit together: a jaw that turns by 12° lowers its incisal point by about 20 mm.
//! The likely unit is one in which everything fits. The bounds are wide: they are for wrong units, points and angles,
//! not for illness. Not found: a wrong unit of a recording that is plausible in several units.

use std::fmt::{self, Display, Formatter};

use masseter_model::geometry::Vec3;
use masseter_scenario::{FileConfig, IfImplausible, JawConfig, LengthUnit, TimeUnit};
use serde::Serialize;

use super::TrajectoryError;
use super::doubts::{GLIDE_M, NOTHING_M, TURN_DEG_PER_M, largest, quantile};
use super::frames::Frames;
use super::import::Source;
use super::mandible::jaw_points;
use super::recording::{Recording, Sample};
use super::row::Located;
use super::table::Format;

/// Largest ways, m. Incisal point: 44 mm in the mean, 56 mm at the 95th percentile; condyles: 22 mm (Kordass 2014).
const WIDEST_M: f64 = 0.08;
const CONDYLES_M: f64 = 0.035;
/// Largest turn, °: 42° at the 95th percentile.
const WIDEST_DEG: f64 = 60.0;
/// From this turn on the way to the turn is judged, rad.
const TURNED_RAD: f64 = 0.07;
/// Least way to the turn, m/rad. The axis of opening lies some 32 mm below the condyles (Mehl 2025), and nobody's runs
/// through them all the time.
const NEAREST_M: f64 = 0.005;
/// The same, as a share of the distance between the condyles and the point that the file follows.
const LEAST_SHARE: f64 = 0.4;
/// Below both a jaw stands still, m and rad. A file without any way is at rest in every unit.
const STILL_M: f64 = 1e-4;
const STILL_RAD: f64 = 2e-3;
/// Largest usual speeds, mm/s and °/s: chewing reaches some 150 mm/s.
const FASTEST_MM_S: f64 = 600.0;
const FASTEST_DEG_S: f64 = 500.0;
/// Least largest speed of a way above 5 mm, mm/s.
const SLOWEST_MM_S: f64 = 1.0;
const WAY_M: f64 = 0.005;
/// Usual time between rows, s.
const STEP_S: [f64; 2] = [1e-4, 0.25];
/// Longest side of a carrier's markers, mm.
const CARRIER_MM: [f64; 2] = [10.0, 500.0];

/// What a wrong value comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cause {
    Length,
    Time,
    Turn,
}

/// A quantity of a recording that no jaw has.
#[derive(Debug, Clone, PartialEq, Serialize, thiserror::Error)]
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

/// A unit in which a recording is plausible, though it is not in the stated one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum LikelyUnit {
    /// Of lengths.
    #[serde(rename = "length_unit")]
    Length(LengthUnit),
    /// Of times.
    #[serde(rename = "time_unit")]
    Time(TimeUnit),
}

impl LikelyUnit {
    const TRIED: [Self; 5] = [
        Self::Length(LengthUnit::Mm),
        Self::Length(LengthUnit::Cm),
        Self::Length(LengthUnit::M),
        Self::Time(TimeUnit::S),
        Self::Time(TimeUnit::Ms),
    ];

    /// The section with this unit.
    pub fn applied(self, config: &FileConfig) -> FileConfig {
        match self {
            Self::Length(unit) => FileConfig { length_unit: Some(unit), ..config.clone() },
            Self::Time(unit) => FileConfig { time_unit: Some(unit), ..config.clone() },
        }
    }
}

/// The key and its value.
impl Display for LikelyUnit {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Length(unit) => write!(f, "length_unit = \"{}\"", unit.name()),
            Self::Time(unit) => write!(f, "time_unit = \"{}\"", unit.name()),
        }
    }
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
    pub likely: Option<LikelyUnit>,
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
        let likely = likely_unit(config, jaw);
        for found in &mut implausible {
            found.remedy = remedy(found.cause, likely);
        }
        let frames = match likely.map(|unit| unit.applied(config)) {
            Some(changed) => Frames::new(&Source::read(&changed, jaw)?, &changed, jaw)?,
            None => Frames::new(source, config, jaw)?,
        };
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
pub(super) fn import(config: &FileConfig, jaw: &JawConfig) -> Result<Recording, TrajectoryError> {
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

/// The unit in which everything is plausible.
fn likely_unit(config: &FileConfig, jaw: &JawConfig) -> Option<LikelyUnit> {
    let is_plausible = |unit: &LikelyUnit| {
        let changed = unit.applied(config);
        let source = Source::read(&changed, jaw)?;
        let samples = source.samples()?;
        implausible(&source, &samples, jaw).map(|found| found.is_empty())
    };
    LikelyUnit::TRIED.into_iter().find(|unit| is_plausible(unit).unwrap_or(false))
}

fn remedy(cause: Cause, likely: Option<LikelyUnit>) -> String {
    match (cause, likely) {
        (_, Some(LikelyUnit::Length(unit))) => {
            let unit = unit.name();
            format!("the unit of length seems to be {unit}: set motion.length_unit = \"{unit}\"")
        }
        (_, Some(LikelyUnit::Time(unit))) => {
            let unit = unit.name();
            format!("the unit of time seems to be {unit}: set motion.time_unit = \"{unit}\"")
        }
        (Cause::Length, None) => "check motion.length_unit and the point that the file follows \
            (motion.reference_point_mm or motion.marker_origin_mm)"
            .to_owned(),
        (Cause::Time, None) => "check motion.time_unit".to_owned(),
        (Cause::Turn, None) => {
            "check that quaternions have the order qw,qx,qy,qz and angles the right unit, and that \
            poses are relative to the closed jaw"
                .to_owned()
        }
    }
}

fn implausible(
    source: &Source,
    samples: &[Sample],
    jaw: &JawConfig,
) -> Result<Vec<Implausible>, TrajectoryError> {
    let [incisal, right, left] = jaw_points(jaw)?;
    let middle = (right + left) / 2.0;
    let is_of_poses = source.table.format == Format::Poses;
    let point = if is_of_poses { source.reference } else { incisal };
    let way_m =
        |point: &Vec3| -> Vec<f64> { samples.iter().map(|sample| sample.way(point).norm()).collect() };
    let turns_rad: Vec<f64> = samples.iter().map(|sample| sample.displacement.rotation.angle()).collect();
    let (turned, turn_rad) = largest(&turns_rad);
    let (farthest, incisal_m) = largest(&way_m(&incisal));
    let (followed, followed_m) = largest(&way_m(&point));
    let (condyle, condyles_m) = largest(&way_m(&middle));
    let turn_deg = turn_rad.to_degrees();
    let mut found = Vec::new();
    let mut judge = |cause, quantity, row: usize, value: f64, unit, [least, most]: [f64; 2]| {
        if (least..=most).contains(&value) {
            return;
        }
        let limit = if value < least { least } else { most };
        let line = samples[row].line;
        found.push(Implausible { quantity, value, limit, unit, line, remedy: String::new(), cause });
    };
    let any = f64::INFINITY;
    judge(Cause::Turn, "turn from the closed jaw", turned, turn_deg, "°", [0.0, WIDEST_DEG]);
    judge(Cause::Length, "way of the incisal point", farthest, incisal_m * 1e3, "mm", [0.0, WIDEST_M * 1e3]);
    let is_still = incisal_m < STILL_M && turn_rad < STILL_RAD && incisal_m > NOTHING_M;
    if is_still {
        judge(
            Cause::Length,
            "way of the incisal point",
            farthest,
            incisal_m * 1e3,
            "mm",
            [STILL_M * 1e3, any],
        );
    }
    if turn_rad >= TURNED_RAD && source.shows_condyles() {
        judge(Cause::Length, "way of the condyles", condyle, condyles_m * 1e3, "mm", [0.0, CONDYLES_M * 1e3]);
    }
    if turn_rad >= TURNED_RAD {
        let distance_m = if is_of_poses { (point - middle).norm() } else { 0.0 };
        let least_m = NEAREST_M.max(LEAST_SHARE * distance_m);
        let mm_deg = (followed_m / turn_deg * 1e3, least_m.to_radians() * 1e3);
        judge(
            Cause::Length,
            "way of the followed point to the turn",
            followed,
            mm_deg.0,
            "mm/°",
            [mm_deg.1, any],
        );
    }
    if is_of_poses && incisal_m > GLIDE_M {
        let least_deg = TURN_DEG_PER_M * incisal_m;
        judge(
            Cause::Turn,
            "turn of a jaw that moves its incisal point so far",
            farthest,
            turn_deg,
            "°",
            [least_deg, any],
        );
    }
    let steps_s: Vec<f64> = samples.windows(2).map(|pair| pair[1].time_s - pair[0].time_s).collect();
    let rate = |of: &dyn Fn(&[Sample]) -> f64| -> Vec<f64> {
        samples.windows(2).zip(&steps_s).map(|(pair, step_s)| of(pair) / step_s).collect()
    };
    let speeds_mm_s = rate(&|pair| (pair[1].way(&incisal) - pair[0].way(&incisal)).norm() * 1e3);
    let speeds_deg_s =
        rate(&|pair| pair[0].displacement.rotation.angle_to(&pair[1].displacement.rotation).to_degrees());
    let twentieth = steps_s.len() / 20 + 2;
    let (row, step_s) = quantile(&steps_s, steps_s.len() / 2);
    judge(Cause::Time, "usual time between rows", row + 1, step_s, "s", STEP_S);
    let (row, speed) = quantile(&speeds_mm_s, twentieth);
    judge(
        Cause::Time,
        "usual greatest speed of the incisal point",
        row + 1,
        speed,
        "mm/s",
        [0.0, FASTEST_MM_S],
    );
    let (row, speed) = quantile(&speeds_deg_s, twentieth);
    judge(Cause::Time, "usual greatest speed of the turn", row + 1, speed, "°/s", [0.0, FASTEST_DEG_S]);
    let (row, speed) = largest(&speeds_mm_s);
    let least = if incisal_m > WAY_M { SLOWEST_MM_S } else { 0.0 };
    judge(Cause::Time, "greatest speed of the incisal point", row + 1, speed, "mm/s", [least, any]);
    if let Some(side_mm) = source.longest_side_mm() {
        judge(Cause::Length, "longest side of the markers' triangle", 0, side_mm, "mm", CARRIER_MM);
    }
    Ok(found)
}

#[cfg(test)]
mod tests;
