//! Which axes of a file are likely to point anterior, left and up, from what a jaw does when it opens widest.
//!
//! Then the incisal point goes down, rather back than forward and hardly aside, the jaw turns about the axis that
//! points left, and the condyles go forward. A recording without an opening shows nothing of that.

use masseter_model::geometry::{Pose, Vec3};

use super::axes::Axes;
use super::error::Located;
use super::import::Source;
use super::table::Row;

/// Rows looked at.
const ROWS: usize = 200;
/// A turn that shows the axis of opening fully, rad.
const CLEAR_RAD: f64 = 0.05;
/// A jaw reaches so far from the closed place only by opening, m.
const OPENED_M: f64 = 0.015;
/// A motion shows its axes from this score on, of less than 2.5, and others than the stated ones only by this much more.
const LEAST: f64 = 0.6;
const BETTER: f64 = 0.5;
/// Weights of the incisal point's way back, and of the condyles' way forward.
const BACK: f64 = 0.25;
const FORWARD: f64 = 0.25;

const SIGNED: [&str; 6] = ["+x", "-x", "+y", "-y", "+z", "-z"];

/// The axes under which the motion opens, where these do not do so.
pub(super) fn likely_axes(source: &Source, stated: &[String; 3]) -> Option<[String; 3]> {
    let mut best: Option<(f64, [String; 3])> = None;
    let mut score_of_stated = f64::NEG_INFINITY;
    for anterior in SIGNED {
        for left in SIGNED {
            for up in SIGNED {
                let names = [anterior, left, up].map(String::from);
                let Ok(axes) = Axes::parse(&names) else { continue };
                let Ok(score) = score(source, &axes) else { continue };
                if names == *stated {
                    score_of_stated = score;
                }
                if best.as_ref().is_none_or(|(most, _)| score > *most) {
                    best = Some((score, names));
                }
            }
        }
    }
    let (most, names) = best?;
    (most >= LEAST && most >= score_of_stated + BETTER).then_some(names)
}

/// How much the widest row looks like an opened jaw.
fn score(source: &Source, axes: &Axes) -> Result<f64, Located> {
    let rows = &source.table.rows;
    let first = source.displacement(&rows[0], axes)?;
    let away = |row: &Row| -> Result<Pose, Located> {
        let displacement = source.displacement(row, axes)?;
        let way = displacement.translation.vector - first.translation.vector;
        Ok(Pose::from_parts(way.into(), first.rotation.inverse() * displacement.rotation))
    };
    let mut widest = Pose::identity();
    for row in rows.iter().step_by(rows.len().div_ceil(ROWS)) {
        let pose = away(row)?;
        if pose.translation.vector.norm() > widest.translation.vector.norm() {
            widest = pose;
        }
    }
    let share = |along: f64, of: &Vec3| along / of.norm().max(f64::MIN_POSITIVE);
    let incisal = widest.translation.vector;
    if incisal.norm() < OPENED_M {
        return Ok(0.0);
    }
    let turn = widest.rotation.scaled_axis();
    let condyle = incisal + widest.rotation * source.reference - source.reference;
    let down = share(-incisal.z - incisal.y.abs() - BACK * incisal.x, &incisal);
    // A small turn is noise, and shows no axis.
    let clear = (turn.norm() / CLEAR_RAD).min(1.0).powi(2);
    let opening = share(turn.y, &turn) + FORWARD * share(condyle.x, &condyle);
    Ok(down + clear * opening)
}
