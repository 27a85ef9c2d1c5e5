//! The plan and the clock of a run; refuses what this machine, the clock or the controller does not have.

use masseter_controller::process::BuildController;
use masseter_judge::requirements::{RequirementError, check_requirements};
use masseter_plant::core as plant;
use masseter_recorder::live;
use masseter_runtime::injection::{Operator, OperatorError, is_seen_by_controller};
use masseter_runtime::named::{NameError, NamedValues};
use masseter_runtime::realtime::scheduling::{SchedulingRequest, obtain, usable_cores};
use masseter_scenario::{CommandFault, FaultKindConfig, ProcessFault, StimulusConfig};

use super::request::{ClockKind, ControllerChoice, RunRequest};
use crate::prelude::*;

/// The highest SCHED_FIFO priority.
const HIGHEST_PRIORITY: u8 = 99;

/// Plans the run and chooses its clock; refuses interfaces and addresses that this machine does not have.
pub(super) fn resolve(request: &RunRequest) -> anyhow::Result<(RunPlan, RunRequest)> {
    let change = |scenario: &mut Scenario| request.change(scenario);
    let scenario = masseter_plan::read_scenario_with(request.scenario.as_deref(), change)?;
    request.cores.map_or(Ok(()), |cores| check_cores(&cores, &usable_cores()))?;
    let controller = request.controller.clone().with_map(request.map.as_ref())?;
    let request = RunRequest { controller, ..request.clone() };
    let request = RunRequest { clock: choose_clock(&request, &scenario), ..request };
    check_clock(&request, &scenario)?;
    request.live.map(live::listen_on).transpose()?;
    let plan = RunPlan::of_file(scenario, request.scenario.as_deref())?;
    plant::check_interfaces(&plan.scenario)?;
    let checked = match request.controller.builder() {
        Some(build) => check_controller(&plan, build),
        None => check_requirements(&plan.scenario, None).map_err(Unknown::from),
    };
    checked.map_err(|unknown| unknown.at(&plan.scenario, request.scenario.as_deref()))?;
    Ok((plan, request))
}

/// Plans a scenario, of a file if it comes from one, for virtual time, under which a controller of the rig runs alone.
pub(crate) fn resolve_simulated(
    scenario: &Scenario,
    path: Option<&Path>,
    build: BuildController,
) -> anyhow::Result<RunPlan> {
    ensure!(
        !needs_processes(scenario),
        "a fault of a process needs processes, which virtual time does not have"
    );
    let of_file = |path| RunPlan::of_file(scenario.clone(), Some(path));
    let plan = path.map_or_else(|| RunPlan::new(scenario.clone()), of_file)?;
    check_controller(&plan, build).map_err(|unknown| unknown.at(scenario, path))?;
    Ok(plan)
}

/// Refuses requirements, parameters and changes of parameters that the controller does not know.
fn check_controller(plan: &RunPlan, build: BuildController) -> Result<(), Unknown> {
    let controller = build(&plan.scenario, plan.mechanism.clone(), plan.trajectory.clone());
    let declared = controller.declared();
    check_requirements(&plan.scenario, Some(&declared))?;
    let named = NamedValues::new(declared, &plan.scenario.parameters)?;
    Operator::new(&plan.scenario, named.settings().declared(), 0)?;
    Ok(())
}

