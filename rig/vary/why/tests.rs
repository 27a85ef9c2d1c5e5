//! Planted failures: the instant is that of runs which are played from their start, with a shorter fault each.

use masseter_recording::{MachineInfo, Manifest};
use masseter_scenario::Scenario;
use masseter_terminal::status;

use super::*;
use crate::run::runner::{Judged, Runner, Source};

const HEAD: &str = "duration_s = 2.5\n";
/// A bound on the true jaw, tighter than the rig's own limits.
const TIGHT: &str =
    "[[require]]\nname = 'incisal'\nsignal = 'incisal.error'\nduring = 'running'\nmax = '60 um'\n";

/// The entries that fail a run, each from 0.8 s of the motion on.
const PLANTED: [&str; 10] = [
    "[[faults]]\nkind = 'encoder_drift'\naxis = 'l1'\nsize = '1 mm/s'\nat_s = 0.8\n",
    "[[faults]]\nkind = 'jam'\naxis = 'd1'\nat_s = 0.8\n",
    "[[faults]]\nkind = 'encoder_stuck'\naxis = 'l2'\nat_s = 0.8\n",
    "[[faults]]\nkind = 'drive_torque_loss'\naxis = 'l3'\nsize = '80 %'\nat_s = 0.8\n",
    "[[faults]]\nkind = 'controller_stall'\nsize = '900 ms'\nat_s = 0.8\n",
    "[[faults]]\nkind = 'disconnect'\nbus = 0\nnode = 1\nat_s = 0.8\n",
    "[[faults]]\nkind = 'encoder_delay'\naxis = 'l1'\nsize = '20 ms'\nat_s = 0.8\n",
    "[[faults]]\nkind = 'drive_ignores_targets'\naxis = 'd2'\nat_s = 0.8\n",
    "[[stimulus]]\npush_n = [0.0, 0.0, -60.0]\nat_s = 0.8\n",
    "[[faults]]\nkind = 'drive_scale'\naxis = 'l2'\nsize = '0.9'\nat_s = 0.8\n",
];

fn scenario(text: &str) -> Scenario {
    Scenario::parse("planted.toml".as_ref(), &format!("{HEAD}{text}{TIGHT}")).unwrap()
}

fn ask(scenario: &Scenario, without: impl Into<Without>) -> anyhow::Result<Why> {
    let digest = played(scenario).figures.digest;
    let build = ControllerKind::Motion.builder();
    let plan = resolve_simulated(scenario, None, build)?;
    let machine = MachineInfo { cpu: "any".into(), cores: 2, kernel: "Linux".into(), is_virtual: true };
    let manifest = Manifest::new("test", scenario.clone(), plan.trajectory.duration_s(), "virtual", machine);
    let without = without.into();
    Question { plan, build, manifest, without, interrupts: &Interrupts::default() }.answer(&digest)
}

fn played(scenario: &Scenario) -> Judged {
    Runner::default().play(Source::Scenario(scenario)).map_err(|failure| failure.error).unwrap()
}

/// Whether the run passes if its entry ends after that many milliseconds.
fn passes_after(text: &str, ms: u64) -> bool {
    passes(&played(&scenario(&format!("{text}for_s = {:.3}\n", ms as f64 / 1e3))).verdict)
}

#[test]
fn the_last_way_back_is_that_of_runs_with_shorter_faults() {
    check(&PLANTED[2..5]);
}

#[test]
#[ignore = "plays hundreds of runs: docs/replay.md has the command"]
fn the_last_way_back_of_ten_planted_failures_is_that_of_runs_with_shorter_faults() {
    check(&PLANTED);
}

fn check(planted: &[&str]) {
    for text in planted {
        let why = ask(&scenario(text), Withdrawn::All).expect(text);
        let [mut passing, mut failing] = [0, 900];
        while failing - passing > 1 {
            let middle = u64::midpoint(passing, failing);
            *(if passes_after(text, middle) { &mut passing } else { &mut failing }) = middle;
        }
        let found_ms = (why.last_way_back.motion_s.unwrap() * 1e3).round() as u64;
        status!("{text}{found_ms} ms, planted {}; {} looks", 800 + passing, why.looks.len());
        assert!(found_ms == 800 + passing, "{text}: {found_ms} instead of {}", 800 + passing);
        assert!(!why.left_first.is_empty() && why.left_first[0].cycle > why.last_way_back.cycle, "{text}");
    }
}

/// Half the motion opens the jaw by 9 mm, and the whole one by 18 mm.
#[test]
fn a_parameter_is_taken_away_by_the_controllers_own_value() {
    let text = "[parameters]\nmotion_amplitude = 0.5\n";
    let small = "[[require]]\nname = 'wide'\nsignal = 'jaw.opening'\nstatistic = 'peak_to_peak'\nduring = 'running'\nmin = '10 mm'\n";
    let scenario = Scenario::parse("planted.toml".as_ref(), &format!("{HEAD}{text}{small}")).unwrap();
    let why = ask(&scenario, Without::Parameter("motion_amplitude".to_owned())).unwrap();
    assert!(why.last_way_back.cycle > 1 && why.without == "parameters.motion_amplitude", "{why:?}");
    let unknown = ask(&scenario, Without::Parameter("gain".to_owned())).unwrap_err().to_string();
    assert!(unknown.contains("'gain'"), "{unknown}");
}

#[test]
fn a_run_that_passes_and_one_that_fails_by_itself_have_no_answer() {
    let refusal = |text: &str, withdrawn| ask(&scenario(text), withdrawn).unwrap_err().to_string();
    assert!(refusal("", Withdrawn::All).contains("has not failed"));
    let by_itself = "[[require]]\nname = 'still'\nsignal = 'jaw.opening'\nduring = 'running'\nmax = '1 mm'\n";
    assert!(refusal(by_itself, Withdrawn::All).contains("fails without them, too"));
    // What is left acting is the cause.
    assert!(refusal(PLANTED[0], Withdrawn::Stimuli).contains("fails without them, too"));
}
