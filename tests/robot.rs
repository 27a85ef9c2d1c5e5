//! The bring-up of a robot as a user calls it: `masseter robot`, on emulated drives.

use std::fs;
use std::path::PathBuf;
use std::process::Output;

use crate::common::{MASSETER, Workspace, bus_log, json, stderr, stdout};

/// Calls a verb of `robot` with this workspace's scenario and folder.
fn robot(workspace: &Workspace, arguments: &[&str]) -> Output {
    let mut command = std::process::Command::new(MASSETER);
    command.args(["robot", arguments[0]]).arg(workspace.file("scenario.toml"));
    command.arg("--folder").arg(workspace.file("bringup")).args(&arguments[1..]);
    command.output().expect("masseter starts")
}

fn result(workspace: &Workspace, step: &str) -> serde_json::Value {
    json(&workspace.file("bringup").join(step).join("result.json"))
}

fn log(workspace: &Workspace, step: &str) -> (PathBuf, String) {
    let path = workspace.file("bringup").join(step).join("candump.log");
    let text = fs::read_to_string(&path).expect("a log");
    (path, text)
}

/// Identifier and data of the frames of a log.
fn frames(log: &str) -> impl Iterator<Item = (&str, &str)> {
    log.lines().filter_map(|line| line.split_whitespace().nth(2)?.split_once('#'))
}

#[test]
fn inspection_sends_uploads_and_nothing_else() {
    let workspace = Workspace::new("");
    let output = robot(&workspace, &["inspect"]);
    assert_eq!(output.status.code(), Some(0), "{}{}", stdout(&output), stderr(&output));
    assert!(stdout(&output).contains("passed: configure would mend 6 deviations"), "{}", stdout(&output));
    let (_, log) = log(&workspace, "01-inspect");
    let requests = bus_log::assert_only_uploads(&log);
    assert!(requests > 300, "{requests}");
    let result = result(&workspace, "01-inspect");
    assert_eq!((&result["step"], &result["passed"]), (&"inspect".into(), &true.into()));
    assert_eq!(result["drives"].as_array().unwrap().len(), 6);
    let sheet = fs::read_to_string(workspace.file("bringup/01-inspect/l1.dcf")).unwrap();
    assert!(sheet.contains("[6066]\nParameterName=Following error time out\n"), "{sheet}");
    assert!(sheet.contains("ParameterValue=Masseter emulated drive"), "{sheet}");
    assert!(masseter_can::canopen::dcf::Dcf::parse(&sheet).is_ok(), "{sheet}");
}

#[test]
fn every_deviation_of_every_drive_is_in_one_table() {
    let workspace =
        Workspace::new("[[drive_profile]]\nkind = 'epos4'\nunits.lead_m = 0.003\naxes = ['l1', 'l2']");
    let output = robot(&workspace, &["inspect"]);
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(1), "{text}{}", stderr(&output));
    let row = |object: &str| {
        let row = text.lines().find(|line| line.contains(object));
        row.unwrap_or_else(|| panic!("no {object} in {text}")).to_owned()
    };
    assert!(row("60AAh:00h").starts_with("l1 l2 "), "{text}");
    assert!(row("60AAh:00h").contains("the drive counts acceleration in increments/s²"), "{text}");
    assert!(row("6085h:00h").contains("write 200000"), "{text}");
    assert!(text.contains("failed: configure cannot mend "), "{text}");
    let refused = robot(&workspace, &["configure"]);
    assert_eq!(refused.status.code(), Some(2), "{}", stdout(&refused));
    assert!(stderr(&refused).contains("run 'masseter robot inspect' first"), "{}", stderr(&refused));
    assert!(!workspace.file("bringup/02-configure").exists(), "a refused step replaces no evidence");
}

