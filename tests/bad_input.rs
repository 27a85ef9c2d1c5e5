//! What bad input gets: refused before anything starts, with place and reason, exit code 2.

use std::fs;
use std::os::unix::fs::symlink;
use std::process::Command;

use crate::common::{MASSETER, Workspace, masseter, stderr};
use serde_json::{Value, json};

#[test]
fn scenarios_are_refused_with_place_and_remedy() {
    let cases = [
        ("seeed = 1", "scenario.toml:1:1: unknown key 'seeed'"),
        ("seeed = 1", "did you mean 'seed'?"),
        ("seed = 1\n[drives.leg]\nmax_force_n = -1.0", "scenario.toml:3:1: drives.leg.max_force_n = -1"),
        ("checks = [999.0, 7]", "scenario.toml:1:10: checks is an array"),
        ("[dynamics]\ncarriage_mass_kg = 1e300", "use 0.001 to 100"),
        ("[motion]\nkind = 'chewing'\nvertical = 3.0", "did you mean 'vertical_mm'?"),
        ("[motion]\nkind = 'yawning'", "scenario.toml:2:8: motion.kind: unknown value 'yawning'"),
        ("[motion]\nkind = 'chewin'", "did you mean 'chewing'?"),
        ("rate_hz = 0", "use 10 to 20000 Hz"),
        ("[can]\nbuses = [[0, 1, 2, 3, 4, 5]]", "too late"),
        ("[can]\nbuses = [[0, 1, 2], [3, 4]]", "axis"),
        ("[can]\nnode_ids = [1, 1, 2, 3, 4, 5]", "node"),
        ("[mechanism]\nplatform_sides_m = [0.05, 0.05, 0.2]", "no triangle"),
        (
            "[motion]\nkind = 'opening'\namplitude_mm = 90.0",
            "scenario.toml:3:1: motion.amplitude_mm of 90.0 mm is out of reach",
        ),
        ("[jaw]\nreference_point_m = [nan, 0, 0]", "scenario.toml:2:1: jaw.reference_point_m is NaN"),
        ("[jaw]\nreference_point_m = [1e300, 0, 0]", "scenario.toml:2:1: jaw.reference_point_m is 1e300"),
        (
            "rate_hz = 10\n[controller]\nstart_timeout_s = 5\n[can]\nheartbeat_consumer_ms = 200",
            "scenario.toml:3:1: controller.start_timeout_s = 5: at 10 Hz",
        ),
        (
            "\n[[faults]]\nkind = 'lose'\nbus = 0\nfrom_s = 1\nnode = 0",
            "scenario.toml:6:1: faults.node = 0: bus 0 has the nodes",
        ),
        ("[can]\nnode_ids = [127, 1, 2, 3, 4, 5]", "scenario.toml:2:1: can.node_ids = 127"),
        ("seed = 1\nseed = 1", "scenario.toml:2:1: seed: the key is there already"),
        ("[jaw]\nclosed_offset_m = [0.04, 0.0, 0.0]", "stroke"),
        ("[motion]\nkind = 'chewing'\ncycle_rate_hz = 5.0", "scenario.toml:1:2: motion at"),
        ("[motion]\nkind = 'chewing'\ncycle_rate_hz = 5.0", "limits.leg_"),
        ("[drives.leg]\nmax_velocity_m_s = 0.1", "axis l1 would move at 0.100 m/s, limit 0.1 m/s"),
        ("[motion]\nkind = 'file'\npath = 'nowhere.csv'", "nowhere.csv"),
    ];
    for (scenario, reason) in cases {
        let workspace = Workspace::new(scenario);
        let output = workspace.run_virtual(&[]);
        assert_eq!(output.status.code(), Some(2), "{scenario}: {}", stderr(&output));
        let said = stderr(&output);
        assert!(said.contains(reason) && !said.contains('`'), "{scenario:?} gave {said:?}");
        assert!(!workspace.run_folder().exists(), "{scenario}: something was started");
    }
}

