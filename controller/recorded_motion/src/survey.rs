//! A survey of a recorded motion, before its use.
//!
//! The survey describes the file. Whether the mechanism can follow the motion is not judged here.

use masseter_model::geometry::Vec3;
use masseter_scenario::{FileConfig, JawConfig};
use serde::Serialize;

use super::import::Source;
use super::plausible::{Implausible, Judgement};
use super::row::{Sample, moved};
use super::table::{Format, Table};

/// A step longer than this many usual steps is a gap.
const GAP_STEPS: f64 = 1.5;
const POINTS: [&str; 3] = ["incisal point", "right condyle", "left condyle"];
/// Components of the rotation vector: about the axes that point anterior, left and up.
const TURNS: [&str; 3] = ["roll to the right", "opening", "yaw to the left"];
/// The survey of a recorded motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecordingSurvey {
    /// `poses` or `markers`.
    pub format: &'static str,
    /// The point that the file follows.
    pub follows: String,
    /// What was read, converted and left out, a line each.
    pub protocol: Vec<String>,
    /// Rows of data.
    pub rows: usize,
    /// Lines of the first and of the last row.
    pub lines: [u64; 2],
    /// From the first to the last row, s.
    pub duration_s: f64,
    /// Time between rows.
    pub steps: StepFigures,
    /// Steps of more than one and a half usual ones.
    pub gaps: Vec<Gap>,
    /// Each column of the file, as written.
    pub columns: Vec<Range>,
    /// Incisal point, right and left condyle, away from the closed jaw.
    pub points: [PointFigures; 3],
    /// Components of the rotation vector from the closed jaw, about the axes that point anterior, left and up, degrees.
    pub turns_deg: [Range; 3],
    /// The largest turn from the closed jaw, degrees.
    pub turn_deg: f64,
    /// Rows that leave the path of their neighbours.
    pub glitches: Vec<super::Glitch>,
    /// Doubts about the motion of a jaw, each with a line.
    pub doubts: Vec<String>,
    /// What no jaw has: units, points or angles are wrong.
    pub implausible: Vec<Implausible>,
    /// The unit in which the motion is plausible, if the stated ones are not.
    pub likely_unit: Option<super::Unit>,
    /// Which of the file's axes point anterior, left and up, in those units; none of a motion without an opening.
    pub frames: Option<super::Frames>,
    /// The most likely axes, if the stated ones are not as likely.
    pub likely_axes: Option<[String; 3]>,
    /// The rows in the jaw frame.
    #[serde(skip)]
    pub path: Vec<SurveyRow>,
}

/// Time between rows, s.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StepFigures {
    /// Median: the usual step.
    pub usual_s: f64,
    /// The shortest.
    pub shortest_s: f64,
    /// The longest.
    pub longest_s: f64,
    /// Standard deviation of all steps that are no gaps.
    pub jitter_s: f64,
}

impl StepFigures {
    /// Rows a second, Hz.
    pub fn rate_hz(&self) -> f64 {
        1.0 / self.usual_s
    }
}

/// A step longer than usual.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gap {
    /// Line of the row after it.
    pub line: u64,
    /// Its length, s.
    pub lasts_s: f64,
}

/// Least and greatest value.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Range {
    /// The quantity.
    pub name: String,
    /// The least value.
    pub least: f64,
    /// The greatest value.
    pub greatest: f64,
}

/// The way of a point of the jaw.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PointFigures {
    /// Its name.
    pub name: &'static str,
    /// Least displacement from the closed jaw along the axes that point anterior, left and up, mm.
    pub least_mm: [f64; 3],
    /// The greatest displacement, mm.
    pub greatest_mm: [f64; 3],
    /// The greatest distance from its place in the closed jaw, mm.
    pub farthest_mm: f64,
    /// The greatest speed as played, after the low-pass, mm/s.
    pub fastest_mm_s: f64,
}

/// A row in the jaw frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurveyRow {
    /// Since the first row, s.
    pub time_s: f64,
    /// Displacement of incisal point, right and left condyle from the closed jaw, m.
    pub points_m: [Vec3; 3],
    /// Rotation vector from the closed jaw, rad.
    pub turn_rad: Vec3,
}

