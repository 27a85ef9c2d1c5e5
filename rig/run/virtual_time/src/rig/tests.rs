//! A rig that steps does what a run does; from a snapshot it goes on as it went on before.

use std::env;

use masseter_recording::Recorded;
use masseter_runtime::messages::Message;
use masseter_runtime::messages::codes::Cause;
use proptest::prelude::*;

use super::*;
use crate::run::tests::{run_of, with_keys};

/// The messages of the first cycles of a run.
fn played(scenario: &Scenario, cycles: usize) -> Vec<Recorded> {
    let mut run = run_of(scenario);
    (0..cycles).for_each(|_| run.play_cycle().unwrap());
    run.into_sink().0
}

fn commands(messages: &[Recorded]) -> Vec<Command> {
    let command =
        |message: &Recorded| if let Recorded::Command(command) = message { Some(*command) } else { None };
    messages.iter().filter_map(command).collect()
}

/// What a step shows, to the bit.
#[derive(Debug, Clone, PartialEq)]
struct Shown {
    reading: Reading,
    events: Vec<Event>,
    bits: Vec<u8>,
}

/// What the steps with these commands show.
fn steps(rig: &mut Rig, commands: &[Command]) -> Vec<Shown> {
    let step = |command| {
        let (reading, events) = (*rig.step(command).unwrap(), rig.events().to_vec());
        let mut bits = reading.body().to_vec();
        bits.extend(rig.truth().unwrap().body());
        rig.latest().cycle.contact.iter().for_each(|contact| bits.extend(contact.body()));
        for event in &events {
            bits.extend(event.body());
        }
        Shown { reading, events, bits }
    };
    commands.iter().map(step).collect()
}

