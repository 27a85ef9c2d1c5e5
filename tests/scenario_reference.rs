//! docs/scenario.md names every key that a scenario can have, with its default, and no others.
//!
//! The keys are those of the scenario as it is written with every default.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use masseter_scenario::{FaultKindConfig, MotionConfig, QuirkKindConfig, Scenario, ScenarioError};
use serde_json::Value;

use crate::common::Workspace;

/// The rows of one heading: key and default, as written.
type Rows = BTreeMap<String, String>;

/// Tables that are given with all their keys or not at all.
const GIVEN_WHOLE: [&str; 2] = ["[[mechanism.slides]]", "[mechanism.strokes]"];

/// A table that the reference has: the TOML that leads to it, as in its heading, and its rows.
#[derive(Debug)]
struct Section {
    toml: String,
    rows: Rows,
}

impl Section {
    /// `motion.phases` for `[motion.phases]`; empty for the scenario itself.
    fn path(&self) -> &str {
        let end = self.toml.find(']').unwrap_or(0);
        self.toml[..end].trim_start_matches('[')
    }

    /// A scenario that has this table with its defaults, and with what is required in it.
    fn text(&self) -> String {
        let prelude = match self.path().split_once('.') {
            Some(("motion", _)) => "motion.kind = 'chewing'\n",
            Some(("drive_profile", _)) => "[[drive_profile]]\n",
            _ => "",
        };
        let (header, rest) = self.toml.split_at(self.toml.rfind(']').map_or(0, |end| end + 1));
        let required = match self.path() {
            "faults" => "kind = 'lose'",
            "stimulus" => "at_s = 0.0",
            "drives.quirk" => "kind = 'two_boot_ups'",
            "teeth.tooth" => "number = 36\npoint_m = [0.0, 0.0, 0.0]",
            "motion" if rest.contains("file") => "path = 'jaw.csv'",
            _ => "",
        };
        let header = if GIVEN_WHOLE.contains(&header) { "" } else { header };
        format!("{prelude}{header}\n{rest}\n{required}\n")
    }
}

fn reference() -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/scenario.md")).unwrap()
}

/// Every heading that has a table of keys; one for two tables counts for both.
fn sections() -> Vec<Section> {
    let text = reference();
    text.split("\n##").skip(1).flat_map(sections_under).collect()
}

fn sections_under(part: &str) -> Vec<Section> {
    let Some((_, table)) = part.split_once("| key | unit | default | range | meaning |\n") else {
        return Vec::new();
    };
    let heading = part.lines().next().unwrap();
    let mut tables: Vec<&str> = quoted(heading).collect();
    if tables.is_empty() {
        tables.push("");
    }
    let section = |(place, toml): (usize, &&str)| Section {
        toml: (*toml).to_owned(),
        rows: table.lines().skip(1).map_while(|line| row(line, place)).collect(),
    };
    tables.iter().enumerate().map(section).collect()
}

/// The key of a row, and its default for the table at this place of the heading.
fn row(line: &str, place: usize) -> Option<(String, String)> {
    let mut cells = line.strip_prefix('|')?.split('|').map(str::trim);
    let key = quoted(cells.next()?).next()?;
    let default = cells.nth(1)?;
    let defaults: Vec<_> = quoted(default).collect();
    let default = defaults.get(place).or(defaults.first()).copied().unwrap_or(default);
    Some((key.to_owned(), default.to_owned()))
}

