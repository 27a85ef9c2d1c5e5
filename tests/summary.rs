//! `summary.json` and `junit.xml` are what their descriptions say.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use masseter_runtime::messages::codes::Source;

use crate::common::Workspace;
use masseter_judge::hop_names;
use serde_json::Value;

fn description() -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/summary.md")).unwrap()
}

/// Keys in the table of docs/summary.md, and those of them that may be absent.
fn documented() -> (BTreeSet<String>, BTreeSet<String>) {
    let text = description();
    let rows = text.lines().filter_map(|line| line.strip_prefix("| `")?.split_once("` | "));
    let rows: Vec<_> = rows.collect();
    let all = rows.iter().map(|(key, _)| (*key).to_owned()).collect();
    let optional = rows.iter().filter(|(_, what)| what.starts_with("*optional*"));
    (all, optional.map(|(key, _)| (*key).to_owned()).collect())
}

/// Every key that leads to a value.
fn keys(path: &str, value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(fields) => {
            for (name, value) in fields {
                let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
                keys(&path, value, found);
            }
        }
        Value::Array(items) => items.iter().for_each(|item| keys(&format!("{path}[]"), item, found)),
        _ => {
            found.insert(path.to_owned());
        }
    }
}

#[test]
fn the_summary_has_the_keys_that_are_documented_and_no_others() {
    for tables in ["", "[teeth]\n[food]"] {
        let workspace = Workspace::new(&format!("duration_s = 1.0\n{tables}"));
        assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
        let mut found = BTreeSet::new();
        keys("", &workspace.summary(), &mut found);
        let (documented, optional) = documented();
        let undocumented: Vec<_> = found.difference(&documented).collect();
        assert!(undocumented.is_empty(), "not in docs/summary.md: {undocumented:?}");
        let absent: Vec<_> = documented.difference(&found).filter(|key| !optional.contains(*key)).collect();
        assert!(absent.is_empty(), "in docs/summary.md, but not in summary.json: {absent:?}");
        assert_eq!(workspace.summary()["form"], 3);
    }
}

#[test]
fn the_intervals_are_those_that_are_documented_in_their_order() {
    let workspace = Workspace::new("duration_s = 1.0");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    let summary = workspace.summary();
    let intervals = summary["figures"]["intervals"].as_array().unwrap();
    let text = description();
    let rows = first_cells(&text, "| interval | from | to |");
    assert!(rows.eq(intervals.iter().map(|interval| interval["name"].as_str().unwrap())));
}

#[test]
fn the_hops_are_those_that_are_documented_in_their_order() {
    let text = description();
    assert!(first_cells(&text, "| hop | from | to |").eq(hop_names()));
}

/// The first cell of every row under a heading of a table.
fn first_cells<'a>(text: &'a str, heading: &str) -> impl Iterator<Item = &'a str> {
    let (_, table) = text.split_once(&format!("{heading}\n| --- | --- | --- |\n")).unwrap();
    table.lines().map_while(|line| line.strip_prefix("| ")?.split(" | ").next())
}

#[test]
fn the_sources_of_events_are_those_that_are_documented() {
    let names: Vec<_> = Source::ALL.iter().map(|source| source.name()).collect();
    let [others @ .., last] = names.as_slice() else { unreachable!("there are sources") };
    let row = format!("| `figures.events[].source` | {} or {last} |", others.join(", "));
    assert!(description().contains(&row), "{row}");
}

/// The attributes of the first element of this name.
fn attribute<'a>(xml: &'a str, element: &str, name: &str) -> &'a str {
    let tag = xml.split(&format!("<{element} ")).nth(1).unwrap().split('>').next().unwrap();
    tag.split(&format!("{name}=\"")).nth(1).unwrap().split('"').next().unwrap()
}

#[test]
fn the_junit_report_counts_its_cases() {
    for (limit, code, failures) in [("1.0", 0, "0"), ("1e-9", 1, "2")] {
        let workspace = Workspace::new(&format!("duration_s = 1.0\n[checks]\ntracking_rms_mm = {limit}"));
        assert_eq!(workspace.run_virtual(&[]).status.code(), Some(code));
        let xml = fs::read_to_string(workspace.run_folder().join("junit.xml")).unwrap();
        let cases = xml.matches("<testcase ").count();
        assert_eq!(attribute(&xml, "testsuite", "tests"), cases.to_string());
        assert_eq!(attribute(&xml, "testsuite", "failures"), failures);
        assert_eq!(xml.matches("<failure ").count().to_string(), failures);
        assert_eq!(attribute(&xml, "testsuite", "errors"), "0");
        let timestamp = attribute(&xml, "testsuite", "timestamp");
        assert!(humantime::parse_rfc3339(&format!("{timestamp}Z")).is_ok(), "{timestamp}");
    }
}
