//! The description as text: no line is longer than a terminal, but for those with a path.

use std::fmt::Write;

use masseter_controller::trajectory::{PointFigures, Range, RecordingSurvey};
use masseter_scenario::wording::counted;

use super::found::Found;
use super::suggestion::Suggestion;

/// Gaps and glitches that are listed.
const MOST: usize = 8;

pub(super) fn text(found: &Found) -> String {
    let survey = &found.survey;
    let mut text = format!("{}: {}\n", found.file.display(), head(survey));
    let _ = writeln!(text, "follows {}\n", survey.follows);
    text += &columns(&survey.columns);
    text += &points(&survey.points);
    text += &turns(survey);
    text += &listed("gap", &gaps(survey));
    text += &listed("glitch", &glitches(survey));
    for doubt in &survey.doubts {
        let _ = writeln!(text, "warning {doubt}");
    }
    text + &judgement(found)
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

fn gaps(survey: &RecordingSurvey) -> Vec<String> {
    let gap = |gap: &masseter_controller::trajectory::Gap| {
        format!("line {}: {:.0} ms since the row before", gap.line, gap.lasts_s * 1e3)
    };
    survey.gaps.iter().map(gap).collect()
}

fn glitches(survey: &RecordingSurvey) -> Vec<String> {
    let glitch = |glitch: &masseter_controller::trajectory::Glitch| {
        let (line, time_s, jump_mm, within_ms) =
            (glitch.line, glitch.time_s, glitch.jump_m * 1e3, glitch.within_s * 1e3);
        format!("line {line}, {time_s:.3} s: {jump_mm:.1} mm within {within_ms:.0} ms")
    };
    survey.glitches.iter().map(glitch).collect()
}

fn listed(name: &str, entries: &[String]) -> String {
    let mut text = String::new();
    for entry in entries.iter().take(MOST) {
        let _ = writeln!(text, "{name:<7} {entry}");
    }
    if entries.len() > MOST {
        let _ = writeln!(text, "{name:<7} and {} more (--format json has all)", entries.len() - MOST);
    }
    text
}

fn judgement(found: &Found) -> String {
    let mut text = match (&found.refused, &found.strokes) {
        (Some(reason), _) => format!("REFUSED: {reason}\n"),
        (None, Some(strokes)) => {
            format!("PLAYS: {} has {:.1} mm left of its stroke\n", strokes.axis, strokes.margin_mm)
        }
        (None, None) => String::new(),
    };
    if let Some(suggestion) = &found.suggestion {
        text += &suggested(suggestion);
    }
    text
}

fn suggested(suggestion: &Suggestion) -> String {
    let mut text = String::from("suggest for the scenario:\n");
    if let Some([anterior, left, up]) = &suggestion.axes {
        let _ = writeln!(text, "  [motion]\n  axes = [\"{anterior}\", \"{left}\", \"{up}\"]");
    }
    if let Some([x, y, z]) = suggestion.closed_offset_m {
        let _ = writeln!(text, "  [jaw]\n  closed_offset_m = [{x:?}, {y:?}, {z:?}]");
    }
    match (&suggestion.strokes, &suggestion.refused) {
        (Some(strokes), _) => {
            let _ = writeln!(
                text,
                "with that the motion plays, and {} has {:.1} mm left of its stroke",
                strokes.axis, strokes.margin_mm
            );
        }
        (None, Some(reason)) => {
            let _ = writeln!(text, "even then the motion is refused: {reason}");
        }
        (None, None) => {}
    }
    text
}
