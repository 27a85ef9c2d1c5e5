//! Signals and parameters of a controller: declared, set from outside while it runs, recorded and reported.

use std::os::unix::net::UnixStream;
use std::process::{Child, Output};
use std::thread;

use masseter_model::geometry::Pose;
use masseter_runtime::control::Outcome;
use masseter_runtime::lifecycle::attach::{attach, socket};
use masseter_runtime::named::{self, Declared, Parameter, access};
use masseter_runtime::transport::Domain;

use crate::common::{Workspace, masseter, stderr, stdout, wait_until, wait_until_it_records};
use masseter_controller::pose_law::{Demand, LawFailed, PoseLaw};
use masseter_controller::process::run_with_law;
use masseter_recording::{Reader, Recorded};
use rustix::process::{Pid, Signal, kill_process};

fn unique(name: &str) -> String {
    format!("{name}-{}", std::process::id())
}

/// A run of ten minutes in simulated time, once its controller takes parameters.
fn running(workspace: &Workspace, name: &str) -> Child {
    let child = workspace.start_lockstep(&["--duration", "600", "--name", name]);
    let domain = Domain::named(name).unwrap();
    wait_until("the controller takes parameters", || access::list(&domain).is_ok());
    wait_until_it_records(workspace);
    child
}

fn param(arguments: &[&str]) -> Output {
    masseter(&[&["param"], arguments].concat())
}

#[test]
fn a_parameter_is_set_while_the_controller_runs_and_every_change_is_an_event() {
    let workspace = Workspace::new("[parameters]\nintegral_gain_per_s = 4\n");
    let name = unique("param");
    let rig = running(&workspace, &name);
    let listed = stdout(&param(&["list", "--rig", &name]));
    assert!(listed.starts_with("integral_gain_per_s = 4 1/s  (0 to 500)"), "{listed}");
    assert_eq!(param(&["set", "integral_gain_per_s=8", "--rig", &name]).status.code(), Some(0));
    assert_eq!(stdout(&param(&["get", "integral_gain_per_s", "--rig", &name])), "8\n");
    for (assignment, complaint) in [
        ("integral_gain_per_s=1e6", "its range is 0 to 500 1/s"),
        ("integral_gain_per_s=nan", "cannot be NaN"),
        ("integral_gain=1", "did you mean 'integral_gain_per_s'?"),
        ("integral_gain_per_s", "write NAME=VALUE"),
        ("integral_gain_per_s=much", "'much' is no number"),
    ] {
        let refused = param(&["set", assignment, "--rig", &name]);
        assert!(
            refused.status.code() == Some(2) && stderr(&refused).contains(complaint),
            "{}",
            stderr(&refused)
        );
    }
    kill_process(Pid::from_child(&rig), Signal::INT).unwrap();
    rig.wait_with_output().unwrap();
    let summary = workspace.summary();
    let events = summary["figures"]["events"].as_array().unwrap();
    let changes: Vec<_> = events.iter().filter(|event| event["cause"] == "parameter_set").collect();
    assert_eq!(changes.len(), 1, "{changes:?}");
    assert_eq!(changes[0]["text"], "integral_gain_per_s was set from 4 to 8 1/s");
    let gain = &summary["figures"]["parameters"][0];
    assert_eq!((&gain["value"], &gain["last"], &gain["changes"]), (&4.0.into(), &8.0.into(), &1.into()));
    let gone = param(&["list", "--rig", &name]);
    assert!(stderr(&gone).contains("does not run"), "{}", stderr(&gone));
}

#[test]
fn a_parameter_that_does_not_fit_is_refused_before_the_run() {
    let workspace = Workspace::new("");
    for (assignment, complaint) in [
        (
            "stiffness=3",
            "the controller has no parameter 'stiffness', but: integral_gain_per_s, trim_limit_m",
        ),
        ("rate_hzz=500", "no parameter 'rate_hzz'"),
        ("rate_hzz=500", "of the keys of a scenario, did you mean 'rate_hz'?"),
        ("integral_gain_per_s=-1", "cannot be -1: its range is 0 to 500 1/s"),
        ("parameters.trim_limit_m=1", "cannot be 1: its range is 0 to 0.001 m"),
    ] {
        let refused = workspace.run_virtual(&["--set", assignment]);
        assert_eq!(refused.status.code(), Some(2));
        assert!(stderr(&refused).contains(complaint), "{}", stderr(&refused));
    }
}

/// Asks for the desired pose, and publishes the height of the platform in the unit of its parameter.
#[derive(Debug, Default)]
struct Watching {
    scale: f64,
    height: f64,
}

impl PoseLaw for Watching {
    fn command(&mut self, demand: &Demand) -> Result<Pose, LawFailed> {
        self.height = demand.desired.translation.z * self.scale;
        Ok(demand.ahead)
    }

    fn declared(&self) -> Declared {
        let signal = |name: &str, unit: &str| named::Signal {
            name: name.into(),
            unit: unit.into(),
            about: "Of a test.".into(),
        };
        let scale = Parameter { range: [1.0, 1e4], unit: "mm/m".into(), ..Parameter::new("scale", 1.0) };
        Declared {
            signals: vec![signal("height", "mm"), signal("no_number", "")],
            parameters: vec![scale],
            ..Declared::default()
        }
    }

    fn set_parameter(&mut self, _: usize, value: f64) {
        self.scale = value;
    }

    fn fill_signals(&self, signals: &mut [f64]) {
        signals.copy_from_slice(&[self.height, f64::NAN]);
    }
}

#[test]
fn signals_of_a_program_are_recorded_by_their_names_and_drawn() {
    let workspace = Workspace::new("duration_s = 1.0\n[parameters]\nscale = 1000\n");
    let name = unique("signals");
    let rig = workspace.start_lockstep(&["--controller", "external", "--name", &name]);
    let waits = socket(&Domain::named(&name).unwrap());
    wait_until("the rig waits", || UnixStream::connect(&waits).is_ok());
    let controller = thread::spawn(move || {
        run_with_law(attach(Some(&name)).unwrap(), Box::new(Watching::default())).unwrap()
    });
    assert_eq!(controller.join().unwrap(), Outcome::Finished);
    let output = rig.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));

    let mut reader = Reader::open(&workspace.run_folder().join("recording.mcap")).unwrap();
    let (mut signals, mut states) = (Vec::new(), 0);
    while let Some(message) = reader.next_message().unwrap() {
        match message {
            Recorded::Signals(message) => signals.push(message),
            Recorded::State(_) => states += 1,
            _ => {}
        }
    }
    assert_eq!(signals.len(), states);
    assert!(signals.iter().all(|message| message.signals.as_slice().len() == 2));
    let definition = |topic: &str| {
        let channel = reader.channels().find(|channel| channel.topic == topic).unwrap();
        String::from_utf8(channel.schema.as_ref().unwrap().data.to_vec()).unwrap()
    };
    assert!(definition("signal").contains("float64 height  # [mm] Of a test.\n"));
    assert!(definition("parameter").contains("float64 scale  # [mm/m]\n"));

    let summary = workspace.summary();
    let figures = &summary["figures"];
    let height = &figures["signals"][0];
    let most = height["max"].as_f64().unwrap();
    assert!(height["unit"] == "mm" && (200.0..400.0).contains(&most), "{height}");
    let none = &figures["signals"][1];
    assert_eq!((none["values"].as_u64(), none["not_finite"].as_u64()), (Some(0), Some(states as u64)));
    let page = std::fs::read_to_string(workspace.run_folder().join("report.html")).unwrap();
    assert!(page.contains("Signals of the controller") && page.contains("\"id\":\"signals-0\""));
}
