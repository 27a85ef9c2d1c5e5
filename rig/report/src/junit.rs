//! `junit.xml`: each check of the run as a test case, as CI systems show it.

use askama::Template;
use masseter_analysis::Figures;
use masseter_recording::Manifest;

use crate::checks::CheckResult;
use crate::verdict::Verdict;

/// One suite; a run that ended wrongly or cannot be judged has an `error` in a case of its own.
#[derive(Template)]
#[template(path = "junit.xml")]
struct Suite<'a> {
    manifest: &'a Manifest,
    figures: &'a Figures,
    verdict: &'a Verdict,
}

impl Suite<'_> {
    fn count(&self, result: CheckResult) -> usize {
        self.verdict.checks.iter().filter(|check| check.result == result).count()
    }
}

/// The document. XML has no form for most control characters: they become replacement characters.
pub(crate) fn xml(manifest: &Manifest, figures: &Figures, verdict: &Verdict) -> askama::Result<String> {
    let is_no_xml = |c: char| c.is_control() && c != '\n' || ('\u{fffe}'..='\u{ffff}').contains(&c);
    Ok(Suite { manifest, figures, verdict }.render()?.replace(is_no_xml, "\u{fffd}"))
}
