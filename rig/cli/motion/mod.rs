//! `masseter motion`: what a recorded jaw motion holds, and whether the rig would play it.
//!
//! The file is read and the motion judged as `masseter run` does. What differs is the answer: a description, and the
//! values of the scenario with which the motion would fit.

mod picture;

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use masseter_controller::trajectory::{
    Frame, Frames, Gap, Glitch, PointFigures, Range, RecordingSurvey, Trajectory, TrajectoryError, Unit,
    plain_form, survey,
};
use masseter_judge::{RecordedError, RecordedFigures, RecordedWatch};
use masseter_model::geometry::{AXES, AXIS_NAMES, Mechanism};
use masseter_plan::{Overrides, best_placement, demands, scenario_with_overrides};
use masseter_scenario::{MotionConfig, Scenario, wording::counted};
use masseter_terminal::{Exit, Format, Tone, result, result_with_tones};
use serde::Serialize;

const TONES: [(&str, Tone); 4] =
    [("PLAYS", Tone::Good), ("suggest", Tone::Good), ("warning", Tone::Doubtful), ("REFUSED", Tone::Bad)];

/// With less left of a stroke another place is suggested, mm: the trim and a slow stop need some.
const TIGHT_MM: f64 = 1.0;
/// Gaps and glitches that are listed.
const MOST: usize = 8;

/// The arguments of `motion`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
  masseter motion examples/patient.csv --svg patient.svg
  masseter motion jaw.trc --set motion.lowpass_hz=6 --write motion.csv
  masseter motion examples/tracker.csv --scenario examples/markers.toml")]
pub(crate) struct MotionArgs {
    /// File of a recorded jaw motion, as for run --trajectory
    file: PathBuf,
    /// Scenario with the file's axes, the jaw and the mechanism [default: the default one]
    #[arg(long, value_name = "SCENARIO.toml")]
    scenario: Option<PathBuf>,
    /// Set a key of the scenario
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Write the motion in its plain form, with what was read and converted in comments
    #[arg(long, value_name = "FILE.csv")]
    write: Option<PathBuf>,
    /// Write a picture of the motion
    #[arg(long, value_name = "FILE.svg")]
    svg: Option<PathBuf>,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Describes the file. [`Exit::Failed`] where the rig would refuse to play it.
pub(crate) fn motion(args: &MotionArgs) -> anyhow::Result<Exit> {
    let overrides =
        Overrides { set: args.set.clone(), trajectory: Some(args.file.clone()), ..Overrides::default() };
    let scenario = scenario_with_overrides(args.scenario.as_deref(), &overrides)?;
    let found = Found::new(&scenario, &args.file)?;
    if let (Some(path), MotionConfig::File(file)) = (&args.write, &scenario.motion) {
        write_beside(&args.file, path, &plain_form(file, &scenario.jaw)?)?;
    }
    if let Some(path) = &args.svg {
        write_beside(&args.file, path, &picture::svg(&found.survey))?;
    }
    match args.format {
        Format::Json => result(&(serde_json::to_string_pretty(&found)? + "\n"))?,
        Format::Human => result_with_tones(&describe(&found), &TONES)?,
    }
    Ok(if found.judged.refused.is_none() { Exit::Passed } else { Exit::Failed })
}

/// Writes what was made of a recording, but not over it.
fn write_beside(source: &Path, path: &Path, text: &str) -> anyhow::Result<()> {
    if path.canonicalize().is_ok_and(|path| source.canonicalize().is_ok_and(|source| path == source)) {
        bail!("{} is the file that is read; name another one to write", path.display());
    }
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}

/// What the verb finds.
#[derive(Debug, Serialize)]
struct Found {
    file: PathBuf,
    #[serde(flatten)]
    survey: RecordingSurvey,
    #[serde(flatten)]
    judged: Judged,
    /// How far filter and ramps lead the motion from the file's rows; none of a motion that is refused.
    recorded: Option<RecordedFigures>,
    /// With the axes that the motion shows; several where they are as likely as each other.
    suggestions: Vec<Suggestion>,
    /// The first of them.
    suggestion: Option<Suggestion>,
}

/// Whether the rig would play a motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Judged {
    /// What is then left of the strokes; negative where the motion is too large.
    strokes: Option<Strokes>,
    /// Why the rig would not play it.
    refused: Option<String>,
}

/// The axis that comes nearest to an end of its stroke.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Strokes {
    axis: &'static str,
    margin_mm: f64,
}