#[test]
fn a_key_that_is_set_by_an_argument_is_used_or_refused_with_the_argument() {
    let workspace = Workspace::new("duration_s = 1.0\n[motion]\nkind = 'opening'\namplitude_mm = 9.0\n");
    let set =
        ["--set", "motion.amplitude_mm=8", "--set", "name=mine", "--set", "checks.tracking_max_mm = 0.4"];
    let output = workspace.run_virtual(&set);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let scenario = &workspace.manifest()["scenario"];
    let found =
        [&scenario["motion"]["amplitude_mm"], &scenario["name"], &scenario["checks"]["tracking_max_mm"]];
    assert_eq!(found, [&json!(8.0), &json!("mine"), &json!(0.4)]);
    for (assignment, reason) in [
        ("controller.integral_gain=5", "did you mean 'integral_gain_per_s'?"),
        ("controller.integral_gain_per_s=much", "--set: controller.integral_gain_per_s=much"),
        ("controller.integral_gain_per_s=5000", "controller.integral_gain_per_s = 5000: use at most 500"),
        ("rate_hz", "write KEY=VALUE"),
        ("motion.kind=yawning", "unknown value 'yawning'"),
        ("a b=1", "a b=1"),
    ] {
        let workspace = Workspace::new("");
        let output = workspace.run_virtual(&["--set", assignment]);
        assert_eq!(output.status.code(), Some(2), "{assignment}");
        assert!(stderr(&output).contains(reason), "{assignment}: {}", stderr(&output));
    }
}

#[test]
fn what_only_the_controller_knows_is_refused_with_its_place_too() {
    let two = "[[require]]\nname = 'a'\nsignal = 'l1.force'\nmax = '1 kN'\n[[require]]\nname = 'b'\n";
    let set = "[[stimulus]]\nat_s = 1\nparameter = 'integral_gain_per_s'\n";
    for (scenario, reason) in [
        (format!("{two}never = 'l1.force'"), "scenario.toml:7:1: require.never: require 'b': "),
        (format!("{two}when = 'running'\nthen = 'signal.x 5 N'"), "scenario.toml:8:1: require.then: "),
        (format!("{two}signal = 'signal.x'\nmax = 1"), "scenario.toml:7:1: require.signal: "),
        ("[expect]\nevents = ['drive.none']".to_owned(), "scenario.toml:2:1: expect.events: "),
        (
            "[parameters]\ngrip = 3\nintegral_gain = 3".to_owned(),
            "scenario.toml:2:1: parameters.grip: the controller has no parameter 'grip'",
        ),
        (
            "[parameters]\nintegral_gain_per_s = 1e9".to_owned(),
            "scenario.toml:2:1: parameters.integral_gain_per_s: parameter 'integral_gain_per_s' cannot be",
        ),
        (format!("{set}value = 1e9"), "scenario.toml:4:1: stimulus.value: [[stimulus]] number 1: "),
        (
            format!("{set}value = 1\n[[stimulus]]\nat_s = 1\nparameter = 'x'\nvalue = 1"),
            "scenario.toml:7:1: stimulus.parameter: [[stimulus]] number 2: ",
        ),
        (
            format!("{two}expression = '{}'\nunit = 'N'\nmax = '1 N'", "abs(".repeat(10_000)),
            "scenario.toml:7:1: require.expression: ",
        ),
        ("[controller]\nlead_cycles = 5e-324".to_owned(), "scenario.toml:2:1: controller.lead_cycles = "),
    ] {
        let workspace = Workspace::new(&scenario);
        let output = workspace.run_virtual(&[]);
        assert_eq!(output.status.code(), Some(2), "{scenario}: {}", stderr(&output));
        let said = stderr(&output);
        assert!(said.contains(reason) && said.chars().count() < 800, "{scenario:?} gave {said:?}");
    }
    // What an argument has replaced stands in no line of the file.
    let workspace = Workspace::new("[parameters]\nintegral_gain_per_s = 3");
    let output = workspace.run_virtual(&["--set", "integral_gain_per_s=1e9"]);
    let said = stderr(&output);
    assert!(said.contains("parameters.integral_gain_per_s: ") && !said.contains("toml:2"), "{said}");
}

/// A terminal would carry them out.
#[test]
fn control_characters_of_a_file_are_printed_as_codes() {
    let workspace = Workspace::new("[motion]\nkind = 'file'\npath = \"no\\u001b]0;evil\\u0007where.csv\"");
    let output = workspace.run_virtual(&[]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains(r"no\u{1b}]0;evil\u{7}where.csv"), "{}", stderr(&output));
    assert!(!stderr(&output).contains(['\u{1b}', '\u{7}']));
}

