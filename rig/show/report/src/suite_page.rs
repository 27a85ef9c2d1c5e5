//! The page of a suite: its result with a histogram of margins, its scenarios with links to the runs that were kept, and the
//! table of requirements against scenarios with margins and their trend.

use std::path::Path;

use masseter_judge::CheckResult;
use masseter_page::{
    Block, Cell, Column, Content, Life, Page, PageError, Section, Table, Time, Tone, Verdict,
    margin_histogram,
};

use crate::page::mark;
use crate::suite::{Outcome, RequirementRow, SuiteReport, TestedScenario};
use crate::text::{or_dash, seen_from, significant};

/// The page of a suite, for this file: the runs that were kept are linked from there.
///
/// # Errors
/// When the page's data cannot be written.
pub fn html_of_suite(report: &SuiteReport, file: &Path) -> Result<String, PageError> {
    let mut sections = vec![result(report), scenarios(report, file)];
    sections.extend(requirements(report));
    let about = format!("masseter {}, {:.1} s", report.masseter, report.took_s);
    Page { about, sections, ..Page::new("Suite", Life::Finished, Time::default()) }.to_html()
}

fn result(report: &SuiteReport) -> Section {
    let count = |outcome| report.count(outcome).to_string();
    let counts = [("passed", Outcome::Passed), ("failed", Outcome::Failed), ("untested", Outcome::Untested)]
        .map(|(name, outcome)| [name.to_owned(), count(outcome)]);
    let reasons = [
        (!report.unrun.is_empty()).then(|| format!("interrupted, not run: {}", report.unrun.join(", "))),
        (!report.left_out.is_empty()).then(|| format!("left out: {}", report.left_out.join(", "))),
        report.trend_in_words(),
    ];
    let tone = match (report.tested.iter().any(TestedScenario::is_short), report.unrun.is_empty()) {
        (true, _) => Tone::Bad,
        (false, true) => Tone::Good,
        (false, false) => Tone::Doubtful,
    };
    let verdict = Verdict {
        word: report.word().to_owned(),
        reason: reasons.into_iter().flatten().collect::<Vec<_>>().join("; "),
        next: None,
        tone,
        timing: "simulated".to_owned(),
        timing_reason: String::new(),
        timing_tone: Tone::Plain,
        figures: counts.into(),
    };
    let warned = report.tested.iter().flat_map(|tested| {
        tested.warnings().iter().map(|warning| format!("warning in {}: {warning}", tested.name))
    });
    let warned = warned.enumerate().map(|(place, line)| Block::text(format!("warning-{place}"), line));
    let margins: Vec<_> = report.requirements().iter().filter_map(RequirementRow::relative_margin).collect();
    let histogram = margin_histogram("Requirements by their margin", "requirement", &margins);
    let histogram = histogram.map(|chart| Block::chart("margins", chart));
    let blocks =
        [Block::new("verdict", Content::Verdict(verdict))].into_iter().chain(warned).chain(histogram);
    Section::new("result", "Result", blocks.collect())
}

fn scenarios(report: &SuiteReport, file: &Path) -> Section {
    let columns =
        [Column::texts(&["scenario", "result", "why", "tags"]), Column::numbers(&["attempts", "took, s"])];
    // What did not pass is first.
    let mut tested: Vec<_> = report.tested.iter().collect();
    tested.sort_by_key(|tested| (!tested.is_short(), tested.outcome() == Outcome::Passed));
    let table = Table::new(
        "Table of scenarios",
        columns,
        tested.into_iter().map(|tested| scenario_row(tested, file)),
    );
    Section::new("scenarios", "Scenarios", vec![Block::table("scenarios", table)])
}

/// The report of the last run that was kept, seen from the page.
fn link(tested: &TestedScenario, file: &Path) -> Option<String> {
    let folder = tested.attempts.iter().rev().find_map(|attempt| attempt.folder.as_ref())?;
    seen_from(file, &folder.join("report.html"))
}

fn scenario_row(tested: &TestedScenario, file: &Path) -> [Cell; 6] {
    let tone = match (tested.outcome(), tested.is_short()) {
        (Outcome::Passed, _) if tested.retries() > 0 => Tone::Doubtful,
        (Outcome::Passed, _) => Tone::Good,
        (_, true) => Tone::Bad,
        (_, false) => Tone::Doubtful,
    };
    let name = tested.name.clone();
    [
        link(tested, file)
            .map_or_else(|| name.clone().into(), |href| Cell::Link { text: name.clone(), href }),
        Cell::Mark { mark: tested.outcome().word().to_owned(), tone },
        tested.reason().into(),
        tested.tags.join(", ").into(),
        tested.attempts.len().to_string().into(),
        format!("{:.2}", tested.took_s).into(),
    ]
}

/// Those that failed are first. None where no scenario requires anything.
fn requirements(report: &SuiteReport) -> Option<Section> {
    let mut rows = report.requirements();
    rows.sort_by_key(|row| row.check.result != CheckResult::Failed);
    let has_baseline = report.baseline.is_some();
    let trend = if has_baseline { Column::numbers(&["before", "change"]) } else { Vec::new() };
    let columns = [
        Column::texts(&["id", "requirement", "scenario", "result"]),
        Column::numbers(&["margin", "of the limit"]),
        trend,
    ];
    let cells = rows.iter().map(|row| {
        let trend = has_baseline.then(|| trend_cells(row));
        requirement_cells(row).into_iter().chain(trend.into_iter().flatten())
    });
    let table = Table::new("Table of requirements by scenario", columns, cells);
    let section = || Section::new("requirements", "Requirements", vec![Block::table("requirements", table)]);
    (!rows.is_empty()).then(section)
}

fn requirement_cells(row: &RequirementRow<'_>) -> [Cell; 6] {
    [
        or_dash(row.check.id.as_ref(), Clone::clone).into(),
        row.check.name.to_string().into(),
        row.scenario.into(),
        mark(row.check.result),
        or_dash(row.margin(), |margin| in_unit(row, margin)).into(),
        or_dash(row.relative_margin(), |share| format!("{:.0} %", share * 100.0)).into(),
    ]
}

fn trend_cells(row: &RequirementRow<'_>) -> [Cell; 2] {
    let before = match row.before {
        Some(before) if before.margin.is_none() => before.result.clone(),
        before => or_dash(before.and_then(|before| before.margin), |margin| in_unit(row, margin)),
    };
    [before.into(), or_dash(row.relative_change(), |change| format!("{:+.0} %", change * 100.0)).into()]
}

fn in_unit(row: &RequirementRow<'_>, margin: f64) -> String {
    format!("{} {}", significant(margin), row.unit()).trim_end().to_owned()
}