/// What the controller, or nobody, knows of a scenario.
#[derive(Debug, thiserror::Error)]
enum Unknown {
    #[error(transparent)]
    Requirement(#[from] RequirementError),
    #[error("{}{}", .0, question(.0))]
    Parameter(#[from] NameError),
    #[error(transparent)]
    Stimulus(#[from] OperatorError),
}

impl Unknown {
    /// The refusal with its key, and with its place where the file of the scenario has this value.
    fn at(self, scenario: &Scenario, path: Option<&Path>) -> anyhow::Error {
        let (key, entry) = match &self {
            Self::Requirement(RequirementError { key, entry, .. }) => ((*key).to_owned(), *entry),
            Self::Parameter(error) => {
                (["parameters"].into_iter().chain(error.name()).collect::<Vec<_>>().join("."), None)
            }
            Self::Stimulus(error) => match error.key() {
                Some((key, entry)) => (key.to_owned(), Some(entry)),
                None => return self.into(),
            },
        };
        let place = path.and_then(|path| scenario.place_of_key(path, &key, entry));
        let place = place.map_or_else(String::new, |place| format!("{place}: "));
        anyhow::Error::from(self).context(format!("{place}{}", masseter_scenario::input::excerpt(&key)))
    }
}

/// A name that `--set` was given may be meant as a key of the scenario.
fn question(error: &NameError) -> String {
    let question = match error {
        NameError::Unknown { name, .. } => Scenario::question_for(name),
        _ => None,
    };
    question.map_or_else(String::new, |question| format!("; of the keys of a scenario, {question}"))
}

/// Refuses cores of the command line to which the kernel pins no thread. Where no pinning is allowed at all, the refusal
/// of the kernel says so later.
fn check_cores(cores: &[usize], usable: &[usize]) -> anyhow::Result<()> {
    match cores.iter().find(|core| !usable.contains(core)) {
        Some(core) if !usable.is_empty() => {
            let choice: Vec<_> = usable.iter().map(usize::to_string).collect();
            bail!("--cores: there is no core {core} for this process; choose among {}", choice.join(", "))
        }
        _ => Ok(()),
    }
}

/// The clock that this machine can keep: real time where the kernel grants it, otherwise lockstep.
fn choose_clock(request: &RunRequest, scenario: &Scenario) -> ClockKind {
    let is_program =
        matches!(request.controller, ControllerChoice::External | ControllerChoice::Executable(..));
    let say = |what: &str| {
        if !request.quiet {
            status!("clock: lockstep, {what}");
        }
        ClockKind::Lockstep
    };
    if request.clock == ClockKind::Virtual && is_program {
        return say("which gives the bytes of virtual: your controller is a process of its own");
    }
    if request.clock != ClockKind::Auto {
        return request.clock;
    }
    if request.controller == ControllerChoice::None {
        return ClockKind::Rt;
    }
    // Whoever names a patience wants the clock that has one.
    if request.patience.is_some() {
        return ClockKind::Lockstep;
    }
    // Real drives know no other time, and a required real time is refused by its own verdict.
    if !scenario.can.is_virtual() || request.require_rt {
        return ClockKind::Rt;
    }
    let Some(refusal) = refusal(scenario) else { return ClockKind::Rt };
    let live = if request.live.is_some() { "; --live shows a run that is faster than real time" } else { "" };
    say(&format!("because real time is not granted: {refusal}; or try --clock rt all the same{live}"))
}

/// Why the kernel does not grant the cores and the priority of the scenario; none if it does.
fn refusal(scenario: &Scenario) -> Option<String> {
    let realtime = &scenario.realtime;
    let fifo_priority = Some(realtime.priority);
    let try_on = |core| {
        let request = SchedulingRequest { core: Some(core), fifo_priority, locked_memory: false };
        // The thread ends with its priority.
        let tried = std::thread::spawn(move || obtain(request));
        let obtained = tried.join().expect("asking the kernel does not panic");
        if obtained.core == Some(core) && obtained.fifo_priority != fifo_priority {
            return Some(format!("SCHED_FIFO is refused; to allow it: {}", crate::doctor::grant_command()));
        }
        obtained.refusals.into_iter().next()
    };
    realtime.cores.into_iter().find_map(try_on)
}

/// The first fault of a process, which exists only where there are processes.
fn fault_of_process(scenario: &Scenario) -> Option<FaultKindConfig> {
    let mut kinds = scenario.faults.iter().map(|fault| fault.kind);
    kinds.find(|kind| kind.is_of_process())
}

/// Whether the scenario cannot run in one thread.
pub(crate) fn needs_processes(scenario: &Scenario) -> bool {
    fault_of_process(scenario).is_some()
}

/// Refuses what the clock has no use for.
fn check_clock(request: &RunRequest, scenario: &Scenario) -> anyhow::Result<()> {
    let RunRequest { clock, controller, .. } = request;
    let has_controller = *controller != ControllerChoice::None;
    ensure!(request.patience.is_none() || *clock == ClockKind::Lockstep, "--patience needs --clock lockstep");
    ensure!(
        has_controller || !scenario.stimulus.iter().any(StimulusConfig::is_of_controller),
        "[[stimulus]]: parameter and stop need a controller: leave --controller none away"
    );
    check_controller_stall(request, scenario)?;
    check_process_faults(request, scenario)?;
    if *clock == ClockKind::Rt {
        return Ok(());
    }
    ensure!(
        has_controller,
        "--controller none needs --clock rt: in simulated time each cycle waits for a command"
    );
    ensure!(
        scenario.can.is_virtual(),
        "simulated time has no real CAN interfaces: use --can virtual, or --clock rt"
    );
    ensure!(!request.require_rt, "--require-rt needs --clock rt");
    if *clock == ClockKind::Lockstep {
        return Ok(());
    }
    ensure!(
        request.name.is_none(),
        "--name needs --clock rt or lockstep: virtual time has no processes to name"
    );
    ensure!(
        request.live.is_none(),
        "--live needs --clock rt or lockstep: virtual time is over before a client can connect"
    );
    Ok(())
}

/// Refuses a stall of the controller that real time cannot have: there its process really stops.
fn check_controller_stall(request: &RunRequest, scenario: &Scenario) -> anyhow::Result<()> {
    let stall = FaultKindConfig::from(CommandFault::ControllerStall);
    if request.clock != ClockKind::Rt || request.controller == ControllerChoice::None {
        return Ok(());
    }
    let entries = scenario.entry_names();
    for fault in scenario.faults.iter().filter(|fault| fault.kind == stall) {
        ensure!(
            request.controller != ControllerChoice::External,
            "faults.kind = {stall}: the rig stops only what it started: use --controller with the path of yours"
        );
        ensure!(
            is_seen_by_controller(fault.when(&entries)?, scenario),
            "faults.after: in real time {stall} cannot count from an occurrence in the plant, which the controller does not \
             see: count from the motion (at_s alone), or use --clock virtual"
        );
    }
    Ok(())
}

/// Refuses faults of processes where there are no such processes, or nothing could carry them out.
fn check_process_faults(request: &RunRequest, scenario: &Scenario) -> anyhow::Result<()> {
    let Some(first) = fault_of_process(scenario) else { return Ok(()) };
    let RunRequest { clock, controller, .. } = request;
    let has = |kind: FaultKindConfig| scenario.faults.iter().any(|fault| fault.kind == kind);
    let (stall, kill): (FaultKindConfig, FaultKindConfig) =
        (ProcessFault::CoreStall.into(), ProcessFault::ControllerKill.into());
    ensure!(
        *clock != ClockKind::Virtual,
        "faults.kind = {first}: virtual time has no processes: use --clock lockstep, or rt"
    );
    ensure!(
        *controller != ControllerChoice::None,
        "faults.kind = {first}: only a controller knows when the motion begins: leave --controller none away"
    );
    ensure!(
        *controller != ControllerChoice::External || !has(kill),
        "faults.kind = {kill}: the rig kills only what it started: use --controller with the path of yours"
    );
    if !has(stall) {
        return Ok(());
    }
    ensure!(*clock == ClockKind::Rt, "faults.kind = {stall}: simulated time waits meanwhile: use --clock rt");
    ensure!(
        scenario.realtime.priority != HIGHEST_PRIORITY,
        "realtime.priority = {HIGHEST_PRIORITY}: {stall} needs a higher one: use at most {}",
        HIGHEST_PRIORITY - 1
    );
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
            let request = RunRequest { clock, require_rt, quiet: true, ..RunRequest::default() };
            choose_clock(&request, &scenario)
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
        let request = RunRequest { quiet: true, ..RunRequest::default() };
        assert_eq!(choose_clock(&request, &scenario), ClockKind::Lockstep);
    }

    #[test]
    fn cores_that_cannot_be_used_are_refused_with_those_that_can() {
        let refusal = |cores: &[usize], usable: &[usize]| {
            check_cores(cores, usable).err().map(|error| error.to_string())
        };
        assert_eq!(refusal(&[0, 1], &[0, 1]), None);
        assert_eq!(refusal(&[0, 9], &[]), None, "nothing is known");
        let refused = refusal(&[0, 9], &[0, 2]).unwrap();
        assert!(refused.contains("no core 9") && refused.contains("choose among 0, 2"), "{refused}");
    }
}
