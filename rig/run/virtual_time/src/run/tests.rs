//! A run goes on from a snapshot as it went on before, with every controller of the rig. Another one is refused.

use std::path::Path;

use masseter_controller::hold_position::HoldPosition;
use masseter_controller::motion_controller::MotionController;
use masseter_recording::Recorded;
use masseter_runtime::control::Tick;
use masseter_runtime::messages::{Command, Event, Reading, State};

use super::*;

/// Keeps every message.
#[derive(Debug, Clone, Default)]
pub(crate) struct Kept(pub(crate) Vec<Recorded>);

impl Sink for Kept {
    fn take(&mut self, message: &Recorded, _: u64) {
        self.0.push(*message);
    }

    fn has_failed(&self) -> bool {
        false
    }
}

pub(crate) fn with_keys(keys: &str) -> Scenario {
    Scenario::parse(Path::new("test.toml"), keys).unwrap()
}

/// A run of the scenario with the rig's controller of motions.
pub(crate) fn run_of(scenario: &Scenario) -> Run<Kept> {
    let build: BuildController =
        |scenario, mechanism, motion| Box::new(MotionController::new(scenario, mechanism, motion));
    Run::new(&RunPlan::new(scenario.clone()).unwrap(), build, Kept::default()).unwrap()
}

/// Plays that many cycles; returns the bytes of their messages.
fn cycles(run: &mut Run<Kept>, number: usize) -> Vec<u8> {
    run.sink_mut().0.clear();
    (0..number).for_each(|_| run.play_cycle().unwrap());
    run.sink().0.iter().flat_map(Recorded::body).copied().collect()
}

/// The run, and a new one of the same scenario, go on twice from a snapshot after so many cycles.
fn goes_on_from_a_snapshot(new: impl Fn() -> Run<Kept>, after: usize, more: usize) {
    let mut run = new();
    cycles(&mut run, after);
    let branch = run.snapshot().unwrap();
    let went_on = cycles(&mut run, more);
    let mut other = new();
    for run in [&mut run, &mut other] {
        for _ in 0..2 {
            run.restore(&branch).unwrap();
            assert!(cycles(run, more) == went_on, "after {after} cycles");
        }
    }
}

#[test]
fn a_run_goes_on_from_a_snapshot_as_it_went_on() {
    let changed = "[controller]\nease_s = 0.2\n[[stimulus]]\nat_s = 0.3\nparameter = 'motion_rate'\nvalue = 0.5\n\
                   [[stimulus]]\nat_s = 0.5\nstop = true\n";
    let pressed = "[controller]\nease_s = 0.2\n[motion]\nkind = 'chewing'\ncycle_rate_hz = 0.7\n[motion.phases]\n\
                   opening = 0.3\nclosing = 0.3\nocclusion = 0.4\n[food]\n[load_cell]\n[force_control]\n\
                   profile = 'hold'\npeak_n = 25.0\nbite_s = 0.6\n";
    let failed = "[controller]\nease_s = 0.2\n[[faults]]\nkind = 'jam'\naxis = 'l2'\nat_s = 0.3\n";
    for keys in [changed, pressed, failed] {
        for after in [0, 700, 1100] {
            goes_on_from_a_snapshot(|| run_of(&with_keys(keys)), after, 600);
        }
    }
}

#[test]
fn a_run_that_holds_its_position_goes_on_too() {
    let build: BuildController =
        |scenario, mechanism, motion| Box::new(HoldPosition::new(scenario, mechanism, motion.duration_s()));
    let plan = RunPlan::new(Scenario::default()).unwrap();
    goes_on_from_a_snapshot(|| Run::new(&plan, build, Kept::default()).unwrap(), 800, 300);
}

#[test]
fn a_snapshot_of_another_run_is_refused_and_changes_nothing() {
    let branch = run_of(&with_keys("seed = 2")).snapshot().unwrap();
    let (mut run, mut undisturbed) = (run_of(&Scenario::default()), run_of(&Scenario::default()));
    let refusal = run.restore(&branch).unwrap_err();
    assert!(matches!(refusal, RestoreError::OtherScenario(OtherScenario::Other { snapshot_seed: 2, .. })));
    assert!(cycles(&mut run, 300) == cycles(&mut undisturbed, 300));
}

/// A controller of a user.
struct Foreign;

impl Controller for Foreign {
    fn observe(&mut self, _: Option<&Reading>) {}

    fn decide(&mut self, _: Tick) -> Option<Event> {
        None
    }

    fn fill_command(&self, _: &mut Command) {}

    fn fill_state(&mut self, _: &mut State) {}

    fn request_stop(&mut self) {}

    fn outcome(&self) -> Option<Outcome> {
        None
    }
}

#[test]
fn a_controller_that_waits_for_ever_is_overdue() {
    let plan = RunPlan::new(with_keys("[controller]\nstart_timeout_s = 1.0\noverdue_s = 0.1\n")).unwrap();
    let mut run = Run::new(&plan, |_, _, _| Box::new(Foreign), Kept::default()).unwrap();
    assert_eq!(run.play(&Uninterrupted), Ending::Overdue);
    let (limit, after) = ((run.control.deadline.begin_s * 1e3).ceil() as u64, 500);
    assert!(run.cycle().abs_diff(limit + after) <= 1, "{}", run.cycle());
}

#[test]
fn a_foreign_controller_is_refused_by_name() {
    let plan = RunPlan::new(Scenario::default()).unwrap();
    let run = Run::new(&plan, |_, _, _| Box::new(Foreign), Kept::default()).unwrap();
    let refusal = run.snapshot().err().unwrap();
    assert!(refusal.0.ends_with("::Foreign") && refusal.to_string().contains("`branch`"), "{refusal}");
}
