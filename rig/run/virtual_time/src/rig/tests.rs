//! A rig that steps does what a run does; from a snapshot it goes on as it went on before.

use std::path::Path;

use masseter_controller::motion_controller::MotionController;
use masseter_runtime::control::{Operator, set_parameters};
use masseter_runtime::messages::codes::Cause;
use masseter_runtime::named::NamedValues;
use proptest::prelude::*;

use super::*;

/// Keeps every message.
#[derive(Debug, Clone, Default)]
struct Kept(Vec<Recorded>);

impl Sink for Kept {
    fn take(&mut self, message: &Recorded, _: u64) {
        self.0.push(*message);
    }

    fn has_failed(&self) -> bool {
        false
    }
}

/// The messages of the first cycles of a run.
fn played(scenario: &Scenario, cycles: usize) -> Vec<Recorded> {
    let plan = RunPlan::new(scenario.clone()).unwrap();
    let mut controller =
        MotionController::new(&plan.scenario, plan.mechanism.clone(), plan.trajectory.clone());
    let named = NamedValues::new(controller.declared(), &plan.scenario.parameters).unwrap();
    set_parameters(&mut controller, &named);
    let operator = Operator::new(&plan.scenario, named.settings().declared(), EPOCH_NS).unwrap();
    let mut duties = Duties { named, operator };
    let mut rig = Stepper::new(&plan.scenario, plan.schedule, Kept::default()).unwrap();
    for _ in 0..cycles {
        rig.play_cycle(&mut controller, &mut duties).unwrap();
    }
    rig.into_sink().0
}

fn commands(messages: &[Recorded]) -> Vec<Command> {
    let command =
        |message: &Recorded| if let Recorded::Command(command) = message { Some(*command) } else { None };
    messages.iter().filter_map(command).collect()
}

fn with_keys(keys: &str) -> Scenario {
    Scenario::parse(Path::new("test.toml"), keys).unwrap()
}

/// Readings, truths and numbers of events of the steps with these commands.
fn steps(rig: &mut Rig, commands: &[Command]) -> Vec<(Reading, Option<Truth>, Vec<Event>)> {
    let step = |command| {
        let reading = *rig.step(command).unwrap();
        (reading, rig.truth().copied(), rig.events().to_vec())
    };
    commands.iter().map(step).collect()
}

#[test]
fn the_steps_with_a_runs_commands_are_the_run() {
    let scenario = with_keys("seed = 3");
    let run = played(&scenario, 2000);
    let mut rig = Rig::new(&scenario, 3).unwrap();
    let mut readings = vec![*rig.reading()];
    readings.extend(steps(&mut rig, &commands(&run)).into_iter().map(|(reading, ..)| reading));
    let of_run: Vec<_> = run
        .iter()
        .filter_map(|message| if let Recorded::Reading(reading) = message { Some(*reading) } else { None })
        .collect();
    // The last step begins a cycle more.
    assert_eq!(readings[..of_run.len()], of_run[..]);
    assert!(of_run.last().unwrap().answers_cycle > 0, "the drives move");
}

#[test]
fn a_reset_rig_is_new() {
    let mut rig = Rig::new(&Scenario::default(), 1).unwrap();
    let commands = commands(&played(&Scenario::default(), 1200));
    let first = *rig.reading();
    let before = steps(&mut rig, &commands);
    assert_eq!(*rig.reset().unwrap(), first);
    assert_eq!(steps(&mut rig, &commands), before);
}

#[test]
fn signals_have_names_and_values() {
    let mut rig = Rig::new(&Scenario::default(), 1).unwrap();
    assert_eq!(rig.signal("d1.position").unwrap(), None, "a drive reports once it has booted");
    steps(&mut rig, &commands(&played(&Scenario::default(), 1200)));
    let shown_mm = rig.signal("d1.position").unwrap().expect("the encoder reports");
    assert!((shown_mm - 1e3 * rig.reading().position_m[0]).abs() < 1e-9, "{shown_mm}");
    let true_mm = rig.signal("d1.true_position").unwrap().expect("the mechanism is emulated");
    assert!((true_mm - 1e3 * rig.truth().unwrap().joint_m[0]).abs() < 1e-9, "{true_mm}");
    assert_eq!(rig.signal("controller.state").unwrap(), None, "a rig alone has no controller");
    let refusal = rig.signal("incisal.zz").unwrap_err().to_string();
    assert!(refusal.contains("did you mean"), "{refusal}");
}

