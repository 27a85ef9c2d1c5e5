//! `masseter replay` and `masseter diff`: recorded runs go through their controllers again, and messages are compared bit
//! by bit.

use std::fs;
use std::path::Path;
use std::process::Output;
use std::time::Duration;

use masseter_runtime::clock;

use crate::common::{self, Cores, LENIENT, Workspace, masseter, skip, stderr, stdout, wait_until_it_records};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

/// Scenarios of the suite that are replayed from virtual time: motions, parameters, stops, and faults of every layer.
const VIRTUAL: [&str; 13] = [
    "motion_chewing",
    "motion_food",
    "teeth_meet",
    "food_breaks",
    "gain_changed",
    "motion_changed",
    "operator_stop",
    "bus_lose",
    "bus_disconnect",
    "encoder_stuck",
    "encoder_noise",
    "controller_stall",
    "command_foreign",
];
/// Others, in lockstep.
const LOCKSTEP: [&str; 5] = ["motion_opening", "bus_bus_off", "drive_fault", "push_table", "two_faults"];
/// A process that is killed in lockstep.
const KILLED: [&str; 2] = ["controller_kill", "plant_kill"];

/// The sixth digit of the gain, which is 5.
const PLANTED: &str = "controller.integral_gain_per_s=5.00001";

fn replay(run: &Path, arguments: &[&str]) -> Output {
    masseter(&[&["replay", run.to_str().unwrap()], arguments].concat())
}

fn assert_equal(run: &Path, what: &str) {
    let output = replay(run, &[]);
    let said = [stdout(&output), stderr(&output)].concat();
    assert!(output.status.code() == Some(0) && said.starts_with("EQUAL: "), "{what}: {said}");
}

fn json_of(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {}", stderr(output)))
}

/// The difference of a field that begins first.
fn field<'a>(differences: &'a Value, topic: &str, field: &str) -> &'a Value {
    let fields = differences["fields"].as_array().expect("a list of fields");
    let found = fields.iter().find(|found| found["topic"] == topic && found["field"] == field);
    found.unwrap_or_else(|| panic!("no difference of {topic}.{field} among {fields:?}"))
}

#[test]
fn runs_in_simulated_time_are_replayed_bit_by_bit() {
    let suite = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/suite");
    let examples = [("virtual", &VIRTUAL[..]), ("lockstep", &LOCKSTEP[..])];
    for (clock, names) in examples {
        for name in common::sample(names) {
            let scenario = fs::read_to_string(suite.join(name).with_extension("toml")).unwrap();
            let scenario = scenario.replace("duration_s = 4.0", "duration_s = 3.0");
            let workspace = Workspace::new(&scenario);
            fs::copy(suite.join("push.csv"), workspace.file("push.csv")).unwrap();
            let output = workspace.run_simulated(clock, &["--quiet"]);
            assert!(workspace.run_folder().is_dir(), "{name}: {}", stderr(&output));
            assert_equal(&workspace.run_folder(), name);
        }
    }
    for kind in KILLED {
        let workspace = Workspace::new(&format!("duration_s = 1.0\n[[faults]]\nkind = '{kind}'\nat_s = 0.5"));
        let output = workspace.run_simulated("lockstep", &["--quiet"]);
        assert_eq!(output.status.code(), Some(4), "{}", stderr(&output));
        assert_equal(&workspace.run_folder(), kind);
    }
}

#[test]
fn a_run_in_real_time_is_replayed_with_its_skipped_cycles_set_parameters_and_the_stop_of_its_user() {
    let cores = Cores::take();
    let stall = "duration_s = 60.0\n[[faults]]\nkind = 'controller_stall'\nat_s = 0.2\nsize = '8 ms'\n";
    let workspace = Workspace::new(&format!("{stall}{LENIENT}"));
    let name = format!("replay-{}", std::process::id());
    let mut run = workspace.start(&cores, &["--name", &name]);
    wait_until_it_records(&workspace);
    clock::sleep(Duration::from_millis(1500));
    let set = masseter(&["param", "set", "integral_gain_per_s=8", "--rig", &name]);
    assert!(set.status.success(), "{}", stderr(&set));
    clock::sleep(Duration::from_millis(300));
    kill_process(Pid::from_child(&run), Signal::TERM).unwrap();
    run.wait().unwrap();

    let path = workspace.run_folder();
    if !masseter(&["recording", "verify", path.to_str().unwrap()]).status.success() {
        skip("the machine is too busy to record a run in real time");
        return;
    }
    let skipped = &workspace.summary()["figures"]["controller_skips"]["skipped"];
    assert!(skipped.as_u64() >= Some(5), "{skipped}");
    let events = fs::read_to_string(path.join("events.jsonl")).unwrap();
    assert!(events.contains("parameter_set") && events.contains("stop_requested"), "{events}");
    assert_equal(&path, "real time");

    let thinned = workspace.file("golden.mcap");
    let thin = masseter(&["recording", "thin", path.to_str().unwrap(), "--out", thinned.to_str().unwrap()]);
    assert!(thin.status.code() == Some(2) && stderr(&thin).contains("--clock virtual"), "{}", stderr(&thin));
    assert!(!thinned.exists());
}

