//! What documents have from declarations: the keys of scenarios, the kinds of faults and quirks, the signals, the commands.
//!
//! `cargo test --test rig -- --ignored renew_the_reference` writes them anew.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use masseter_judge::signals::Registry;
use masseter_model::geometry::{AXIS_NAMES, MechanismConfig, SlideConfig, StrokeLimits};
use masseter_runtime::named::Declared;
use masseter_scenario::{
    AxesConfig, BrakeConfig, CanConfig, ChecksConfig, ChewingConfig, ControllerConfig, DcfRead, DriveConfig,
    DriveProfile, DrivesConfig, DryConfig, DynamicsConfig, ExpectConfig, FaultConfig, FaultDeclaration,
    FaultKindConfig, FileConfig, FoodConfig, ForceControlConfig, ForceEstimateConfig, FrictionConfig,
    HomingConfig, IdentityConfig, JawConfig, Key, LateralConfig, LateralForceConfig, LoadCellConfig,
    MotionConfig, OpeningConfig, PdosConfig, PhaseShares, ProbeConfig, ProtrusionConfig, QuirkConfig,
    QuirkKindConfig, Range, RealtimeConfig, RecordingConfig, RequirementConfig, Scenario, ScenarioError,
    StimulusConfig, StoreConfig, StudyConfig, TeethConfig, ToothConfig, TrajectoryLimitsConfig, UnitsConfig,
    unit_of,
};
use serde_json::Value;

use crate::common::{MASSETER, stdout};

const KEYS: &str = "| key | unit | default | range | meaning |\n| --- | --- | --- | --- | --- |\n";
const FAULTS: &str = "| `faults.kind` | |\n| --- | --- |\n";
const QUIRKS: &str = "| `drives.quirk.kind` | |\n| --- | --- |\n";
const SIGNALS: &str = "| signal | unit | meaning |\n| --- | --- | --- |\n";
/// A table whose keys are those of the controller.
const IN_PROSE: &str = "parameters";
/// Tables that are given with all their keys or not at all.
const GIVEN_WHOLE: [&str; 2] = ["[[mechanism.slides]]", "[mechanism.strokes]"];

type Rewrite = fn(&str) -> String;

/// Every such document, and how it is written anew.
const DOCUMENTS: [(&str, Rewrite); 3] =
    [("scenario.md", scenario), ("signals.md", signals), ("commands.md", commands)];

/// The tables of a scenario by the TOML that leads to them.
const TABLES: [(&str, &[Key]); 49] = [
    ("", Scenario::KEYS),
    ("[motion] kind = \"chewing\"", ChewingConfig::KEYS),
    ("[motion] kind = \"opening\"", OpeningConfig::KEYS),
    ("[motion] kind = \"protrusion\"", ProtrusionConfig::KEYS),
    ("[motion] kind = \"lateral\"", LateralConfig::KEYS),
    ("[motion.phases]", PhaseShares::KEYS),
    ("[motion] kind = \"file\"", FileConfig::KEYS),
    ("[jaw]", JawConfig::KEYS),
    ("[limits]", TrajectoryLimitsConfig::KEYS),
    ("[mechanism]", MechanismConfig::KEYS),
    ("[[mechanism.slides]]", SlideConfig::KEYS),
    ("[mechanism.strokes]", StrokeLimits::KEYS),
    ("[dry]", DryConfig::KEYS),
    ("[controller]", ControllerConfig::KEYS),
    ("[controller.model]", DynamicsConfig::KEYS),
    ("[controller.model.axes]", AxesConfig::KEYS),
    ("[controller.model.friction]", FrictionConfig::KEYS),
    ("[can]", CanConfig::KEYS),
    ("[drives]", DrivesConfig::KEYS),
    ("[[drives.quirk]]", QuirkConfig::KEYS),
    ("[drives.slide]", DriveConfig::KEYS),
    ("[drives.leg]", DriveConfig::KEYS),
    ("[[drive_profile]]", DriveProfile::KEYS),
    ("[drive_profile.dcf_read]", DcfRead::KEYS),
    ("[drive_profile.identity]", IdentityConfig::KEYS),
    ("[drive_profile.pdos]", PdosConfig::KEYS),
    ("[drive_profile.units]", UnitsConfig::KEYS),
    ("[drive_profile.store]", StoreConfig::KEYS),
    ("[drive_profile.brake]", BrakeConfig::KEYS),
    ("[drive_profile.homing]", HomingConfig::KEYS),
    ("[dynamics]", DynamicsConfig::KEYS),
    ("[dynamics.axes]", AxesConfig::KEYS),
    ("[dynamics.friction]", FrictionConfig::KEYS),
    ("[teeth]", TeethConfig::KEYS),
    ("[[teeth.tooth]]", ToothConfig::KEYS),
    ("[food]", FoodConfig::KEYS),
    ("[load_cell]", LoadCellConfig::KEYS),
    ("[force_estimate]", ForceEstimateConfig::KEYS),
    ("[force_control]", ForceControlConfig::KEYS),
    ("[force_control.lateral]", LateralForceConfig::KEYS),
    ("[force_control.probe]", ProbeConfig::KEYS),
    ("[realtime]", RealtimeConfig::KEYS),
    ("[recording]", RecordingConfig::KEYS),
    ("[checks]", ChecksConfig::KEYS),
    ("[[faults]]", FaultConfig::KEYS),
    ("[[stimulus]]", StimulusConfig::KEYS),
    ("[[require]]", RequirementConfig::KEYS),
    ("[expect]", ExpectConfig::KEYS),
    ("[study]", StudyConfig::KEYS),
];