/// Reads a file and describes its motion.
///
/// # Errors
/// For an unusable file: the line, the reason and a remedy.
pub fn survey(config: &FileConfig, jaw: &JawConfig) -> Result<RecordingSurvey, super::TrajectoryError> {
    let source = Source::read(config, jaw)?;
    let samples = source.samples()?;
    let recording = source.recording(&samples)?;
    let Judgement { implausible, likely, frames } = Judgement::new(&source, &samples, config, jaw)?;
    let points = super::jaw::points_in_jaw_frame(jaw)?;
    let table = &source.table;
    let row = |sample: &Sample| SurveyRow {
        time_s: sample.time_s - samples[0].time_s,
        points_m: points.map(|point| sample.way(&point)),
        turn_rad: sample.displacement.rotation.scaled_axis(),
    };
    let path: Vec<SurveyRow> = samples.iter().map(row).collect();
    let (steps, gaps) = steps_and_gaps(table);
    Ok(RecordingSurvey {
        format: match table.format {
            Format::Poses => "poses",
            Format::Markers(_) => "markers",
        },
        follows: follows(config, &source),
        protocol: table.protocol.clone(),
        rows: table.rows.len(),
        lines: [table.rows[0].line, table.rows[table.rows.len() - 1].line],
        duration_s: recording.length_s(),
        steps,
        gaps,
        columns: columns(table),
        points: std::array::from_fn(|point| point_figures(&path, &points, &recording, point)),
        turns_deg: std::array::from_fn(|axis| {
            range(TURNS[axis], path.iter().map(|row| row.turn_rad[axis].to_degrees()))
        }),
        turn_deg: path.iter().map(|row| row.turn_rad.norm().to_degrees()).fold(0.0, f64::max),
        implausible,
        likely_unit: likely,
        likely_axes: frames
            .as_ref()
            .filter(|frames| !frames.fits())
            .map(|frames| frames.best[0].axes.clone()),
        frames,
        glitches: recording.glitches,
        doubts: recording.doubts,
        path,
    })
}

fn follows(config: &FileConfig, source: &Source) -> String {
    let mm = |point: &Vec3| format!("({:.1}, {:.1}, {:.1}) mm", point.x * 1e3, point.y * 1e3, point.z * 1e3);
    let reference = mm(&source.reference);
    match (&source.table.format, config.reference_point_mm, config.marker_origin_mm) {
        (Format::Poses, None, _) => format!(
            "the middle between the condyles, {reference} from the incisal point\n        (assumed; if it is another point, set motion.reference_point_mm)"
        ),
        (Format::Poses, Some(_), _) => format!("the point {reference} from the incisal point"),
        (Format::Markers(_), _, None) => {
            "the markers' centroid, not the incisal point (set motion.marker_origin_mm)".to_owned()
        }
        (Format::Markers(_), _, Some([x, y, z])) => {
            format!("the incisal point, at ({x:.1}, {y:.1}, {z:.1}) mm of the tracker in the first row")
        }
    }
}

fn steps_and_gaps(table: &Table) -> (StepFigures, Vec<Gap>) {
    let steps = || table.rows.windows(2).map(|pair| (pair[1].line, pair[1].time_s - pair[0].time_s));
    let mut sorted: Vec<f64> = steps().map(|(_, step_s)| step_s).collect();
    sorted.sort_by(f64::total_cmp);
    let usual_s = sorted[sorted.len() / 2];
    let is_gap = |step_s: f64| step_s > GAP_STEPS * usual_s;
    let even: Vec<f64> = sorted.iter().copied().filter(|&step_s| !is_gap(step_s)).collect();
    let mean_s = even.iter().sum::<f64>() / even.len() as f64;
    let variance = even.iter().map(|step_s| (step_s - mean_s).powi(2)).sum::<f64>() / even.len() as f64;
    let gaps = steps().filter(|&(_, step_s)| is_gap(step_s));
    let figures = StepFigures {
        usual_s,
        shortest_s: sorted[0],
        longest_s: sorted[sorted.len() - 1],
        jitter_s: variance.sqrt(),
    };
    (figures, gaps.map(|(line, lasts_s)| Gap { line, lasts_s }).collect())
}

fn columns(table: &Table) -> Vec<Range> {
    let values = |column: usize| table.rows.iter().map(move |row| row.values[column]);
    let names = table.columns().into_iter().enumerate();
    names.map(|(column, name)| range(name, values(column))).collect()
}

fn range(name: impl Into<String>, values: impl Iterator<Item = f64>) -> Range {
    let [least, greatest] = extent(values);
    Range { name: name.into(), least, greatest }
}

/// The least and the greatest value.
fn extent(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, greatest], value| {
        [least.min(value), greatest.max(value)]
    })
}

fn point_figures(
    path: &[SurveyRow],
    points: &[Vec3; 3],
    recording: &super::recording::Recording,
    point: usize,
) -> PointFigures {
    let along_mm = [0, 1, 2].map(|axis| extent(path.iter().map(|row| row.points_m[point][axis] * 1e3)));
    let played = |row: &SurveyRow| moved(&recording.displacement(row.time_s), &points[point]);
    let speed_m_s =
        |pair: &[SurveyRow]| (played(&pair[1]) - played(&pair[0])).norm() / (pair[1].time_s - pair[0].time_s);
    PointFigures {
        name: POINTS[point],
        least_mm: along_mm.map(|[least_mm, _]| least_mm),
        greatest_mm: along_mm.map(|[_, greatest_mm]| greatest_mm),
        farthest_mm: path.iter().map(|row| row.points_m[point].norm() * 1e3).fold(0.0, f64::max),
        fastest_mm_s: path.windows(2).map(speed_m_s).fold(0.0, f64::max) * 1e3,
    }
}
