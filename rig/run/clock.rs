//! The clock of a run: what `--clock auto` comes to on this machine, and which arguments a clock has no use for.

use std::thread;

use anyhow::bail;
use masseter_runtime::control::is_seen_by_controller;
use masseter_runtime::realtime::scheduling::{SchedulingRequest, obtain};
use masseter_scenario::{FaultConfig, FaultKindConfig, FaultLayer, Scenario, StimulusConfig};
use masseter_terminal::status;

use crate::arguments::ControllerChoice;

use super::args::{ClockKind, RunArgs};
use crate::doctor;

/// The highest SCHED_FIFO priority.
const HIGHEST_PRIORITY: u8 = 99;

/// The arguments with a clock that this machine can keep: real time where the kernel grants it, otherwise lockstep.
pub(super) fn choose(args: &RunArgs, scenario: &Scenario) -> RunArgs {
    let chosen = |clock| RunArgs { clock, ..args.clone() };
    if args.clock == ClockKind::Auto && args.controller == ControllerChoice::None {
        return chosen(ClockKind::Rt);
    }
    let is_program = matches!(args.controller, ControllerChoice::External | ControllerChoice::Executable(_));
    if args.clock == ClockKind::Virtual && is_program {
        if !args.quiet {
            status!(
                "clock: lockstep, which gives the bytes of virtual: your controller is a process of its own"
            );
        }
        return chosen(ClockKind::Lockstep);
    }
    // Whoever names a patience wants the clock that has one.
    if args.clock == ClockKind::Auto && args.patience.is_some() {
        return chosen(ClockKind::Lockstep);
    }
    if args.clock != ClockKind::Auto {
        return args.clone();
    }
    // Real drives know no other time, and a required real time is refused by its own verdict.
    if !scenario.can.is_virtual() || args.require_rt {
        return chosen(ClockKind::Rt);
    }
    let Some(refusal) = refusal(scenario) else { return chosen(ClockKind::Rt) };
    if !args.quiet {
        let live =
            if args.live.is_some() { "; --live shows a run that is faster than real time" } else { "" };
        status!(
            "clock: lockstep, because real time is not granted: {refusal}; or try --clock rt all the same{live}"
        );
    }
    chosen(ClockKind::Lockstep)
}

/// Why the kernel does not grant the cores and the priority of the scenario; none if it does.
fn refusal(scenario: &Scenario) -> Option<String> {
    let realtime = &scenario.realtime;
    let fifo_priority = Some(realtime.priority);
    let try_on = |core| {
        let request = SchedulingRequest { core: Some(core), fifo_priority, locked_memory: false };
        // The thread ends with its priority.
        let tried = thread::spawn(move || obtain(request));
        let obtained = tried.join().expect("asking the kernel does not panic");
        if obtained.core == Some(core) && obtained.fifo_priority != fifo_priority {
            return Some(format!("SCHED_FIFO is refused; to allow it: {}", doctor::grant_command()));
        }
        obtained.refusals.into_iter().next()
    };
    realtime.cores.into_iter().find_map(try_on)
}

/// The first fault of a process, which exists only where there are processes.
fn fault_of_process(scenario: &Scenario) -> Option<FaultKindConfig> {
    let kinds = scenario.faults.iter().map(|fault| fault.kind);
    kinds.into_iter().find(|kind| kind.layer() == FaultLayer::Process)
}

/// Whether the scenario cannot run in one thread.
pub(crate) fn needs_processes(scenario: &Scenario) -> bool {
    fault_of_process(scenario).is_some()
}

/// Refuses arguments that the clock has no use for.
pub(super) fn check(args: &RunArgs, scenario: &Scenario) -> anyhow::Result<()> {
    if args.patience.is_some() && args.clock != ClockKind::Lockstep {
        bail!("--patience needs --clock lockstep");
    }
    check_stimuli(args, scenario)?;
    check_controller_stall(args, scenario)?;
    check_process_faults(args, scenario)?;
    if args.clock == ClockKind::Rt {
        return Ok(());
    }
    if args.controller == ControllerChoice::None {
        bail!("--controller none needs --clock rt: in simulated time each cycle waits for a command");
    }
    if !scenario.can.is_virtual() {
        bail!("simulated time has no real CAN interfaces: use --can virtual, or --clock rt");
    }
    if args.require_rt {
        bail!("--require-rt needs --clock rt");
    }
    if args.clock == ClockKind::Lockstep {
        return Ok(());
    }
    if args.name.is_some() {
        bail!("--name needs --clock rt or lockstep: virtual time has no processes to name");
    }
    if args.live.is_some() {
        bail!("--live needs --clock rt or lockstep: virtual time is over before a client can connect");
    }
    Ok(())
}

