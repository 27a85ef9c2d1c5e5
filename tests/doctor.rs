//! The doctor on the machine at hand: whatever it finds, exit code, report and reality agree.

use crate::common::{masseter, stdout};
use serde_json::Value;

/// On any machine; where there is SocketCAN, its interfaces are one more.
const FINDINGS: usize = 14;

#[test]
fn exit_code_and_level_agree_and_whatever_is_not_ok_says_what_it_costs() {
    let output = masseter(&["doctor", "--format", "json"]);
    let report: Value = serde_json::from_str(&stdout(&output)).unwrap();
    let findings = report["findings"].as_array().unwrap();
    assert!(findings.len() >= FINDINGS, "{report}");
    let has = |level: &str| findings.iter().any(|finding| finding["level"] == level);
    assert_eq!(output.status.code(), Some(if has("bad") { 3 } else { 0 }), "{report}");
    assert_eq!(report["level"] == "bad", has("bad"), "{report}");
    for finding in findings {
        assert_eq!(finding["level"] == "ok", finding["cost"].is_null(), "{finding}");
    }
}

#[test]
fn the_human_report_names_every_check_of_the_other_form() {
    let report: Value = serde_json::from_str(&stdout(&masseter(&["doctor", "--format", "json"]))).unwrap();
    let words = stdout(&masseter(&["doctor"]));
    for finding in report["findings"].as_array().unwrap() {
        assert!(words.contains(finding["check"].as_str().unwrap()), "{words}");
    }
}
