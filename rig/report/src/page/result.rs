//! The verdict, the figures that matter most, and the checks.

use masseter_analysis::Figures;
use masseter_page::{Block, Column, Content, Section, Table, Tone};
use masseter_recording::Manifest;
use masseter_terminal::Exit;

use crate::check::{Check, CheckResult};
use crate::text::{decimals, microseconds, or_dash};
use crate::timing::TimingWord;
use crate::verdict::Verdict;

pub(super) fn section(manifest: &Manifest, figures: &Figures, verdict: &Verdict) -> Section {
    let row = |check: &Check| {
        let Check { name, finding, result, .. } = check;
        vec![name.to_string().into(), mark(*result), finding.clone().into()]
    };
    let checks = verdict.checks.iter().filter(|check| !check.is_requirement());
    let table = Table {
        label: "Checks".to_owned(),
        columns: vec![Column::text("check"), Column::text("result"), Column::text("found")],
        rows: checks.map(row).collect(),
    };
    let blocks = vec![
        Block::new("verdict", Content::Verdict(panel(manifest, figures, verdict))),
        Block::new("moments", Content::Moments),
        Block::table("checks", table),
    ];
    Section::new("result", "Result", blocks)
}

/// The word for a result as a cell.
pub(super) fn mark(result: CheckResult) -> masseter_page::Cell {
    let tone = match result {
        CheckResult::Passed => Tone::Good,
        CheckResult::Failed => Tone::Bad,
        CheckResult::Excused | CheckResult::Untested => Tone::Doubtful,
        CheckResult::NotJudged => Tone::Plain,
    };
    masseter_page::Cell::Mark { mark: result.mark().to_owned(), tone }
}

fn panel(manifest: &Manifest, figures: &Figures, verdict: &Verdict) -> masseter_page::Verdict {
    let timing = verdict.timing.to_string();
    let (word, more) = timing.split_once(" (").unwrap_or((&timing, ""));
    let more = more.trim_end_matches(')').to_owned();
    let reasons = [more].into_iter().filter(|more| !more.is_empty()).chain(verdict.advice(manifest));
    masseter_page::Verdict {
        word: verdict.word.to_owned(),
        reason: verdict.reason.clone(),
        tone: match verdict.exit_code {
            Exit::Passed => Tone::Good,
            Exit::Invalid | Exit::Interrupted => Tone::Doubtful,
            _ => Tone::Bad,
        },
        timing: word.to_owned(),
        timing_reason: reasons.collect::<Vec<_>>().join("; "),
        timing_tone: match verdict.timing.word {
            TimingWord::Held => Tone::Good,
            TimingWord::Disturbed | TimingWord::Stalled => Tone::Doubtful,
            TimingWord::Missed => Tone::Bad,
            TimingWord::Simulated | TimingWord::Unknown => Tone::Plain,
        },
        figures: figures_in_words(figures),
    }
}

fn figures_in_words(figures: &Figures) -> Vec<[String; 2]> {
    let errors = figures.tracking.actual;
    let mm = |value: Option<f64>| or_dash(value, |mm| format!("{} mm", decimals(mm)));
    let longest = figures.worst_cycles.first().map(|cycle| cycle.total_ns);
    let mut all = [
        ["incisal point from desired, rms", &mm(errors.incisal_rms_mm)],
        ["incisal point from desired, most", &mm(errors.incisal_max_mm)],
    ]
    .map(|pair| pair.map(str::to_owned))
    .to_vec();
    if let Some(longest_ns) = longest {
        all.push(["longest cycle".to_owned(), format!("{} µs", microseconds(longest_ns))]);
    }
    if let Some(most_n) = figures.bite_force_max_n.filter(|most_n| *most_n > 0.0) {
        all.push(["greatest bite force".to_owned(), format!("{most_n:.1} N")]);
    }
    all
}
