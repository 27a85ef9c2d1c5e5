//! Runs under virtual time: determinism, tracking, the files a run leaves, recordings played.

use std::fs;
use std::path::Path;

use crate::common::{self, Workspace, json, stderr, stdout, wait_until_it_records};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::json;

#[test]
fn a_run_passes_tracks_within_a_tenth_of_a_millimetre_and_leaves_its_folder() {
    let workspace = Workspace::new("duration_s = 4.0");
    let output = workspace.run_virtual(&["--verbose"]);
    assert_eq!(output.status.code(), Some(0), "{}{}", stdout(&output), stderr(&output));
    let figures = &workspace.summary()["figures"];
    assert!(figures["tracking"]["rms_mm"].as_f64().unwrap() < 0.1, "{}", figures["tracking"]);
    assert!(figures["tracking"]["samples"].as_u64().unwrap() >= 3999);
    assert_eq!(figures["final_state"], "finished");
    for name in [
        "scenario.toml",
        "manifest.json",
        "recording.mcap",
        "events.jsonl",
        "summary.json",
        "junit.xml",
        "report.html",
        "can0.log",
        "can1.log",
        "hist/forward-kinematics.hlog",
    ] {
        let file = workspace.run_folder().join(name);
        assert!(fs::metadata(&file).is_ok_and(|file| file.len() > 0), "{name} is missing or empty");
    }
    let table = stdout(&output);
    assert!(table.starts_with("PASS"), "{table}");
    assert!(table.contains("forward kinematics"), "{table}");
}

#[test]
fn another_controller_runs_through_the_whole_rig() {
    let workspace = Workspace::new("duration_s = 1.0");
    let output = workspace.run_virtual(&["--controller", "hold"]);
    assert_eq!(output.status.code(), Some(0), "{}{}", stdout(&output), stderr(&output));
    let tracking = &workspace.summary()["figures"]["tracking"];
    assert_eq!(tracking["samples"], 1000, "{tracking}");
    assert!(tracking["max_mm"].as_f64().unwrap() < 0.01, "{tracking}");
}