#[test]
fn files_without_an_end_are_refused_at_once() {
    let workspace = Workspace::new(&format!("# {}", "x".repeat(2 << 20)));
    let large = workspace.file("scenario.toml");
    for (arguments, reason) in [
        (["run", "/dev/zero"], "/dev/zero: it is no regular file"),
        (["run", "--trajectory=/dev/zero"], "/dev/zero: cannot be read (it is no regular file"),
        (["run", large.to_str().unwrap()], "it is larger than 1048576 bytes"),
        (["fk", "--scenario=/dev/zero"], "no regular file"),
        (["fk", "--input=/dev/zero"], "/dev/zero:1: longer than 4096 bytes"),
        (["ik", "--input=/dev/zero"], "/dev/zero:1: longer than 4096 bytes"),
    ] {
        let output = masseter(&arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(reason), "{arguments:?}: {}", stderr(&output));
    }
}

/// The rig has written them, and anybody may have replaced them since.
#[test]
fn files_of_a_folder_without_an_end_are_refused_at_once() {
    let workspace = Workspace::new("duration_s = 0.5");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    let run = workspace.run_folder();
    let run = run.to_str().unwrap();
    let endless = |path: &str| {
        fs::remove_file(path).unwrap();
        symlink("/dev/zero", path).unwrap();
    };
    for (file, arguments) in [
        ("summary.json", vec!["report", run, run]),
        ("manifest.json", vec!["report", run]),
        ("manifest.json", vec!["replay", run]),
    ] {
        let kept = fs::read(format!("{run}/{file}")).unwrap();
        endless(&format!("{run}/{file}"));
        let output = masseter(&arguments);
        let said = stderr(&output);
        assert!(matches!(output.status.code(), Some(2 | 6)), "{arguments:?}: {said}");
        assert!(said.contains("no regular file"), "{arguments:?}: {said}");
        fs::remove_file(format!("{run}/{file}")).unwrap();
        fs::write(format!("{run}/{file}"), kept).unwrap();
    }
}

#[test]
fn limits_on_memory_and_files_are_refused_with_figures() {
    let workspace = Workspace::new("");
    let run = workspace.run_folder();
    for (limit, code, reason) in [
        ("-v 150000", 2, "153.6 MB of address space, and a run needs 200.0 MB"),
        ("-d 100000", 2, "102.4 MB of data, and a run needs 120.0 MB"),
        ("-f 8", 6, "a file may have 0.0 MB, and the recording may need"),
    ] {
        for clock in ["rt", "virtual"] {
            let output = Command::new("sh")
                .args([
                    "-c",
                    &format!("ulimit {limit}; exec \"$@\""),
                    "sh",
                    MASSETER,
                    "run",
                    "--clock",
                    clock,
                ])
                .arg("--out")
                .arg(&run)
                .output()
                .unwrap();
            assert_eq!(output.status.code(), Some(code), "{limit}, {clock}: {}", stderr(&output));
            assert!(stderr(&output).contains(reason), "{limit}, {clock}: {}", stderr(&output));
            assert!(!run.exists(), "{limit}, {clock}: something was started");
        }
    }
}

#[test]
fn a_doubtful_motion_is_played_with_a_warning_that_names_the_line() {
    let head = "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n";
    let rows = |z_mm: &dyn Fn(i32) -> f64| {
        let row = |i: i32| format!("{},0,0,{},1,0,0,0\n", f64::from(i) * 0.02, z_mm(i));
        (0..50).map(row).collect::<String>()
    };
    let still = |_: i32| 0.0;
    let jump = |i: i32| if i == 25 { -2.0 } else { 0.0 };
    let cases: [(&dyn Fn(i32) -> f64, &str); 2] =
        [(&still, "line 51: the jaw does not move"), (&jump, "line 27: the incisal point jumps by 2.0 mm")];
    for (z_mm, warning) in cases {
        let workspace = Workspace::new("");
        let file = workspace.write("jaw.csv", &(head.to_owned() + &rows(z_mm)));
        let output = workspace.run_virtual(&["--trajectory", file.to_str().unwrap()]);
        assert!(stderr(&output).contains(warning), "{}", stderr(&output));
        assert!(workspace.run_folder().exists(), "{}", stderr(&output));
    }
}