fn path_of(document: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs").join(document)
}

#[test]
fn the_reference_is_what_is_declared() {
    for (document, renewed) in DOCUMENTS {
        let text = fs::read_to_string(path_of(document)).unwrap();
        let renewed = renewed(&text);
        for (written, declared) in text.lines().zip(renewed.lines()) {
            assert_eq!(
                written, declared,
                "{document}: cargo test --test rig -- --ignored renew_the_reference; then look at the changes"
            );
        }
        assert_eq!(text.len(), renewed.len(), "{document}");
    }
}

#[test]
#[ignore = "writes documents"]
fn renew_the_reference() {
    for (document, renewed) in DOCUMENTS {
        let text = fs::read_to_string(path_of(document)).unwrap();
        fs::write(path_of(document), renewed(&text)).unwrap();
    }
}

/// The text with these rows in place of those under the head of a table.
pub(crate) fn with_rows(text: &str, head: &str, rows: &str) -> String {
    let (before, table) = text.split_once(head).unwrap_or_else(|| panic!("no table {head}"));
    let old: usize = table.split_inclusive('\n').take_while(|line| line.starts_with('|')).map(str::len).sum();
    format!("{before}{head}{rows}{}", &table[old..])
}

fn scenario(text: &str) -> String {
    let text =
        with_rows(text, FAULTS, &FaultKindConfig::ALL.iter().copied().map(fault_row).collect::<String>());
    let text =
        with_rows(&text, QUIRKS, &QuirkKindConfig::ALL.iter().copied().map(quirk_row).collect::<String>());
    let mut documented = Vec::new();
    let parts = text.split("\n##").map(|part| {
        if !part.contains(KEYS) {
            return part.to_owned();
        }
        let tables = tables_under(part.lines().next().unwrap());
        documented.extend(tables.iter().map(|table| table.toml));
        with_rows(part, KEYS, &rows_of(&tables))
    });
    let renewed = parts.collect::<Vec<_>>().join("\n##");
    for (toml, _) in TABLES {
        assert!(documented.contains(&toml), "docs/scenario.md has no heading for {toml}");
    }
    renewed
}

/// A table that the reference has: the TOML that leads to it, as in its heading, and its keys.
struct Table {
    toml: &'static str,
    keys: &'static [Key],
}

/// The tables of a heading, which names one or two of them; without a name it is that of the scenario itself.
fn tables_under(heading: &str) -> Vec<Table> {
    let named: Vec<_> = heading.split('`').skip(1).step_by(2).collect();
    let named = if named.is_empty() { vec![""] } else { named };
    let declared = |name: &str| TABLES.into_iter().find(|(toml, _)| *toml == name);
    let tables = named.into_iter().map(|name| declared(name).unwrap_or_else(|| panic!("no table {name}")));
    tables.map(|(toml, keys)| Table { toml, keys }).collect()
}

impl Table {
    /// `motion.phases` for `[motion.phases]`; empty for the scenario itself.
    fn path(&self) -> &str {
        let end = self.toml.find(']').unwrap_or(0);
        self.toml[..end].trim_start_matches('[')
    }

    /// A scenario that has this table with its defaults, and with its required keys.
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

