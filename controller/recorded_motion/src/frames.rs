//! Which axes of a file point anterior, left and up: all 24 right-handed frames, scored over all rows.
//!
//! A jaw that opens turns about the axis that points left. Its incisal point goes down and somewhat back. Its condyles
//! go forward and down along the eminence: the teeth and the fossa leave no way up, and little way back. Each deviation
//! from that counts in standard deviations of people; their squares add up to a frame's misfit. A row counts by its
//! distance from the closed jaw, so that openings decide.
//!
//! Not found: a mirror of left and right, which is a jaw as well, and the frame of a recording without an opening.

use std::fmt::Write;

use masseter_model::geometry::Vec3;
use masseter_scenario::{FileConfig, JawConfig};
use nalgebra::{Matrix3, UnitQuaternion};
use serde::Serialize;

use super::import::{Axes, SIGNED_AXES, Source};
use super::{TrajectoryError, doubts::largest, jaw::condylar_middle, row::Located, table::Format};

/// A turn moves the incisal point by this length a radian, m.
const LEVER_M: f64 = 0.08;
/// Beyond one of these a motion has an opening: no side shift and no protrusion is as large, rad and m.
const OPENED_RAD: f64 = 0.14;
const OPENED_M: f64 = 0.015;
/// A mean turn from which the axis of opening begins to show, and from which the axis shows fully, rad.
const SHOWN_RAD: [f64; 2] = [0.0175, 0.0525];
/// Standard deviation of the axis of opening, °: its tilt varies by 8.9° (Munir & Gallo 2012), a tracker's frame by more.
const HINGE_DEG: f64 = 25.0;
/// Mean direction of the incisal point in opening, from down to back, and its standard deviation, °.
const BACK_DEG: f64 = 23.0;
const INCISAL_DEG: f64 = 20.0;
/// The incisal point's way from which its direction counts fully, m.
const INCISAL_M: f64 = 0.010;
/// Inclination of the condylar path below the horizontal, and its standard deviation between people and frames, °.
const CONDYLAR_DEG: [f64; 2] = [40.0, 45.0];
/// The condyles' way from which its direction begins to count, and from which the direction counts fully, m.
const CONDYLAR_M: [f64; 2] = [0.002, 0.008];
/// How far the condyles get up, back and aside: the bound and the standard deviation beyond, m.
const UP_M: [f64; 2] = [0.0003, 0.0003];
const BACK_M: [f64; 2] = [0.00125, 0.0005];
const ASIDE_M: [f64; 2] = [0.002, 0.001];
/// The same of the incisal point aside: 13 mm at the 95th percentile of a lateral excursion (Kordass 2014).
const INCISAL_ASIDE_M: [f64; 2] = [0.010, 0.003];
/// The most that one deviation counts, so that none outvotes all others.
const MOST: f64 = 25.0;
/// Misfit of axes in another order than x, y, z: trackers turn signs more often than they exchange axes.
const EXCHANGED: f64 = 1.0;
/// Frames whose misfit differs by less are equally likely: a ratio of likelihoods below e² = 7.
const NEAR: f64 = 4.0;
/// Axes with more misfit than the best ones by that are wrong: three standard deviations.
const WRONG: f64 = 9.0;
/// Frames shown.
const SHOWN: usize = 3;

/// A frame of the file, and what the jaw does under it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Frame {
    /// The file's axes that point anterior, left and up.
    pub axes: [String; 3],
    /// Sum of the squared deviations from an opening jaw, in standard deviations.
    pub misfit: f64,
    /// Way of the incisal point anterior, left and up at the widest opening, mm.
    pub incisal_mm: [f64; 3],
    /// The same of the middle between the condyles; none where the recording does not show the condyles.
    pub condyles_mm: Option<[f64; 3]>,
}

/// The stated frame beside the most likely ones.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Frames {
    /// The scenario's axes.
    pub stated: Frame,
    /// The most likely frames, the best first.
    pub best: Vec<Frame>,
    /// By how much the misfit of the second exceeds that of the first.
    pub margin: f64,
}

impl Frame {
    /// The motion of the jaw in words.
    pub fn words(&self) -> String {
        let incisal = format!("incisal point {}", ways(&self.incisal_mm));
        self.condyles_mm.map_or(incisal.clone(), |mm| format!("condyles {}; {incisal}", ways(&mm)))
    }
}

/// `2.3 mm down, 0.9 mm back`, the longest way first.
fn ways(mm: &[f64; 3]) -> String {
    let names = [["forward", "back"], ["left", "right"], ["up", "down"]];
    let mut ways: Vec<_> = mm
        .iter()
        .zip(names)
        .map(|(mm, [plus, minus])| (mm.abs(), if *mm < 0.0 { minus } else { plus }))
        .filter(|(mm, _)| *mm >= 0.05)
        .collect();
    ways.sort_by(|a, b| b.0.total_cmp(&a.0));
    let words: Vec<_> = ways.iter().map(|(mm, name)| format!("{mm:.1} mm {name}")).collect();
    if words.is_empty() { "at rest".to_owned() } else { words.join(", ") }
}

