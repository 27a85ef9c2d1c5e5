//! Faults in the middle of every step from inspection to run: a cable is pulled, a supply fails for long or for a
//! moment, another master resets a node or only sends SYNC. The step ends with an exit code above 0, names the drive,
//! gives no drive power again, and is no evidence. What it owes to a drive returns with the next step.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use crate::common::{MASSETER, Workspace, json, stderr, stdout};

/// The leg l1 has node 4 on bus 1.
const CABLE: &str = "kind = 'disconnect'\nbus = 1\nnode = 4";
const SUPPLY: &str = "kind = 'drive_reboot'\naxis = 'l1'\nsize = '10 s'";
/// A dip from which the drive is back at once.
const DIP: &str = "kind = 'drive_reboot'\naxis = 'l1'\nsize = '10 ms'";
/// NMT "reset node", as another master on the place of l2 sends it.
const RESET: &str = "kind = 'babble'\nbus = 1\nnode = 5\nid = 0\ndata = [0x81, 4]\ncount = 1";
/// SYNC, as another master on the place of d2 sends it.
const SYNC: &str = "kind = 'babble'\nbus = 0\nnode = 2\nid = 0x80\ndata = []\ncount = 1";
const SOUND: &str = "duration_s = 0.5\n[controller]\nease_s = 0.2\n[drives]\nmemory = 'memory.json'\n[[drives.quirk]]\nkind = 'slow_save'\nfor_s = 1.0\n\
                     [dynamics]\ninitial_leg_m = 0.2974\n[[drive_profile]]\naxes = ['l1', 'l2', 'l3']\n\
                     homing = { absolute = false, method = 33, home_position_m = 0.2974 }\n";
const OFF: &str = "the axis is off";
const NOT_PROVED: &str = "l1: NOT PROVED OFF (l1: object 6040h:00h: no answer";
const DIPPED: &str = "l1 restarted during the step; check its supply";
const BY_MASTER: &str = "l1 restarted during the step; end the other master, which sends NMT";

const BESIDE: &str = "bus 0: another master sends SYNC; end that program";

/// A step with the moment of its fault: s since switch-on, in the middle of what the step does with l1.
#[derive(Debug)]
struct Tried {
    before: &'static [&'static str],
    step: &'static str,
    from_s: f64,
    exit: i32,
    /// What the step says after each of the five faults.
    says: [&'static [&'static str]; 5],
}