    /// The table with every default: the first of several.
    fn defaults(&self) -> Value {
        let scenario = serde_json::to_value(read(&self.text()).unwrap()).unwrap();
        let steps = self.path().split('.').filter(|step| !step.is_empty());
        steps.fold(scenario, |mut table, step| match table[step].take() {
            Value::Array(mut tables) => tables.swap_remove(0),
            table => table,
        })
    }

    /// Whether the table is refused without the key.
    fn requires(&self, key: &str) -> bool {
        let text = self.text();
        let without: Vec<_> = text.lines().filter(|line| !line.starts_with(&format!("{key} ="))).collect();
        read(&without.join("\n")).is_err()
    }

    /// The names that a key takes: the message on another one lists them.
    fn names(&self, key: &str) -> Vec<String> {
        let refusal = read(&format!("{}{key} = '?'\n", self.text())).err().map(|refusal| refusal.to_string());
        let refusal = refusal.unwrap_or_default();
        let of_enum = refusal.split_once("unknown value '?', expected ").map(|(_, names)| names);
        let names = of_enum.map(|names| names.split('\'').skip(1).step_by(2).collect::<Vec<_>>());
        let of_kind = || Some(refusal.split_once("there is no kind '?'; use ")?.1.split(", ").collect());
        names.or_else(of_kind).unwrap_or_default().into_iter().map(str::to_owned).collect()
    }
}

fn read(text: &str) -> Result<Scenario, ScenarioError> {
    Scenario::parse(Path::new("scenario.toml"), text)
}

/// The rows of tables with the same keys.
fn rows_of(tables: &[Table]) -> String {
    let table = &tables[0];
    let defaults: Vec<_> = tables.iter().map(Table::defaults).collect();
    let is_table = |key: &str| {
        let path = if table.path().is_empty() { key.to_owned() } else { format!("{}.{key}", table.path()) };
        let mut all = TABLES.into_iter().map(|(toml, keys)| Table { toml, keys });
        let is_around = |known: &str| known == path || known.starts_with(&format!("{path}."));
        path == IN_PROSE || all.any(|table| is_around(table.path()))
    };
    let row = |key: &Key| {
        let unit = unit_of(key.name).unwrap_or_default();
        let mut default: Vec<_> =
            defaults.iter().map(|table_there| default_cell(table, table_there, key.name)).collect();
        default.dedup();
        let names = table.names(key.name).iter().map(|name| format!("`{name}`")).collect::<Vec<_>>();
        let range = key.range.map_or_else(String::new, range_cell);
        let range = [range, names.join(", "), key.condition.to_owned()];
        let range: Vec<_> = range.into_iter().filter(|part| !part.is_empty()).collect();
        let meaning: Vec<_> =
            key.about.iter().map(|line| line.trim()).take_while(|line| !line.is_empty()).collect();
        let cells =
            [&format!("`{}`", key.name), unit, &default.join(", "), &range.join("; "), &meaning.join(" ")];
        let cell = |cell: &&str| if cell.is_empty() { "| ".to_owned() } else { format!("| {cell} ") };
        cells.iter().map(cell).collect::<String>() + "|\n"
    };
    table.keys.iter().filter(|key| !is_table(key.name)).map(row).collect()
}

fn default_cell(table: &Table, defaults: &Value, key: &str) -> String {
    match defaults.get(key).unwrap_or(&Value::Null) {
        _ if table.requires(key) => "*required*".to_owned(),
        Value::Null => "none".to_owned(),
        Value::Number(number) if table.path() == "drive_profile.identity" => {
            format!("`0x{:08X}`", number.as_u64().unwrap())
        }
        value => format!("`{}`", literal(value)),
    }
}

/// A value as TOML has it, its numbers with six digits.
fn literal(value: &Value) -> String {
    match value {
        Value::Array(values) => format!("[{}]", values.iter().map(literal).collect::<Vec<_>>().join(", ")),
        Value::Number(number) if number.is_f64() => {
            let short: f64 = format!("{:.5e}", number.as_f64().unwrap()).parse().unwrap();
            Value::from(short).to_string()
        }
        value => value.to_string(),
    }
}

/// Of a number the documents do not say that it is finite.
fn range_cell(range: Range) -> String {
    range.to_string().trim_start_matches("a finite number ").replace('-', "−")
}