#[test]
fn the_same_scenario_and_seed_leave_the_same_bytes_and_another_seed_others() {
    let recording = |seed: &str| {
        let workspace = Workspace::new("duration_s = 2.0");
        let output = workspace.run_virtual(&["--seed", seed]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        fs::read(workspace.run_folder().join("recording.mcap")).unwrap()
    };
    let first = recording("7");
    assert!(first == recording("7"), "two runs of one seed differ");
    assert!(first != recording("8"), "the seed changes nothing");
}

#[test]
fn a_run_folder_runs_again_from_its_own_scenario() {
    let workspace = Workspace::new("duration_s = 1.0\n[motion]\nkind = 'protrusion'");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    let scenario = workspace.run_folder().join("scenario.toml");
    let again = workspace.file("again");
    let output = common::masseter(&[
        "run",
        scenario.to_str().unwrap(),
        "--clock",
        "virtual",
        "--out",
        again.to_str().unwrap(),
    ]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let [first, second] =
        [workspace.run_folder(), again].map(|run| fs::read(run.join("recording.mcap")).unwrap());
    assert!(first == second);
}

#[test]
fn a_run_folder_has_the_recording_that_it_played() {
    let workspace = Workspace::new("[motion]\nkind = 'file'\npath = 'jaw.csv'");
    let rows = |lowered_mm: f64| -> String {
        let row =
            |i: u32| format!("{},0,0,{},1,0,0,0\n", f64::from(i) / 10.0, -lowered_mm * f64::from(i % 2));
        "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n".to_owned() + &(0..=10).map(row).collect::<String>()
    };
    let original = workspace.write("jaw.csv", &rows(0.5));
    let output = workspace.run_virtual(&[]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let played = workspace.manifest()["scenario"]["motion"]["path"].as_str().unwrap().to_owned();
    assert_eq!(played, original.canonicalize().unwrap().to_str().unwrap());
    assert!(stdout(&output).contains(&format!("recording played: {played}")), "{}", stdout(&output));

    // Elsewhere, and with another recording where the first one was.
    let moved = workspace.file("moved");
    fs::rename(workspace.run_folder(), &moved).unwrap();
    workspace.write("jaw.csv", &rows(0.1));
    let (scenario, again) = (moved.join("scenario.toml"), workspace.file("again"));
    let paths = [&scenario, &again].map(|path| path.to_str().unwrap());
    let output = common::masseter(&["run", paths[0], "--clock", "virtual", "--out", paths[1]]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let [first, second] = [moved, again].map(|run| fs::read(run.join("recording.mcap")).unwrap());
    assert!(first == second);
}

#[test]
fn every_generated_motion_plays() {
    for kind in ["chewing", "opening", "protrusion", "lateral"] {
        let workspace = Workspace::new(&format!("duration_s = 3.0\n[motion]\nkind = '{kind}'"));
        let output = workspace.run_virtual(&[]);
        assert_eq!(output.status.code(), Some(0), "{kind}: {}{}", stdout(&output), stderr(&output));
    }
}

/// Recordings as poses and as markers; each kind with one like a patient's.
#[test]
fn recordings_play_and_are_tracked() {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    for (scenario, recordings) in
        [("patient.toml", ["jaw.csv", "patient.csv"]), ("markers.toml", ["markers.csv", "tracker.csv"])]
    {
        let scenario = fs::read_to_string(examples.join(scenario)).unwrap();
        for name in recordings {
            let workspace = Workspace::new(&scenario);
            let output = workspace.run_virtual(&["--trajectory", examples.join(name).to_str().unwrap()]);
            assert_eq!(output.status.code(), Some(0), "{name}: {}{}", stdout(&output), stderr(&output));
            let tracking = &workspace.summary()["figures"]["tracking"];
            assert!(tracking["rms_mm"].as_f64().unwrap() < 0.1, "{name}: {tracking}");
            assert!(tracking["samples"].as_u64().unwrap() >= 2000, "{name}: {tracking}");
        }
    }
}

/// Without turns, the platform is displaced as the jaw.
#[test]
fn the_desired_pose_at_a_time_is_the_recordings_sample_of_that_time() {
    let lowered_m = |time_s: f64| -0.005 * (2.0 * time_s).sin().powi(2);
    let row = |i: u32| {
        let time_s = f64::from(i) / 100.0;
        format!("{},0,0,{},1,0,0,0\n", 7.0 + time_s, 1e3 * lowered_m(time_s))
    };
    let rows: String = (0..=200).map(row).collect();
    let workspace = Workspace::new("[motion]\nkind = 'file'\npath = 'jaw.csv'\nlowpass_hz = 0.0");
    workspace.write("jaw.csv", &format!("time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n{rows}"));
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    let (run, out) = (workspace.run_folder(), workspace.file("csv"));
    let [run, out] = [&run, &out].map(|path| path.to_str().unwrap());
    common::masseter(&["export", run, "--format", "csv", "--table", "state", "--out", out]);

    let table = fs::read_to_string(workspace.file("csv").join("state.csv")).unwrap();
    let (header, lines) = table.split_once('\n').unwrap();
    let column = |name: &str| header.split(',').position(|column| column == name).expect(name);
    let [time, height] = ["motion_time_s", "desired_position_m_2"].map(column);
    let value = |line: &str, column| line.split(',').nth(column).unwrap().parse::<f64>().unwrap();
    let played: Vec<_> = lines
        .lines()
        .map(|line| (value(line, time), value(line, height)))
        .filter(|(time_s, _)| *time_s >= 0.0)
        .collect();
    let (_, closed_m) = played[0];
    for &(time_s, height_m) in &played {
        assert!(
            (height_m - closed_m - lowered_m(time_s)).abs() < 1e-6,
            "{} mm at {time_s} s",
            1e3 * (height_m - closed_m)
        );
    }
    assert!(played.len() > 2500 && (played.last().unwrap().0 - 2.0).abs() < 1e-9, "{:?}", played.last());
}

#[test]
fn every_reader_is_warned_where_the_centroid_of_the_markers_is_used_and_the_jaw_turns() {
    // One marker in the axis of the turn, which is that of the condyles.
    let row = |i: u32, largest_deg: f64| {
        let time_s = f64::from(i) / 100.0;
        let (sin, cos) = (largest_deg.to_radians() * (2.0 * time_s).sin().powi(2)).sin_cos();
        format!("{time_s},0,0,0,{},0,{},0,40,0\n", 40.0 * cos, -40.0 * sin)
    };
    let columns = "time_s,m1_x_mm,m1_y_mm,m1_z_mm,m2_x_mm,m2_y_mm,m2_z_mm,m3_x_mm,m3_y_mm,m3_z_mm";
    let origin = "marker_origin_mm = [0.0, 0.0, 0.0]";
    for (largest_deg, key, is_expected) in [(3.0, "", true), (3.0, origin, false), (1.0, "", false)] {
        let workspace = Workspace::new(&format!("[motion]\nkind = 'file'\npath = 'm.csv'\n{key}"));
        let rows: String = (0..=160).map(|i| row(i, largest_deg)).collect();
        workspace.write("m.csv", &format!("{columns}\n{rows}"));
        let output = workspace.run_virtual(&[]);
        assert_eq!(output.status.code(), Some(0), "{}{}", stdout(&output), stderr(&output));
        let warning = "the jaw turns by up to 3.0°, so the markers' centroid does not follow the incisal point; \
                    set motion.marker_origin_mm";
        let [manifest, summary, junit, page] = ["manifest.json", "summary.json", "junit.xml", "report.html"]
            .map(|name| fs::read_to_string(workspace.run_folder().join(name)).unwrap());
        let junit = junit.replace("&#39;", "'");
        for text in [stderr(&output), stdout(&output), manifest, summary, junit, page] {
            assert_eq!(text.contains(warning), is_expected, "{largest_deg}° {key}: {text}");
        }
    }
}

/// The example's piece of food yields at 35 N.
#[test]
fn food_resists_the_jaw_and_the_platform_still_follows() {
    let workspace = Workspace::new("duration_s = 3.0\n[food]");
    let output = workspace.run_virtual(&[]);
    assert_eq!(output.status.code(), Some(0), "{}", stdout(&output));
    let bite_force_n = workspace.summary()["figures"]["bite_force_max_n"].as_f64().unwrap();
    assert!((33.0..37.0).contains(&bite_force_n), "{bite_force_n}");
}

#[test]
fn another_builders_mechanism_runs() {
    let scenario = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/builder.toml");
    let workspace = Workspace::new(&fs::read_to_string(scenario).unwrap());
    let output = workspace.run_virtual(&["--duration", "5s"]);
    assert_eq!(output.status.code(), Some(0), "{}{}", stdout(&output), stderr(&output));
}

/// A velocity loop far too stiff for the step that it is integrated with.
#[test]
fn a_plant_that_fails_is_reported_as_dead_by_the_run_and_by_report() {
    let workspace = Workspace::new(
        "[drives.leg]\nvelocity_gain_n_s_per_m = 6e7\nrated_force_n = 1e7\nmax_force_n = 1e8\nfollowing_error_m = 1.0",
    );
    let output = workspace.run_virtual(&["--verbose"]);
    assert_eq!(output.status.code(), Some(4), "{}{}", stdout(&output), stderr(&output));
    let again = common::masseter(&["report", workspace.run_folder().to_str().unwrap()]);
    assert_eq!(stdout(&again), stdout(&output));
    assert!(stdout(&again).contains("the plant died: the mechanism"), "{}", stdout(&again));
}

#[test]
fn an_interrupt_ends_a_run_in_order_as_in_real_time() {
    for signal in [Signal::INT, Signal::TERM] {
        let workspace = Workspace::new("duration_s = 60.0");
        let child = workspace.start_virtual();
        wait_until_it_records(&workspace);
        kill_process(Pid::from_child(&child), signal).unwrap();
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(130), "{signal:?}: {}", stderr(&output));
        let summary = workspace.summary();
        assert_eq!(summary["verdict"]["word"], "INTERRUPTED");
        assert_eq!(summary["figures"]["final_state"], "finished");
        assert!(workspace.run_folder().join("junit.xml").is_file());
    }
}

#[test]
fn a_check_that_fails_fails_the_run() {
    let workspace = Workspace::new("duration_s = 1.0\n[checks]\ntracking_rms_mm = 1e-9");
    let output = workspace.run_virtual(&["--format", "json"]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let printed: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(printed["verdict"]["word"], "FAIL");
    assert_eq!(printed["verdict"]["exit_code"], json!(1));
    let junit = fs::read_to_string(workspace.run_folder().join("junit.xml")).unwrap();
    assert!(junit.contains("failures=\"2\""), "{junit}");
}

#[test]
fn a_report_can_be_made_again_and_says_that_a_recording_is_cut() {
    let workspace = Workspace::new("duration_s = 2.0");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    let folder = workspace.run_folder();
    let before = fs::read(folder.join("summary.json")).unwrap();
    let report = || common::masseter(&["report", folder.to_str().unwrap()]);
    assert_eq!(report().status.code(), Some(0));
    assert_eq!(fs::read(folder.join("summary.json")).unwrap(), before);

    let recording = folder.join("recording.mcap");
    let whole = fs::read(&recording).unwrap();
    for cut in [whole.len() / 3, whole.len() / 2, whole.len() * 2 / 3] {
        fs::write(&recording, &whole[..cut]).unwrap();
        let output = report();
        assert_eq!(output.status.code(), Some(6), "{}", stdout(&output));
        let figures = &json(&folder.join("summary.json"))["figures"];
        assert_eq!(figures["cut_short"], json!(true));
        assert!(figures["cycles"].as_u64().unwrap() > 0);
    }
    fs::write(&recording, "no recording").unwrap();
    assert_eq!(report().status.code(), Some(2));
}
