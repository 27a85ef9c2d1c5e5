//! `masseter motion`: what a recording holds before it is played.

use std::f64::consts::TAU;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use crate::common::{Workspace, masseter, stderr, stdout};
use serde_json::Value;

const POSES: &str = "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n";

/// Two seconds of opening by 12° at 1 Hz and 100 rows a second, from line 2 on; `change` gets the row's number and its
/// numbers.
fn opening(change: impl Fn(usize, &mut [f64; 8])) -> String {
    (0..=200).fold(POSES.to_owned(), |text, row| {
        let time_s = f64::from(row) / 100.0;
        let share = (1.0 - (TAU * time_s).cos()) / 2.0;
        let half = (12_f64.to_radians() * share) / 2.0;
        let mut numbers = [time_s, 4.0 * share, 0.0, -3.0 * share, half.cos(), 0.0, half.sin(), 0.0];
        change(row as usize, &mut numbers);
        text + &numbers.map(|number| format!("{number:.6}")).join(",") + "\n"
    })
}

fn describe(text: &str, arguments: &[&str]) -> Output {
    let workspace = Workspace::new("");
    let file = workspace.write("motion.csv", text);
    masseter(&[&["motion", file.to_str().unwrap()], arguments].concat())
}

/// With these keys of `[motion]`.
fn describe_with(text: &str, keys: &str) -> Output {
    let workspace = Workspace::new(&format!("[motion]\nkind = 'file'\npath = 'motion.csv'\n{keys}\n"));
    let (file, scenario) = (workspace.write("motion.csv", text), workspace.file("scenario.toml"));
    masseter(&["motion", file.to_str().unwrap(), "--scenario", scenario.to_str().unwrap()])
}

