//! Which step of the bring-up finds which habit of a drive: every row of the table in docs/robot.md is played.
//!
//! The emulated drives take the habits of vendors' drives from `[[drives.quirk]]`.

use std::fs;
use std::path::Path;
use std::process::Command;

use masseter_scenario::QuirkKindConfig;

use crate::common::{self, MASSETER, Workspace, stderr, stdout};

const AXES: [&str; 6] = ["l1", "l2", "l3", "d1", "d2", "d3"];

/// A row of the table.
#[derive(Debug)]
pub(crate) struct Row {
    /// The first cell.
    pub(crate) cell: String,
    quirk: String,
    /// Keys of the profile without which the quirk does not show.
    shown_with: String,
    /// What a gauge shows after a jog by 1 mm.
    gauge: String,
    found_by: Option<String>,
    exit: Option<i32>,
    says: Option<String>,
    /// Keys of a profile with which every step passes; none where no profile helps.
    profile: Option<String>,
    /// How `run --dry` and `run` end on the same robot without the profile, and what they say.
    runs: [(i32, Option<String>); 2],
}

/// The first text between backticks of a cell.
fn quoted(cell: &str) -> Option<String> {
    quoted_at(cell, 0)
}

fn quoted_at(cell: &str, place: usize) -> Option<String> {
    Some(cell.split('`').nth(2 * place + 1)?.to_owned())
}

pub(crate) fn rows() -> Vec<Row> {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/robot.md")).unwrap();
    let (_, table) = text.split_once("| quirk | found by | exit |").unwrap();
    let lines = table.lines().skip(2).take_while(|line| line.starts_with('|'));
    let row = |line: &str| {
        let [_, quirk, found_by, exit, says, profile, dry, full, _] = line.split('|').collect::<Vec<_>>()[..]
        else {
            panic!("{line}");
        };
        let no_profile_helps = profile.trim().starts_with("none");
        let gauge = quirk.split_once("a gauge that shows ").and_then(|(_, reading)| quoted(reading));
        Row {
            cell: quirk.trim().to_owned(),
            quirk: quoted(quirk).unwrap(),
            shown_with: quoted_at(quirk, 1).filter(|_| gauge.is_none()).unwrap_or_default(),
            gauge: gauge.unwrap_or_else(|| "1mm".to_owned()),
            found_by: quoted(found_by),
            exit: exit.trim().parse().ok(),
            says: quoted(says),
            profile: (!no_profile_helps).then(|| quoted(profile).unwrap_or_default()),
            runs: [dry, full].map(|cell| {
                let exit = cell.split_whitespace().next().and_then(|exit| exit.parse().ok());
                (exit.unwrap_or_else(|| panic!("{line}: '{cell}' begins with an exit code")), quoted(cell))
            }),
        }
    };
    lines.map(row).collect()
}

/// A robot whose jaw is closed, with that quirk and those keys of a profile.
fn robot(quirk: &str, profile: &str) -> Workspace {
    Workspace::new(&scenario(&table(quirk), profile))
}

/// The table of a quirk, or that of a fault which has its head.
fn table(quirk: &str) -> String {
    // An array goes on.
    let keys = quirk.replace(", ", "\n").replace("\"\n\"", "\", \"");
    if keys.starts_with("[[faults]]") {
        keys.replacen(' ', "\n", 1)
    } else {
        format!("[[drives.quirk]]\n{keys}")
    }
}

/// The scenario of a robot whose jaw is closed, with these tables and those keys of a profile.
pub(crate) fn scenario(tables: &str, profile: &str) -> String {
    format!(
        "duration_s = 0.2\n[drives]\nmemory = 'drives.json'\n{tables}\n[dynamics]\ninitial_leg_m = 0.2974\n\
         [[drive_profile]]\n{profile}\n"
    )
}

impl Row {
    pub(crate) fn robot(&self) -> Workspace {
        robot(&self.quirk, &self.shown_with)
    }

    /// Every step in its order: its name, and its arguments.
    pub(crate) fn steps(&self) -> Vec<(&'static str, Vec<&str>)> {
        steps(&self.gauge)
    }
}