/// Keys of the scenario.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Suggestion {
    /// `motion.length_unit` or `motion.time_unit`; none where the stated ones are likely.
    #[serde(flatten)]
    unit: Option<Unit>,
    /// `motion.axes`; none where the stated ones are likely.
    axes: Option<[String; 3]>,
    /// The motion of the jaw with these axes.
    jaw: Option<String>,
    /// `jaw.closed_offset_m`; none where the stated one is good.
    closed_offset_m: Option<[f64; 3]>,
    /// Whether the rig would play the motion with them.
    #[serde(flatten)]
    judged: Judged,
}

impl Found {
    /// What the file of a scenario's motion holds.
    fn new(scenario: &Scenario, path: &Path) -> anyhow::Result<Self> {
        let MotionConfig::File(file) = &scenario.motion else { bail!("the scenario plays no file") };
        let survey = survey(file, &scenario.jaw)?;
        let mechanism = Mechanism::new(&scenario.mechanism)?;
        let judged = Judged::new(scenario, &mechanism);
        let other = survey.frames.iter().filter(|frames| !frames.fits()).flat_map(Frames::likely);
        let mut frames: Vec<Option<&Frame>> = other.map(Some).collect();
        if frames.is_empty() {
            frames.push(None);
        }
        let suggest = |frame| suggest(scenario, &mechanism, survey.likely_unit, frame, &judged);
        let suggestions: Vec<_> = frames.into_iter().filter_map(suggest).collect();
        let suggestion = suggestions.first().cloned();
        let recorded = predicted(scenario, &mechanism);
        Ok(Self { file: path.to_owned(), survey, judged, recorded, suggestions, suggestion })
    }
}

impl Judged {
    fn new(scenario: &Scenario, mechanism: &Mechanism) -> Self {
        match Strokes::left(scenario, mechanism) {
            Ok(strokes) => Self { strokes: Some(strokes), refused: None },
            Err(error) => Self { strokes: None, refused: Some(error.to_string()) },
        }
    }

    fn fits(&self) -> bool {
        self.strokes.is_some_and(|strokes| strokes.margin_mm >= TIGHT_MM)
    }
}

impl Strokes {
    /// What a motion leaves of the strokes, if the rig would play it.
    fn left(scenario: &Scenario, mechanism: &Mechanism) -> Result<Self, TrajectoryError> {
        let trajectory = Trajectory::new(&scenario.motion, &scenario.jaw, mechanism, scenario.duration_s)?;
        let margin_m = demands(scenario, &trajectory, mechanism)?.margin_m(mechanism.strokes());
        let axis = (0..AXES).min_by(|&a, &b| margin_m[a].total_cmp(&margin_m[b])).unwrap_or_default();
        Ok(Self { axis: AXIS_NAMES[axis], margin_mm: margin_m[axis] * 1e3 })
    }
}

/// What to change; nothing where the motion fits as it is. Whatever is suggested was played.
fn suggest(
    scenario: &Scenario,
    mechanism: &Mechanism,
    unit: Option<Unit>,
    frame: Option<&Frame>,
    now: &Judged,
) -> Option<Suggestion> {
    let is_changed = unit.is_some() || frame.is_some();
    if !is_changed && now.fits() {
        return None;
    }
    let mut changed = scenario.clone();
    if let MotionConfig::File(file) = &mut changed.motion {
        if let Some(unit) = unit {
            *file = unit.applied(file);
        }
        if let Some(frame) = frame {
            file.axes.clone_from(&frame.axes);
        }
    }
    let is_enough = is_changed && Judged::new(&changed, mechanism).fits();
    let closed_offset_m = if is_enough { None } else { better_offset(&changed, mechanism) };
    if !is_changed && closed_offset_m.is_none() {
        return None;
    }
    changed.jaw.closed_offset_m = closed_offset_m.unwrap_or(changed.jaw.closed_offset_m);
    let judged = Judged::new(&changed, mechanism);
    let (axes, jaw) = (frame.map(|frame| frame.axes.clone()), frame.map(Frame::words));
    Some(Suggestion { unit, axes, jaw, closed_offset_m, judged })
}

