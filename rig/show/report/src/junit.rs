//! JUnit documents, as CI systems show them: a run or a whole suite of runs, each check as a test case.

use askama::Template;
use masseter_analysis::{Check, CheckFigures, CheckResult, Figures, Verdict};
use masseter_recording::Manifest;
use masseter_runtime::named::PlayedMotion;
use masseter_terminal::Exit;

/// A document with one run, or with the runs of a suite that took so long.
#[derive(Template)]
#[template(path = "junit.xml")]
struct Document<'a> {
    runs: &'a [JunitRun<'a>],
    suite_s: Option<f64>,
}

/// A run as a test suite: a case for the run itself, and one for each of its checks.
#[derive(Debug)]
pub struct JunitRun<'a> {
    name: String,
    /// The class of its cases.
    class: String,
    properties: Vec<(&'static str, String)>,
    took_s: f64,
    timestamp: Option<&'a str>,
    cases: Vec<Case<'a>>,
}

#[derive(Debug)]
struct Case<'a> {
    name: &'a str,
    result: CaseResult,
    figures: Option<&'a CheckFigures>,
}

/// What a case comes to, with the reason.
#[derive(Debug)]
enum CaseResult {
    Passed,
    Failed(String),
    /// A check of the rig that was not tested. Most CI systems show a suite with skipped cases as passed.
    Untested(String),
    Error(String),
    Skipped(String),
}

impl CaseResult {
    fn is_failure(&self) -> bool {
        matches!(self, Self::Failed(_) | Self::Untested(_))
    }
}

impl<'a> JunitRun<'a> {
    /// A run with its verdict, or without one for that reason. `is_short`: the run does not count as passed.
    pub fn new(name: &str, verdict: Result<&'a Verdict, &str>, is_short: bool, took_s: f64) -> Self {
        let checks = verdict.iter().flat_map(|verdict| &verdict.checks);
        let case = |check: &'a Check| Case {
            name: check.name.as_ref(),
            result: of_check(check, is_short),
            figures: check.figures.as_ref(),
        };
        let mut cases: Vec<_> = checks.map(case).collect();
        let has_failure = cases.iter().any(|case| case.result.is_failure());
        let result = match verdict {
            _ if !is_short => CaseResult::Passed,
            // The cases of its checks say it.
            Ok(verdict) if has_failure && verdict.is_by_checks() => CaseResult::Passed,
            Ok(verdict) => CaseResult::Error(format!("{}: {}", verdict.word, verdict.reason)),
            Err(why) => CaseResult::Error(why.to_owned()),
        };
        cases.insert(0, Case { name: "run", result, figures: None });
        let (name, class) = (name.to_owned(), name.to_owned());
        Self { name, class, properties: Vec::new(), took_s, timestamp: None, cases }
    }

    /// The same with these properties.
    #[must_use]
    pub fn with(self, properties: Vec<(&'static str, String)>) -> Self {
        Self { properties, ..self }
    }

    fn tests(&self) -> usize {
        self.cases.len()
    }

    fn failures(&self) -> usize {
        self.count(CaseResult::is_failure)
    }

    fn errors(&self) -> usize {
        self.count(|result| matches!(result, CaseResult::Error(_)))
    }

    fn skipped(&self) -> usize {
        self.count(|result| matches!(result, CaseResult::Skipped(_)))
    }

    fn count(&self, is_counted: fn(&CaseResult) -> bool) -> usize {
        self.cases.iter().filter(|case| is_counted(&case.result)).count()
    }
}

impl<'a> Document<'a> {
    fn sum(&self, of: fn(&JunitRun<'a>) -> usize) -> usize {
        self.runs.iter().map(of).sum()
    }

    /// XML has no form for most control characters: they become replacement characters.
    fn xml(&self) -> askama::Result<String> {
        let is_no_xml = |c: char| c.is_control() && c != '\n' || ('\u{fffe}'..='\u{ffff}').contains(&c);
        Ok(self.render()?.replace(is_no_xml, "\u{fffd}"))
    }
}

/// The case of a check. One that failed, in a run that passed, did so as the scenario expects.
fn of_check(check: &Check, is_short: bool) -> CaseResult {
    let finding = &check.finding;
    match check.result {
        CheckResult::Passed => CaseResult::Passed,
        CheckResult::Failed if is_short => CaseResult::Failed(finding.clone()),
        CheckResult::Failed => CaseResult::Skipped(format!("as expected: {finding}")),
        CheckResult::Untested if is_short && !check.is_requirement() => CaseResult::Untested(finding.clone()),
        CheckResult::Untested => CaseResult::Skipped(format!("untested: {finding}")),
        CheckResult::Excused | CheckResult::NotJudged => CaseResult::Skipped(finding.clone()),
    }
}

/// The document of a run.
pub(crate) fn xml(manifest: &Manifest, figures: &Figures, verdict: &Verdict) -> askama::Result<String> {
    let name = format!("masseter.{}", manifest.scenario.name);
    let mut properties = vec![
        ("masseter", manifest.masseter.clone()),
        ("function", verdict.word.to_owned()),
        ("timing", verdict.timing.to_string()),
    ];
    if manifest.declared.motion == PlayedMotion::Own {
        properties.push(("motion", "own".to_owned()));
    }
    let run = JunitRun::new(&name, Ok(verdict), verdict.exit_code != Exit::Passed, figures.duration_s);
    let timestamp = Some(manifest.began.trim_end_matches('Z'));
    let run = JunitRun { class: "masseter.run".to_owned(), properties, timestamp, ..run };
    Document { runs: &[run], suite_s: None }.xml()
}

/// The document of a suite of runs that took so long, s.
///
/// ```
/// use masseter_report::{JunitRun, junit_of_suite};
///
/// let run = JunitRun::new("push", Err("it cannot be read"), true, 0.5);
/// assert!(junit_of_suite(&[run], 1.0)?.contains("<error message=\"it cannot be read\"/>"));
/// # Ok::<(), askama::Error>(())
/// ```
///
/// # Errors
/// When the text cannot be formatted.
pub fn junit_of_suite(runs: &[JunitRun], took_s: f64) -> askama::Result<String> {
    Document { runs, suite_s: Some(took_s) }.xml()
}

#[cfg(test)]
mod tests {
    use masseter_analysis::Analysis;
    use masseter_recording::MachineInfo;
    use masseter_runtime::named::Declared;
    use masseter_scenario::Scenario;

    use super::*;

    #[test]
    fn a_reason_of_any_characters_leaves_the_document_xml() {
        let machine = MachineInfo { cpu: String::new(), cores: 2, kernel: String::new(), is_virtual: false };
        let manifest = Manifest::new("0.1.0", Scenario::default(), 10.0, "virtual", machine);
        let figures = Analysis::new(&manifest.scenario, &Declared::default()).finish(false, &[]);
        let mut verdict = Verdict::new(&manifest, &figures);
        "<&\u{1b}\u{ffff}\">".clone_into(&mut verdict.reason);
        let xml = xml(&manifest, &figures, &verdict).unwrap();
        let case = "  <testcase classname=\"masseter.run\" name=\"run\">\
                    <error message=\"DIED: &#60;&#38;\u{fffd}\u{fffd}&#34;&#62;\"/></testcase>\n";
        assert!(xml.contains(case), "{xml}");
    }
}
