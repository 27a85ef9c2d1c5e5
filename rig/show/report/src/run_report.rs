//! The report of a run folder: one pass over its recording, then every file of the report.

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use masseter_judge::{Analysis, Figures, Verdict};
use masseter_recording::{Manifest, ReadError, Reader, Recorded, RunFolder, manifest_of};
use masseter_runtime::messages::tap::{self, TapError};
use masseter_scenario::Scenario;
use masseter_terminal::{Exit, Failure, Format, OrFailure, result, result_with_tones, status};
use serde::Serialize;

use crate::logs::{CandumpLogs, WriteError, write_events, write_histograms};
use crate::table::{self, Detail};
use crate::{junit, page, why::Why};

/// Why the recording of a run could not be analysed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum AnalysisError {
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error("a message on topic 'frame' holds no CAN frame: {0}")]
    Frame(#[from] TapError),
}

/// Analyses and judges a run that has just ended, prints its report and writes it. Without `shown` nothing is printed, for a run
/// of many. `reserved` holds the summary's room on the disk until the verdict is printed.
///
/// ```no_run
/// use masseter_recording::{Manifest, RunFolder};
/// use masseter_report::{Detail, report_run};
/// use masseter_terminal::Format;
///
/// let folder = RunFolder::open("runs/latest".as_ref())?;
/// let manifest = Manifest::read(&folder)?;
/// let reserved = std::fs::File::create(folder.file("reserved"))?;
/// let shown = Some((Format::Human, Detail::Brief));
/// let verdict = report_run(&folder, &manifest, shown, reserved).map_err(|failure| failure.error)?;
/// println!("{:?}", verdict.exit_code);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// With [`Exit::Incomplete`] when the recording cannot be read, or a file or standard output cannot be written.
pub fn report_run(
    folder: &RunFolder,
    manifest: &Manifest,
    shown: Option<(Format, Detail)>,
    reserved: File,
) -> Result<Verdict, Failure> {
    let analysed = analyse(folder, manifest, Some(folder.path()));
    let (figures, logged) = analysed.context("the run's recording cannot be analysed").incomplete()?;
    let (verdict, written) = show_and_write(folder, manifest, &figures, logged, shown, Some(reserved))?;
    written.incomplete()?;
    Ok(verdict)
}

/// `masseter report`: the same of a past run, with assignments to keys of `[study]`. Where its folder is read-only, the run is shown and no file is written.
///
/// ```no_run
/// use masseter_report::report_past_run;
/// use masseter_terminal::Format;
///
/// let exit = report_past_run("runs/latest".as_ref(), &[], Format::Human).map_err(|failure| failure.error)?;
/// println!("{exit:?}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// With [`Exit::Usage`] when the folder holds no readable run, with [`Exit::Incomplete`] when a file cannot be written.
pub fn report_past_run(path: &Path, set: &[String], format: Format) -> Result<Exit, Failure> {
    let folder = RunFolder::open(path).usage()?;
    refuse_running(&folder).usage()?;
    let unread = || format!("cannot read {}", folder.manifest().display());
    let mut manifest = manifest_of(&folder).with_context(unread).usage()?;
    choose_cycles(&mut manifest.scenario, set).usage()?;
    let (figures, logged) = analyse(&folder, &manifest, Some(folder.path())).usage()?;
    let shown = Some((format, Detail::Whole));
    let (verdict, written) = show_and_write(&folder, &manifest, &figures, logged, shown, None)?;
    match written {
        Err(WriteError { path, error }) if is_read_only(&error) => status!(
            "masseter: cannot write {}: {error}; the run is shown, and no file written",
            path.display()
        ),
        written => written.incomplete()?,
    }
    Ok(verdict.exit_code)
}

/// Refuses a run that goes on: its manifest says until the end that the supervisor has died.
fn refuse_running(folder: &RunFolder) -> anyhow::Result<()> {
    let path = folder.path().display();
    ensure!(!folder.is_occupied(), "the run {path} goes on and has no verdict yet: wait for its end");
    Ok(())
}

/// Writes the page of a failed run again, with until when the run could pass; returns its place.
pub fn explain(path: &Path, why: &Why) -> Result<PathBuf, Failure> {
    let folder = RunFolder::open(path).usage()?;
    let manifest = manifest_of(&folder).context("cannot read the manifest").usage()?;
    let (figures, _) = analyse(&folder, &manifest, None).usage()?;
    let verdict = Verdict::new(&manifest, &figures);
    let html = page::html(&manifest, &figures, &verdict, Some(why));
    let html = html.context("cannot write the page").incomplete()?;
    let page = folder.file("report.html");
    folder.keep(&page, &html).with_context(|| format!("cannot write {}", page.display())).incomplete()?;
    Ok(page)
}

