//! The verbs of `robot` that move axes, on emulated drives.

use std::collections::BTreeSet;
use std::process::{Command, Stdio};
use std::time::Duration;

use masseter_model::geometry::AXIS_NAMES;

use crate::common::{self, MASSETER, Workspace, bus_log, masseter, stderr, stdout};
use serde_json::Value;

/// A rig whose jaw is closed, as check-pose wants it.
const CLOSED: &str = "[dynamics]\ninitial_leg_m = 0.2974\n";

/// A verb of `robot` in an empty folder without earlier steps: exit code, standard output, standard error, result.
fn robot(scenario: &str, arguments: &[&str]) -> (Option<i32>, String, String, Value) {
    let workspace = Workspace::new(scenario);
    let (file, evidence) = (workspace.file("scenario.toml"), workspace.file("bringup"));
    let more = ["--out-of-order", "--folder", evidence.to_str().unwrap(), file.to_str().unwrap()];
    let output = masseter(&[&["robot"], arguments, &more].concat());
    let folders = std::fs::read_dir(evidence).unwrap();
    let folder = folders.last().unwrap().unwrap().path();
    assert!(folder.join("candump.log").exists());
    let result = std::fs::read_to_string(folder.join("result.json")).unwrap();
    (output.status.code(), stdout(&output), stderr(&output), serde_json::from_str(&result).unwrap())
}

#[test]
fn a_jog_passes_with_a_right_reading_of_a_gauge_alone() {
    for (measured, code, passed, text) in [
        (None, 0, false, "not passed yet"),
        (Some("1.01mm"), 0, true, "/bringup/01-jog-l1"),
        (Some("0.97mm"), 1, false, "multiply encoder_resolution_m"),
        (Some("-1mm"), 1, false, "drive_profile.reversed"),
        (Some("0mm"), 1, false, "did another axis move? compare can.node_ids with the drives"),
    ] {
        let more = measured.map_or(vec![], |measured| vec!["--measured", measured]);
        let (found, out, err, result) =
            robot("", &[&["jog", "--axis", "l1", "--by", "1mm"], &more[..]].concat());
        assert_eq!((found, &result["passed"]), (Some(code), &Value::Bool(passed)), "{out}{err}");
        assert!(out.contains("friction") && err.contains(text), "{out}{err}");
        assert!((result["result"]["moved_m"].as_f64().unwrap() - 1e-3).abs() < 1e-5, "{result}");
    }
}

#[test]
fn a_jog_with_a_sync_that_the_drive_misses_is_no_evidence() {
    let deaf = "[[faults]]\nkind = 'lose'\nbus = 1\nnode = 4\nid = 0x80\ncount = 1\nfrom_s = 0.0\n";
    let (code, out, err, result) = robot(deaf, &["jog", "--axis", "l1", "--by", "1mm", "--measured", "1mm"]);
    assert_eq!((code, &result["passed"]), (Some(1), &Value::Bool(false)), "{out}{err}");
    assert!(out.contains("49 of 50 SYNCs answered, within "), "{out}");
    assert!(err.contains("l1: 1 of 50 SYNCs without process data; check 1800h"), "{err}");
}

#[test]
fn a_way_that_no_gauge_resolves_is_refused_with_a_reading() {
    let workspace = Workspace::new("");
    let (file, evidence) = (workspace.file("scenario.toml"), workspace.file("bringup"));
    let output = Command::new(MASSETER)
        .args([
            "robot",
            "jog",
            "--axis",
            "l1",
            "--by",
            "0.2mm",
            "--measured",
            "0.2mm",
            "--out-of-order",
            "--folder",
        ])
        .args([&evidence, &file])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", stdout(&output));
    assert!(
        stderr(&output).contains("a gauge proves no way below 0.5 mm; jog further"),
        "{}",
        stderr(&output)
    );
    assert!(!evidence.exists(), "a refused step makes no folder");
}

#[test]
fn a_jog_that_is_stopped_ends_with_5_and_is_no_evidence() {
    let jammed = "[[faults]]\nkind = 'drive_fault'\naxis = 'l1'\nfrom_s = 2.2\n";
    let (code, _, err, result) = robot(jammed, &["jog", "--axis", "l1", "--by", "5mm"]);
    assert_eq!(code, Some(5), "{err}");
    assert!(err.contains("l1: l1 sent emergency 5112h") && err.contains("the axis is off"), "{err}");
    assert_eq!(result["passed"], false);
}

