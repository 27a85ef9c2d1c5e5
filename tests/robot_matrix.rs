//! What every step of the bring-up does with every quirk, and after every event between two steps: the last two tables of
//! docs/robot.md. `cargo test --test rig -- --ignored renew_the_tables_of_the_robot` plays everything and writes the tables anew.
//!
//! Each step plays, also those after the one that finds the quirk. The log of every step shows that no second axis ever had power,
//! and that `inspect` only reads.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use masseter_model::geometry::AXIS_NAMES;

use crate::common::{self, Workspace, bus_log};
use crate::robot_quirks::{Row, play, play_runs, rows, scenario, steps};

const QUIRKS: &str = "| quirk | inspect | configure | jog | watchdog | home | check-pose | run --dry | run |\n\
                      | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
const EVENTS: &str = "| between two steps | inspect | configure | jog | watchdog | home | check-pose | run --dry | run | the step says |\n\
                      | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";

/// What a step does: the word in the table.
fn reaction(exit: i32, has_moved: bool) -> &'static str {
    match (exit, has_moved) {
        (0, _) => "passes",
        (1 | 2 | 5, false) => "refuses",
        (1, true) => "switches off",
        (5, true) => "stops",
        other => panic!("no table has a word for {other:?}"),
    }
}

fn reaction_of_run(exit: Option<i32>) -> &'static str {
    match exit {
        Some(0) => "passes",
        Some(1) => "fails",
        Some(5) => "safe stop",
        other => panic!("no table has a word for {other:?}"),
    }
}

/// Plays a step, and judges its log; returns the word for the log, and its text.
fn reaction_to(robot: &Workspace, step: &str, arguments: &[&str]) -> (&'static str, String) {
    let before = folders(robot);
    let (exit, text) = play(robot, step, arguments);
    let new = folders(robot).into_iter().find(|folder| !before.contains(folder));
    // A step that the files alone refuse sends nothing, and makes no folder.
    let log = new.map(|folder| fs::read_to_string(folder.join("candump.log")).unwrap()).unwrap_or_default();
    let has_moved = bus_log::moved_one_axis_at_most(step, &log);
    if step == "inspect" {
        assert!(bus_log::assert_only_uploads(&log) > 50, "{log}");
    }
    (reaction(exit, has_moved), text)
}

fn folders(robot: &Workspace) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(robot.file("bringup")) else { return Vec::new() };
    entries.map(|entry| entry.unwrap().path()).filter(|path| path.is_dir()).collect()
}

/// A row: the first word that is not "passes" is set in bold.
fn row_of(name: &str, reactions: &[&str]) -> String {
    let found = reactions.iter().position(|reaction| *reaction != "passes");
    let cell = |(place, reaction): (usize, &&str)| {
        let mark = if found == Some(place) { "**" } else { "" };
        format!(" {mark}{reaction}{mark} |")
    };
    format!("| {name} |{}", reactions.iter().enumerate().map(cell).collect::<String>())
}

/// The steps beside those of the other axes: one jog.
fn with_one_jog<'a>(steps: Vec<(&'static str, Vec<&'a str>)>) -> Vec<(&'static str, Vec<&'a str>)> {
    let is_other = |arguments: &[&str]| arguments.get(1).is_some_and(|axis| *axis != "l1");
    steps.into_iter().filter(|(step, arguments)| *step != "jog" || !is_other(arguments)).collect()
}

/// Every step with a quirk, also after the step that finds it.
fn row_of_quirk(row: &Row) -> String {
    let robot = row.robot();
    let mut reactions = Vec::new();
    for (step, mut arguments) in with_one_jog(row.steps()) {
        if !matches!(step, "inspect" | "configure") {
            arguments.push("--out-of-order");
        }
        if step == "watchdog" {
            arguments.extend(["--axis", "l1"]);
        }
        reactions.push(reaction_to(&robot, step, &arguments).0);
    }
    reactions.extend(play_runs(&robot).map(|(exit, _)| reaction_of_run(exit)));
    row_of(&row.cell, &reactions) + "\n"
}