#[test]
fn the_steps_with_a_runs_commands_are_the_run() {
    let scenario = with_keys("seed = 3");
    let run = played(&scenario, 2000);
    let mut rig = Rig::new(&scenario, 3).unwrap();
    let mut readings = vec![*rig.reading()];
    readings.extend(steps(&mut rig, &commands(&run)).into_iter().map(|shown| shown.reading));
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
    let events = last.events;
    assert!(events.iter().any(|event| event.cause == Cause::BadMessage.code()), "{events:?}");
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

/// Other faults, which need not strike; the last ones overlap.
const OTHER_FAULTS: [&str; 16] = [
    "kind = 'corrupt'\nbus = 0\nprobability = 0.1\nat_s",
    "kind = 'lose'\nbus = 1\nprobability = 0.1\nat_s",
    "kind = 'delay'\nbus = 0\nsize = '1500 us'\nprobability = 0.05\nat_s",
    "kind = 'babble'\nbus = 0\nnode = 2\nfor_s = 0.01\nat_s",
    "kind = 'bus_off'\nbus = 1\nnode = 4\nat_s",
    "kind = 'encoder_stuck'\naxis = 'l3'\nfor_s = 0.02\nat_s",
    "kind = 'drive_sto'\naxis = 'd3'\nat_s",
    "kind = 'emcy_storm'\naxis = 'l1'\nsize = '5 ms'\nat_s",
    "kind = 'end_stop'\naxis = 'l1'\nsize = '1 mm'\nat_s",
    "kind = 'payload'\nsize = '0.5 kg'\nat_s",
    "kind = 'command_jump'\naxis = 'l2'\nsize = '1 mm'\nfor_s = 0.02\nat_s",
    "kind = 'controller_stall'\nsize = '50 ms'\nat_s",
    "kind = 'encoder_stuck'\naxis = 'l3'\nat_s = 0.05\n\
     [[faults]]\nkind = 'encoder_stuck'\naxis = 'l3'\nfor_s = 0.02\nat_s",
    "kind = 'emcy_storm'\naxis = 'l1'\nsize = '5 ms'\nat_s = 0.05\n\
     [[faults]]\nkind = 'emcy_storm'\naxis = 'l1'\nsize = '7 ms'\nfor_s = 0.02\nat_s",
    "kind = 'play'\naxis = 'l2'\nsize = '0.1 mm'\nat_s = 0.05\n\
     [[faults]]\nkind = 'play'\naxis = 'l2'\nsize = '0.2 mm'\nfor_s = 0.02\nat_s",
    "kind = 'friction'\naxis = 'd1'\nsize = '3'\nat_s = 0.05\n\
     [[faults]]\nkind = 'friction'\naxis = 'd1'\nsize = '2'\nfor_s = 0.02\nat_s",
];

/// What a scenario has beside a fault.
const FURNISHED: [&str; 7] = [
    "",
    "[food]\n[teeth]\n",
    "[food]\nkind = 'peanut'\n[load_cell]\n[dynamics.friction]\nmodel = 'lugre'\n",
    "[food]\n[[stimulus]]\nat_s = 0.1\nfood = { stiffness_n_per_m = 5000.0, strength_n = 50.0 }\n",
    "[food]\n[[stimulus]]\nat_s = 0.05\nfor_s = 0.3\nfood = { stiffness_n_per_m = 5000.0 }\n\
     [[stimulus]]\nat_s = 0.1\nfor_s = 0.05\nfood = { stiffness_n_per_m = 8000.0 }\n",
    "[[drives.quirk]]\nkind = 'two_boot_ups'\n[[drives.quirk]]\nkind = 'restarts'\nafter_s = 0.7\naxes = ['l2']\n",
    "[[stimulus]]\nat_s = 0.05\nfor_s = 0.3\nshape = 'half_sine'\npush_n = [0.0, 0.0, -4.0]\n",
];

/// The events after a snapshot at that cycle. Both this rig and another one, which reads the snapshot from a file, go on
/// as the rig went on.
fn events_after_a_snapshot(scenario: &Scenario, at: usize, more: usize) -> Vec<Event> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("branch.snapshot");
    let commands = commands(&played(scenario, at + more));
    let mut rig = Rig::new(scenario, scenario.seed).unwrap();
    let (before, after) = commands.split_at(at.min(commands.len()));
    steps(&mut rig, before);
    let branch = rig.snapshot();
    branch.write_to(&path).unwrap();
    let went_on = steps(&mut rig, after);

    rig.restore(&branch).unwrap();
    assert!(steps(&mut rig, after) == went_on);
    let mut other = Rig::new(scenario, scenario.seed).unwrap();
    let read = other.read_snapshot(&path).unwrap();
    other.restore(&read).unwrap();
    assert!(steps(&mut other, after) == went_on);
    went_on.into_iter().flat_map(|shown| shown.events).collect()
}

#[test]
fn faults_that_begin_after_a_snapshot_begin_in_every_branch() {
    for fault in FAULTS {
        let events = events_after_a_snapshot(&with_fault(1, fault, 0.4), 1000, 900);
        let strikes = events.iter().filter(|event| event.cause == Cause::FaultInjected.code()).count();
        assert!(strikes >= fault.matches("kind").count(), "{fault}: {strikes} strikes");
    }
}

/// How many random snapshots are taken: `scripts/nightly` takes a thousand.
fn cases() -> u32 {
    env::var("SNAPSHOT_CASES").map_or(100, |cases| cases.parse().expect("SNAPSHOT_CASES is a number"))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(), ..ProptestConfig::default() })]

    #[test]
    fn going_on_from_a_snapshot_is_going_on(
        seed in 1_u64..1000, rate_hz in prop::sample::select(&[500, 1000][..]),
        fault in prop::sample::select([&FAULTS[..], &OTHER_FAULTS[..]].concat()), time_s in 0.0..0.2,
        furnished in prop::sample::select(&FURNISHED[..]),
        at in 0_usize..1200, more in 1_usize..100,
    ) {
        let scenario = with_keys(&format!(
            "seed = {seed}\nrate_hz = {rate_hz}\nduration_s = 2.0\n[controller]\nease_s = 0.1\n[[faults]]\n{fault} = {time_s:.3}\n{furnished}"
        ));
        events_after_a_snapshot(&scenario, at, more);
    }
}