impl Frames {
    /// The frames of a file; none of a motion without an opening.
    pub(super) fn new(
        source: &Source,
        config: &FileConfig,
        jaw: &JawConfig,
    ) -> Result<Option<Self>, TrajectoryError> {
        let evidence = Evidence::new(source, jaw).map_err(|problem| problem.in_file(&config.path))?;
        let Some(evidence) = evidence else { return Ok(None) };
        let mut frames: Vec<_> = right_handed().map(|(names, axes)| evidence.frame(names, &axes)).collect();
        frames.sort_by(|a, b| a.misfit.total_cmp(&b.misfit));
        let Some(stated) = frames.iter().find(|frame| frame.axes == config.axes).cloned() else {
            return Ok(None);
        };
        let margin = frames[1].misfit - frames[0].misfit;
        frames.truncate(SHOWN);
        Ok(Some(Self { stated, best: frames, margin }))
    }

    /// Whether the best frame makes the motion an opening jaw's.
    fn is_jaw(&self) -> bool {
        self.best[0].misfit <= WRONG
    }

    /// Whether several frames are as likely as the best one.
    pub fn is_ambiguous(&self) -> bool {
        self.margin < NEAR
    }

    /// The frames as likely as the best one, that one among them; none if the motion is no opening jaw's in any.
    pub fn likely(&self) -> impl Iterator<Item = &Frame> {
        let best = self.best[0].misfit;
        self.best.iter().filter(move |frame| self.is_jaw() && frame.misfit < best + NEAR)
    }

    /// The misfit of the stated frame above the best one's.
    fn excess(&self) -> f64 {
        self.stated.misfit - self.best[0].misfit
    }

    /// Whether the stated frame is as likely as the best one.
    pub fn fits(&self) -> bool {
        !self.is_jaw() || self.excess() < NEAR
    }

    /// Whether the stated frame is wrong.
    pub(super) fn is_wrong(&self) -> bool {
        self.is_jaw() && self.excess() >= WRONG
    }

    /// What the stated axes make of the jaw, and what other ones do; none where the stated ones fit.
    pub(super) fn doubt(&self) -> Option<String> {
        if !self.is_jaw() {
            let words = self.best[0].words();
            return Some(format!("no axes make this an opening jaw; nearest: {}, {words}", self.best[0]));
        }
        if self.fits() {
            return None;
        }
        let mut text = format!("with motion.axes = {}: {}", self.stated, self.stated.words());
        for frame in self.likely() {
            let _ = write!(text, "; with {frame}: {}", frame.words());
        }
        Some(text)
    }
}

impl std::fmt::Display for Frame {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [anterior, left, up] = &self.axes;
        write!(f, "[\"{anterior}\", \"{left}\", \"{up}\"]")
    }
}

/// All right-handed frames.
fn right_handed() -> impl Iterator<Item = ([String; 3], Axes)> {
    let pairs = SIGNED_AXES.iter().flat_map(|anterior| SIGNED_AXES.map(|left| [*anterior, left]));
    let triples =
        pairs.flat_map(|[anterior, left]| SIGNED_AXES.map(|up| [anterior, left, up].map(String::from)));
    triples.filter_map(|names| Axes::parse(&names).ok().map(|axes| (names, axes)))
}

/// Means over all rows, each by its distance from the closed jaw, in the file's axes.
struct Evidence {
    /// Way of the point that the file follows, m.
    way: Vec3,
    rotation: Matrix3<f64>,
    turn_rad: Vec3,
    /// The row farthest from the closed jaw.
    widest: (Vec3, Matrix3<f64>),
    /// The point that the file follows and the middle between the condyles, jaw frame, m.
    point: Vec3,
    middle: Vec3,
    /// From 0, no turn is shown, to 1.
    turn_shown: f64,
    shows_condyles: bool,
}

