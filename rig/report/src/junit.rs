//! `junit.xml`: each check of the run as a test case, as CI systems show it.

use askama::Template;
use masseter_analysis::Figures;
use masseter_recording::Manifest;
use masseter_terminal::Exit;

use crate::check::{Check, CheckResult};
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
    /// With checks of the rig that were not tested: most CI systems show a suite with skipped cases as passed.
    fn failures(&self) -> usize {
        if !self.is_short() {
            return 0;
        }
        self.count(CheckResult::Failed) + self.count(CheckResult::Untested) - self.untested_requirements()
    }

    /// Whether the run did not pass. A check that failed in a run that passed did so as the scenario expects.
    fn is_short(&self) -> bool {
        self.verdict.exit_code != Exit::Passed
    }

    /// Whether the case of the run itself is an error: no other case shows why the run did not pass.
    fn is_unexplained(&self) -> bool {
        let is_by_checks = self.verdict.reason.starts_with("failed: ") || self.verdict.word == "UNTESTED";
        self.is_short() && !(self.verdict.is_judged() && is_by_checks)
    }

    fn untested_requirements(&self) -> usize {
        let is_untested = |check: &&Check| check.is_requirement() && check.result == CheckResult::Untested;
        self.verdict.checks.iter().filter(is_untested).count()
    }

    fn count(&self, result: CheckResult) -> usize {
        self.verdict.checks.iter().filter(|check| check.result == result).count()
    }

    fn skipped(&self) -> usize {
        if !self.is_short() {
            return self.verdict.checks.iter().filter(|check| check.result != CheckResult::Passed).count();
        }
        self.count(CheckResult::Excused) + self.count(CheckResult::NotJudged) + self.untested_requirements()
    }
}

/// The document. XML has no form for most control characters: they become replacement characters.
pub(crate) fn xml(manifest: &Manifest, figures: &Figures, verdict: &Verdict) -> askama::Result<String> {
    let is_no_xml = |c: char| c.is_control() && c != '\n' || ('\u{fffe}'..='\u{ffff}').contains(&c);
    Ok(Suite { manifest, figures, verdict }.render()?.replace(is_no_xml, "\u{fffd}"))
}

#[cfg(test)]
mod tests {
    use masseter_analysis::Analysis;
    use masseter_recording::MachineInfo;
    use masseter_shared::config::Scenario;
    use masseter_shared::named::Declared;

    use super::*;

    #[test]
    fn a_reason_of_any_characters_leaves_the_document_xml() {
        let machine = MachineInfo { cpu: String::new(), cores: 2, kernel: String::new(), is_virtual: false };
        let manifest = Manifest::new(Scenario::default(), 10.0, "virtual", machine);
        let figures = Analysis::new(&manifest.scenario, &Declared::default()).finish(false, &[]);
        let verdict =
            Verdict { reason: "<&\u{1b}\u{ffff}\">".to_owned(), ..Verdict::new(&manifest, &figures) };
        let xml = xml(&manifest, &figures, &verdict).unwrap();
        let case = "  <testcase classname=\"masseter.run\" name=\"run\">\
                    <error message=\"DIED: &#60;&#38;\u{fffd}\u{fffd}&#34;&#62;\"/></testcase>\n";
        assert!(xml.contains(case), "{xml}");
    }
}