/// The offset with the most left of every stroke, to half a millimetre; none where there is no better one.
fn better_offset(scenario: &Scenario, mechanism: &Mechanism) -> Option<[f64; 3]> {
    let jaw = &scenario.jaw;
    let trajectory = Trajectory::new(&scenario.motion, jaw, mechanism, scenario.duration_s).ok()?;
    let best = best_placement(&trajectory, mechanism)?;
    if best.shift_m.iter().all(|shift_m| shift_m.abs() < 1e-9) {
        return None;
    }
    let at = |axis: usize| ((jaw.closed_offset_m[axis] + best.shift_m[axis]) * 1e4).round() / 1e4;
    Some(std::array::from_fn(at))
}

/// The errors that a robot without errors would have: those of filter and ramps.
fn predicted(scenario: &Scenario, mechanism: &Mechanism) -> Option<RecordedFigures> {
    let trajectory = Trajectory::new(&scenario.motion, &scenario.jaw, mechanism, scenario.duration_s).ok()?;
    let cycles = (trajectory.duration_s() / scenario.period_s()) as u32;
    let mut watch = RecordedWatch::new(trajectory.clone(), &scenario.jaw);
    for cycle in 0..=cycles {
        let motion_s = trajectory.motion_time_s(f64::from(cycle) * scenario.period_s());
        watch.add(motion_s, &trajectory.pose_in_motion(motion_s));
    }
    watch.into_figures()
}

/// The description as text: no line is longer than a terminal, but for those with a path.
fn describe(found: &Found) -> String {
    let survey = &found.survey;
    let mut text = format!("{}: {}\n", found.file.display(), head(survey));
    let _ = writeln!(text, "follows {}", survey.follows);
    for line in &survey.protocol {
        let _ = writeln!(text, "read    {line}");
    }
    text.push('\n');
    text += &columns(&survey.columns);
    text += &points(&survey.points);
    text += &turns(survey);
    text += &listed("gap", &survey.gaps, gap);
    text += &listed("glitch", &survey.glitches, glitch);
    for doubt in &survey.doubts {
        let _ = writeln!(text, "warning {doubt}");
    }
    for implausible in &survey.implausible {
        let _ = writeln!(text, "warning {implausible}");
    }
    text += &axes(survey);
    text += &found.recorded.as_ref().map_or_else(String::new, against_played);
    text += &judgement(&found.judged);
    text + &found.suggestions.iter().map(suggested).collect::<String>()
}

/// The table of errors; the robot's own are measured in a run.
fn against_played(recorded: &RecordedFigures) -> String {
    let line = |error: &RecordedError| {
        let numbers = [error.rms, error.p95, error.max].map(|value| format!("{value:.4} {}", error.unit));
        let [rms, p95, max] = numbers;
        format!("{:<14} {:<7} {rms:>12} {p95:>12} {max:>12}\n", error.place, error.source)
    };
    let head = format!("{:<22} {:>12} {:>12} {:>12}\n", "recorded against played", "rms", "95 %", "max");
    let is_predicted = |error: &&RecordedError| ["filter", "ramps"].contains(&error.source);
    let lines: String = recorded.errors.iter().filter(is_predicted).map(line).collect();
    format!("{head}{lines}{}\n\n", recorded.in_words())
}

/// The jaw's motion with the stated axes, and with other ones where those are not the only likely ones.
fn axes(survey: &RecordingSurvey) -> String {
    let Some(frames) = &survey.frames else {
        return "axes    not judged: the motion has no opening\n".to_owned();
    };
    let line = |(name, frame): (&str, &Frame)| {
        format!(
            "{name:<7} {frame} misfit {:.1}: {}\n",
            frame.misfit,
            frame.words().replace("; ", "\n        ")
        )
    };
    let others = frames.best.iter().filter(|frame| frame.axes != frames.stated.axes);
    let is_clear = frames.fits() && !frames.is_ambiguous();
    let shown = others.take(if is_clear { 0 } else { frames.best.len() }).map(|frame| ("or", frame));
    let text: String = [("axes", &frames.stated)].into_iter().chain(shown).map(line).collect();
    let likely: Vec<String> = frames.likely().map(Frame::to_string).collect();
    match likely.len() {
        0 | 1 => text,
        _ => text + &format!("AMBIGUOUS, as likely as each other: {}\n", likely.join(", ")),
    }
}

fn head(survey: &RecordingSurvey) -> String {
    let [first, last] = survey.lines;
    let gaps = match survey.gaps.len() {
        0 => "no gaps".to_owned(),
        gaps => counted(gaps as u64, "gap"),
    };
    format!(
        "{} of {}, lines {first} to {last}\n{:.3} s at {:.2} Hz, steps {:.2} to {:.2} ms, jitter {:.3} ms, {gaps}",
        counted(survey.rows as u64, "row"),
        survey.format,
        survey.duration_s,
        survey.steps.rate_hz(),
        survey.steps.shortest_s * 1e3,
        survey.steps.longest_s * 1e3,
        survey.steps.jitter_s * 1e3,
    )
}

