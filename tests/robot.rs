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
    assert!(row("1018h:01h").starts_with("l1 l2 "), "{text}");
    assert!(row("1018h:01h").contains("drive_profile.identity.vendor_id"), "{text}");
    assert!(row("6085h:00h").contains("write 200000"), "{text}");
    assert!(text.contains("failed: configure cannot mend "), "{text}");
    let refused = robot(&workspace, &["configure"]);
    assert_eq!(refused.status.code(), Some(2), "{}", stdout(&refused));
    assert!(stderr(&refused).contains("run 'masseter robot inspect' first"), "{}", stderr(&refused));
    let (_, log) = log(&workspace, "02-configure");
    assert!(
        frames(&log).all(|(id, data)| !id.starts_with('6') || !data.starts_with('2')),
        "nothing is written"
    );
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
    let before = json(&workspace.file("bringup/03-configure/before-l1.json"));
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
    assert!(report.contains("## 03-configure\n") && report.contains("| inspect | passed "), "{report}");
}
