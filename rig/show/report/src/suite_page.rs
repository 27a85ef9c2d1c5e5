//! The page of a suite: its scenarios, and the table of requirements against scenarios with margins and their trend.

use masseter_page::{Block, Cell, Column, Life, Page, PageError, Section, Table, Time, Tone};

use crate::page::mark;
use crate::suite::{Outcome, RequirementRow, SuiteReport, TestedScenario};
use crate::text::{or_dash, significant};

/// The page of a suite.
///
/// # Errors
/// When the page's data cannot be written.
pub fn html_of_suite(report: &SuiteReport) -> Result<String, PageError> {
    let mut sections = vec![scenarios(report)];
    sections.extend(requirements(report));
    let about = format!("masseter {}, {:.1} s", report.masseter, report.took_s);
    Page { about, sections, ..Page::new("suite", Life::Finished, Time::default()) }.to_html()
}

fn scenarios(report: &SuiteReport) -> Section {
    let count = |outcome| report.count(outcome);
    let [passed, failed, untested] = [Outcome::Passed, Outcome::Failed, Outcome::Untested].map(count);
    let result = format!("{}: {passed} passed; {failed} failed; {untested} untested", report.word());
    let lines = [
        Some(result),
        (!report.unrun.is_empty()).then(|| format!("interrupted, not run: {}", report.unrun.join(", "))),
        (!report.left_out.is_empty()).then(|| format!("left out: {}", report.left_out.join(", "))),
        report.trend_in_words(),
    ];
    let warned = report.tested.iter().flat_map(|tested| {
        tested.warnings().iter().map(|warning| format!("warning in {}: {warning}", tested.name))
    });
    let lines = lines.into_iter().flatten().chain(warned).enumerate();
    let lines = lines.map(|(place, line)| Block::text(format!("line-{place}"), line));
    let columns =
        [Column::texts(&["scenario", "result", "why", "tags"]), Column::numbers(&["attempts", "took, s"])];
    let table = Table::new("Scenarios", columns, report.tested.iter().map(scenario_row));
    let blocks = lines.chain([Block::table("scenarios", table)]).collect();
    Section::new("result", "Result", blocks)
}

fn scenario_row(tested: &TestedScenario) -> [Cell; 6] {
    let tone = match (tested.outcome(), tested.is_short()) {
        (Outcome::Passed, _) if tested.retries() > 0 => Tone::Doubtful,
        (Outcome::Passed, _) => Tone::Good,
        (_, true) => Tone::Bad,
        (_, false) => Tone::Doubtful,
    };
    [
        tested.name.clone().into(),
        Cell::Mark { mark: tested.outcome().word().to_owned(), tone },
        tested.reason().into(),
        tested.tags.join(", ").into(),
        tested.attempts.len().to_string().into(),
        format!("{:.2}", tested.took_s).into(),
    ]
}

/// None where no scenario requires anything.
fn requirements(report: &SuiteReport) -> Option<Section> {
    let rows: Vec<_> = report.requirements().iter().map(requirement_row).collect();
    if rows.is_empty() {
        return None;
    }
    let columns = [
        Column::texts(&["id", "requirement", "scenario", "result"]),
        Column::numbers(&["margin", "of the limit", "before", "change"]),
    ];
    let table = Table::new("Requirements by scenario", columns, rows);
    Some(Section::new("requirements", "Requirements", vec![Block::table("requirements", table)]))
}

fn requirement_row(row: &RequirementRow<'_>) -> [Cell; 8] {
    let in_unit = |margin: f64| format!("{} {}", significant(margin), row.unit()).trim_end().to_owned();
    let percent = |share: f64| format!("{:.0} %", share * 100.0);
    let share = row.check.figures.as_ref().and_then(|figures| figures.relative_margin);
    let before = match row.before {
        Some(before) if before.margin.is_none() => before.result.clone(),
        before => or_dash(before.and_then(|before| before.margin), in_unit),
    };
    [
        or_dash(row.check.id.as_ref(), Clone::clone).into(),
        row.check.name.to_string().into(),
        row.scenario.into(),
        mark(row.check.result),
        or_dash(row.margin(), in_unit).into(),
        or_dash(share, percent).into(),
        before.into(),
        or_dash(row.relative_change(), |change| format!("{:+.0} %", change * 100.0)).into(),
    ]
}