/// Refuses stimuli that nobody would carry out.
fn check_stimuli(args: &RunArgs, scenario: &Scenario) -> anyhow::Result<()> {
    let is_of_controller = scenario.stimulus.iter().any(StimulusConfig::is_of_controller);
    if args.controller == ControllerChoice::None && is_of_controller {
        bail!("[[stimulus]]: parameter and stop need a controller: leave --controller none away");
    }
    Ok(())
}

/// Refuses a stall of the controller that real time cannot have: there its process really stops.
fn check_controller_stall(args: &RunArgs, scenario: &Scenario) -> anyhow::Result<()> {
    let stall = FaultKindConfig::ControllerStall;
    let of_stall = |fault: &&FaultConfig| fault.kind == stall;
    if args.clock != ClockKind::Rt || args.controller == ControllerChoice::None {
        return Ok(());
    }
    let entries = scenario.entry_names();
    for fault in scenario.faults.iter().filter(of_stall) {
        if args.controller == ControllerChoice::External {
            bail!(
                "faults.kind = {stall}: the rig stops only what it started: use --controller with the path of yours"
            );
        }
        if !is_seen_by_controller(fault.when(&entries)?, scenario) {
            bail!(
                "faults.after: in real time {stall} cannot count from an occurrence in the plant, which the controller does not \
                 see: count from the motion (at_s alone), or use --clock virtual"
            );
        }
    }
    Ok(())
}

/// Refuses faults of processes where there are no such processes, or nothing could carry them out.
fn check_process_faults(args: &RunArgs, scenario: &Scenario) -> anyhow::Result<()> {
    let Some(first) = fault_of_process(scenario) else { return Ok(()) };
    let has = |kind| scenario.faults.iter().any(|fault| fault.kind == kind);
    let (stall, kill) = (FaultKindConfig::CoreStall, FaultKindConfig::ControllerKill);
    if args.clock == ClockKind::Virtual {
        bail!("faults.kind = {first}: virtual time has no processes: use --clock lockstep, or rt");
    }
    if args.controller == ControllerChoice::None {
        bail!(
            "faults.kind = {first}: only a controller knows when the motion begins: leave --controller none away"
        );
    }
    if args.controller == ControllerChoice::External && has(kill) {
        bail!(
            "faults.kind = {kill}: the rig kills only what it started: use --controller with the path of yours"
        );
    }
    if has(stall) && args.clock != ClockKind::Rt {
        bail!("faults.kind = {stall}: simulated time stands still meanwhile: use --clock rt");
    }
    if has(stall) && scenario.realtime.priority == HIGHEST_PRIORITY {
        bail!(
            "realtime.priority = {HIGHEST_PRIORITY}: {stall} needs a higher one: use at most {}",
            HIGHEST_PRIORITY - 1
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chosen_clock_stays_and_the_robot_has_real_time() {
        let of = |clock, interfaces: &[&str], require_rt| {
            let mut scenario = Scenario::default();
            scenario.can.interfaces = interfaces.iter().map(|name| (*name).to_owned()).collect();
            let args = RunArgs { clock, require_rt, quiet: true, ..RunArgs::default() };
            choose(&args, &scenario).clock
        };
        for clock in [ClockKind::Rt, ClockKind::Lockstep, ClockKind::Virtual] {
            assert_eq!(of(clock, &[], false), clock);
        }
        assert_eq!(of(ClockKind::Auto, &["can0", "can1"], false), ClockKind::Rt);
        assert_eq!(of(ClockKind::Auto, &[], true), ClockKind::Rt);
    }

    #[test]
    fn without_the_cores_of_the_scenario_the_clock_is_lockstep() {
        let mut scenario = Scenario::default();
        scenario.realtime.cores = [0, 4000];
        let args = RunArgs { quiet: true, ..RunArgs::default() };
        assert_eq!(choose(&args, &scenario).clock, ClockKind::Lockstep);
    }
}
