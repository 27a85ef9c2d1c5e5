//! Drives that are not who they were, do not do what they acknowledge, or stand on a limit switch: each step that gives
//! power refuses them before it does.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{MASSETER, Workspace, json, stderr, stdout};

/// The jaw is closed; l1 forgets its position.
const SOUND: &str = "duration_s = 0.2\n[dynamics]\ninitial_leg_m = 0.2974\n[[drive_profile]]\naxes = ['l1']\n\
                     homing = { absolute = false, method = 33, home_position_m = 0.2974 }\n";
/// Every drive knows its position.
const KNOWING: &str = "duration_s = 0.2\n";
/// The value that a lying drive shows: no object of the rig has it.
const SHOWN: u32 = 165;

/// A quirk of the drive of l1.
fn quirk(keys: &str) -> String {
    format!("[[drives.quirk]]\naxes = ['l1']\n{keys}\n")
}

fn shows(object: &str, value: u32) -> String {
    quirk(&format!("kind = 'shows'\nobjects = ['{object}']\nvalue = {value}"))
}

/// Plays `masseter` with these words in a workspace; its exit code and everything that it says.
fn play(workspace: &Workspace, words: &str) -> (Option<i32>, String) {
    let mut command = Command::new(MASSETER);
    command.args(words.split(' ')).arg("scenario.toml").current_dir(workspace.file("."));
    let output = command.output().expect("masseter starts");
    (output.status.code(), stdout(&output) + &stderr(&output))
}

fn assert_passes(workspace: &Workspace, words: &str) -> String {
    let (exit, text) = play(workspace, words);
    assert_eq!(exit, Some(0), "{words}: {text}");
    text
}

/// The folder of the newest step.
fn newest(workspace: &Workspace) -> PathBuf {
    let steps = fs::read_dir(workspace.file("bringup")).unwrap().map(|step| step.unwrap().path());
    steps.filter(|step| step.is_dir()).max().unwrap()
}

/// The data of the frames in a log that have this identifier.
fn frames(log: &Path, wanted: &str) -> Vec<String> {
    let text = fs::read_to_string(log).unwrap();
    let frames = text.lines().filter_map(|line| line.split_whitespace().nth(2)?.split_once('#'));
    frames.filter(|(id, _)| *id == wanted).map(|(_, data)| data.to_owned()).collect()
}

/// The downloads to l1 in a log, each as object and data.
fn downloads(log: &Path) -> Vec<(String, String)> {
    let sent = frames(log, "604").into_iter().filter(|data| data.starts_with('2'));
    sent.map(|data| (format!("{}{}h:{}h", &data[4..6], &data[2..4], &data[6..8]), data[8..].to_owned()))
        .collect()
}

/// Whether a log has a controlword to l1 that switches it on: a step sends it by SDO, a run at the beginning of RPDO1.
fn has_power(log: &Path) -> bool {
    let written =
        downloads(log).into_iter().filter(|(object, _)| object == "6040h:00h").map(|(_, data)| data);
    let mut words = written.chain(frames(log, "204"));
    words.any(|word| u8::from_str_radix(&word[..2], 16).unwrap() & 1 == 1)
}

/// A step that writes to l1, where its log is, the exit code of its refusal, and what proves its writes to 6060h.
struct Writing {
    scenario: &'static str,
    words: &'static str,
    log: fn(&Workspace) -> PathBuf,
    exit: i32,
    mode: Option<&'static str>,
}

fn of_step(workspace: &Workspace) -> PathBuf {
    newest(workspace).join("candump.log")
}

fn of_run(workspace: &Workspace) -> PathBuf {
    workspace.file("run/can1.log")
}