/// The fourth axis is l1, whose drive ignores a lost heartbeat.
#[test]
fn a_proof_that_fails_keeps_the_figures_of_the_axes_before() {
    let deaf = "[[drives.quirk]]\nkind = 'ignores_heartbeat'\naxes = ['l1']\n";
    let (code, out, err, result) = robot(deaf, &["watchdog"]);
    assert_eq!((code, out.lines().count()), (Some(1), 3), "{out}{err}");
    assert_eq!(result["passed"], false);
    let result = &result["result"];
    assert!(result["error"].as_str().unwrap().starts_with("l1: kept its power for "), "{result}");
    let before = result["before"].as_array().unwrap();
    assert_eq!(before.iter().map(|figures| &figures["axis"]).collect::<Vec<_>>(), ["d1", "d2", "d3"]);
    for figures in before {
        let reaction = &figures["heartbeat"];
        assert!(reaction["stopped_after_ms"].as_f64().unwrap() > 140.0, "{figures}");
        assert_eq!((&reaction["emergency"], &reaction["last_frame"]), (&0x8130.into(), &"left".into()));
    }
}

#[test]
fn nothing_moves_without_a_held_key() {
    let (code, out, err, result) = robot("", &["jog", "--axis", "d1", "--by=-1mm", "--hold"]);
    assert_eq!(code, Some(130), "{out}{err}");
    assert!(err.contains("stopped on request") && !out.contains("moved"), "{out}{err}");
    assert_eq!(result["passed"], false);
}

#[test]
fn absolute_axes_are_compared_and_incremental_ones_home_twice() {
    let (code, out, err, _) = robot("", &["home"]);
    assert_eq!((code, out.lines().count()), (Some(0), 6), "{out}{err}");
    assert!(out.starts_with("l1: 289.9") && out.contains("the encoder keeps its position"), "{out}");
    let index = "[[drive_profile]]\naxes = ['l1']\n\
                 homing = { method = 33, absolute = false, home_position_m = 0.288 }\n";
    let (code, out, err, result) = robot(index, &["home", "--axis", "l1"]);
    assert_eq!(code, Some(0), "{out}{err}");
    assert!(result["result"][0]["spread_m"].as_f64().unwrap() < 5e-5, "{result}");
}

#[test]
fn the_closed_pose_passes_and_another_one_is_explained_by_axis() {
    let (code, out, err, result) = robot(CLOSED, &["check-pose"]);
    assert_eq!((code, &result["passed"]), (Some(0), &Value::Bool(true)), "{out}{err}");
    assert!(out.contains("condition number") && out.lines().count() == 9, "{out}");
    // A slipped coupling.
    let slipped =
        format!("{CLOSED}[[faults]]\nkind = 'encoder_offset'\naxis = 'd2'\nsize = '2 mm'\nfrom_s = 0.0\n");
    let (code, out, err, result) = robot(&slipped, &["check-pose"]);
    assert_eq!((code, &result["passed"]), (Some(1), &Value::Bool(false)), "{out}{err}");
    assert!(err.contains("d2 differs most, by 2.0"), "{out}{err}");
}

#[test]
fn a_step_needs_the_earlier_one_and_a_length_its_unit() {
    let workspace = Workspace::new("");
    let evidence = workspace.file("bringup");
    let jog = ["robot", "jog", "--axis", "l1", "--folder", evidence.to_str().unwrap(), "--by"];
    let output = masseter(&[&jog[..], &["1mm"]].concat());
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("l1: configure not done"), "{}", stderr(&output));
    assert!(!evidence.exists(), "a refused step makes no folder");
    let output = masseter(&[&jog[..], &["1"]].concat());
    assert!(stderr(&output).contains("such as 1mm"), "{}", stderr(&output));
}

#[test]
fn the_steps_follow_each_other_by_their_evidence() {
    let workspace = Workspace::new("");
    let (file, evidence) = (workspace.file("scenario.toml"), workspace.file("bringup"));
    let places = ["--folder", evidence.to_str().unwrap(), file.to_str().unwrap()];
    for step in [
        "inspect",
        "configure",
        "jog --axis l1 --by 2mm --measured 2mm",
        "watchdog --axis l1",
        "home --axis l1",
    ] {
        let step: Vec<_> = step.split(' ').collect();
        let output = masseter(&[&["robot"], &step[..], &places].concat());
        assert_eq!(output.status.code(), Some(0), "{step:?}: {}{}", stdout(&output), stderr(&output));
    }
    let output = masseter(&[&["robot", "check-pose"], &places[..]].concat());
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("d1: home not done"), "{}", stderr(&output));
}

/// All steps up to the pose check, which may fail.
fn bring_up(workspace: &Workspace) -> (Option<i32>, String) {
    let places = ["--folder", "bringup", "scenario.toml"];
    let play = |step: &[&str]| {
        let mut command = Command::new(MASSETER);
        command.arg("robot").args(step).args(places).current_dir(workspace.file("."));
        command.output().expect("masseter starts")
    };
    let jogs = AXIS_NAMES.map(|axis| vec!["jog", "--axis", axis, "--by", "1mm", "--measured", "1mm"]);
    let before = [vec!["inspect"], vec!["configure"]];
    for step in before.into_iter().chain(jogs).chain([vec!["watchdog"], vec!["home"]]) {
        let output = play(&step);
        assert_eq!(output.status.code(), Some(0), "{step:?}: {}{}", stdout(&output), stderr(&output));
    }
    let output = play(&["check-pose"]);
    (output.status.code(), stderr(&output))
}