fn described(text: &str) -> Value {
    serde_json::from_slice(&describe(text, &["--format", "json"]).stdout).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn a_motion_is_described_by_its_rows_rate_range_turn_and_speed() {
    let output = describe(&opening(|_, _| ()), &[]);
    assert_eq!(output.status.code(), Some(0), "{}", stdout(&output));
    for part in ["201 rows of poses, lines 2 to 202", "2.000 s at 100.00 Hz", "no gaps", "PLAYS: "] {
        assert!(stdout(&output).contains(part), "{part}: {}", stdout(&output));
    }
    let found = described(&opening(|_, _| ()));
    assert!((number(&found["turns_deg"][1]["greatest"]) - 12.0).abs() < 1e-3, "{found}");
    let condyle = &found["points"][1];
    assert!((number(&condyle["farthest_mm"]) - 5.0).abs() < 1e-3, "{condyle}");
    // The condyle goes out and back by 5 mm in a second: at π times that at the fastest.
    assert!((number(&condyle["fastest_mm_s"]) - 5.0 * TAU / 2.0).abs() < 0.2, "{condyle}");
    assert_eq!(found["glitches"], Value::Array(Vec::new()));
}

/// Trackers write UTF-16 and Windows-1252, too: the motion is that of the same text in UTF-8, also in the copy of a run.
#[test]
fn the_code_page_of_a_recording_does_not_matter() {
    let text = opening(|_, _| ());
    let utf_16: Vec<u8> =
        [0xFEFF].into_iter().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    let with_mark = [&[0xEF, 0xBB, 0xBF], text.as_bytes()].concat();
    let workspace = Workspace::new("duration_s = 2.0\n[motion]\nkind = 'file'\npath = 'motion.csv'");
    let file = workspace.write("motion.csv", &text);
    let play = || {
        let described = stdout(&masseter(&["motion", file.to_str().unwrap(), "--format", "json"]));
        let output = workspace.run_virtual(&[]);
        assert_eq!(output.status.code(), Some(0), "{}{}", stdout(&output), stderr(&output));
        let digest = workspace.summary()["figures"]["digest"].clone();
        fs::remove_dir_all(workspace.run_folder()).unwrap();
        (described, digest)
    };
    let plain = play();
    for bytes in [utf_16, with_mark] {
        fs::write(&file, bytes).unwrap();
        assert_eq!(play(), plain);
    }
}

#[test]
fn a_jump_of_the_tracker_and_a_gap_are_named_with_their_lines() {
    let text = opening(|row, numbers| {
        numbers[2] += if row == 150 { 2.7 } else { 0.0 };
        numbers[0] += if row >= 60 { 0.1 } else { 0.0 };
    });
    let found = described(&text);
    let glitch = &found["glitches"][0];
    assert_eq!((&glitch["line"], found["glitches"].as_array().unwrap().len()), (&152.into(), 1));
    assert!((number(&glitch["jump_m"]) - 2.7e-3).abs() < 2e-4, "{glitch}");
    assert_eq!(found["gaps"][0]["line"], 62);
    assert!((number(&found["gaps"][0]["lasts_s"]) - 0.11).abs() < 1e-6, "{}", found["gaps"]);
    let said = stdout(&describe(&text, &[]));
    assert!(said.contains("glitch  line 152, 1.600 s: 2.7 mm within 10 ms"), "{said}");
}

#[test]
fn units_that_fit_no_jaw_are_refused_and_the_likely_ones_suggested() {
    let turned = |factor: f64| {
        opening(move |_, numbers| {
            numbers[1] *= 4.0;
            numbers[3] *= 4.0;
            let half = numbers[6].asin() * factor;
            (numbers[4], numbers[6]) = (half.cos(), half.sin());
        })
    };
    // Seven decimals, or too little is left of a metre's file.
    let in_unit = |mm: f64| {
        opening(|_, _| ()).lines().skip(1).fold(POSES.to_owned(), |text, row| {
            let mut numbers: Vec<f64> = row.split(',').map(|number| number.parse().unwrap()).collect();
            numbers[1..4].iter_mut().for_each(|length| *length /= mm);
            text + &numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n"
        })
    };
    let order = opening(|_, numbers| numbers[4..].rotate_left(1));
    for (text, remedy, unit) in [
        (in_unit(1000.0), "set motion.length_unit = \"m\"", Some("m")),
        (in_unit(10.0), "set motion.length_unit = \"cm\"", Some("cm")),
        (turned(1.0_f64.to_radians()), "angles the right unit", None),
        (order, "quaternions have the order qw,qx,qy,qz", None),
    ] {
        let output = describe(&text, &[]);
        assert_eq!(output.status.code(), Some(1), "{}", stdout(&output));
        let found = described(&text);
        assert!(found["refused"].as_str().unwrap().contains(remedy), "{remedy}: {}", found["refused"]);
        assert_eq!(found["suggestion"]["length_unit"].as_str(), unit, "{}", found["suggestion"]);
        if let Some(unit) = unit {
            let played = describe_with(&text, &format!("length_unit = '{unit}'"));
            assert!(stdout(&played).contains("PLAYS"), "{}", stdout(&played));
        }
    }
    let milliseconds = opening(|_, numbers| numbers[0] *= 1000.0);
    let said = stderr(&describe(&milliseconds, &[]));
    assert!(said.contains("set motion.time_unit = \"ms\""), "{said}");
    let played = describe_with(&milliseconds, "time_unit = 'ms'");
    assert!(stdout(&played).contains("PLAYS"), "{}", stdout(&played));
}

/// Axes under which the condyles rise: refused, with axes that play.
#[test]
fn wrong_axes_are_refused_and_those_suggested_play() {
    let text = opening(|_, numbers| (numbers[1], numbers[3]) = (-numbers[1], -numbers[3]));
    let found = described(&text);
    assert!(found["refused"].as_str().unwrap().contains("3.0 mm up"), "{}", found["refused"]);
    assert_eq!(found["suggestion"]["axes"], serde_json::json!(["-x", "+y", "-z"]));
    assert!(found["suggestion"]["refused"].is_null());
    let played = describe_with(&text, "axes = ['-x', '+y', '-z']");
    assert!(stdout(&played).contains("PLAYS"), "{}", stdout(&played));
    let played = describe_with(&text, "if_implausible = 'warn'");
    assert!(stdout(&played).contains("PLAYS"), "{}", stdout(&played));
    let mirrored = stderr(&describe_with(&text, "axes = ['+x', '-y', '+z']"));
    assert!(mirrored.contains("left is +y") && mirrored.contains("negate its y_mm"), "{mirrored}");
}

/// Degrees where radians belong turn the jaw by more than any jaw.
#[test]
fn a_file_that_cannot_be_read_is_refused_with_its_row() {
    let degrees = opening(|_, numbers| {
        let half = numbers[6].asin() * 57.3;
        (numbers[4], numbers[6]) = (half.cos(), half.sin());
    });
    let late = opening(|row, numbers| numbers[0] -= if row == 30 { 0.5 } else { 0.0 });
    let broken = opening(|_, _| ()).replacen("0.100000,", "0.100000,much,", 1);
    for (text, reason) in [(degrees, "turned by"), (late, "motion.csv:32: time"), (broken, "motion.csv:12: ")]
    {
        let output = describe(&text, &[]);
        assert_eq!(output.status.code(), Some(2), "{}", stdout(&output));
        let said = stderr(&output);
        assert!(said.contains(reason) && said.contains("motion.csv:"), "{reason}: {said}");
    }
}

/// The verdict is that of `masseter run`, in the same words.
#[test]
fn what_a_run_would_refuse_is_refused_in_the_same_words_and_a_place_that_fits_is_suggested() {
    let workspace = Workspace::new("[jaw]\nclosed_offset_m = [-0.024, 0.0, 0.0]\n");
    let file = workspace.write("motion.csv", &opening(|_, _| ()));
    let (file, scenario) = (file.to_str().unwrap().to_owned(), workspace.file("scenario.toml"));
    let scenario = scenario.to_str().unwrap();
    let refused = masseter(&["motion", &file, "--scenario", scenario]);
    assert_eq!(refused.status.code(), Some(1), "{}", stdout(&refused));
    let run = stderr(&workspace.run_virtual(&["--trajectory", &file]));
    let reason = stdout(&refused);
    let reason = reason.lines().find_map(|line| line.strip_prefix("REFUSED: ")).unwrap();
    assert!(run.contains(reason), "{run}\n{reason}");

    let found = masseter(&["motion", &file, "--scenario", scenario, "--format", "json"]);
    let found: Value = serde_json::from_slice(&found.stdout).unwrap();
    let suggestion = &found["suggestion"];
    assert!(number(&suggestion["strokes"]["margin_mm"]) > 1.0, "{suggestion}");
    let set = format!("jaw.closed_offset_m={}", suggestion["closed_offset_m"]);
    let moved = masseter(&["motion", &file, "--scenario", scenario, "--set", &set]);
    assert_eq!(moved.status.code(), Some(0), "{}", stdout(&moved));
}

#[test]
fn a_motion_too_large_for_any_place_is_said_to_be() {
    let large = opening(|_, numbers| numbers[1..4].iter_mut().for_each(|mm| *mm *= 20.0));
    let output = describe_with(&large, "if_implausible = 'warn'");
    assert_eq!(output.status.code(), Some(1));
    assert!(stdout(&output).contains("even then the motion is refused"), "{}", stdout(&output));
}

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples").join(name)
}

