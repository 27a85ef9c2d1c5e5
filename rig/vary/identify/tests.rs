//! Parameters are those of the robot that was recorded, which the fit does not know.

use std::fmt::Write;
use std::io::Cursor;

use masseter_controller::motion_controller::MotionController;
use masseter_plan::RunPlan;
use masseter_recording::{MachineInfo, thin};
use masseter_terminal::status;
use masseter_virtual_time::{Run, Sink, Uninterrupted};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::*;
use crate::run::request::ControllerKind;

impl Sink for Played {
    fn take(&mut self, message: &Recorded, _: u64) {
        match message {
            Recorded::Command(command) => self.take_command(*command),
            Recorded::Reading(reading) => {
                self.take_reading(reading);
            }
            _ => {}
        }
    }

    fn has_failed(&self) -> bool {
        false
    }
}

fn scenario(keys: &str) -> Scenario {
    Scenario::parse("hidden.toml".as_ref(), keys).unwrap()
}

/// A run of a robot to its end.
fn recorded(robot: &Scenario) -> Played {
    let plan = RunPlan::new(robot.clone()).unwrap();
    let mut run = Run::new(
        &plan,
        |scenario, mechanism, motion| Box::new(MotionController::new(scenario, mechanism, motion)),
        Played::default(),
    )
    .unwrap();
    while !run.has_ended() {
        run.play_cycle().unwrap();
    }
    let mut played = run.into_sink();
    played.trim();
    played
}

/// A robot with other values than the nominal ones, and another seed.
fn hidden(nominal: &Scenario, number: u64) -> Scenario {
    let mut random = Pcg64Mcg::seed_from_u64(number);
    let mut robot = Scenario { seed: 1000 + number, ..nominal.clone() };
    for key in &KEYS {
        let value = (key.at)(&mut robot);
        *value = if key.name.contains("play") {
            random.random_range(5e-5..3e-4)
        } else {
            *value * random.random_range(0.7..1.4)
        };
    }
    robot
}

/// The values of all keys.
fn values(robot: &Scenario) -> [f64; KEYS.len()] {
    KEYS.each_ref().map(|key| *(key.at)(&mut robot.clone()))
}

#[test]
fn parameters_of_a_hidden_robot_are_found_and_are_those_of_the_scenario() {
    let nominal = scenario("duration_s = 1.0");
    let robot = hidden(&nominal, 1);
    let answer = recorded(&robot).identify(nominal, &Uninterrupted).unwrap();
    assert!((answer.misfit - 1.0).abs() < 0.1, "{}", answer.misfit);
    let found_in = values(&answer.scenario);
    for ((identified, truth), in_scenario) in answer.keys.iter().zip(values(&robot)).zip(found_in) {
        let Some(Found { value, high, .. }) = identified.found else {
            panic!("{identified:?} is determined")
        };
        // The test of coverage is the next one.
        assert!((value - truth).abs() < 2.0 * (high - value), "{identified:?}: {truth}");
        assert_eq!(value.to_bits(), in_scenario.to_bits(), "{identified:?}");
    }
}

#[test]
fn what_a_robot_at_rest_does_not_show_is_undetermined_and_keeps_its_value() {
    let nominal = scenario(
        "duration_s = 1.0\n[motion]\nkind = 'opening'\namplitude_mm = 0.0\n[dynamics]\ninitial_leg_m = 0.2974",
    );
    let robot = hidden(&nominal, 2);
    let answer = recorded(&robot).identify(nominal.clone(), &Uninterrupted).unwrap();
    for (key, start) in [("dynamics.viscous_friction_n_s_per_m", 20.0), ("dynamics.carriage_mass_kg", 0.7)] {
        let place = answer.keys.iter().position(|identified| identified.key == key).unwrap();
        assert!(answer.keys[place].found.is_none(), "{:?}", answer.keys[place]);
        assert_eq!(values(&answer.scenario)[place].to_bits(), f64::to_bits(start));
    }
}

