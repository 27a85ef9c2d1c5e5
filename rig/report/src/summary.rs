//! `summary.json`: the verdict and the figures of a run.

use masseter_analysis::Figures;
use serde::Serialize;

use crate::verdict::Verdict;

/// Version of the summary's form.
pub(crate) const FORM: u32 = 2;

#[derive(Serialize)]
struct Summary<'a> {
    form: u32,
    verdict: &'a Verdict,
    figures: &'a Figures,
}

/// The file's content.
pub(crate) fn json(verdict: &Verdict, figures: &Figures) -> serde_json::Result<String> {
    Ok(serde_json::to_string_pretty(&Summary { form: FORM, verdict, figures })? + "\n")
}