const SILENT: &[&str] = &["node 4 does not answer; check its power"];
const ALL: [Tried; 8] = [
    Tried {
        before: &[],
        step: "inspect",
        from_s: 2.3,
        exit: 1,
        says: [
            SILENT,
            SILENT,
            &[DIPPED],
            &["failed: bus 1: another master sends NMT; end that program", BY_MASTER],
            &[BESIDE],
        ],
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
            &[BESIDE],
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
            &[BESIDE],
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
            &[BESIDE],
        ],
    },
    Tried {
        before: &[],
        step: "jog --axis l1 --by=-5mm --measured=-5mm --out-of-order",
        from_s: 2.5,
        exit: 5,
        says: [&[NOT_PROVED], &[NOT_PROVED], &[DIPPED, OFF], &[BY_MASTER, OFF], &[BESIDE, OFF]],
    },
    // While the axis stands with power.
    Tried {
        before: &[],
        step: "watchdog --axis l1 --out-of-order",
        from_s: 1.5,
        exit: 5,
        says: [&[NOT_PROVED], &[NOT_PROVED], &[DIPPED, OFF], &[BY_MASTER, OFF], &[BESIDE, OFF]],
    },
    Tried {
        before: &[],
        step: "home --axis l1 --out-of-order",
        from_s: 2.5,
        exit: 5,
        says: [&[NOT_PROVED], &[NOT_PROVED], &[DIPPED, OFF], &[BY_MASTER, OFF], &[BESIDE, OFF]],
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
            &[BESIDE],
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
        for (fault, says) in [CABLE, SUPPLY, DIP, RESET, SYNC].into_iter().zip(tried.says) {
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

/// When a frame like this is on the bus first, and the frames after it, s since switch-on.
fn find(log: &str, is_it: impl Fn(&str, &str) -> bool) -> (f64, &str) {
    let place = |line: &str| {
        let mut words = line.split_whitespace();
        let at_s: f64 = words.next()?.trim_matches(['(', ')']).parse().ok()?;
        let (id, data) = words.nth(1)?.split_once('#')?;
        is_it(id, data).then_some(at_s)
    };
    let mut rest = log;
    while let Some((line, after)) = rest.split_once('\n') {
        if let Some(at_s) = place(line) {
            return (at_s, after);
        }
        rest = after;
    }
    panic!("no such frame");
}

/// A download to an object, by its first byte.
fn writes(data: &str) -> bool {
    data.starts_with('2')
}

/// The log of a step without a fault.
fn sound_log(before: &[&str], step: &str) -> String {
    let workspace = Workspace::new(SOUND);
    for step in before.iter().chain([&step]) {
        assert_passes(&workspace, step);
    }
    fs::read_to_string(newest(&workspace).join("candump.log")).unwrap()
}

/// A step with a fault at that time; its exit code, what it says, and its result.
fn with_fault(before: &[&str], step: &str, fault: &str, from_s: f64) -> (Option<i32>, String, Workspace) {
    let workspace = Workspace::new(SOUND);
    for step in before {
        assert_passes(&workspace, step);
    }
    workspace.write("scenario.toml", &format!("{SOUND}[[faults]]\n{fault}\nfrom_s = {from_s:?}\n"));
    let output = robot(&workspace, step);
    (output.status.code(), stdout(&output) + &stderr(&output), workspace)
}

/// Whether a frame, by its identifier and data, is a moment of a step.
type Moment<'m> = &'m dyn Fn(&str, &str) -> bool;

/// Once the step is done with l1, l1 is dark to the end.
#[test]
fn a_drive_that_fails_after_its_own_turn_fails_the_step() {
    let l2_begins = |id: &str, data: &str| id == "605" && data.starts_with("40001000");
    let l2_is_written = |id: &str, data: &str| id == "605" && writes(data);
    let l1_is_compared = |id: &str, data: &str| id == "584" && data.starts_with("43646000");
    let (home, silent) = ("home --axis d1 --out-of-order", "l1: object 1018h:01h: no answer");
    let tried: [(&[&str], &str, Moment<'_>, &str); 5] = [
        (&[], "inspect", &l2_begins, SILENT[0]),
        (&["inspect"], "configure", &l2_is_written, silent),
        (&["inspect", "configure --store"], "restore", &l2_is_written, silent),
        (&[], home, &|id, data| id == "581" && data.starts_with("43646000"), silent),
        (&[], "check-pose --out-of-order", &l1_is_compared, "l1: object"),
    ];
    for (before, step, is_done, says) in tried {
        let log = sound_log(before, step);
        let (mut done_s, after) = find(&log, is_done);
        if step.starts_with("check-pose") {
            // The second reading.
            done_s = find(after, is_done).0;
        }
        for fault in [CABLE, SUPPLY] {
            let (exit, text, workspace) = with_fault(before, step, fault, done_s + 5e-4);
            assert_eq!((exit, text.contains(says)), (Some(1), true), "{step} with {fault}: {text}");
            let result = json(&newest(&workspace).join("result.json"));
            assert_eq!(result["passed"], false, "{step} with {fault}: it would be evidence");
        }
    }
}

/// The values of l1 are written, and read again.
#[test]
fn a_drive_that_is_lost_while_its_values_are_compared_has_no_wrong_values() {
    let log = sound_log(&["inspect"], "configure");
    let (_, written) = find(&log, |id, data| id == "604" && writes(data));
    let (compared_s, _) = find(written, |id, data| id == "604" && data.starts_with("40001000"));
    let bus = "kind = 'bus_off'\nbus = 1\nnode = 127\ncount = 1000";
    for (fault, says) in [
        (CABLE, "failed: l1: node 4 does not answer"),
        (SUPPLY, "failed: l1: node 4 does not answer"),
        (bus, "failed: bus 1: bus-off"),
    ] {
        let (exit, text, workspace) = with_fault(&["inspect"], "configure", fault, compared_s + 0.02);
        assert_eq!((exit, text.contains(says)), (Some(1), true), "{fault}: {text}");
        assert!(text.contains("l1: 4 values written") && !text.contains("differ"), "{fault}: {text}");
        let result = json(&newest(&workspace).join("result.json"));
        assert_eq!(result["result"].as_array().map(Vec::len), Some(4), "d1 to l1: {result}");
    }
}

/// A dip at any moment from the first value to the last comparison of l1: that it restarted, and no consequence of that.
#[test]
fn a_restart_is_told_before_what_follows_from_it() {
    let log = sound_log(&["inspect"], "configure");
    let (first_s, _) = find(&log, |id, data| id == "604" && writes(data));
    let (last_s, _) = find(&log, |id, data| id == "605" && writes(data));
    for part in 0..12 {
        let from_s = first_s + (last_s - first_s) * f64::from(part) / 12.0;
        let (exit, text, _) = with_fault(&["inspect"], "configure", DIP, from_s);
        assert_eq!((exit, text.contains(&format!("failed: {DIPPED}"))), (Some(1), true), "{from_s}: {text}");
        assert!(!text.contains("differ") && !text.contains("no answer"), "{from_s}: {text}");
    }
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
            (SYNC, "another node sends SYNC or NMT"),
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