#[test]
fn a_gain_with_another_sixth_digit_is_found_in_the_cycle_in_which_a_run_with_it_differs() {
    let workspace = Workspace::new("duration_s = 1.0");
    workspace.run_virtual(&[]);
    let replayed = replay(&workspace.run_folder(), &["--set", PLANTED, "--format", "json"]);
    assert_eq!(replayed.status.code(), Some(1), "{}", stderr(&replayed));
    let replayed = json_of(&replayed);
    assert_eq!((&replayed["is_equal"], &replayed["open_loop"]), (&false.into(), &true.into()));

    let other = Workspace::new("duration_s = 1.0");
    other.run_virtual(&["--set", PLANTED]);
    let paths = [workspace.run_folder(), other.run_folder()];
    let diff =
        masseter(&["diff", paths[0].to_str().unwrap(), paths[1].to_str().unwrap(), "--format", "json"]);
    assert_eq!(diff.status.code(), Some(1), "{}", stderr(&diff));
    let diff = json_of(&diff);
    // Until then the readings of both runs are the same.
    let first = field(&replayed, "command", "target_m");
    for key in ["first_cycle", "element", "values", "motion_s"] {
        assert_eq!(first[key], field(&diff, "command", "target_m")[key], "{key}");
    }
    assert!(first["first_cycle"].as_u64() > Some(1), "{first}");
    assert!(first["largest"].as_f64() > first["first"].as_f64(), "the difference grows: {first}");
    assert_eq!(first["unit"], "µm");
}