#[test]
fn what_no_rig_can_be_is_neither_planned_nor_described() {
    let refused = |scenario: &str, verbs: &[&str]| {
        let workspace = Workspace::new(scenario);
        for verb in verbs {
            let output = masseter(&["can", verb, workspace.file("scenario.toml").to_str().unwrap()]);
            assert_eq!(output.status.code(), Some(2), "can {verb}, {scenario}: {}", stderr(&output));
        }
    };
    refused("rate_hz = 0", &["plan", "eds", "dbc"]);
    refused("[can]\nnode_ids = [1, 1, 2, 3, 4, 5]", &["plan", "eds", "dbc"]);
    refused("rate_hz = 10", &["plan"]);
    for buses in ["[]", "[[0, 1, 2], [3, 4]]", "[[0, 1, 2], [3, 4, 99]]", "[[0, 1, 2], [3, 4, 5], []]"] {
        refused(&format!("[can]\nbuses = {buses}"), &["plan"]);
    }
}

#[test]
fn recordings_are_refused_with_file_reason_and_the_line_if_it_is_one_lines_fault() {
    let head = "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n";
    let rest = |t: f64| format!("{t},0,0,0,1,0,0,0\n");
    let good: String = (0..50).map(|i| rest(f64::from(i) * 0.02)).collect();
    let cases = [
        (format!("time,x_mm,y_mm,z_mm,qw,qx,qy,qz\n{good}"), ":1:", "time"),
        (format!("{head}{good}1.0,inf,0,0,1,0,0,0\n"), ":52:", "x_mm"),
        (format!("{head}{good}1.0,a,0,0,1,0,0,0\n"), ":52:", "x_mm"),
        (format!("{head}{good}0.5,0,0,0,1,0,0,0\n"), ":52:", "time"),
        (format!("{head}{good}1.0,0,0,0,1,1,0,0\n"), ":52:", "quaternion"),
        (format!("{head}{good}1.0,0,0\n"), ":52:", "3 cells"),
        (format!("{head}{good}1.0,0,0,200,1,0,0,0\n"), ":49)", "axis l1 would accelerate"),
        (head.to_owned(), ":", "0 rows of data"),
    ];
    for (text, place, reason) in cases {
        let workspace = Workspace::new("");
        let file = workspace.write("jaw.csv", &text);
        let output = workspace.run_virtual(&["--trajectory", file.to_str().unwrap()]);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(&format!("jaw.csv{place}")) && said.contains(reason), "{said}");
        assert!(!workspace.run_folder().exists(), "something was started");
    }
}

#[test]
fn a_point_that_a_recording_has_no_use_for_is_refused() {
    let poses = "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n";
    let markers = "time_s,m1_x_mm,m1_y_mm,m1_z_mm,m2_x_mm,m2_y_mm,m2_z_mm,m3_x_mm,m3_y_mm,m3_z_mm\n";
    let row = |i: i32, values: &str| format!("{},{values}\n", f64::from(i) * 0.02);
    let rows = |values: &str| (0..50).map(|i| row(i, values)).collect::<String>();
    let cases = [
        (poses.to_owned() + &rows("0,0,0,1,0,0,0"), "marker_origin_mm"),
        (markers.to_owned() + &rows("0,0,0,40,0,0,0,40,0"), "reference_point_mm"),
    ];
    for (recording, superfluous) in cases {
        for key in ["marker_origin_mm", "reference_point_mm"] {
            let workspace = Workspace::new(&format!(
                "[motion]\nkind = 'file'\npath = 'jaw.csv'\n{key} = [0.0, 0.0, 0.0]"
            ));
            workspace.write("jaw.csv", &recording);
            let output = workspace.run_virtual(&["--duration", "1s"]);
            let is_refused = output.status.code() == Some(2) && stderr(&output).contains(key);
            assert_eq!(is_refused, key == superfluous, "{key}: {}", stderr(&output));
        }
    }
}