/// Every object that the step writes to a sound drive, in turn. So an object that a step writes one day is tested too.
fn assert_every_value_is_read_back(Writing { scenario, words, log, exit, mode }: &Writing) {
    let sound = Workspace::new(scenario);
    assert_passes(&sound, words);
    let written: BTreeSet<_> = downloads(&log(&sound)).into_iter().map(|(object, _)| object).collect();
    assert!(written.len() > 10, "{words}: {written:?}");
    assert!(has_power(&log(&sound)), "{words}: a sound drive gets power");
    for object in written {
        let named = match (object.as_str(), mode) {
            ("6060h:00h", Some(mode)) => (*mode).to_owned(),
            // A command, whose result the statusword shows; and the mode of a run, which 6061h shows from delivery on.
            ("6040h:00h", _) | ("6060h:00h", None) => continue,
            _ => format!("object {object}"),
        };
        let key = object.replacen("h:", ":", 1).replacen('h', "", 1);
        let key = format!("{}h:{}", &key[..4], &key[5..7]);
        let liar = Workspace::new(&((*scenario).to_owned() + &shows(&key, SHOWN)));
        let (found, text) = play(&liar, words);
        assert_eq!((found, text.contains(&named)), (Some(*exit), true), "{words}: {object}: {text}");
        assert!(!has_power(&log(&liar)), "{words}: {object}: the drive had power");
    }
}

#[test]
fn a_jog_refuses_a_drive_that_does_not_keep_what_it_acknowledges() {
    let words = "robot jog --axis l1 --by 1mm --out-of-order";
    let (scenario, mode) = (SOUND, Some("6061h shows"));
    assert_every_value_is_read_back(&Writing { scenario, words, log: of_step, exit: 1, mode });
}

#[test]
fn home_refuses_a_drive_that_does_not_keep_what_it_acknowledges() {
    let words = "robot home --axis l1 --out-of-order";
    let (scenario, mode) = (SOUND, Some("6061h shows"));
    assert_every_value_is_read_back(&Writing { scenario, words, log: of_step, exit: 1, mode });
}

#[test]
fn a_run_refuses_a_drive_that_does_not_keep_what_it_acknowledges() {
    for words in ["run --clock virtual --out run", "run --clock virtual --out run --dry"] {
        assert_every_value_is_read_back(&Writing {
            scenario: KNOWING,
            words,
            log: of_run,
            exit: 5,
            mode: None,
        });
    }
}

/// The values before and after, in words.
#[test]
fn a_value_that_is_not_kept_is_named_with_what_was_written_and_what_is_read() {
    let liar = Workspace::new(&(SOUND.to_owned() + &shows("6065h", SHOWN)));
    let (_, text) = play(&liar, "robot jog --axis l1 --by 1mm --out-of-order");
    let says =
        "l1: object 6065h:00h (Following error window) := 250: the drive acknowledged it and shows 165";
    assert!(text.contains(says), "{text}");
    liar.write("scenario.toml", &(KNOWING.to_owned() + &shows("6065h", SHOWN)));
    let (_, text) = play(&liar, "run --clock virtual --out run");
    let says = "object 6065h:00h was written as 000007D0h and acknowledged, and reads 000000A5h";
    assert!(text.contains(says), "{text}");
    liar.write("scenario.toml", &(SOUND.to_owned() + &shows("6065h", SHOWN)));
    for step in ["robot inspect", "robot configure"] {
        play(&liar, step);
    }
    let (exit, text) = play(&liar, "robot configure");
    let says = "failed: l1: object 6065h:00h (Following error window) := 2000: the drive acknowledged it and shows 165; \
                change drives.leg.following_error_m";
    assert_eq!((exit, text.contains(says)), (Some(1), true), "{text}");
}

/// What a replaced drive says of itself, and what a step says of it.
const REPLACED: [(&str, &str); 4] = [
    ("kind = 'shows'\nobjects = ['1018h:04']\nvalue = 77", "serial number was 4, and is 77"),
    ("kind = 'lacks'\nobjects = ['1018h:04']", "serial number was 4, and is none"),
    ("kind = 'shows'\nobjects = ['1018h:03']\nvalue = 0x10001", "revision was 10000h, and is 10001h"),
    ("kind = 'shows'\nobjects = ['1018h:02']\nvalue = 7", "product code was 402h, and is 7h"),
];

#[test]
fn a_replaced_drive_gets_no_power_and_no_value_whatever_it_tells() {
    let workspace = Workspace::new(SOUND);
    let jog = "robot jog --axis l1 --by 1mm";
    for step in [
        "robot inspect",
        "robot configure",
        "robot jog --axis l1 --by 1mm --measured 1mm",
        "robot watchdog --axis l1",
    ] {
        assert_passes(&workspace, step);
    }
    for (keys, says) in REPLACED {
        workspace.write("scenario.toml", &(SOUND.to_owned() + &quirk(keys)));
        for step in ["robot home --axis l1", jog] {
            let (exit, text) = play(&workspace, step);
            let outdated = format!("outdated: the drive's {says}");
            assert_eq!((exit, text.contains(&outdated)), (Some(2), true), "{step}: {keys}: {text}");
            assert_eq!(downloads(&of_step(&workspace)), [], "{step}: {keys}");
            fs::remove_dir_all(newest(&workspace)).unwrap();
        }
    }
}