/// Whatever differs is written, read back, stored and proved; the steps need each other in order.
#[test]
fn configuration_needs_the_inspection_and_leaves_evidence() {
    let workspace = Workspace::new("[[drive_profile]]\nobjects.6066h = { value = 9 }\naxes = ['l1']");
    let early = robot(&workspace, &["configure"]);
    assert_eq!(early.status.code(), Some(2), "{}", stdout(&early));
    assert!(stderr(&early).contains("inspect not done"), "{}", stderr(&early));
    let inspected = robot(&workspace, &["inspect"]);
    assert_eq!(inspected.status.code(), Some(0), "{}", stdout(&inspected));
    assert!(
        stdout(&inspected).contains("passed: configure would mend 7 deviations"),
        "{}",
        stdout(&inspected)
    );
    let configured = robot(&workspace, &["configure", "--store"]);
    let text = stdout(&configured);
    assert_eq!(configured.status.code(), Some(0), "{text}{}", stderr(&configured));
    assert!(text.contains("l1: 2 values written, stored\n  1400h:05h Event timer: 0 -> 150\n  6066h:00h Following error time out: 20 -> 9\n"), "{text}");
    let before = json(&workspace.file("bringup/02-configure/before-l1.json"));
    let objects = before["objects"].as_array().unwrap();
    assert!(objects.iter().any(|object| object["object"] == "6066h" && object["value"] == 20), "{before}");
    let status = stdout(&robot(&workspace, &["status"]));
    assert!(status.contains("passed  configure"), "{status}");
    assert!(status.contains("next: masseter robot jog --axis d1"), "{status}");
    let restored = robot(&workspace, &["restore", "--axis", "l1"]);
    assert_eq!(restored.status.code(), Some(0), "{}{}", stdout(&restored), stderr(&restored));
    let status = stdout(&robot(&workspace, &["status"]));
    assert!(status.contains("open    configure   l1: outdated: restored at "), "{status}");
    let report = stdout(&robot(&workspace, &["report"]));
    assert!(report.contains("## 02-configure\n") && report.contains("| inspect | passed "), "{report}");
}

/// An EPOS4 as delivered, with a slow memory and a boot loader: only after the configuration does a run pass.
#[test]
fn drives_as_vendors_deliver_them_are_configured_once_and_run() {
    let workspace = Workspace::new(
        "duration_s = 0.5\n[drives]\nmemory = 'memory.json'\n\
         [[drives.quirk]]\nkind = 'factory_pdos'\n[[drives.quirk]]\nkind = 'slow_save'\nfor_s = 3\n\
         [[drives.quirk]]\nkind = 'two_boot_ups'\n[[drives.quirk]]\nkind = 'pdos_locked_in_operation'\n\
         [[drives.quirk]]\nkind = 'interpolation_in_ms'\n\
         [[drive_profile]]\nobjects.'60C2h:02' = { rule = 'expect', value = -3, bytes = 1 }",
    );
    let run = workspace.run_virtual(&[]);
    assert_ne!(run.status.code(), Some(0), "{}", stdout(&run));
    for (arguments, text) in [
        (&["inspect"][..], "passed: configure would mend "),
        (&["configure", "--store"], "passed: the values are stored"),
        (&["inspect"], "passed: all drives are as the scenario needs them"),
    ] {
        let output = robot(&workspace, arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}{}", stdout(&output), stderr(&output));
        assert!(stdout(&output).contains(text), "{arguments:?}: {}", stdout(&output));
    }
    fs::remove_dir_all(workspace.run_folder()).unwrap();
    let run = workspace.run_virtual(&[]);
    assert_eq!(run.status.code(), Some(0), "{}{}", stdout(&run), stderr(&run));
    let restored = robot(&workspace, &["restore", "--store"]);
    assert_eq!(restored.status.code(), Some(0), "{}{}", stdout(&restored), stderr(&restored));
    let inspected = stdout(&robot(&workspace, &["inspect"]));
    assert!(inspected.contains("1800h:02h Transmission type"), "{inspected}");
}

