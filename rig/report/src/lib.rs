//! The report of a run: on the screen, as JSON, as JUnit XML and as a page.
//!
//! Everything is computed from the manifest and the recording, so `masseter report` can do it again.

mod charts;
pub mod checks;
pub mod compare;
mod events;
mod film;
mod html;
mod junit;
pub mod outcome;
mod table;
mod usage;
pub mod verdict;

use std::fs;
use std::io::{self, ErrorKind};
use std::path::Path;

use anyhow::Context;
use serde::Serialize;

use masseter_analysis::{AnalysisError, Figures};
use masseter_recording::{Manifest, RunFolder};
use masseter_terminal::Format;
use masseter_terminal::show;
use masseter_terminal::{Exit, Failure, OrFailure};
use verdict::Verdict;

/// Version of the summary's form.
const FORM: u32 = 1;

/// `summary.json`.
#[derive(Debug, Serialize)]
struct Summary<'a> {
    form: u32,
    verdict: &'a Verdict,
    figures: &'a Figures,
}

/// `masseter report`: the report of a past run. Its folder may be an archive that takes nothing more.
pub fn again(path: &Path, format: Format) -> Result<Exit, Failure> {
    let folder = RunFolder::open(path).usage()?;
    let unread = || format!("cannot read {}", folder.manifest().display());
    let manifest = Manifest::read(&folder).with_context(unread).usage()?;
    match masseter_analysis::analyse(&folder, &manifest.scenario) {
        Err(AnalysisError::Write { path, error }) if is_read_only(&error) => {
            masseter_terminal::status!(
                "masseter: cannot write {}: {error}; the run is shown, and no file written",
                path.display()
            );
            let figures = masseter_analysis::look(&folder, &manifest.scenario).usage()?;
            Ok(present(&folder, &manifest, &figures, format)?.verdict.outcome.exit())
        }
        written @ Err(AnalysisError::Write { .. }) => {
            write(&folder, &manifest, &written.incomplete()?, format)
        }
        read => write(&folder, &manifest, &read.usage()?, format),
    }
}

fn is_read_only(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem)
}

/// A run judged, and its summary as JSON.
struct Presented {
    verdict: Verdict,
    json: String,
}

/// Judges the run and prints the result.
fn present(
    folder: &RunFolder,
    manifest: &Manifest,
    figures: &Figures,
    format: Format,
) -> Result<Presented, Failure> {
    let verdict = Verdict::of(manifest, figures);
    let summary = Summary { form: FORM, verdict: &verdict, figures };
    let json =
        serde_json::to_string_pretty(&summary).context("cannot write the summary").incomplete()? + "\n";
    show(&match format {
        Format::Human => {
            format!("{}\nfiles: {}\n", table::of_run(manifest, figures, &verdict), folder.path().display())
        }
        Format::Json => json.clone(),
    });
    Ok(Presented { verdict, json })
}

/// Judges the run, prints the result and writes the report's files.
pub fn write(
    folder: &RunFolder,
    manifest: &Manifest,
    figures: &Figures,
    format: Format,
) -> Result<Exit, Failure> {
    let Presented { verdict, json } = present(folder, manifest, figures, format)?;
    for (path, text) in [
        (folder.summary(), &json),
        (folder.junit(), &junit::of_run(manifest, figures, &verdict)),
        (folder.report(), &html::of_run(manifest, figures, &verdict)),
    ] {
        fs::write(&path, text).with_context(|| format!("cannot write {}", path.display())).incomplete()?;
    }
    Ok(verdict.outcome.exit())
}