#[test]
fn interfaces_that_cannot_be_used_are_refused_with_what_to_do() {
    let cases = [
        (
            &["run", "--can", "no-such-a,no-such-b"][..],
            &["modprobe can-raw", "no CAN interface 'no-such-a'"][..],
        ),
        (&["run", "--can", "can0"], &["name 2 interfaces"]),
        (&["run", "--can", "can0,can0"], &["name 2 interfaces"]),
        (&["run", "--can", "can0,"], &["such as can0,can1"]),
        (
            &["run", "--clock", "virtual", "--can", "can0,can1"],
            &["simulated time has no real CAN interfaces"],
        ),
        (
            &["plant", "--emulate", "--can", "no-such-a,no-such-b"],
            &["modprobe can-raw", "no CAN interface 'no-such-a'"],
        ),
        (&["plant", "--emulate"], &["need an interface for each bus"]),
        (&["plant", "--emulate", "--can", "virtual"], &["need an interface for each bus"]),
        (&["plant", "--can", "can0,can1"], &["masseter run --can can0,can1"]),
    ];
    for (arguments, remedies) in cases {
        let output = masseter(arguments);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        let is_named = remedies.iter().any(|remedy| said.contains(remedy));
        assert!(is_named && !said.contains('`'), "{arguments:?} gave {said}");
    }
}

#[test]
fn manifests_that_no_run_wrote_are_refused_and_their_words_are_no_markup() {
    let workspace = Workspace::new("duration_s = 1.0");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    let report_on = |edit: &dyn Fn(&mut Value)| {
        let mut manifest = workspace.manifest_without_digest();
        edit(&mut manifest);
        let folder = workspace.file("edited");
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::copy(workspace.run_folder().join("recording.mcap"), folder.join("recording.mcap")).unwrap();
        std::fs::write(folder.join("manifest.json"), manifest.to_string()).unwrap();
        masseter(&["report", folder.to_str().unwrap()])
    };
    for (rate_hz, form, reason) in
        [(0, 1, "use 10 to 20000 Hz"), (2_000_000_000, 1, "Hz"), (1000, 9, "form 9")]
    {
        let output = report_on(&|manifest| {
            manifest["scenario"]["rate_hz"] = rate_hz.into();
            manifest["form"] = form.into();
        });
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(stderr(&output).contains(reason), "{}", stderr(&output));
    }
    let output = report_on(&|manifest| {
        manifest["clock"] = "<b>".into();
        manifest["scheduling"] = json!({
            "<b>": { "wanted": { "locked_memory": true }, "locked_memory": true, "refusals": ["<b>"] },
        });
        let used = json!({
            "observed_s": 1.0, "cpu_s": 1.0, "voluntary_switches": 0, "involuntary_switches": 0, "minor_faults": 0,
            "major_faults": 0,
        });
        manifest["usage"]["processes"] = json!({ "<b>": used });
    });
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let page = std::fs::read_to_string(workspace.file("edited").join("report.html")).unwrap();
    assert!(page.contains("\\u003cb>") && !page.contains("<b>"));
}