#[test]
fn what_a_drive_cannot_take_is_named_with_its_key() {
    let workspace = Workspace::new("[[drives.quirk]]\nkind = 'narrow_limits'\naxes = ['d2']");
    assert_eq!(robot(&workspace, &["inspect"]).status.code(), Some(0));
    let output = robot(&workspace, &["configure"]);
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(1), "{text}{}", stderr(&output));
    let refusal = "failed: d2: object 6066h:00h (Following error time out) := 20: 06090031h (value is too high); change \
                   drives.slide.following_error_timeout_ms\n";
    assert!(text.contains(refusal), "{text}");
    assert!(text.contains("d1: 1 value written") && !text.contains("d3: "), "{text}");
    assert!(text.contains("masseter robot restore"), "{text}");
    let missing = Workspace::new(
        "[[drives.quirk]]\nkind = 'missing_objects'\n[[drives.quirk]]\nkind = 'acceleration_in_rpm_s'\naxes = ['l1']",
    );
    let output = robot(&missing, &["inspect"]);
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    for object in ["6007h:00h", "6066h:00h", "6085h:00h", "6502h:00h"] {
        let row = text.lines().find(|line| line.contains(object)).unwrap_or_default();
        assert!(row.starts_with("all ") && row.contains("REFUSES"), "{object}: {text}");
    }
    assert!(
        text.contains("the drive counts acceleration in rpm/s, the profile declares increments/s²"),
        "{text}"
    );
}

/// A file that a person or a full disk has damaged: nothing is sent to a drive.
#[test]
fn damaged_old_values_are_refused_with_what_to_do() {
    let workspace = Workspace::new("");
    for step in ["inspect", "configure"] {
        assert_eq!(robot(&workspace, &[step]).status.code(), Some(0));
    }
    let file = workspace.file("bringup/02-configure/before-l1.json");
    let sound = fs::read_to_string(&file).unwrap();
    assert!(sound.contains("\"6065h\"") && sound.contains("\"bytes\": 4"), "{sound}");
    for (damaged, named) in [
        (sound.replace("\"6065h\"", "\"606h\""), "'606h' is no object"),
        (sound.replace("\"6065h\"", "\"6040h\""), "6040h with 4 bytes is no old value"),
        (sound.replace("\"6065h\"", "\"6040h:01\""), "6040h:01 with 4 bytes is no old value"),
        (sound.replace("\"bytes\": 4", "\"bytes\": 5"), "with 5 bytes is no old value"),
        (sound.replace("\"bytes\": 4", "\"bytes\": 0"), "with 0 bytes is no old value"),
        (
            sound.replace("\"communication\": 5120", "\"communication\": 65535"),
            "FFFFh with 2 objects is no PDO",
        ),
        (sound[..sound.len() / 2].to_owned(), "EOF while parsing"),
        (String::new(), "EOF while parsing"),
    ] {
        fs::write(&file, &damaged).unwrap();
        let output = robot(&workspace, &["restore"]);
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{named}: {text}");
        assert!(text.contains(named) && text.contains("before-l1.json: "), "{named}: {text}");
        assert!(text.contains("the file is damaged: bring it back from a backup, or remove it"), "{text}");
        let (_, log) = log(&workspace, "03-restore");
        assert!(!frames(&log).any(|(id, data)| id == "604" && data.starts_with('2')), "nothing is written");
        fs::remove_dir_all(workspace.file("bringup/03-restore")).unwrap();
    }
    fs::write(&file, sound).unwrap();
    let result = workspace.file("bringup/02-configure/result.json");
    let configured = fs::read_to_string(&result).unwrap();
    fs::write(&result, &configured[..configured.len() / 2]).unwrap();
    let refused = robot(&workspace, &["restore"]);
    assert_eq!(refused.status.code(), Some(2), "{}", stdout(&refused));
    let says = "before-d1.json: result.json beside it is missing or damaged, so that nobody knows whose values these are";
    assert!(stderr(&refused).contains(says), "{}", stderr(&refused));
    fs::write(&result, configured).unwrap();
    assert_eq!(robot(&workspace, &["restore"]).status.code(), Some(0));
}

