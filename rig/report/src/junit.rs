//! `junit.xml`: each check of the run as a test case, as CI systems show it.

use crate::check::CheckResult;
use crate::text::escape;
use crate::verdict::Verdict;
use masseter_analysis::Figures;
use masseter_recording::Manifest;

/// One suite; a run that ended wrongly or cannot be judged has an `error` case of its own.
pub(crate) fn xml(manifest: &Manifest, figures: &Figures, verdict: &Verdict) -> String {
    let count = |result| verdict.checks.iter().filter(|check| check.result == result).count();
    let (failures, skipped) = (count(CheckResult::Failed), count(CheckResult::NotJudged));
    let judged = verdict.is_judged();
    let tests = verdict.checks.len() + 1;
    let mut xml = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <testsuite name=\"masseter.{}\" tests=\"{tests}\" failures=\"{failures}\" skipped=\"{skipped}\" errors=\"{}\" time=\"{:.3}\" timestamp=\"{}\">\n",
        escape(&manifest.scenario.name),
        usize::from(!judged),
        figures.duration_s,
        escape(manifest.began.trim_end_matches('Z')),
    );
    let problem = (!judged).then(|| ("error", format!("{}: {}", verdict.word, verdict.reason)));
    xml += &case("run", problem);
    for check in &verdict.checks {
        let problem = match check.result {
            CheckResult::Passed => None,
            CheckResult::Failed => Some("failure"),
            CheckResult::NotJudged => Some("skipped"),
        };
        xml += &case(check.name, problem.map(|kind| (kind, check.finding.clone())));
    }
    xml + "</testsuite>\n"
}

fn case(name: &str, problem: Option<(&str, String)>) -> String {
    match problem {
        None => format!("  <testcase classname=\"masseter.run\" name=\"{name}\"/>\n"),
        Some((kind, message)) => format!(
            "  <testcase classname=\"masseter.run\" name=\"{name}\"><{kind} message=\"{}\"/></testcase>\n",
            escape(&message)
        ),
    }
}
