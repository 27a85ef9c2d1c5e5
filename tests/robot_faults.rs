//! Faults in the middle of every step from inspection to run: a cable is pulled, a supply fails for long or for a moment, another master
//! resets a node. The step ends with an exit code above 0, names the drive, gives no drive power again, and is no evidence. What it
//! owes to a drive returns with the next step.

mod common;

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use common::{MASSETER, Workspace, json, stderr, stdout};

/// The leg l1 has node 4 on bus 1.
const CABLE: &str = "kind = 'disconnect'\nbus = 1\nnode = 4";
const SUPPLY: &str = "kind = 'drive_reboot'\naxis = 'l1'\nsize = '10 s'";
/// A dip from which the drive is back at once.
const DIP: &str = "kind = 'drive_reboot'\naxis = 'l1'\nsize = '10 ms'";
/// NMT "reset node", as another master on the place of l2 sends it.
const RESET: &str = "kind = 'babble'\nbus = 1\nnode = 5\nid = 0\ndata = [0x81, 4]\ncount = 1";
const SOUND: &str = "duration_s = 0.5\n[drives]\nmemory = 'memory.json'\n[[drives.quirk]]\nkind = 'slow_save'\nfor_s = 1.0\n\
                     [dynamics]\ninitial_leg_m = 0.2974\n[[drive_profile]]\naxes = ['l1', 'l2', 'l3']\n\
                     homing = { absolute = false, method = 33, home_position_m = 0.2974 }\n";
const OFF: &str = "the axis is off";
const NOT_PROVED: &str = "l1: NOT PROVED OFF (l1: object 6040h:00h: no answer";
const DIPPED: &str = "l1 restarted during the step; check its supply";
const BY_MASTER: &str = "l1 restarted during the step; end the other master, which sends NMT";

/// A step with the moment of its fault: s since switch-on, in the middle of what the step does with l1.
#[derive(Debug)]
struct Tried {
    before: &'static [&'static str],
    step: &'static str,
    from_s: f64,
    exit: i32,
    /// What the step says after each of the four faults.
    says: [&'static [&'static str]; 4],
}

const SILENT: &[&str] = &["node 4 does not answer; check its power"];
const ALL: [Tried; 7] = [
    Tried {
        before: &[],
        step: "inspect",
        from_s: 2.3,
        exit: 1,
        says: [SILENT, SILENT, &[DIPPED], &["bus 1: NMT: another master is on the bus", BY_MASTER]],
    },
    // The drives after l1 are not touched.
    Tried {
        before: &["inspect"],
        step: "configure",
        from_s: 2.9,
        exit: 1,
        says: [
            &["failed: l1: object 607Ch:00h: no answer; check its power", "d3: 1 value written"],
            &["failed: l1: object 607Ch:00h: no answer; check its power", "masseter robot restore"],
            &[DIPPED],
            &[BY_MASTER],
        ],
    },
    // Between 1010h and the reset that proves the memory.
    Tried {
        before: &["inspect"],
        step: "configure --store --axis l1",
        from_s: 1.5,
        exit: 1,
        says: [
            &["failed: l1: object 1010h:01h: no answer"],
            &["failed: l1: object 1010h:01h: no answer"],
            &[DIPPED],
            &[BY_MASTER],
        ],
    },
    Tried {
        before: &["inspect", "configure --store"],
        step: "restore",
        from_s: 2.9,
        exit: 1,
        says: [
            &["failed: l1: object 607Ch:00h: no answer"],
            &["failed: l1: object 607Ch:00h: no answer"],
            &[DIPPED],
            &[BY_MASTER],
        ],
    },
    Tried {
        before: &[],
        step: "jog --axis l1 --by=-5mm --measured=-5mm --out-of-order",
        from_s: 2.5,
        exit: 5,
        says: [&[NOT_PROVED], &[NOT_PROVED], &[DIPPED, OFF], &[BY_MASTER, OFF]],
    },
    Tried {
        before: &[],
        step: "home --axis l1 --out-of-order",
        from_s: 2.5,
        exit: 5,
        says: [&[NOT_PROVED], &[NOT_PROVED], &[DIPPED, OFF], &[BY_MASTER, OFF]],
    },
    // Between the two readings.
    Tried {
        before: &[],
        step: "check-pose --out-of-order",
        from_s: 0.6,
        exit: 1,
        says: [
            &["l1: object 6064h:00h: no answer"],
            &["l1: object 6064h:00h: no answer"],
            &[DIPPED],
            &[BY_MASTER],
        ],
    },
];

fn robot(robot: &Workspace, step: &str) -> Output {
    let mut words = step.split(' ');
    let mut command = Command::new(MASSETER);
    command.args(["robot", words.next().unwrap()]).arg(robot.file("scenario.toml")).args(words);
    command.arg("--folder").arg(robot.file("bringup")).output().expect("masseter starts")
}

fn assert_passes(workspace: &Workspace, step: &str) {
    let output = robot(workspace, step);
    assert!(output.status.success(), "{step}: {}{}", stdout(&output), stderr(&output));
}

fn newest(workspace: &Workspace) -> PathBuf {
    let entries = fs::read_dir(workspace.file("bringup")).unwrap().map(|entry| entry.unwrap().path());
    entries.filter(|path| path.is_dir()).max().expect("a step leaves a folder")
}