/// Another drive than the profile's, also where no evidence is asked for.
#[test]
fn a_drive_of_another_kind_gets_no_power_out_of_order_either() {
    let other = SOUND.to_owned() + &quirk("kind = 'lacks'\nobjects = ['1018h:04']") + &shows("1018h:02", 7);
    for step in [
        "robot jog --axis l1 --by 1mm",
        "robot watchdog --axis l1",
        "robot home --axis l1",
        "robot check-pose",
    ] {
        let workspace = Workspace::new(&other);
        let (exit, text) = play(&workspace, &format!("{step} --out-of-order"));
        let says = "l1: object 1018h:02h (Product code) is 7h, the profile wants 402h";
        assert_eq!((exit, text.contains(says)), (Some(1), true), "{step}: {text}");
        assert_eq!(downloads(&of_step(&workspace)), [], "{step}");
    }
}

/// 1018h:04 is optional (CiA 301).
#[test]
fn a_drive_without_a_serial_number_uses_its_evidence_and_the_steps_say_what_is_not_known() {
    let workspace = Workspace::new(&(SOUND.to_owned() + &quirk("kind = 'lacks'\nobjects = ['1018h:04']")));
    let says = "warning: l1: no serial number (1018h:04), so that nobody knows whether a drive of the same vendor, \
                product and revision has taken its place";
    assert!(assert_passes(&workspace, "robot inspect").contains(says));
    assert_passes(&workspace, "robot configure");
    for step in
        ["robot jog --axis l1 --by 1mm --measured 1mm", "robot watchdog --axis l1", "robot home --axis l1"]
    {
        let text = assert_passes(&workspace, step);
        assert!(text.contains(says), "{step}: {text}");
    }
    let result = json(&newest(&workspace).join("result.json"));
    assert_eq!(result["drives"][3]["is"]["serial"], "absent", "{result}");
    workspace.write("scenario.toml", SOUND);
    let (exit, text) = play(&workspace, "robot jog --axis l1 --by 1mm");
    assert_eq!((exit, text.contains("serial number was none, and is 4")), (Some(2), true), "{text}");
}

#[test]
fn an_inspection_names_drives_that_cannot_be_told_apart() {
    let twins = "[[drives.quirk]]\nkind = 'shows'\nobjects = ['1018h:04']\nvalue = 7\naxes = ['l1', 'l3']\n";
    let text = assert_passes(&Workspace::new(twins), "robot inspect");
    let says =
        "warning: l1 l3: one identity, serial number 7: nobody knows which is which when they change places";
    assert!(text.contains(says), "{text}");
    let text = assert_passes(&Workspace::new(""), "robot inspect");
    assert!(!text.contains("warning"), "{text}");
}

/// The wire of a normally closed switch is broken.
#[test]
fn a_limit_switch_that_is_closed_at_the_start_is_shown_and_allows_no_way_in_its_direction() {
    for (bits, found, toward, away) in [(2, "positive", "1mm", "-1mm"), (1, "negative", "-1mm", "1mm")] {
        let workspace = Workspace::new(&(SOUND.to_owned() + &shows("60FDh", bits)));
        let text = assert_passes(&workspace, "robot inspect");
        let row = text.lines().find(|line| line.contains("60FDh:00h Digital inputs")).unwrap_or_default();
        assert!(row.starts_with("l1 ") && row.contains(&format!("{found} closed  (look) ")), "{text}");
        let jog = |by: &str| play(&workspace, &format!("robot jog --axis l1 --by={by} --out-of-order"));
        let (exit, text) = jog(toward);
        let says =
            format!("l1: a limit switch is closed (60FDh = {bits:08X}h), and the way goes in its direction");
        assert_eq!((exit, text.contains(&says)), (Some(1), true), "{text}");
        assert!(!has_power(&of_step(&workspace)));
        let (exit, text) = jog(away);
        assert_eq!(exit, Some(0), "{text}");
    }
}