#[test]
fn another_controller_of_the_rig_answers_otherwise_and_that_of_the_run_is_found_by_itself() {
    let workspace = Workspace::new("duration_s = 1.0");
    workspace.run_virtual(&["--controller", "hold"]);
    assert_equal(&workspace.run_folder(), "hold");
    let output = replay(&workspace.run_folder(), &["--controller", "motion"]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let said = stdout(&output);
    assert!(said.starts_with("DIFFERENT from cycle ") && said.contains("in open loop"), "{said}");
}

#[test]
fn what_cannot_be_replayed_is_refused_with_the_reason() {
    let workspace = Workspace::new("duration_s = 1.0");
    workspace.run_virtual(&[]);
    let run = workspace.run_folder();
    let refused = |reason: &str| {
        let output = replay(&run, &[]);
        assert!(output.status.code() == Some(2) && stderr(&output).contains(reason), "{}", stderr(&output));
    };
    let (manifest, recording) = (run.join("manifest.json"), run.join("recording.mcap"));
    let text = fs::read_to_string(&manifest).unwrap();
    let mut of_program = workspace.manifest_without_digest();
    of_program["controller"] = "external".into();
    fs::write(&manifest, of_program.to_string()).unwrap();
    refused("the controller of this run was external");
    fs::write(&manifest, text).unwrap();
    let bytes = fs::read(&recording).unwrap();
    fs::write(&recording, &bytes[..bytes.len() / 2]).unwrap();
    refused("the recording is incomplete");
    fs::remove_file(&recording).unwrap();
    refused("recording.mcap does not exist: the run ended before its recorder wrote");
}

#[test]
fn two_runs_of_one_seed_are_equal_and_the_noise_of_another_seed_is_found_with_its_growth() {
    let run = |seed: &str| {
        let workspace = Workspace::new("duration_s = 1.0");
        workspace.run_virtual(&["--seed", seed]);
        workspace
    };
    let [first, again, other] = ["1", "1", "2"].map(run);
    let diff = |a: &Path, b: &Path| masseter(&["diff", a.to_str().unwrap(), b.to_str().unwrap()]);
    let equal = diff(&first.run_folder(), &again.run_folder());
    assert!(equal.status.code() == Some(0) && stdout(&equal).starts_with("EQUAL: "), "{}", stdout(&equal));
    let different = diff(&first.run_folder(), &other.run_folder());
    let said = stdout(&different);
    assert!(different.status.code() == Some(1) && said.starts_with("DIFFERENT from cycle "), "{said}");
    assert!(said.contains("state.estimated_position_m") && said.contains(" µm"), "{said}");

    // A thinned recording tells the same cycle.
    let thinned = first.file("golden.mcap");
    let run_folder = first.run_folder();
    let thin =
        masseter(&["recording", "thin", run_folder.to_str().unwrap(), "--out", thinned.to_str().unwrap()]);
    assert!(thin.status.success(), "{}", stderr(&thin));
    assert_eq!(diff(&thinned, &again.run_folder()).status.code(), Some(0));
    let different = stdout(&diff(&thinned, &other.run_folder()));
    let cycle = |said: &str| said.split_whitespace().nth(3).map(str::to_owned);
    assert_eq!(cycle(&different), cycle(&said), "{different}\n{said}");
    assert!(different.contains("by its digest; in cycle "), "{different}");
}

/// Why the run of a folder failed, as JSON, or the refusal.
fn why(run: &Path, arguments: &[&str]) -> Result<Value, String> {
    let output = masseter(&[&["why", run.to_str().unwrap(), "--format", "json"], arguments].concat());
    if output.status.code() == Some(0) { Ok(json_of(&output)) } else { Err(stderr(&output)) }
}

#[test]
fn the_last_way_back_of_a_stopped_run_is_the_cycle_before_its_fault_and_other_runs_are_refused() {
    let fault = "[[faults]]\nkind = 'encoder_offset'\naxis = 'l1'\nsize = '0.3 mm'\nat_s = 0.5\n";
    let folder = Workspace::new(fault);
    let run = |name: &str, arguments: &[&str]| {
        let out = folder.file(name);
        let begin =
            ["run", "--clock", "virtual", "--quiet", "--duration", "1", "--out", out.to_str().unwrap()];
        masseter(&[&begin, arguments].concat());
        out
    };
    let stopped = run("stopped", &[folder.file("scenario.toml").to_str().unwrap()]);
    let found = why(&stopped, &[]).unwrap();
    assert_eq!(found["last_way_back"]["motion_s"], 0.5, "{found}");
    assert_eq!(found["left_first"][0]["signal"], "l1.position", "{found}");
    assert_eq!(found["intervals"].as_array().map(Vec::len), Some(2), "{found}");
    let page = fs::read_to_string(stopped.join("report.html")).unwrap();
    assert!(page.contains("without faults and stimuli from here on"), "the page has the last way back");
    assert!(why(&stopped, &["--without", "stimuli"]).unwrap_err().contains("0 stimuli"));
    assert!(why(&stopped, &["--without", "faults.2"]).unwrap_err().contains("takes nothing away"));
    assert!(why(&stopped, &["--without", "faults.0"]).unwrap_err().contains("faults.N"));

    let passed = run("passed", &[]);
    assert!(why(&passed, &[]).unwrap_err().contains("takes nothing away"));
    let change = |key: &str, value: &str| {
        let manifest = stopped.join("manifest.json");
        let text = fs::read_to_string(&manifest).unwrap();
        let mut known: Value = serde_json::from_str(&text).unwrap();
        known.as_object_mut().unwrap().remove("digest").expect("a digest");
        known[key] = value.into();
        fs::write(&manifest, known.to_string()).unwrap();
        let refusal = why(&stopped, &[]).unwrap_err();
        fs::write(&manifest, text).unwrap();
        refusal
    };
    assert!(change("clock", "rt").contains("--clock virtual"));
    assert!(change("controller", "./law.py").contains("none of the rig's"));
    let summary = stopped.join("summary.json");
    let text = fs::read_to_string(&summary).unwrap();
    fs::write(&summary, text.replace("\"digest\": \"", "\"digest\": \"0")).unwrap();
    assert!(why(&stopped, &[]).unwrap_err().contains("other messages than its recording"));
    fs::remove_file(&summary).unwrap();
    assert!(why(&stopped, &[]).unwrap_err().contains("masseter report"));
}