/// Something that happens to a sound robot between two steps.
struct Event {
    name: &'static str,
    /// Tables of the scenario, and keys of the profile, of the whole bring-up.
    before: [&'static str; 2],
    /// Tables of the scenario from the event on.
    tables: &'static str,
    /// A file that is lost.
    lost: Option<&'static str>,
    says: &'static str,
}

/// Slides whose encoders forget their position: zero is their place at the closed pose.
const FORGETTING: &str =
    "axes = ['d1', 'd2', 'd3']\nhoming = { absolute = false, method = 37, home_position_m = 0.0 }";

const BETWEEN: [Event; 6] = [
    Event {
        name: "a power dip; the drives have stored their values, and their encoders are absolute",
        before: ["", ""],
        tables: "",
        lost: None,
        says: "",
    },
    Event {
        name: "a power dip of drives that have stored nothing",
        before: ["[[drives.quirk]]\nkind = 'factory_pdos'", ""],
        tables: "[[drives.quirk]]\nkind = 'factory_pdos'",
        lost: Some("drives.json"),
        says: "SYNCs without process data; check 1800h (run configure)",
    },
    Event {
        name: "a power dip of incremental encoders",
        before: ["[[drives.quirk]]\nkind = 'incremental_encoder'\naxes = ['d1', 'd2', 'd3']", FORGETTING],
        tables: "[[drives.quirk]]\nkind = 'incremental_encoder'\naxes = ['d1', 'd2', 'd3']",
        lost: None,
        says: "the drive was without power, reset or jogged since ",
    },
    Event {
        name: "a lost heartbeat that the drives take for a fault",
        before: ["", ""],
        tables: "[[drives.quirk]]\nkind = 'fault_at_power_on'\ncode = 0x8100",
        lost: None,
        says: "(error code 8100h); the drive has lost its master; switch its supply off and on",
    },
    Event {
        name: "the node ids of l1 and l2 are swapped",
        before: ["", ""],
        tables: "[[drives.quirk]]\nkind = 'swapped_ids'\naxes = ['l1', 'l2']",
        lost: None,
        says: "outdated: the drive's serial number was 4, and is 5",
    },
    Event {
        name: "the folder is that of another robot",
        before: ["", ""],
        tables: "[[drives.quirk]]\nkind = 'shows'\nobjects = ['1018h:04']\nvalue = 77",
        lost: None,
        says: "outdated: the drive's serial number was 1, and is 77",
    },
];

/// The robot before each step, and after the last one. A step that does not pass is the last one.
fn brought_up([tables, profile]: [&str; 2]) -> Vec<Workspace> {
    let robot = Workspace::new(&scenario(tables, profile));
    let mut stages = Vec::new();
    for (step, arguments) in steps("1mm") {
        if step != "jog" || arguments[1] == AXIS_NAMES[3] {
            stages.push(copy_of(&robot));
        }
        if play(&robot, step, &arguments).0 != 0 {
            break;
        }
    }
    stages.push(copy_of(&robot));
    stages
}

fn copy_of(robot: &Workspace) -> Workspace {
    let copy = Workspace::new("");
    let [from, to] = [robot, &copy].map(|workspace| workspace.file("."));
    let status = Command::new("cp").arg("-r").args([&from, &to]).status().expect("cp starts");
    assert!(status.success());
    copy
}

/// Every step after an event, with the evidence of the steps before the event; `stages` are those of the bring-up without it.
fn row_of_event(event: &Event, stages: &[Workspace]) -> String {
    let struck = |place: usize| {
        let robot = copy_of(&stages[place]);
        robot.write("scenario.toml", &scenario(event.tables, event.before[1]));
        if let Some(lost) = event.lost {
            let _ = fs::remove_file(robot.file(lost));
        }
        robot
    };
    let (mut reactions, mut is_said) = (Vec::new(), event.says.is_empty());
    let steps = with_one_jog(steps("1mm"));
    assert_eq!(stages.len(), steps.len() + 1, "{}: the steps before the event pass", event.name);
    for (place, (step, arguments)) in steps.iter().enumerate() {
        let (reaction, text) = reaction_to(&struck(place), step, arguments);
        is_said |= text.contains(event.says);
        reactions.push(reaction);
    }
    assert!(is_said, "{}: no step says '{}'", event.name, event.says);
    reactions.extend(play_runs(&struck(steps.len())).map(|(exit, _)| reaction_of_run(exit)));
    let says = if event.says.is_empty() { String::new() } else { format!("`{}`", event.says) };
    format!("{} {says} |\n", row_of(event.name, &reactions))
}

fn rows_of_events() -> Vec<String> {
    let mut brought = BTreeMap::new();
    let row = |event: &Event| {
        let stages = brought.entry(event.before).or_insert_with_key(|before| brought_up(*before));
        row_of_event(event, stages)
    };
    BETWEEN.iter().map(row).collect()
}

fn document() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/robot.md")
}

/// The rows under the head of a table.
fn rows_under<'t>(text: &'t str, head: &str) -> Vec<&'t str> {
    let (_, table) = text.split_once(head).unwrap_or_else(|| panic!("no table {head}"));
    table.split_inclusive('\n').take_while(|line| line.starts_with('|')).collect()
}

#[test]
fn every_step_does_with_every_quirk_what_the_table_says() {
    let text = fs::read_to_string(document()).unwrap();
    let shown = rows_under(&text, QUIRKS);
    let quirks = rows();
    assert_eq!(shown.len(), quirks.len(), "one row for each row of the table of quirks");
    let both: Vec<_> = quirks.iter().zip(shown).collect();
    for (quirk, shown) in common::sample(&both) {
        assert_eq!(row_of_quirk(quirk), *shown);
    }
}

#[test]
fn every_step_does_after_an_event_what_the_table_says() {
    let text = fs::read_to_string(document()).unwrap();
    assert_eq!(rows_of_events(), rows_under(&text, EVENTS));
}

#[test]
#[ignore = "writes documents"]
fn renew_the_tables_of_the_robot() {
    let mut text = fs::read_to_string(document()).unwrap();
    let all: [(&str, String); 2] =
        [(QUIRKS, rows().iter().map(row_of_quirk).collect()), (EVENTS, rows_of_events().concat())];
    for (head, rows) in all {
        text = crate::reference::with_rows(&text, head, &rows);
    }
    fs::write(document(), text).unwrap();
}