#[test]
fn the_axes_of_a_tracker_are_found_from_how_the_jaw_opens() {
    let tracker = example("tracker.csv");
    let found = masseter(&["motion", tracker.to_str().unwrap(), "--format", "json"]);
    let found: Value = serde_json::from_slice(&found.stdout).unwrap();
    assert_eq!(found["suggestion"]["axes"], serde_json::json!(["+y", "-x", "+z"]));
    let scenario = example("markers.toml");
    let stated = masseter(&[
        "motion",
        tracker.to_str().unwrap(),
        "--scenario",
        scenario.to_str().unwrap(),
        "--format",
        "json",
    ]);
    let stated: Value = serde_json::from_slice(&stated.stdout).unwrap();
    assert!(stated["likely_axes"].is_null() && stated["refused"].is_null(), "{stated}");
}

/// As of a tracker whose y points anterior and x to the right, on a jaw that hardly turns.
#[test]
fn the_axes_of_an_opening_without_a_turn_are_those_under_which_the_jaw_goes_down_and_back() {
    let found = described(&opening(|_, numbers| {
        let share = numbers[1] / 4.0;
        *numbers = [numbers[0], -2.0 * share, -34.0 * share, -44.0 * share, 1.0, 0.0, 0.0, 0.0];
    }));
    assert_eq!(found["likely_axes"], serde_json::json!(["+y", "-x", "+z"]));
}