/// Applies assignments of `[study]`: nothing else of a run can change once it is recorded.
pub(crate) fn choose_cycles(scenario: &mut Scenario, set: &[String]) -> anyhow::Result<()> {
    for assignment in set {
        let is_choice = assignment.trim_start().starts_with("study.");
        ensure!(is_choice, "--set {assignment}: the run is recorded; only keys of 'study.' can be set");
        *scenario = scenario.with(assignment).context("--set")?;
    }
    Ok(scenario.validate()?)
}

/// Whether the folder takes no files, as an archive does.
fn is_read_only(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem)
}

/// Reads the recording once: its figures, and whether its CAN frames could be written into a folder, as candump logs.
pub(crate) fn analyse(
    folder: &RunFolder,
    manifest: &Manifest,
    log_folder: Option<&Path>,
) -> Result<(Figures, Result<(), WriteError>), AnalysisError> {
    let mut reader = Reader::open(&folder.recording())?;
    // The files that it named may have changed since.
    let mut scenario = manifest.scenario.clone();
    scenario.files_mut().for_each(|(name, file)| *file = folder.file(&name));
    let mut analysis = Analysis::new(&scenario, &manifest.declared);
    manifest.process_faults.iter().for_each(|fault| analysis.process_fault(fault));
    analysis.loop_samples(&manifest.usage);
    let mut logs = Ok(log_folder.map(|folder| CandumpLogs::new(folder, &manifest.scenario.can.interfaces)));
    while let Some(message) = reader.next_message()? {
        analysis.take(&message)?;
        if let (Recorded::Frame(frame), Ok(Some(open))) = (&message, &mut logs)
            && let Err(error) = open.write(tap::bus_of(frame)?, &tap::decode(frame)?)
        {
            logs = Err(error);
        }
    }
    let figures = analysis.finish(reader.was_cut_short(), reader.damage());
    Ok((figures, logs.and_then(|logs| logs.map_or(Ok(()), |logs| logs.finish().map(drop)))))
}

/// Judges the run and prints the result, then writes every file of the report, the summary first.
fn show_and_write(
    folder: &RunFolder,
    manifest: &Manifest,
    figures: &Figures,
    logged: Result<(), WriteError>,
    shown: Option<(Format, Detail)>,
    reserved: Option<File>,
) -> Result<(Verdict, Result<(), WriteError>), Failure> {
    let verdict = Verdict::new(manifest, figures);
    let summary = summary_json(&verdict, figures).context("cannot write the summary").incomplete()?;
    let page = page::html(manifest, figures, &verdict, None).context("cannot write the page").incomplete()?;
    let junit = junit::xml(manifest, figures, &verdict).context("cannot write junit.xml").incomplete()?;
    let shown = match shown {
        None => Ok(()),
        Some((Format::Human, detail)) => {
            let table = table::table_in_words(manifest, figures, &verdict, detail);
            let more = if detail == Detail::Brief { "; --verbose shows every figure" } else { "" };
            let said = table::verdict_in_words(&verdict, folder.path());
            let report = format!("report: {}{more}\n", folder.file("report.html").display());
            // What failed is the last that a screen shows; a pass fits on one.
            let text = match verdict.exit_code {
                Exit::Passed => format!("{said}{table}\n{report}"),
                _ => format!("{table}\n{report}{said}"),
            };
            result_with_tones(&text, &table::TONES)
        }
        Some((Format::Json, _)) => result(&summary),
    };
    drop(reserved);
    let others = [("junit.xml", junit), ("report.html", page)];
    let written = write_files(folder, figures, logged, &summary, others);
    shown.incomplete()?;
    Ok((verdict, written))
}

/// Writes the summary, the logs and the other documents; `logged` is whether the logs of the buses were written.
fn write_files(
    folder: &RunFolder,
    figures: &Figures,
    logged: Result<(), WriteError>,
    summary: &str,
    others: [(&str, String); 2],
) -> Result<(), WriteError> {
    fs::write(folder.summary(), summary).map_err(WriteError::for_file(&folder.summary()))?;
    logged?;
    write_histograms(&folder.file("hist"), &figures.intervals)?;
    write_events(&folder.file("events.jsonl"), &figures.events)?;
    others
        .into_iter()
        .map(|(name, text)| (folder.file(name), text))
        .try_for_each(|(path, text)| fs::write(&path, text).map_err(WriteError::for_file(&path)))
}

/// Version of the summary's form.
pub(crate) const SUMMARY_FORM: u32 = 3;

#[derive(Serialize)]
struct Summary<'a> {
    form: u32,
    verdict: &'a Verdict,
    figures: &'a Figures,
}

/// The file's content.
pub(crate) fn summary_json(verdict: &Verdict, figures: &Figures) -> serde_json::Result<String> {
    Ok(serde_json::to_string_pretty(&Summary { form: SUMMARY_FORM, verdict, figures })? + "\n")
}

#[cfg(test)]
mod tests;
