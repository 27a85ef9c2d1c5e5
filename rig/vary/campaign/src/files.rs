//! The files of a campaign's report: the page, which needs no network, and the table, a row a case.

use std::fs::{self, File};

use anyhow::Context;
use masseter_table::{Column, Table, Values, write_table};

use crate::case::{COLUMNS, CaseCheck, CaseResult, check_names};
use crate::report::{PAGE, Report, WorstCase};
use crate::{campaign::Campaign, folder::CampaignFolder, page};

/// Writes page and table into the folder of the campaign.
///
/// # Errors
/// When a file cannot be written.
pub fn write(report: &Report<'_>, folder: &CampaignFolder, worst: &[WorstCase]) -> anyhow::Result<()> {
    // The page first: it needs no other program.
    let html = page::html(report, worst).context("cannot make the page")?;
    let path = folder.file(PAGE);
    fs::write(&path, html).with_context(|| format!("cannot write {}", path.display()))?;
    let path = report.table_path(folder);
    let unfinished = path.with_extension("part");
    let unwritten = || format!("cannot write {}", path.display());
    let file = File::create(&unfinished).with_context(unwritten)?;
    write_table(&report.format, file, &results_table(report.campaign, &report.results))?;
    fs::rename(&unfinished, &path).with_context(unwritten)
}

/// The table: case, factors, verdict, margins, figures.
fn results_table(campaign: &Campaign, results: &[CaseResult]) -> Table {
    let [identity, verdict, figures] = COLUMNS.map(|columns| {
        columns.iter().map(|&(name, unit, about, values)| Column::new(name, unit, about, values(results)))
    });
    let factors = campaign.file.factors.iter().enumerate();
    let factors = factors.map(|(at, factor)| factor_column(results, at, factor));
    let checks = check_names(results).into_iter().flat_map(|name| check_columns(results, &name));
    Table::new(identity.chain(factors).chain(verdict).chain(checks).chain(figures).collect())
}

/// Numbers where all values of the factor are numbers, otherwise words.
fn factor_column(results: &[CaseResult], at: usize, factor: &crate::factor::Factor) -> Column {
    let settings = || results.iter().map(|result| &result.settings[at]);
    let values = if settings().all(|setting| setting.number().is_some()) {
        Values::Numbers(settings().map(crate::factor::Setting::number).collect())
    } else {
        Values::Words(settings().map(|setting| Some(setting.word())).collect())
    };
    Column::new(factor.name(), factor.unit(), "factor", values)
}

/// Whether the check passed, and its margin where it has one.
fn check_columns(results: &[CaseResult], name: &str) -> Vec<Column> {
    let checks = || results.iter().map(|result| result.checks.iter().find(|check| check.name == name));
    let passed = checks().map(|check| check?.passed).collect();
    let about = "whether the check passed";
    let mut columns = vec![Column::new(&format!("{name}.passed"), "", about, Values::Truths(passed))];
    let with_margin = checks().flatten().find(|check| check.margin.is_some());
    if let Some(CaseCheck { unit, .. }) = with_margin {
        let column = |ending: &str, unit: &str, about: &str, number: fn(&CaseCheck) -> Option<f64>| {
            let numbers = checks().map(|check| number(check?)).collect();
            Column::new(&format!("{name}.{ending}"), unit, about, Values::Numbers(numbers))
        };
        columns.push(column("margin", unit, "distance from failing", |check| check.margin));
        let about = "distance from failing as a share of the limit";
        columns.push(column("relative_margin", "", about, |check| check.relative_margin));
    }
    columns
}
