//! The description of a recorded motion in words. Finds and judges nothing.

use std::fmt::Write;

use masseter_judge::{RecordedError, RecordedFigures};
use masseter_recorded_motion::{Frame, Gap, Glitch, PointFigures, Range, RecordingSurvey};
use masseter_scenario::wording::counted;

use super::found::{Found, Judged, Strokes, Suggestion};

/// Gaps and glitches that are listed.
const MOST: usize = 8;

/// The description as text: no line is longer than a terminal, but for those with a path.
pub(super) fn describe(found: &Found) -> String {
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