/// Every step in its order: its name, and its arguments.
pub(crate) fn steps(gauge: &str) -> Vec<(&'static str, Vec<&str>)> {
    let jog = |axis| ("jog", vec!["--axis", axis, "--by", "1mm", "--measured", gauge]);
    let before = [("inspect", vec![]), ("configure", vec!["--store"])];
    let after = ["watchdog", "home", "check-pose"].map(|step| (step, vec![]));
    before.into_iter().chain(AXES.map(jog)).chain(after).collect()
}

/// Plays one step; returns its exit code and what it says.
pub(crate) fn play(robot: &Workspace, step: &str, arguments: &[&str]) -> (i32, String) {
    let mut command = Command::new(MASSETER);
    command.args(["robot", step]).arg(robot.file("scenario.toml")).args(arguments);
    let output = command.arg("--folder").arg(robot.file("bringup")).output().expect("masseter starts");
    (output.status.code().unwrap_or(-1), stdout(&output) + &stderr(&output))
}

/// The steps up to the one that finds the quirk.
fn assert_found(row: &Row) {
    let Some(found_by) = &row.found_by else { return };
    let robot = row.robot();
    for (step, arguments) in row.steps() {
        let (exit, text) = play(&robot, step, &arguments);
        if step == found_by {
            let says = row.says.as_deref().unwrap();
            assert_eq!((Some(exit), text.contains(says)), (row.exit, true), "{row:?}: {step}: {text}");
            return;
        }
        assert_eq!(exit, 0, "{row:?}: {step}: {text}");
    }
    panic!("{row:?}: there is no step {found_by}");
}

/// All steps, where a profile tells of the quirk.
fn assert_passes(row: &Row) {
    let Some(profile) = &row.profile else { return };
    let robot = robot(&row.quirk, profile);
    for (step, arguments) in row.steps() {
        let (exit, text) = play(&robot, step, &arguments);
        assert_eq!(exit, 0, "{row:?}: {step}: {text}");
    }
    let (exit, text) = play(&robot, "inspect", &[]);
    assert!(
        exit == 0 && text.contains("passed: all drives are as the scenario needs them"),
        "{row:?}: {text}"
    );
}

/// `run --dry` and `run`: exit codes and what they say. The dry run eases ten times as long as is set: 2 s, and 10 s without it.
pub(crate) fn play_runs(robot: &Workspace) -> [(Option<i32>, String); 2] {
    [&["--dry", "--set", "controller.ease_s=0.2"][..], &[]].map(|arguments| {
        let output = robot.run_virtual(arguments);
        fs::remove_dir_all(robot.run_folder()).expect("a run leaves a folder");
        (output.status.code(), stdout(&output) + &stderr(&output))
    })
}

/// A run does not need the steps on simulated buses. The drives are as `configure --store` leaves them.
fn assert_runs(row: &Row) {
    let robot = row.robot();
    for (step, arguments) in &row.steps()[..2] {
        play(&robot, step, arguments);
    }
    for ((exit, text), (wanted, says)) in play_runs(&robot).into_iter().zip(&row.runs) {
        let is_said = says.as_ref().is_none_or(|says| text.contains(says));
        assert_eq!((exit, is_said), (Some(*wanted), true), "{row:?}: {text}");
    }
    if let Some(profile) = &row.profile {
        let robot = self::robot(&row.quirk, profile);
        for (step, arguments) in &row.steps()[..2] {
            assert_eq!(play(&robot, step, arguments).0, 0);
        }
        for (exit, text) in play_runs(&robot) {
            assert_eq!(exit, Some(0), "{row:?} with its profile: {text}");
        }
    }
}

#[test]
fn every_quirk_does_in_a_run_what_the_table_says() {
    common::sample(&rows()).for_each(assert_runs);
}

#[test]
fn every_quirk_is_found_by_its_step() {
    let rows = rows();
    for kind in QuirkKindConfig::ALL {
        let name = serde_json::to_string(kind).unwrap();
        assert!(rows.iter().any(|row| row.quirk.contains(&name)), "docs/robot.md has no row of {name}");
    }
    rows.iter().for_each(assert_found);
}

#[test]
fn every_quirk_passes_with_its_profile() {
    rows().iter().for_each(assert_passes);
}