fn columns(columns: &[Range]) -> String {
    let mut text = format!("{:<10} {:>11} {:>11} {:>11}\n", "column", "least", "greatest", "range");
    for Range { name, least, greatest } in columns {
        let _ = writeln!(text, "{name:<10} {least:>11.4} {greatest:>11.4} {:>11.4}", greatest - least);
    }
    text + "\n"
}

fn points(points: &[PointFigures]) -> String {
    let mut text = format!(
        "{:<14} {:>15} {:>15} {:>15} {:>9} {:>8}\n",
        "mm from closed", "anterior", "left", "up", "farthest", "mm/s"
    );
    for point in points {
        let _ = write!(text, "{:<14}", point.name);
        for axis in 0..3 {
            let along =
                format!("{:.1} to {:.1}", plain(point.least_mm[axis]), plain(point.greatest_mm[axis]));
            let _ = write!(text, " {along:>15}");
        }
        let _ = writeln!(text, " {:>9.1} {:>8.0}", point.farthest_mm, point.fastest_mm_s);
    }
    text
}

fn turns(survey: &RecordingSurvey) -> String {
    let [roll, opening, yaw] = &survey.turns_deg;
    let turns = [opening, yaw, roll]
        .map(|turn| format!("{} {:.1}° to {:.1}°", turn.name, plain(turn.least), plain(turn.greatest)));
    format!("turns by {:.1}° at most: {}\n\n", survey.turn_deg, turns.join(", "))
}

/// To a tenth, without a minus before zero.
fn plain(value: f64) -> f64 {
    (value * 10.0).round() / 10.0 + 0.0
}

fn gap(gap: &Gap) -> String {
    format!("line {}: {:.0} ms since the row before", gap.line, gap.lasts_s * 1e3)
}

fn glitch(glitch: &Glitch) -> String {
    let &Glitch { line, time_s, jump_m, within_s } = glitch;
    let (jump_mm, within_ms) = (jump_m * 1e3, within_s * 1e3);
    format!("line {line}, {time_s:.3} s: {jump_mm:.1} mm within {within_ms:.0} ms")
}

fn listed<T>(name: &str, entries: &[T], describe: impl Fn(&T) -> String) -> String {
    let mut text = String::new();
    for entry in entries.iter().take(MOST) {
        let _ = writeln!(text, "{name:<7} {}", describe(entry));
    }
    if entries.len() > MOST {
        let _ = writeln!(text, "{name:<7} and {} more (--format json has all)", entries.len() - MOST);
    }
    text
}

fn judgement(judged: &Judged) -> String {
    let refused = judged.refused.iter().map(|reason| format!("REFUSED: {reason}\n"));
    let plays = judged.strokes.iter().map(|Strokes { axis, margin_mm }| {
        format!("PLAYS: {axis} has {margin_mm:.1} mm left of its stroke\n")
    });
    refused.chain(plays).collect()
}

fn suggested(suggestion: &Suggestion) -> String {
    let mut text = String::from("suggest for the scenario:\n");
    let unit = suggestion.unit.map(|unit| format!("  {unit}\n"));
    let axes = suggestion.axes.iter().zip(&suggestion.jaw).map(|([anterior, left, up], jaw)| {
        let jaw = jaw.replace("; ", "\n  # ");
        format!("  # {jaw}\n  axes = [\"{anterior}\", \"{left}\", \"{up}\"]\n")
    });
    let motion: String = unit.into_iter().chain(axes).collect();
    if !motion.is_empty() {
        text = text + "  [motion]\n" + &motion;
    }
    if let Some([x, y, z]) = suggestion.closed_offset_m {
        let _ = writeln!(text, "  [jaw]\n  closed_offset_m = [{x:?}, {y:?}, {z:?}]");
    }
    let Judged { strokes, refused } = &suggestion.judged;
    if let Some(Strokes { axis, margin_mm }) = strokes {
        let _ =
            writeln!(text, "with that the motion plays, and {axis} has {margin_mm:.1} mm left of its stroke");
    }
    if let Some(reason) = refused {
        let _ = writeln!(text, "even then the motion is refused: {reason}");
    }
    text
}