#[test]
fn a_snapshot_of_another_scenario_or_seed_is_refused() {
    let of_one = Rig::new(&Scenario::default(), 1).unwrap().snapshot();
    let mut other = Rig::new(&Scenario::default(), 2).unwrap();
    let refusal = other.restore(&of_one).unwrap_err().to_string();
    assert!(refusal.contains("seed 1") && refusal.contains("seed 2"), "{refusal}");
    let mut other = Rig::new(&with_keys("rate_hz = 500"), 1).unwrap();
    let refusal = other.restore(&of_one).unwrap_err().to_string();
    assert!(refusal.contains("other values of its keys"), "{refusal}");
    let mut same = Rig::new(&Scenario::default(), 1).unwrap();
    same.restore(&of_one).unwrap();
}

#[test]
fn a_scenario_that_cannot_be_played_is_refused() {
    let wrong = Scenario { rate_hz: 0, ..Scenario::default() };
    assert!(matches!(Rig::new(&wrong, 1), Err(RigError::Scenario(_))));
    let mut real = Scenario::default();
    real.can.interfaces = vec!["can0".to_owned(), "can1".to_owned()];
    let refusal = Rig::new(&real, 1).unwrap_err().to_string();
    assert!(refusal.contains("can0, can1"), "{refusal}");
}

#[test]
fn a_command_that_is_no_number_is_the_masters_to_refuse() {
    let scenario = Scenario::default();
    let mut commands = commands(&played(&scenario, 1500));
    commands.last_mut().unwrap().target_m[0] = f64::NAN;
    let mut rig = Rig::new(&scenario, 1).unwrap();
    let last = steps(&mut rig, &commands).pop().unwrap();
    assert!(last.2.iter().any(|event| event.cause == Cause::BadMessage.code()), "{:?}", last.2);
}

/// Faults of drives, encoders, buses and mechanism, up to the time at which the last one begins.
const FAULTS: [&str; 8] = [
    "kind = 'encoder_delay'\naxis = 'l1'\nsize = '2 ms'\nat_s",
    "kind = 'encoder_noise'\naxis = 'l1'\nsize = '5 um'\nfor_s = 0.1\nat_s = 0.3\nname = 'first'\n\
     [[faults]]\nkind = 'jam'\naxis = 'l2'\nafter = 'fault.first'\nat_s = 0.05\n\
     [[faults]]\nkind = 'jam'\naxis = 'd1'\nat_s",
    "kind = 'encoder_noise'\naxis = 'l1'\nsize = '20 um'\nat_s",
    "kind = 'drive_torque_loss'\naxis = 'd2'\nsize = '50 %'\nat_s",
    "kind = 'jam'\naxis = 'l3'\nat_s",
    "kind = 'disconnect'\nbus = 1\nnode = 5\nat_s",
    "kind = 'drive_reboot'\naxis = 'd1'\nsize = '100 ms'\nat_s",
    "kind = 'play'\naxis = 'l2'\nsize = '0.3 mm'\nat_s",
];

fn with_fault(seed: u64, fault: &str, time_s: f64) -> Scenario {
    with_keys(&format!("seed = {seed}\n[[faults]]\n{fault} = {time_s:.3}\n"))
}

/// The events after a snapshot at that cycle. Both this rig and another one go on from the snapshot as the rig went on.
fn events_after_a_snapshot(scenario: &Scenario, at: usize, more: usize) -> Vec<Event> {
    let commands = commands(&played(scenario, at + more));
    let mut rig = Rig::new(scenario, scenario.seed).unwrap();
    let (before, after) = commands.split_at(at.min(commands.len()));
    steps(&mut rig, before);
    let branch = rig.snapshot();
    let went_on = steps(&mut rig, after);

    rig.restore(&branch).unwrap();
    assert_eq!(steps(&mut rig, after), went_on);
    let mut other = Rig::new(scenario, scenario.seed).unwrap();
    other.restore(&branch).unwrap();
    assert_eq!(steps(&mut other, after), went_on);
    went_on.into_iter().flat_map(|(.., events)| events).collect()
}

#[test]
fn faults_that_begin_after_a_snapshot_begin_in_every_branch() {
    for fault in FAULTS {
        let events = events_after_a_snapshot(&with_fault(1, fault, 0.4), 1000, 900);
        let strikes = events.iter().filter(|event| event.cause == Cause::FaultInjected.code()).count();
        assert!(strikes >= fault.matches("kind").count(), "{fault}: {strikes} strikes");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn going_on_from_a_snapshot_is_going_on(
        seed in 1_u64..1000, fault in prop::sample::select(&FAULTS[..]), time_s in 0.4..1.6,
        at in 0_usize..1500, more in 1_usize..600,
    ) {
        events_after_a_snapshot(&with_fault(seed, fault, time_s), at, more);
    }
}
