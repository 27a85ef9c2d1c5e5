//! The files of a campaign's report.

use std::fs::{self, File};

use anyhow::Context;
use masseter_table::write_table;

use crate::folder::CampaignFolder;
use crate::page;
use crate::report::{PAGE, Report, WorstCase};
use crate::results_table::results_table;

/// Writes page and table into the folder of the campaign.
///
/// # Errors
/// When a file cannot be written.
pub fn write(report: &Report<'_>, folder: &CampaignFolder, worst: &[WorstCase]) -> anyhow::Result<()> {
    // The page first: it needs no other program.
    let html = page::html(report, worst).context("cannot make the page")?;
    let path = folder.file(PAGE);
    fs::write(&path, html).with_context(|| format!("cannot write {}", path.display()))?;
    let path = report.table(folder);
    let unfinished = path.with_extension("part");
    let unwritten = || format!("cannot write {}", path.display());
    let file = File::create(&unfinished).with_context(unwritten)?;
    write_table(&report.format, file, &results_table(report.campaign, &report.results))?;
    fs::rename(&unfinished, &path).with_context(unwritten)
}