#[test]
#[ignore = "takes ten minutes: docs/identify.md has the command"]
fn intervals_of_twenty_hidden_robots_cover() {
    let nominal = scenario("duration_s = 3.0");
    let mut covered = [0; KEYS.len()];
    let mut determined = [0; KEYS.len()];
    for number in 0..20 {
        let robot = hidden(&nominal, number);
        let answer = recorded(&robot).identify(nominal.clone(), &Uninterrupted).unwrap();
        let mut line = format!("| {} |", number + 1);
        for (at, (identified, truth)) in answer.keys.iter().zip(values(&robot)).enumerate() {
            let Some(Found { value, low, high }) = identified.found else {
                line += " – |";
                continue;
            };
            let is_covered = (low..=high).contains(&truth);
            covered[at] += usize::from(is_covered);
            determined[at] += 1;
            let [truth, value, half] =
                [truth, value, high - value].map(|of| if truth < 0.01 { of * 1e6 } else { of });
            let mark = if is_covered { "" } else { " ✗" };
            let _ = write!(line, " {truth:.4}: {value:.4} ± {half:.4}{mark} |");
            assert!((value / truth - 1.0).abs() < 0.05, "{number}: {identified:?}, truth {truth}");
        }
        status!("{line}");
    }
    status!("covered {covered:?} of {determined:?}");
    assert!(covered.iter().zip(determined).all(|(covered, of)| covered + 2 >= of), "{covered:?}");
}

/// A run in a folder.
fn folder(keys: &str) -> (tempfile::TempDir, RunFolder) {
    let robot = scenario(keys);
    let plan = RunPlan::new(robot.clone()).unwrap();
    let parent = tempfile::tempdir().unwrap();
    let folder = RunFolder::create(&parent.path().join("run")).unwrap();
    let machine = MachineInfo { cpu: "any".into(), cores: 2, kernel: "Linux".into(), is_virtual: true };
    let mut manifest = Manifest::new("test", robot.clone(), plan.trajectory.duration_s(), "virtual", machine);
    // The recording contains both.
    manifest.write(&folder).unwrap();
    folder.keep(&folder.scenario(), &robot.to_toml()).unwrap();
    let build = ControllerKind::Motion.builder();
    masseter_virtual_time::record(&plan, &folder, build, &mut manifest, &Uninterrupted).unwrap();
    manifest.write(&folder).unwrap();
    (parent, folder)
}

fn refusal(folder: &RunFolder) -> IdentifyError {
    identify(folder.path(), &[], &Uninterrupted).unwrap_err()
}

#[test]
fn a_recording_that_is_not_whole_or_too_short_is_refused() {
    let (_parent, run) = folder("duration_s = 0.1");
    assert!(matches!(refusal(&run), IdentifyError::Short { cycles: 1.. }), "{}", refusal(&run));
    let recording = std::fs::read(run.recording()).unwrap();

    std::fs::write(run.recording(), &recording[..recording.len() / 2]).unwrap();
    assert!(matches!(refusal(&run), IdentifyError::Incomplete), "{}", refusal(&run));

    let mut thinned = Cursor::new(Vec::new());
    thin(&mut Reader::new(Cursor::new(&recording)).unwrap(), &mut thinned).unwrap();
    std::fs::write(run.recording(), thinned.into_inner()).unwrap();
    assert!(matches!(refusal(&run), IdentifyError::Gap { missing: 1.., .. }), "{}", refusal(&run));

    std::fs::remove_file(run.recording()).unwrap();
    assert!(matches!(refusal(&run), IdentifyError::Folder(FolderError::Unwritten(_))), "{}", refusal(&run));
}

#[test]
fn commands_that_came_late_in_real_time_are_refused() {
    let mut played = Played::default();
    let on_time = Reading { cycle: 7, answers_cycle: 6, ..Reading::default() };
    assert!(played.take_reading(&on_time));
    assert!(!played.take_reading(&Reading { answers_cycle: 5, ..on_time }));
    assert!(!played.take_reading(&Reading { skipped_cycles: 1, ..on_time }));
}

/// The user interrupts at once.
struct Interrupting;

impl Requests for Interrupting {
    fn is_stop_requested(&self) -> bool {
        true
    }
}

#[test]
fn an_interrupt_ends_the_fit() {
    let nominal = scenario("duration_s = 1.0");
    let ended = recorded(&nominal).identify(nominal, &Interrupting).unwrap_err();
    assert!(matches!(ended, IdentifyError::Interrupted), "{ended}");
}