impl Evidence {
    fn new(source: &Source, jaw: &JawConfig) -> Result<Option<Self>, Located> {
        let is_of_poses = source.table.format == Format::Poses;
        let point = if is_of_poses { source.reference } else { Vec3::zeros() };
        let middle = condylar_middle(jaw).map_err(|error| Located::whole(error.to_string()))?;
        let displaced = |row| -> Result<(Vec3, UnitQuaternion<f64>), Located> {
            let displacement = source.displacement(row, &Axes::of_jaw())?;
            let turn = displacement.rotation;
            Ok((displacement.translation.vector + turn * point - point, turn))
        };
        let rows = source.table.rows.iter().map(displaced).collect::<Result<Vec<_>, _>>()?;
        let each = |of: fn(&(Vec3, UnitQuaternion<f64>)) -> f64| rows.iter().map(of).collect::<Vec<f64>>();
        let weights = each(|(way, turn)| LEVER_M * turn.angle() + way.norm());
        let is_opened = largest(&each(|(_, turn)| turn.angle())).1 >= OPENED_RAD
            || largest(&each(|(way, _)| way.norm())).1 >= OPENED_M;
        if !is_opened {
            return Ok(None);
        }
        let (widest, most) = largest(&weights);
        let matrix = |turn: &UnitQuaternion<f64>| *turn.to_rotation_matrix().matrix();
        let widest = (rows[widest].0, matrix(&rows[widest].1));
        let (mut sum, mut way, mut turn_rad, mut rotation) =
            (0.0, Vec3::zeros(), Vec3::zeros(), Matrix3::zeros());
        // What is farther is a glitch.
        for ((row_way, turn), &weight) in rows.iter().zip(&weights).filter(|(_, weight)| **weight <= most) {
            sum += weight;
            way += row_way * weight;
            turn_rad += turn.scaled_axis() * weight;
            rotation += matrix(turn) * weight;
        }
        let turn_rad = turn_rad / sum;
        let shows_condyles = source.shows_condyles();
        let (way, rotation, turn_shown) = (way / sum, rotation / sum, between(SHOWN_RAD, turn_rad.norm()));
        Ok(Some(Self { way, rotation, turn_rad, widest, point, middle, turn_shown, shows_condyles }))
    }

    /// Ways of the incisal point and of the middle between the condyles, jaw frame, m.
    fn ways(&self, axes: &Axes, way: &Vec3, rotation: &Matrix3<f64>) -> [Vec3; 2] {
        let to_jaw = axes.matrix();
        let arm = |point: &Vec3| to_jaw * rotation * to_jaw.transpose() * point - point;
        let incisal = to_jaw * way - arm(&self.point);
        [incisal, incisal + arm(&self.middle)]
    }

    fn frame(&self, axes_names: [String; 3], axes: &Axes) -> Frame {
        let (way, rotation) = &self.widest;
        let [incisal, condyles] = self.ways(axes, way, rotation).map(|way| (way * 1e3).into());
        let is_shown = self.shows_condyles && self.turn_shown > 0.0;
        let misfit = self.misfit(axes) + exchanged(&axes_names);
        Frame { axes: axes_names, misfit, incisal_mm: incisal, condyles_mm: is_shown.then_some(condyles) }
    }

    fn misfit(&self, axes: &Axes) -> f64 {
        let [incisal, condyles] = self.ways(axes, &self.way, &self.rotation);
        let (sin, cos) = BACK_DEG.to_radians().sin_cos();
        let off_deg = |way: &Vec3, along: Vec3| way.angle(&along).to_degrees();
        let hinge = off_deg(&axes.vector(&self.turn_rad), Vec3::y()) / HINGE_DEG;
        let opening = off_deg(&incisal, Vec3::new(-sin, 0.0, -cos)) / INCISAL_DEG;
        let guided = self.turn_shown * if self.shows_condyles { condylar(&condyles) } else { 0.0 };
        beyond(INCISAL_ASIDE_M, incisal.y.abs())
            + self.turn_shown * squared(hinge)
            + between([0.0, INCISAL_M], incisal.norm()) * squared(opening)
            + guided
    }
}

/// Misfit of the condyles' way.
fn condylar(way: &Vec3) -> f64 {
    let [inclination_deg, deviation_deg] = CONDYLAR_DEG;
    let (sin, cos) = inclination_deg.to_radians().sin_cos();
    let sagittal = Vec3::new(way.x, 0.0, way.z);
    let off_deg = sagittal.angle(&Vec3::new(cos, 0.0, -sin)).to_degrees();
    beyond(UP_M, way.z)
        + beyond(BACK_M, -way.x)
        + beyond(ASIDE_M, way.y.abs())
        + between(CONDYLAR_M, sagittal.norm()) * squared(off_deg / deviation_deg)
}

fn beyond([bound_m, deviation_m]: [f64; 2], m: f64) -> f64 {
    squared((m - bound_m).max(0.0) / deviation_m)
}

fn squared(deviations: f64) -> f64 {
    (deviations * deviations).min(MOST)
}

/// From 0 at the first bound to 1 at the second.
fn between([from, to]: [f64; 2], value: f64) -> f64 {
    ((value - from) / (to - from)).clamp(0.0, 1.0)
}

fn exchanged(axes: &[String; 3]) -> f64 {
    let is_in_order = axes.iter().zip(["x", "y", "z"]).all(|(axis, name)| axis.ends_with(name));
    if is_in_order { 0.0 } else { EXCHANGED }
}

#[cfg(test)]
mod tests;
