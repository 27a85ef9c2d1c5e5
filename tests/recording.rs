//! Recordings as their users meet them: looked at, proved, cut, repaired, converted.

use std::fs;
use std::io::Cursor;
use std::path::Path;
use std::process::Output;

use masseter_model::geometry::Mechanism;
use masseter_scenario::Scenario;

use crate::common::{Workspace, cramped, json, masseter, stderr, stdout};
use masseter_recording::{Reader, Recorded, Recorder, Scene};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

fn virtual_run() -> Workspace {
    let workspace = Workspace::new("duration_s = 1.0");
    let output = workspace.run_virtual(&[]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    workspace
}

fn log(verb: &str, recording: &Path, more: &[&str]) -> Output {
    let recording = recording.to_str().unwrap();
    masseter(&[&["recording", verb, recording], more].concat())
}

fn messages(recording: &Path) -> Vec<Recorded> {
    let mut reader = Reader::open(recording).unwrap();
    let mut messages = Vec::new();
    while let Some(message) = reader.next_message().unwrap() {
        messages.push(message);
    }
    messages
}

#[test]
fn a_whole_recording_passes_info_and_verify() {
    let workspace = virtual_run();
    for of in [workspace.run_folder(), workspace.run_folder().join("recording.mcap")] {
        let info = log("info", &of, &[]);
        assert_eq!(info.status.code(), Some(0), "{}", stdout(&info));
        for word in [
            "masseter/msg/Reading (cdr)",
            "tf2_msgs/msg/TFMessage (cdr)",
            "attached: scenario.toml, ",
            "attached: circumstances.json, ",
            "zstd",
            "bytes a cycle",
        ] {
            assert!(stdout(&info).contains(word), "{word}: {}", stdout(&info));
        }
        let proof = log("verify", &of, &[]);
        assert_eq!(proof.status.code(), Some(0), "{}", stdout(&proof));
        assert!(!stdout(&proof).contains("FAIL"), "{}", stdout(&proof));
    }
}

/// At 1 kHz 720 bytes a cycle are 0.72 MB/s. Force control of a bite has every topic.
#[test]
fn a_cycle_takes_at_most_720_bytes_also_with_every_topic() {
    for (scenario, has_every_topic) in [("", false), (include_str!("../examples/force_control.toml"), true)] {
        let workspace = Workspace::new(scenario);
        let output = workspace.run_virtual(&["--quiet"]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let cycles = workspace.summary()["figures"]["cycles"].as_u64().unwrap();
        let bytes = workspace.recorded_bytes();
        assert!(cycles > 9000 && bytes <= 720 * cycles, "{bytes} bytes of {cycles} cycles");
        let info = stdout(&log("info", &workspace.run_folder(), &[]));
        for topic in ["contact", "signal"] {
            let messages = info
                .lines()
                .find(|line| line.starts_with(topic))
                .and_then(|line| line.split_whitespace().nth(1)?.parse::<u64>().ok());
            // The plant goes on for a moment after the controller.
            assert_eq!(messages >= Some(cycles), has_every_topic, "{topic}: {info}");
        }
    }
}

#[test]
fn damaged_recordings_are_exit_2_and_cut_ones_exit_6_with_the_place() {
    let workspace = virtual_run();
    let whole = fs::read(workspace.run_folder().join("recording.mcap")).unwrap();
    let cut = whole[..whole.len() * 2 / 3].to_vec();
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 0x10;
    let longer = [&whole[..], b"x"].concat();
    let cases: [(&str, &[u8], i32, &str); 5] = [
        ("cut", &cut, 6, "lacks its end"),
        ("flipped", &flipped, 2, "unreadable: bytes"),
        ("longer", &longer, 2, "bytes behind the end of the recording"),
        ("foreign", b"\x89PNG\r\n\x1a\n and so on and on", 2, "not readable as MCAP"),
        ("empty", b"", 2, "it is empty"),
    ];
    for (name, bytes, code, words) in cases {
        let path = workspace.file(name);
        fs::write(&path, bytes).unwrap();
        for verb in ["info", "verify"] {
            let output = log(verb, &path, &[]);
            let said = stdout(&output) + &stderr(&output);
            assert_eq!(output.status.code(), Some(code), "{verb} {name}: {said}");
            assert!(said.contains(words), "{verb} {name}: {said}");
        }
    }
    assert_eq!(log("info", &workspace.file("nowhere"), &[]).status.code(), Some(2));
}

#[test]
fn only_the_lines_of_failed_proofs_say_fail() {
    let workspace = virtual_run();
    let whole = fs::read(workspace.run_folder().join("recording.mcap")).unwrap();
    let mut flipped = whole.clone();
    // In the first chunk, that of the definitions.
    flipped[1000] ^= 0x10;
    let cases = [
        (whole[..whole.len() - 1].to_vec(), &["7 of ", "the file lacks its end"][..]),
        ([&whole[..], b"x"].concat(), &["1 of "]),
        (flipped, &["without: 1", "cannot be read"]),
    ];
    for (bytes, expected) in cases {
        let path = workspace.file("hurt");
        fs::write(&path, bytes).unwrap();
        let proof = stdout(&log("verify", &path, &[]));
        for line in proof.lines() {
            let is_expected = expected.iter().any(|words| line.contains(words));
            assert!(!line.starts_with("FAIL") || is_expected, "{proof}");
        }
        for words in expected {
            assert!(proof.lines().any(|line| line.starts_with("FAIL") && line.contains(words)), "{proof}");
        }
    }
}

#[test]
fn a_cut_recording_is_recovered_beside_the_old_one_and_nothing_is_overwritten() {
    let workspace = virtual_run();
    let whole = fs::read(workspace.run_folder().join("recording.mcap")).unwrap();
    let cut = workspace.file("cut.mcap");
    fs::write(&cut, &whole[..whole.len() * 2 / 3]).unwrap();

    let output = log("recover", &cut, &[]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(stdout(&output).contains("messages saved"), "{}", stdout(&output));
    let recovered = workspace.file("cut.recovered.mcap");
    let saved = messages(&recovered);
    assert!(!saved.is_empty() && saved == messages(&cut));
    assert_eq!(log("verify", &recovered, &[]).status.code(), Some(0));

    assert!(!stdout(&output).contains("recording recover"), "advice already followed: {}", stdout(&output));
    let diff = masseter(&["diff", recovered.to_str().unwrap(), recovered.to_str().unwrap()]);
    assert_eq!(diff.status.code(), Some(0), "{}", stdout(&diff));

    let before = fs::read(&recovered).unwrap();
    assert_eq!(log("recover", &cut, &[]).status.code(), Some(2));
    assert!(before == fs::read(&recovered).unwrap());

    let foreign = workspace.write("foreign.mcap", "no recording at all");
    assert_eq!(log("recover", &foreign, &[]).status.code(), Some(2));
    assert!(!workspace.file("foreign.recovered.mcap").exists());
}

#[test]
fn a_thinned_recording_lacks_nothing_and_recovered_it_is_still_one() {
    let workspace = virtual_run();
    let [thinned, again] = ["thinned.mcap", "again.mcap"].map(|name| workspace.file(name));
    let run = workspace.run_folder();
    assert_eq!(log("thin", &run, &["--out", thinned.to_str().unwrap()]).status.code(), Some(0));
    let proof = log("verify", &thinned, &[]);
    assert_eq!(proof.status.code(), Some(0), "{}", stdout(&proof));
    assert!(
        stdout(&proof).contains("thinned: ") && stdout(&proof).contains(" left out"),
        "{}",
        stdout(&proof)
    );
    assert_eq!(log("recover", &thinned, &["--out", again.to_str().unwrap()]).status.code(), Some(0));
    let diff = masseter(&["diff", run.to_str().unwrap(), again.to_str().unwrap()]);
    assert_eq!(diff.status.code(), Some(0), "{}", stdout(&diff));
}

/// A run of real time also attaches when and where it was made.
#[test]
fn a_recording_explains_itself() {
    let workspace = virtual_run();
    let reader_of = |path: &Path| {
        let mut reader = Reader::open(path).unwrap();
        while reader.next_message().unwrap().is_some() {}
        reader
    };
    let recording = workspace.run_folder().join("recording.mcap");
    let recovered = workspace.file("recovered.mcap");
    let output = log("recover", &recording, &["--out", recovered.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    for path in [recording, recovered] {
        let reader = reader_of(&path);
        let [scenario, circumstances] = reader.attachments() else { panic!("{:?}", reader.attachments()) };
        assert_eq!((&*scenario.name, &*circumstances.name), ("scenario.toml", "circumstances.json"));
        assert_eq!(*scenario.data, fs::read(workspace.run_folder().join("scenario.toml")).unwrap());
        let known: serde_json::Value = serde_json::from_slice(&circumstances.data).unwrap();
        assert_eq!(known["motion_s"], workspace.manifest()["motion_s"]);
        assert_eq!(known["masseter"], workspace.manifest()["masseter"]);
        assert!(known["began"].is_null(), "recordings of simulated time are equal: {known}");
    }
}

/// A recording alone is enough to play its run again.
#[test]
fn the_attached_scenario_and_motion_give_the_same_run_again() {
    let workspace = Workspace::new("duration_s = 1.0\n[motion]\nkind = 'file'\npath = 'jaw.csv'\n");
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    fs::copy(examples.join("jaw.csv"), workspace.file("jaw.csv")).unwrap();
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    let (lone, out, again) =
        (workspace.file("lone.mcap"), workspace.file("attached"), workspace.file("again"));
    fs::write(&lone, workspace.recording()).unwrap();
    let digest = workspace.summary()["figures"]["digest"].clone();
    // Nothing else is left of the run.
    fs::remove_dir_all(workspace.run_folder()).unwrap();
    fs::remove_file(workspace.file("jaw.csv")).unwrap();
    let extract = || log("extract", &lone, &["--out", out.to_str().unwrap()]);
    let output = extract();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    for name in ["scenario.toml", "motion.csv", "circumstances.json"] {
        assert!(stdout(&output).contains(out.join(name).to_str().unwrap()), "{}", stdout(&output));
    }
    assert_eq!(extract().status.code(), Some(2), "an existing folder was written to");

    let [scenario, run] = [out.join("scenario.toml"), again.clone()].map(|path| path.display().to_string());
    let output = masseter(&["run", &scenario, "--clock", "virtual", "--out", &run]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(json(&again.join("summary.json"))["figures"]["digest"], digest);
    assert!(fs::read(again.join("recording.mcap")).unwrap() == fs::read(&lone).unwrap(), "other bytes");
}

#[test]
fn a_recovery_that_fails_leaves_nothing_in_the_way_of_the_next() {
    let workspace = virtual_run();
    let recording = workspace.run_folder().join("recording.mcap");
    let out = workspace.file("recovered.mcap");
    let arguments = ["recording", "recover", recording.to_str().unwrap(), "--out", out.to_str().unwrap()];
    let failed = cramped(8, &arguments);
    assert_eq!(failed.status.code(), Some(6), "{}", stderr(&failed));
    assert!(!out.exists(), "{}", stderr(&failed));
    assert_eq!(masseter(&arguments).status.code(), Some(0));
}

/// Bytes of a recording that holds nothing but its definitions.
fn definitions() -> usize {
    let scenario = Scenario::default();
    let scene = Scene::new(&Mechanism::new(&scenario.mechanism).unwrap(), &scenario.jaw);
    let mut medium = Cursor::new(Vec::new());
    // As if it were killed: the end is not written.
    std::mem::forget(Recorder::new(&mut medium, scene).unwrap());
    medium.into_inner().len()
}

#[test]
fn a_recording_cut_at_any_byte_lacks_its_end_and_nothing_else() {
    let workspace = virtual_run();
    let whole = fs::read(workspace.run_folder().join("recording.mcap")).unwrap();
    let mut chance = Pcg64Mcg::seed_from_u64(6);
    let definitions = definitions();
    for _ in 0..CUTS {
        let cut = chance.random_range(definitions..whole.len());
        let path = workspace.file("cut.mcap");
        fs::write(&path, &whole[..cut]).unwrap();
        let proof = log("verify", &path, &[]);
        assert_eq!(proof.status.code(), Some(6), "cut at byte {cut}: {}", stdout(&proof));
        assert!(!stdout(&proof).contains("missing:"), "cut at byte {cut}: {}", stdout(&proof));
    }
}

/// How many times a recording is cut at random.
const CUTS: usize = 300;