/// Another tool has changed nothing meanwhile: what the first configuration found is in the drives and in their memory
/// in the end.
#[test]
fn old_values_can_be_stored_after_they_were_restored_until_a_reset() {
    let workspace = Workspace::new(
        "[drives]\nmemory = 'memory.json'\n[[drive_profile]]\nobjects.6066h = { value = 9 }\naxes = ['l1']",
    );
    let play = |arguments: &[&str], says: &str| {
        let output = robot(&workspace, arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}{}", stdout(&output), stderr(&output));
        assert!(stdout(&output).contains(says), "{arguments:?}: {}", stdout(&output));
    };
    play(&["inspect"], "");
    play(&["configure", "--store"], "6066h:00h Following error time out: 20 -> 9");
    play(&["restore"], "6066h:00h Following error time out: 9 -> 20");
    play(&["restore", "--store"], "6066h:00h Following error time out: 9 -> 20");
    let again = robot(&workspace, &["restore"]);
    assert!(stderr(&again).contains("there is nothing to restore"), "{}{}", stdout(&again), stderr(&again));
    play(&["inspect"], "l1    6066h:00h Following error time out  9");
}

/// The object is no object of the rig any more.
#[test]
fn a_changed_profile_does_not_keep_old_values_from_their_drive() {
    let sound = "[drives]\nmemory = 'memory.json'\n";
    let profile = "[[drive_profile]]\nobjects.6084h = { value = 77, bytes = 4 }\naxes = ['l1']";
    let workspace = Workspace::new(&format!("{sound}{profile}"));
    for step in [&["inspect"][..], &["configure", "--store"]] {
        let output = robot(&workspace, step);
        assert_eq!(output.status.code(), Some(0), "{step:?}: {}{}", stdout(&output), stderr(&output));
    }
    workspace.write("scenario.toml", sound);
    let output = robot(&workspace, &["restore", "--store"]);
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(0), "{text}{}", stderr(&output));
    assert!(text.contains("  6084h:00h") && text.contains(": 77 -> "), "{text}");
}

/// Another master is on the bus, so that nothing is written.
#[test]
fn a_refused_step_outdates_no_evidence() {
    let workspace = Workspace::new("");
    for step in ["inspect", "configure"] {
        assert_eq!(robot(&workspace, &[step]).status.code(), Some(0));
    }
    workspace.write(
        "scenario.toml",
        "[[faults]]\nkind = 'babble'\nbus = 0\nnode = 2\nid = 0x80\ndata = []\ncount = 1\nfrom_s = 0.2\n",
    );
    let refused = robot(&workspace, &["restore"]);
    assert_eq!(refused.status.code(), Some(1), "{}", stderr(&refused));
    assert!(
        stderr(&refused).contains("nothing was written: bus 0: another master sends SYNC"),
        "{}",
        stderr(&refused)
    );
    let status = stdout(&robot(&workspace, &["status"]));
    assert!(status.contains("passed  configure"), "{status}");
}

/// Node 9 answers on bus 0 once it is asked, as a drive with another id than the scenario's does.
#[test]
fn a_scan_asks_every_node_id_and_names_a_drive_with_another_one() {
    let answer = "[[faults]]\nkind = 'babble'\nbus = 0\nnode = 1\nid = 0x589\n\
                  data = [0x43, 0, 0x10, 0, 0x92, 1, 2, 0]\ncount = 1\nfrom_s = 3.0\n";
    let workspace = Workspace::new(answer);
    let asked = |step: &str| {
        let (_, log) = log(&workspace, step);
        let requests = frames(&log).filter(|(_, data)| data.starts_with("40001000"));
        let ids = requests.filter_map(|(id, _)| Some(u16::from_str_radix(id, 16).ok()? - 0x600));
        ids.collect::<std::collections::BTreeSet<_>>()
    };
    let output = robot(&workspace, &["inspect"]);
    assert_eq!((output.status.code(), stdout(&output).contains("node 9")), (Some(0), false));
    assert_eq!(asked("01-inspect"), (1..=6).collect());
    let output = robot(&workspace, &["inspect", "--scan"]);
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(0), "{text}");
    assert!(text.contains("warning: node 9 on bus 0 is not of the scenario"), "{text}");
    assert_eq!(asked("02-inspect"), (1..=127).collect());
}