/// What stands between backticks.
fn quoted(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

fn read(text: &str) -> Result<Scenario, ScenarioError> {
    Scenario::read(&Workspace::new(text).file("scenario.toml"))
}

/// The table that a section describes, with every key: the first of several.
fn table_of(section: &Section) -> Value {
    let scenario = serde_json::to_value(read(&section.text()).unwrap()).unwrap();
    let steps = section.path().split('.').filter(|step| !step.is_empty());
    steps.fold(scenario, |mut table, step| match table[step].take() {
        Value::Array(mut tables) => tables.swap_remove(0),
        table => table,
    })
}

#[test]
fn every_key_of_every_table_is_documented_and_no_others() {
    let sections = sections();
    let paths: BTreeSet<_> = sections.iter().map(Section::path).collect();
    for section in &sections {
        let path = section.path();
        let is_table = |key: &str| {
            let below = if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
            paths.iter().any(|path| *path == below || path.starts_with(&format!("{below}.")))
        };
        let table = table_of(section);
        let mut keys: BTreeSet<_> = table.as_object().unwrap().keys().cloned().collect();
        // The heading of a motion names its kind.
        if path == "motion" && !section.rows.contains_key("kind") {
            keys.remove("kind");
        }
        let undocumented: Vec<_> =
            keys.iter().filter(|key| !section.rows.contains_key(*key) && !is_table(key)).collect();
        assert!(undocumented.is_empty(), "{}: not in docs/scenario.md: {undocumented:?}", section.toml);
        let unknown: Vec<_> = section.rows.keys().filter(|key| !keys.contains(*key)).collect();
        assert!(unknown.is_empty(), "{}: in docs/scenario.md, but no keys: {unknown:?}", section.toml);
    }
    assert_eq!(sections.len(), 45);
}

/// The word for a kind of motion. A new kind does not compile until it is here, and [`MOTIONS`] counts it.
fn kind_of_motion(motion: &MotionConfig) -> &'static str {
    match motion {
        MotionConfig::Chewing(_) => "chewing",
        MotionConfig::Opening(_) => "opening",
        MotionConfig::Protrusion(_) => "protrusion",
        MotionConfig::Lateral(_) => "lateral",
        MotionConfig::File(_) => "file",
    }
}
const MOTIONS: usize = 5;

#[test]
fn every_kind_of_motion_of_fault_and_of_quirk_is_documented() {
    let text = reference();
    let documented = |table: &str| -> BTreeSet<_> {
        let (_, rows) = text.split_once(&format!("| `{table}` | |\n| --- | --- |\n")).unwrap();
        rows.lines().map_while(|line| quoted(line.strip_prefix("| `").map(|_| line)?).next()).collect()
    };
    let motions = documented("motion.kind");
    assert_eq!(motions.len(), MOTIONS, "{motions:?}");
    for kind in motions {
        let path = if kind == "file" { "path = 'jaw.csv'" } else { "" };
        let scenario = read(&format!("[motion]\nkind = '{kind}'\n{path}")).unwrap();
        assert_eq!(kind_of_motion(&scenario.motion), kind);
        assert!(text.contains(&format!("### `[motion] kind = \"{kind}\"`")), "{kind}");
    }
    let faults = documented("faults.kind");
    let kinds: BTreeSet<_> = FaultKindConfig::ALL.iter().map(|kind| kind.name()).collect();
    assert_eq!(faults, kinds);
    let kinds: BTreeSet<_> = QuirkKindConfig::ALL.iter().map(|kind| kind.name()).collect();
    assert_eq!(documented("drives.quirk.kind"), kinds);
}

#[test]
fn the_defaults_are_those_that_are_documented() {
    for section in sections() {
        let table = table_of(&section);
        for (key, default) in &section.rows {
            let value = table.get(key).unwrap_or(&Value::Null);
            let place = format!("{} {key}", section.toml);
            match default.as_str() {
                "none" => assert_eq!(value, &Value::Null, "{place}"),
                "*required*" => {
                    let without: Vec<_> = section
                        .text()
                        .lines()
                        .filter(|line| !line.starts_with(key))
                        .map(str::to_owned)
                        .collect();
                    assert!(read(&without.join("\n")).is_err(), "{place} is not required");
                }
                written => assert!(is_about(&literal(written), value), "{place} is {value}, not {written}"),
            }
        }
    }
}

/// TOML writes most values as JSON does, but for numbers to the base 16.
fn literal(written: &str) -> Value {
    match written.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16).unwrap().into(),
        None => serde_json::from_str(written).unwrap_or_else(|error| panic!("{written}: {error}")),
    }
}

/// Equal but for the digits that a table leaves out.
fn is_about(written: &Value, value: &Value) -> bool {
    match (written, value) {
        (Value::Array(written), Value::Array(values)) => {
            written.len() == values.len() && written.iter().zip(values).all(|(a, b)| is_about(a, b))
        }
        (Value::Number(written), Value::Number(value)) => {
            let [written, value] = [written, value].map(|number| number.as_f64().unwrap());
            (written - value).abs() <= 1e-5 * value.abs()
        }
        _ => written == value,
    }
}
