//! The bring-up of a robot as a user calls it: `masseter robot`, on emulated drives.

mod common;

use std::fs;
use std::path::PathBuf;
use std::process::Output;

use common::{MASSETER, Workspace, json, stderr, stdout};

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
    let (path, log) = log(&workspace, "01-inspect");
    let mut requests = 0;
    for (id, data) in frames(&log) {
        let id = u16::from_str_radix(id, 16).unwrap();
        match id {
            // An upload begins with 40h, and its segments are asked for with 60h and 70h.
            0x601..=0x606 => {
                assert!(["40", "60", "70"].contains(&&data[..2]), "{}: {id:X}#{data}", path.display());
                requests += 1;
            }
            // Answers, heartbeats and emergencies of the drives.
            0x581..=0x586 | 0x701..=0x706 | 0x081..=0x086 => {}
            _ => panic!("{}: {id:X}#{data}", path.display()),
        }
    }
    assert!(requests > 300, "{requests}");
    let result = result(&workspace, "01-inspect");
    assert_eq!((&result["step"], &result["passed"]), (&"inspect".into(), &true.into()));
    assert_eq!(result["serials"].as_array().unwrap().len(), 6);
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