fn fault_row(kind: FaultKindConfig) -> String {
    let FaultDeclaration { name, layer, overlap: _, needs, takes, size, about } = kind.declared();
    let size = size.map_or_else(String::new, |size| {
        let range = format!("{} {}", Range::Within(size.min, size.max), size.dimension.si_unit().name);
        format!(" `size`: {}, {}, such as `\"{}\"`.", size.about, range.trim_end(), size.example)
    });
    format!("| `{name}` | {layer}: {about}{}{size} |\n", keys_in_words([needs, takes]))
}

fn quirk_row(kind: QuirkKindConfig) -> String {
    format!("| `{kind}` | {}{} |\n", kind.about(), keys_in_words(kind.keys()))
}

fn keys_in_words([needs, takes]: [&[&str]; 2]) -> String {
    let said = [("Needs", needs), ("Takes", takes)].into_iter().filter(|(_, keys)| !keys.is_empty());
    let sentence = |(verb, keys): (&str, &[&str])| {
        let keys: Vec<_> = keys.iter().map(|key| format!("`{key}`")).collect();
        format!(" {verb} {}.", keys.join(", "))
    };
    said.map(sentence).collect()
}

/// The signals of a jaw with one tooth and a load cell, those of an axis once.
fn signals(text: &str) -> String {
    let others: Vec<_> = [31..=38, 41..=48].into_iter().flatten().filter(|tooth| *tooth != 36).collect();
    let scenario = read(&format!("[teeth]\nmissing = {others:?}\n[load_cell]")).unwrap();
    let registry = Registry::new(&scenario, &Declared::default());
    let axis = |name: &str| AXIS_NAMES.iter().position(|axis| name.starts_with(&format!("{axis}.")));
    let of_first = registry.signals().iter().filter(|signal| axis(&signal.name).is_none_or(|axis| axis == 0));
    let rows = of_first.map(|signal| {
        let unit = if signal.unit.is_empty() { String::new() } else { format!("{} ", signal.unit) };
        format!("| `{}` | {unit}| {} |\n", signal.name, signal.about)
    });
    with_rows(text, SIGNALS, &rows.collect::<String>())
}

/// What `masseter help` prints of each verb, below the text before the first heading.
fn commands(text: &str) -> String {
    let (before, _) = text.split_once("\n## ").unwrap_or((text, ""));
    let mut renewed = before.trim_end().to_owned();
    // Verbs whose help is still to come, the next one last.
    let mut names = vec![Vec::new()];
    while let Some(name) = names.pop() {
        // Without a terminal a line has as many signs as this variable says, at most 100.
        let mut command = Command::new(MASSETER);
        command.arg("help").args(&name).env_remove("COLUMNS");
        let help = stdout(&command.output().unwrap());
        let inner = verbs_of(&help).rev().map(|verb| name.iter().cloned().chain([verb.to_owned()]).collect());
        names.extend(inner);
        if !name.is_empty() {
            let lines: Vec<_> = help.trim_end().lines().map(str::trim_end).collect();
            let [name, help] = [name.join(" "), lines.join("\n")];
            write!(renewed, "\n\n## masseter {name}\n\n```text\n{help}\n```").unwrap();
        }
    }
    renewed + "\n"
}

/// The verbs that a help lists.
fn verbs_of(help: &str) -> impl DoubleEndedIterator<Item = &str> {
    let (list, _) = help.split_once("\nOptions:").unwrap();
    let entries = list.lines().filter_map(|line| line.strip_prefix("  ")?.split_once("  "));
    let verbs = entries.map(|(name, _)| name);
    verbs.filter(|name| *name != "help" && name.starts_with(|first: char| first.is_ascii_lowercase()))
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
fn every_kind_of_motion_is_documented() {
    let text = fs::read_to_string(path_of("scenario.md")).unwrap();
    let (_, rows) = text.split_once("| `motion.kind` | |\n| --- | --- |\n").unwrap();
    let motions: Vec<_> =
        rows.lines().map_while(|line| line.strip_prefix("| `")?.split('`').next()).collect();
    assert_eq!(motions.len(), MOTIONS, "{motions:?}");
    for kind in motions {
        let path = if kind == "file" { "path = 'jaw.csv'" } else { "" };
        let scenario = read(&format!("[motion]\nkind = '{kind}'\n{path}")).unwrap();
        assert_eq!(kind_of_motion(&scenario.motion), kind);
        assert!(text.contains(&format!("### `[motion] kind = \"{kind}\"`")), "{kind}");
    }
}