/// Controlwords that a log has after a time, with the node: those that a step has sent by SDO.
fn controlwords(log: &str) -> Vec<(f64, u16, u8)> {
    let word = |line: &str| {
        let mut words = line.split_whitespace();
        let at_s = words.next()?.trim_matches(['(', ')']).parse().ok()?;
        let (id, data) = words.nth(1)?.split_once('#')?;
        let low = u8::from_str_radix(data.strip_prefix("2B406000")?.get(..2)?, 16).ok()?;
        Some((at_s, u16::from_str_radix(id, 16).ok()?, low))
    };
    log.lines().filter_map(word).collect()
}

#[test]
fn a_fault_in_the_middle_of_a_step_ends_it_safely_and_owes_nothing_for_ever() {
    for tried in &ALL {
        for (fault, says) in [CABLE, SUPPLY, DIP, RESET].into_iter().zip(tried.says) {
            let case = format!("{} with {}", tried.step, fault.lines().next().unwrap());
            let workspace = Workspace::new(SOUND);
            tried.before.iter().for_each(|step| assert_passes(&workspace, step));
            workspace.write(
                "scenario.toml",
                &format!("{SOUND}[[faults]]\n{fault}\nfrom_s = {:?}\n", tried.from_s),
            );
            let output = robot(&workspace, tried.step);
            let text = stdout(&output) + &stderr(&output);
            assert_eq!(output.status.code(), Some(tried.exit), "{case}: {text}");
            for said in says {
                assert!(text.contains(said), "{case}: no '{said}' in {text}");
            }
            let folder = newest(&workspace);
            assert_eq!(json(&folder.join("result.json"))["passed"], false, "{case}: it would be evidence");
            let log = fs::read_to_string(folder.join("candump.log")).unwrap();
            let words = controlwords(&log);
            let moves = tried.exit == 5;
            assert_eq!(words.is_empty(), !moves, "{case}: a step that moves nothing sends no controlword");
            if moves {
                assert_eq!(
                    words.last().map(|&(_, id, word)| (id, word)),
                    Some((0x604, 0)),
                    "{case}: disable voltage"
                );
            }
            workspace.write("scenario.toml", SOUND);
            let again = if tried.step.starts_with("configure") { "restore" } else { tried.step };
            assert_passes(&workspace, again);
            assert!(
                !workspace.file("bringup/borrowed-l1.json").exists(),
                "{case}: old values are still owed"
            );
        }
    }
}

/// While l2 or l3 is written: the values of l1 are lost.
#[test]
fn a_drive_that_restarts_after_its_own_turn_fails_the_configuration() {
    let workspace = Workspace::new(SOUND);
    assert_passes(&workspace, "inspect");
    workspace.write("scenario.toml", &format!("{SOUND}[[faults]]\n{DIP}\nfrom_s = 3.1\n"));
    let output = robot(&workspace, "configure");
    let text = stdout(&output) + &stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains(&format!("failed: {DIPPED}")) && text.contains("l3: "), "{text}");
}

/// The last statusword of each node on the bus of the legs, as the process data of a run told it.
fn last_statuswords(log: &str) -> Vec<(u16, u16)> {
    let told = |line: &str| {
        let (id, data) = line.split_whitespace().nth(2)?.split_once('#')?;
        let id = u16::from_str_radix(id, 16).ok().filter(|id| (0x184..=0x186).contains(id))?;
        Some((id, u16::from_str_radix(data.get(..4)?, 16).ok()?.swap_bytes()))
    };
    let last: std::collections::BTreeMap<_, _> = log.lines().filter_map(told).collect();
    last.into_iter().collect()
}

/// Bit 1 is "switched on". The drive itself says nothing more, or boots: a cut one stops by itself.
#[test]
fn a_fault_in_the_middle_of_a_run_stops_all_drives_and_names_the_one() {
    for arguments in [&["--dry"][..], &[]] {
        for (fault, says) in [
            (CABLE, "process_data_lost (axis l1 (node 4 on bus 1)"),
            (SUPPLY, "process_data_lost (axis l1 (node 4 on bus 1)"),
            (DIP, "process_data_lost (axis l1 (node 4 on bus 1)"),
            (RESET, "another node sends SYNC or NMT"),
        ] {
            let workspace = Workspace::new(SOUND);
            for step in ["inspect", "configure --store"] {
                assert_passes(&workspace, step);
            }
            workspace.write("scenario.toml", &format!("{SOUND}[[faults]]\n{fault}\nat_s = 0.2\n"));
            let mut command = Command::new(MASSETER);
            command.args(["run", "scenario.toml", "--out", "run", "--clock", "virtual"]).args(arguments);
            let output = command.current_dir(workspace.file(".")).output().expect("masseter starts");
            let text = stdout(&output) + &stderr(&output);
            assert_eq!(output.status.code(), Some(5), "{arguments:?} {fault}: {text}");
            assert!(text.contains(says), "{arguments:?} {fault}: {text}");
            let log = fs::read_to_string(workspace.run_folder().join("can1.log")).unwrap();
            let words = last_statuswords(&log);
            assert_eq!(words.len(), 3);
            for (id, word) in words.iter().filter(|(id, _)| *id != 0x184) {
                assert_eq!(word & 2, 0, "{arguments:?} {fault}: {id:X}h {word:04X}h");
            }
            let boot_ups = log.matches(" 704#00").count();
            let restarts = [DIP, RESET].contains(&fault);
            assert_eq!(boot_ups > 1, restarts, "{arguments:?} {fault}: a drive boots without power");
            let result = newest(&workspace).join("result.json");
            let is_dry_run = json(&result)["step"] == "dry-run";
            assert!(!is_dry_run || json(&result)["passed"] == false, "a run that failed is no evidence");
        }
    }
}