/// A wrong verdict is worse than none. Whoever computes the digest anew, and forges the recording too, is not kept from it.
#[test]
fn a_run_whose_files_were_changed_is_not_judged() {
    let row = |i: i32| format!("{},0,0,{},1,0,0,0\n", f64::from(i) * 0.02, -(f64::from(i) * 0.1).sin());
    let rows: String = (0..50).map(row).collect();
    let workspace = Workspace::new("[motion]\nkind = 'file'\npath = 'jaw.csv'\n");
    workspace.write("jaw.csv", &format!("time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n{rows}"));
    let output = workspace.run_virtual(&[]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let run = workspace.run_folder();
    let report = || masseter(&["report", run.to_str().unwrap()]);
    let refused = |file: &str, edit: &dyn Fn(&str) -> String, reason: &str| {
        let path = run.join(file);
        let kept = fs::read_to_string(&path).unwrap();
        assert_ne!(kept, edit(&kept), "{reason}");
        fs::write(&path, edit(&kept)).unwrap();
        let output = report();
        assert!(output.status.code() == Some(2) && stderr(&output).contains(reason), "{}", stderr(&output));
        fs::write(&path, kept).unwrap();
    };
    let changed = "manifest.json: it was changed after the run: its text has the digest ";
    for (from, to) in [
        ("\"kind\": \"completed\"", "\"kind\": \"safe_stop\""),
        ("\"motion_lag_ms\": 20.0", "\"motion_lag_ms\": 200.0"),
        ("\"controller\": null", "\"controller\": \"hold\""),
    ] {
        refused("manifest.json", &|text| text.replacen(from, to, 1), changed);
    }
    let without_digest = |key: [&str; 2], value: Value| {
        let mut manifest = workspace.manifest_without_digest();
        let [table, key] = key;
        *(if table.is_empty() { &mut manifest[key] } else { &mut manifest["scenario"][table][key] }) = value;
        manifest.to_string()
    };
    let lag = "the scenario has 'motion_lag_ms = 200.0' here and 'motion_lag_ms = 20.0' there";
    refused("manifest.json", &|_| without_digest(["checks", "motion_lag_ms"], json!(200.0)), lag);
    refused("manifest.json", &|_| without_digest(["", "motion_s"], json!(0.5)), "motion_s is 0.5 here and ");
    refused("motion.csv", &|text| text.replacen("0.04,", "0.05,", 1), "motion.csv has changed since");
    // The recording of another run.
    let other = Workspace::new("duration_s = 1.0\n[motion]\nkind = 'opening'");
    assert_eq!(other.run_virtual(&[]).status.code(), Some(0));
    let recording = workspace.recording();
    fs::write(run.join("recording.mcap"), other.recording()).unwrap();
    let said = stderr(&report());
    assert!(said.contains("manifest.json: it is not that of the recording: "), "{said}");
    fs::write(run.join("recording.mcap"), recording).unwrap();
    // The scenario to play again may change.
    fs::write(run.join("scenario.toml"), "duration_s = 2.0").unwrap();
    let output = report();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}

#[test]
fn a_run_folder_is_never_overwritten() {
    let workspace = Workspace::new("duration_s = 1.0");
    std::fs::create_dir(workspace.run_folder()).unwrap();
    let output = workspace.run_virtual(&[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("not overwritten"), "{}", stderr(&output));
}

#[test]
fn wrong_usage_exits_with_2() {
    for (arguments, reason) in [
        (&["run", "--cores", "0"][..], "such as 0,1"),
        (&["run", "--cores", "1,1"], "name two"),
        (&["run", "--cores", "0,4000"], "no core 4000 for this process; choose among 0"),
        (&["run", "--clock", "virtual", "--cores", "4000,0"], "no core 4000"),
        (&["run", "--clock", "virtual", "--require-rt"], "needs --clock rt"),
        (&["run", "--clock", "virual"], "a similar value exists: 'virtual'"),
        (&["run", "--duration", "soon"], "such as 10, 10s or 2min"),
        (&["run", "--duration", "1e300"], "such as 10, 10s or 2min"),
        (&["run", "--duration", "0"], "duration_s = 0: use 0.1 to 86400"),
        (&["run", "--live=99999"], "such as 8765 or 192.168.1.5:8765"),
        (&["run", "--live=127.0.0.1"], "such as 8765 or 192.168.1.5:8765"),
        (&["can", "serve", "--listen", "here"], "such as 8765 or 192.168.1.5:8765"),
        (&["can", "eds", "--axis", "l9"], "d1, d2, d3, l1, l2, l3"),
        (&["completions", "bas"], "a similar value exists: 'bash'"),
        (&["runn"], "a similar subcommand exists: 'run'"),
        (&["report", "/nowhere"], "/nowhere"),
        (&[], "Usage: masseter"),
    ] {
        let output = masseter(arguments);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.contains(reason) && !said.contains('`'), "{arguments:?} gave {said}");
    }
}

#[test]
fn kinematics_of_a_scenario_that_cannot_be_are_refused() {
    let workspace = Workspace::new("rate_hz = 0");
    let scenario = workspace.file("scenario.toml");
    for verb in ["fk", "ik"] {
        let output = masseter(&[verb, "--scenario", scenario.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(2), "{verb}: {}", stderr(&output));
        assert!(stderr(&output).contains("rate_hz"), "{verb}: {}", stderr(&output));
    }
}
