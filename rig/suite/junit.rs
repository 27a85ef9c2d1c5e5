//! One JUnit file of a whole suite: a test suite for each scenario, with its checks as test cases.

use std::fmt::Write;

use masseter_report::{Check, CheckFigures, CheckResult};
use masseter_terminal::Exit;

use super::outcome::Tested;

/// What a test case came to.
enum Case {
    Passed,
    Failed(String),
    Error(String),
    Skipped(String),
}

/// The document.
pub(super) fn xml(all: &[Tested], allow_untested: bool, took_s: f64) -> String {
    let suites: Vec<_> = all.iter().map(|tested| Suite::new(tested, allow_untested)).collect();
    let cases: usize = suites.iter().map(|suite| suite.cases.len()).sum();
    let [failures, errors, skipped] =
        [Suite::failures, Suite::errors, Suite::skipped].map(|of| suites.iter().map(of).sum::<usize>());
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <testsuites name=\"masseter\" tests=\"{cases}\" failures=\"{failures}\" errors=\"{errors}\" \
         skipped=\"{skipped}\" time=\"{took_s:.3}\">\n"
    );
    for suite in &suites {
        text += &suite.xml();
    }
    text + "</testsuites>\n"
}

/// A test case, with the figures of a requirement.
struct TestCase<'a> {
    name: &'a str,
    case: Case,
    figures: Option<&'a CheckFigures>,
}

struct Suite<'a> {
    tested: &'a Tested,
    /// The run itself, then its checks.
    cases: Vec<TestCase<'a>>,
}

impl<'a> Suite<'a> {
    fn new(tested: &'a Tested, allow_untested: bool) -> Self {
        let is_short = tested.outcome.is_short(allow_untested);
        let checks = tested.verdict.iter().flat_map(|verdict| &verdict.checks);
        let test_case = |check: &'a Check| TestCase {
            name: check.name.as_ref(),
            case: of_check(check, is_short),
            figures: check.figures.as_ref(),
        };
        let mut cases: Vec<_> = checks.map(test_case).collect();
        let has_failure = cases.iter().any(|found| matches!(found.case, Case::Failed(_)));
        let is_by_checks = tested.verdict.as_ref().is_some_and(|verdict| verdict.exit_code == Exit::Failed);
        let is_explained = !is_short || has_failure && is_by_checks;
        let of_run = if is_explained { Case::Passed } else { Case::Error(tested.reason.clone()) };
        cases.insert(0, TestCase { name: "run", case: of_run, figures: None });
        Self { tested, cases }
    }

    fn count(&self, is_counted: fn(&Case) -> bool) -> usize {
        self.cases.iter().filter(|found| is_counted(&found.case)).count()
    }

    fn failures(&self) -> usize {
        self.count(|case| matches!(case, Case::Failed(_)))
    }

    fn errors(&self) -> usize {
        self.count(|case| matches!(case, Case::Error(_)))
    }

    fn skipped(&self) -> usize {
        self.count(|case| matches!(case, Case::Skipped(_)))
    }

    fn xml(&self) -> String {
        let Tested { case, outcome, took_s, retries, .. } = self.tested;
        let name = escaped(&case.name);
        let mut text = format!(
            "  <testsuite name=\"{name}\" tests=\"{}\" failures=\"{}\" errors=\"{}\" skipped=\"{}\" time=\"{took_s:.3}\">\n    \
             <properties>\n      \
             <property name=\"outcome\" value=\"{}\"/>\n      \
             <property name=\"retries\" value=\"{retries}\"/>\n    \
             </properties>\n",
            self.cases.len(),
            self.failures(),
            self.errors(),
            self.skipped(),
            outcome.word(),
        );
        for TestCase { name: check, case, figures } in &self.cases {
            let properties = figures.map_or_else(String::new, properties);
            let inner = match case {
                Case::Passed => String::new(),
                Case::Failed(why) => format!("<failure message=\"{}\"/>", escaped(why)),
                Case::Error(why) => format!("<error message=\"{}\"/>", escaped(why)),
                Case::Skipped(why) => format!("<skipped message=\"{}\"/>", escaped(why)),
            };
            let check = escaped(check);
            let _ = writeln!(
                text,
                "    <testcase classname=\"{name}\" name=\"{check}\">{properties}{inner}</testcase>"
            );
        }
        text + "  </testsuite>\n"
    }
}

/// Margin and latency of a requirement.
fn properties(figures: &CheckFigures) -> String {
    let CheckFigures { margin, margin_unit, latency_ms, worst_at_s, .. } = figures;
    let property = |name: &str, value: String| {
        format!("<property name=\"{name}\" value=\"{}\"/>", escaped(value.trim_end()))
    };
    let list = [
        margin.map(|margin| property("margin", format!("{margin} {margin_unit}"))),
        latency_ms.map(|ms| property("latency_ms", ms.to_string())),
        worst_at_s.map(|at_s| property("worst_at_s", at_s.to_string())),
    ];
    format!("<properties>{}</properties>", list.into_iter().flatten().collect::<String>())
}

/// A check that failed fails its suite only if the scenario did not pass: a scenario may expect a failure.
fn of_check(check: &Check, is_short: bool) -> Case {
    let finding = check.finding.clone();
    match check.result {
        CheckResult::Passed => Case::Passed,
        CheckResult::Failed if is_short => Case::Failed(finding),
        CheckResult::Untested if is_short && check.figures.is_none() => {
            Case::Failed(format!("not tested: {finding}"))
        }
        CheckResult::Failed | CheckResult::Untested | CheckResult::Excused | CheckResult::NotJudged => {
            Case::Skipped(finding)
        }
    }
}

/// Text within an attribute. XML has no form for most control characters: they become replacement characters.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '"' => escaped += "&quot;",
            '\n' => escaped += "&#10;",
            '\u{fffe}' | '\u{ffff}' => escaped.push('\u{fffd}'),
            c if c.is_control() => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}