/// Zero is the place of a slide at the closed pose, so that the pose alone shows no lost position. Emulated drives lose their
/// power between two commands.
#[test]
fn a_slide_that_was_without_power_since_home_fails_the_pose_check() {
    let slides = "axes = ['d1', 'd2', 'd3']\n";
    let workspace = Workspace::new(&format!(
        "{CLOSED}[[drives.quirk]]\nkind = 'incremental_encoder'\n{slides}[[drive_profile]]\n{slides}\
         homing = {{ absolute = false, method = 37, home_position_m = 0.0 }}\n"
    ));
    let (code, err) = bring_up(&workspace);
    assert_eq!(code, Some(1), "{err}");
    assert!(err.contains("d1: the drive was without power, reset or jogged since "), "{err}");
    let jogs = AXIS_NAMES.map(|axis| format!("jog-{axis}"));
    let moved = jogs.into_iter().chain(["watchdog", "home"].map(str::to_owned));
    assert_eq!(steps_with_power(&workspace), moved.collect());
}

/// The steps that gave an axis power, and never a second one; at their end none has power.
fn steps_with_power(workspace: &Workspace) -> BTreeSet<String> {
    let folders = std::fs::read_dir(workspace.file("bringup")).unwrap().map(|entry| entry.unwrap().path());
    let mut moved = BTreeSet::new();
    for folder in folders {
        // A dry run is a run, and has no log here.
        let Ok(log) = std::fs::read_to_string(folder.join("candump.log")) else { continue };
        let name = folder.file_name().unwrap().to_str().unwrap()[3..].to_owned();
        if bus_log::moved_one_axis_at_most(&name, &log) {
            moved.insert(name);
        }
    }
    moved
}

#[test]
fn no_step_before_the_run_gives_two_axes_power() {
    let workspace = Workspace::new(&format!("duration_s = 0.2\n{CLOSED}"));
    let (code, err) = bring_up(&workspace);
    assert_eq!(code, Some(0), "{err}");
    let run = Command::new(MASSETER)
        .args(["run", "scenario.toml", "--dry", "--clock", "virtual", "--quiet"])
        .current_dir(workspace.file("."))
        .output()
        .unwrap();
    assert_eq!(run.status.code(), Some(0), "{}{}", stdout(&run), stderr(&run));
    let dry = std::fs::read_dir(workspace.file("bringup")).unwrap().map(|entry| entry.unwrap().path());
    let dry = dry.filter(|path| path.ends_with("12-dry-run")).last().expect("the dry run leaves evidence");
    assert_eq!(common::json(&dry.join("result.json"))["passed"], true);
    let jogs = AXIS_NAMES.map(|axis| format!("jog-{axis}"));
    let moved = jogs.into_iter().chain(["watchdog".to_owned()]);
    assert_eq!(steps_with_power(&workspace), moved.collect(), "absolute drives need no homing");
}

/// The emulated drives do not outlive their process: what the next step writes back is proved by the library's test.
#[test]
fn a_killed_jog_leaves_the_old_values_in_a_file_and_the_next_step_settles_them() {
    let workspace = Workspace::new("");
    let (file, evidence) = (workspace.file("scenario.toml"), workspace.file("bringup"));
    let places = ["--out-of-order", "--folder", evidence.to_str().unwrap(), file.to_str().unwrap()];
    let jog = ["robot", "jog", "--axis", "l1", "--by", "1mm"];
    let owed = evidence.join("borrowed-l1.json");
    let mut killed = Command::new(MASSETER);
    killed.args(jog).args(["--dwell", "100000s"]).args(places);
    let mut killed = killed.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    for _ in 0..1000 {
        if owed.exists() {
            break;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    // SIGKILL.
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert!(std::fs::read_to_string(&owed).unwrap().contains("\"object\": \"60"));
    let inspect = masseter(&[&["robot", "inspect"], &places[1..]].concat());
    assert!(
        stdout(&inspect).contains("warning: l1: a killed step left reduced values"),
        "{}",
        stdout(&inspect)
    );
    assert!(owed.exists(), "inspect writes nothing");
    let mut of_another = common::json(&owed);
    of_another["drive"]["serial"] = serde_json::json!({ "told": 77 });
    let next = masseter(&[&jog[..], &places].concat());
    assert_eq!(next.status.code(), Some(0), "{}", stderr(&next));
    assert!(
        stderr(&next).contains("l1: a step was killed; the drive has its old values again"),
        "{}",
        stderr(&next)
    );
    assert!(!owed.exists(), "the step itself owes nothing at its end");
    std::fs::write(&owed, of_another.to_string()).unwrap();
    let other = masseter(&[&jog[..], &places].concat());
    assert_eq!(other.status.code(), Some(1), "{}", stderr(&other));
    let says = "has the old values of another drive (serial number was 77, and is 4)";
    assert!(stderr(&other).contains(says), "{}", stderr(&other));
}