#[test]
fn the_picture_shows_the_paths_the_courses_and_the_glitches() {
    let workspace = Workspace::new("");
    let mut text = opening(|row, numbers| numbers[2] += if row == 150 { 2.7 } else { 0.0 });
    let _ = writeln!(text);
    let (file, picture) = (workspace.write("motion.csv", &text), workspace.file("motion.svg"));
    let output = masseter(&["motion", file.to_str().unwrap(), "--svg", picture.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let picture = fs::read_to_string(picture).unwrap();
    for part in ["<svg", "sagittal", "frontal", "opening", "line 152"] {
        assert!(picture.contains(part), "{part}");
    }
}

/// `--set` speaks of the file that the command line names.
#[test]
fn every_key_of_a_file_can_be_set_from_the_command_line() {
    let workspace = Workspace::new("");
    let text = opening(|_, _| ()).replacen("time_s,x_mm,y_mm,z_mm", "t,x,y,z", 1);
    let file = workspace.write("motion.csv", &text);
    let file = file.to_str().unwrap();
    let asked = masseter(&["motion", file]);
    assert_eq!(asked.status.code(), Some(2), "{}", stdout(&asked));
    for key in ["motion.time_unit = \"s\"", "motion.length_unit = \"um\", \"mm\""] {
        assert!(stderr(&asked).contains(key), "{key}: {}", stderr(&asked));
    }
    let keys = [
        "--set",
        "motion.time_unit=\"s\"",
        "--set",
        "motion.length_unit=\"mm\"",
        "--set",
        "motion.lowpass_hz=6",
    ];
    let set = masseter(&[&["motion", file], &keys[..]].concat());
    assert_eq!(set.status.code(), Some(0), "{}", stderr(&set));
    let output = workspace.run_virtual(&[&["--trajectory", file, "--duration", "1s"], &keys[..]].concat());
    assert!(workspace.run_folder().exists(), "{}", stderr(&output));
    let scenario = fs::read_to_string(workspace.run_folder().join("scenario.toml")).unwrap();
    assert!(scenario.contains("lowpass_hz = 6.0") && scenario.contains("length_unit = \"mm\""), "{scenario}");
}

#[test]
fn the_plain_form_has_the_protocol_and_is_the_same_motion() {
    let workspace = Workspace::new("");
    let text = opening(|row, numbers| numbers[3] = if row == 50 { f64::NAN } else { numbers[3] });
    let tracker = text
        .replacen(POSES, "Zeit [s];X [mm];Y [mm];Z [mm];q0;q1;q2;q3\n", 1)
        .replace(',', ";")
        .replace('.', ",");
    let (file, plain) = (workspace.write("export.csv", &tracker), workspace.file("plain.csv"));
    let arguments = ["motion", file.to_str().unwrap(), "--write", plain.to_str().unwrap()];
    let written = masseter(&arguments);
    assert_eq!(written.status.code(), Some(0), "{}", stderr(&written));
    let plain_text = fs::read_to_string(&plain).unwrap();
    let protocol = [
        "columns between semicolons",
        "time from 'Zeit [s]' in s",
        "turn from 'q0', 'q1', 'q2', 'q3', a quaternion, scalar first",
        "place from 'X [mm]', 'Y [mm]', 'Z [mm]' in mm",
        "decimal comma",
        "gaps for lost samples: 1 row, lines 52 to 52",
    ];
    for line in protocol {
        assert!(stdout(&written).contains(&format!("read    {line}\n")), "{line}: {}", stdout(&written));
        assert!(plain_text.contains(&format!("# {line}\n")), "{line}: {plain_text}");
    }
    let figures = |path: &Path| {
        let output = masseter(&["motion", path.to_str().unwrap(), "--format", "json"]);
        let found: Value = serde_json::from_slice(&output.stdout).unwrap();
        [&found["points"], &found["turns_deg"], &found["steps"], &found["strokes"]].map(Value::clone)
    };
    assert_eq!(figures(&plain), figures(&file));
    for option in ["--write", "--svg"] {
        let over = masseter(&["motion", plain.to_str().unwrap(), option, plain.to_str().unwrap()]);
        assert!(
            over.status.code() == Some(2) && stderr(&over).contains("is the file that is read"),
            "{option}: {}",
            stderr(&over)
        );
    }
    assert_eq!(fs::read_to_string(&plain).unwrap(), plain_text);
}

/// Columns beside the motion are signals of the run in motion time: requirements judge them, and tables have them.
#[test]
fn columns_beside_the_motion_are_signals_of_the_run() {
    let beside = |(row, line): (usize, &str)| {
        let gauge = if (100..110).contains(&row) { String::new() } else { row.to_string() };
        if row == 0 {
            format!("{line},EMG left [µV],gauge\n")
        } else {
            format!("{line},{},{gauge}\n", row - 1)
        }
    };
    let text: String = opening(|_, _| ()).lines().enumerate().map(beside).collect();
    let workspace = Workspace::new(
        "[motion]
         kind = 'file'
         path = 'motion.csv'
         [[require]]
         name = 'the muscle rests'
         signal = 'recorded.emg_left'
         min = '0'
         max = '200'",
    );
    workspace.write("motion.csv", &text);
    let listed = stdout(&masseter(&["signals", workspace.file("scenario.toml").to_str().unwrap()]));
    assert!(listed.contains("recorded.emg_left") && listed.contains("Column 'gauge'"), "{listed}");
    let output = workspace.run_virtual(&[]);
    assert_eq!(output.status.code(), Some(0), "{}{}", stdout(&output), stderr(&output));
    let (run, out) = (workspace.run_folder(), workspace.file("tables"));
    let (run, folder) = (run.to_str().unwrap(), out.to_str().unwrap());
    let output = masseter(&["export", run, "--format", "csv", "--table", "cycles", "--out", folder]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let table = fs::read_to_string(out.join("cycles.csv")).unwrap();
    let (head, rows) = table.split_once('\n').unwrap();
    let place =
        |name| head.split(',').position(|column| column == name).unwrap_or_else(|| panic!("{name}: {head}"));
    let places = ["motion_time_s", "recorded_emg_left_uv", "recorded_gauge"].map(place);
    let mut lost = 0;
    for row in rows.lines() {
        let cells: Vec<&str> = row.split(',').collect();
        let [motion_s, emg, gauge] = places.map(|place| cells[place].parse::<f64>());
        // Before the motion there is none.
        let Some(motion_s) = motion_s.ok().filter(|motion_s| *motion_s >= 0.0) else { continue };
        let expected = (motion_s * 100.0 + 1e-4).floor();
        assert_eq!(emg, Ok(expected), "{motion_s}");
        let is_lost = (99.0..109.0).contains(&expected);
        lost += u32::from(is_lost);
        assert_eq!(gauge.ok(), (!is_lost).then_some(expected + 1.0), "{motion_s}");
    }
    assert!((90..110).contains(&lost), "{lost} cycles");
}
