//! JUnit documents, as CI systems show them: a run or a whole suite of runs, each check as a test case.

use askama::Template;
use masseter_judge::{Check, CheckResult, Figures, Verdict};
use masseter_recording::Manifest;
use masseter_runtime::named::PlayedMotion;
use masseter_terminal::Exit;

use crate::suite::{Attempt, NOT_RUN, SuiteReport, TestedScenario};

/// A document with one run, or with the runs of a suite that took so long.
#[derive(Template)]
#[template(path = "junit.xml")]
struct Document<'a> {
    runs: &'a [JunitRun<'a>],
    suite_s: Option<f64>,
}

/// A run as a test suite: a case for the run itself, and one for each of its checks.
#[derive(Debug)]
struct JunitRun<'a> {
    name: &'a str,
    /// The class of its cases.
    class: &'a str,
    /// The scenario's file.
    file: Option<String>,
    properties: Vec<(&'static str, String)>,
    took_s: f64,
    timestamp: Option<&'a str>,
    cases: Vec<Case<'a>>,
}

#[derive(Debug)]
struct Case<'a> {
    name: &'a str,
    took_s: f64,
    result: CaseResult,
    /// Attempts before, which CI systems show as those of a flaky test: word and reason.
    earlier: Vec<[&'a str; 2]>,
    check: Option<&'a Check>,
}

/// What a case comes to, with its kind and the reason.
#[derive(Debug)]
enum CaseResult {
    Passed,
    /// A check of the rig that was not tested is a failure: most CI systems show a suite with skipped cases as passed.
    Failed(&'static str, String),
    Error(&'static str, String),
    Skipped(String),
}

impl<'a> JunitRun<'a> {
    /// A run with its verdict, or with an error of that kind and reason. `is_short`: the run does not count as passed.
    fn new(
        name: &'a str,
        verdict: Result<&'a Verdict, (&'static str, String)>,
        is_short: bool,
        took_s: f64,
    ) -> Self {
        let checks = verdict.iter().flat_map(|verdict| &verdict.checks);
        let case = |check: &'a Check| Case {
            name: check.name.as_ref(),
            took_s: 0.0,
            result: of_check(check, is_short),
            earlier: Vec::new(),
            check: Some(check),
        };
        let mut cases: Vec<_> = checks.map(case).collect();
        let has_failure = cases.iter().any(|case| matches!(case.result, CaseResult::Failed(..)));
        let result = match verdict {
            _ if !is_short => CaseResult::Passed,
            // The cases of its checks say it.
            Ok(verdict) if has_failure && verdict.is_by_checks() => CaseResult::Passed,
            Ok(verdict) => {
                CaseResult::Error(verdict.word, format!("{}: {}", verdict.word, verdict.in_words()))
            }
            Err((kind, why)) => CaseResult::Error(kind, why),
        };
        cases.insert(0, Case { name: "run", took_s, result, earlier: Vec::new(), check: None });
        let properties = Vec::new();
        Self { name, class: name, file: None, properties, took_s, timestamp: None, cases }
    }

    /// A scenario of a suite, with the attempts before the last.
    fn of_tested(tested: &'a TestedScenario, masseter: &str) -> Self {
        let is_short = tested.is_short();
        let verdict = match tested.last().verdict() {
            _ if tested.differs() => Err(("DIFFERS", tested.reason())),
            verdict => verdict.map_err(|why| (NOT_RUN, why.to_owned())),
        };
        let mut run = Self::new(&tested.name, verdict, is_short, tested.took_s);
        let earlier = tested.attempts.iter().take(tested.retries());
        run.cases[0].earlier = earlier.map(Attempt::word_and_reason).collect();
        let is_flaky = tested.retries() > 0 && !is_short;
        run.properties = warned(tested.warnings());
        run.properties.extend([
            ("masseter", masseter.to_owned()),
            ("outcome", tested.outcome().word().to_owned()),
            ("retries", tested.retries().to_string()),
            ("flaky", is_flaky.to_string()),
            ("tags", tested.tags.join(" ")),
        ]);
        run.properties.extend(tested.last().verdict().into_iter().flat_map(told));
        run.file = Some(tested.file.display().to_string());
        run
    }

    /// The element for an attempt before the last, in the form of Maven's Surefire.
    fn earlier_element(&self) -> &'static str {
        let is_short =
            self.cases.iter().any(|case| !matches!(case.result, CaseResult::Passed | CaseResult::Skipped(_)));
        if is_short { "rerunError" } else { "flakyError" }
    }

    fn tests(&self) -> usize {
        self.cases.len()
    }

    fn failures(&self) -> usize {
        self.count(|result| matches!(result, CaseResult::Failed(..)))
    }

    fn errors(&self) -> usize {
        self.count(|result| matches!(result, CaseResult::Error(..)))
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

/// What the plan of a run warns of, as a property; none without warnings.
fn warned(warnings: &[String]) -> Vec<(&'static str, String)> {
    if warnings.is_empty() { Vec::new() } else { vec![("warnings", warnings.join("; "))] }
}

/// The first breach of a run and what to do next, as properties.
fn told(verdict: &Verdict) -> impl Iterator<Item = (&'static str, String)> {
    let first_breach = verdict.first_breach.as_ref().map(|breach| ("first breach", breach.to_string()));
    let next_step = verdict.next_step.clone().map(|step| ("next step", step));
    first_breach.into_iter().chain(next_step)
}

/// The case of a check. One that failed, in a run that passed, did so as the scenario expects.
fn of_check(check: &Check, is_short: bool) -> CaseResult {
    let finding = &check.finding;
    let kind = if check.is_requirement() { "requirement" } else { "check" };
    match check.result {
        CheckResult::Passed => CaseResult::Passed,
        CheckResult::Failed if is_short => CaseResult::Failed(kind, finding.clone()),
        CheckResult::Failed => CaseResult::Skipped(format!("as expected: {finding}")),
        CheckResult::Untested if is_short && !check.is_requirement() => {
            CaseResult::Failed("untested", format!("not tested: {finding}"))
        }
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
    properties.extend(told(verdict));
    let timestamp = Some(manifest.began.trim_end_matches('Z'));
    properties.extend(warned(&verdict.warnings));
    let run = JunitRun { class: "masseter.run", properties, timestamp, ..run };
    Document { runs: &[run], suite_s: None }.xml()
}

/// The document of a suite. Scenarios that an interrupt left are errors, since most CI systems show a suite with
/// skipped cases as passed.
///
/// # Errors
/// When the text cannot be formatted.
pub fn junit_of_suite(report: &SuiteReport) -> askama::Result<String> {
    let tested = report.tested.iter().map(|tested| JunitRun::of_tested(tested, report.masseter));
    let unrun = report.unrun.iter().map(|name| {
        let properties = vec![("masseter", report.masseter.to_owned())];
        JunitRun {
            properties,
            ..JunitRun::new(name, Err((NOT_RUN, "interrupted before its end".to_owned())), true, 0.0)
        }
    });
    let runs: Vec<_> = tested.chain(unrun).collect();
    Document { runs: &runs, suite_s: Some(report.took_s) }.xml()
}

#[cfg(test)]
mod tests {
    use masseter_judge::Analysis;
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
        let case = "  <testcase classname=\"masseter.run\" name=\"run\" time=\"0.000\">\
                    <error message=\"DIED: &#60;&#38;\u{fffd}\u{fffd}&#34;&#62;\" type=\"DIED\"/></testcase>\n";
        assert!(xml.contains(case), "{xml}");
    }
}