/// Somebody else has switched on l1 by SDO, which the rig's interface has not heard, and left.
#[test]
fn a_drive_with_power_is_refused_and_stopped_with_take_over_alone() {
    let commanded = |word: u8, from_s: f64| {
        format!(
            "[[faults]]\nkind = 'babble'\nbus = 1\nnode = 5\nid = 0x604\ncount = 1\nfrom_s = {from_s}\n\
             data = [0x2B, 0x40, 0x60, 0, {word}, 0, 0, 0]\n"
        )
    };
    let unheard = "[[faults]]\nkind = 'lose'\nbus = 1\nnode = 127\nid = 0x604\nfrom_s = 0.0\n";
    let workspace = Workspace::new(&(unheard.to_owned() + &commanded(6, 0.1) + &commanded(7, 0.2)));
    let inspected = robot(&workspace, &["inspect"]);
    assert_eq!(inspected.status.code(), Some(0), "{}", stdout(&inspected));
    assert!(stdout(&inspected).contains("configure refuses unless --take-over may stop the drive"));
    let refused = robot(&workspace, &["configure"]);
    assert_eq!(refused.status.code(), Some(1), "{}", stdout(&refused));
    let says = "does not show that the drive is without power; switch it off, or use --take-over";
    assert!(
        stderr(&refused).contains("l1: statusword ") && stderr(&refused).contains(says),
        "{}",
        stderr(&refused)
    );
    let words = |step: &str| {
        let (_, log) = log(&workspace, step);
        let words = frames(&log).filter(|(id, data)| *id == "604" && data.starts_with("2B406000"));
        words.map(|(_, data)| data[8..10].to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(words("02-configure"), ["06", "07"], "those of the other one");
    for step in ["configure", "restore"] {
        let output = robot(&workspace, &[step, "--take-over"]);
        assert_eq!(output.status.code(), Some(0), "{step}: {}{}", stdout(&output), stderr(&output));
    }
    for step in ["03-configure", "04-restore"] {
        assert_eq!(words(step), ["06", "07", "02", "00"], "{step}: quick stop, then no voltage");
    }
}

/// A force offset of an earlier run, whose process data carried 60B2h, is in the drive. The default profile does not
/// name the object.
#[test]
fn an_old_torque_offset_does_not_act_in_a_later_run() {
    let workspace = Workspace::new(
        "duration_s = 0.2\n[[faults]]\nkind = 'babble'\nbus = 1\nnode = 5\nid = 0x604\ncount = 1\nfrom_s = 0.05\n\
         data = [0x2B, 0xB2, 0x60, 0, 55, 0, 0, 0]\n",
    );
    let inspected = stdout(&robot(&workspace, &["inspect"]));
    let row = inspected.lines().find(|line| line.contains("60B2h:00h")).unwrap_or_default();
    assert!(row.starts_with("l1 ") && row.contains("55 ") && row.contains("write 0"), "{inspected}");
    let run = workspace.run_virtual(&[]);
    assert_eq!(run.status.code(), Some(0), "{}{}", stdout(&run), stderr(&run));
    let log = fs::read_to_string(workspace.run_folder().join("can1.log")).unwrap();
    let frames: Vec<_> = frames(&log).collect();
    let place = |is_it: fn(&(&str, &str)) -> bool, what| frames.iter().position(is_it).expect(what);
    let old = place(|frame| *frame == ("604", "2BB2600037000000"), "the offset of the earlier run");
    let cleared = place(|frame| *frame == ("604", "2BB2600000000000"), "the boot writes 0");
    let enabled = place(|(id, data)| *id == "204" && data.starts_with("0F"), "l1 has power");
    assert!(old < cleared && cleared < enabled, "{old} {cleared} {enabled}");
}
