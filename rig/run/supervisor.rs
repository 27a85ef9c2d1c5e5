//! Starts the three processes, watches them, stops them in order, and sweeps what they leave.
//!
//! Order of ending: the controller first (it brings the drives to rest), then the plant, then the
//! logger, which drains what is left. A process that dies is not restarted: the rig ends in that order, and the
//! survivors have come to a safe stop by their own watchdogs by then. One that does not end in time is killed, and so is
//! a controller that hangs, of which the plant tells.

use std::collections::BTreeMap;
use std::io;
use std::process::ExitStatus;
use std::time::Duration;

use anyhow::Context;
use masseter_plan::Plan;
use masseter_recording::{DmaLatency, Ending, RunFolder, RunUsage};
use masseter_shared::clock::{self, SECOND_NS};
use masseter_shared::config::Scenario;
use masseter_shared::lifecycle::Start;
use masseter_shared::realtime::scheduling::Obtained;
use masseter_shared::schedule::OFF_TICK_NS;
use masseter_shared::transport::{Claim, Domain, DomainError};

use super::args::RunArgs;
use super::child::{ChildError, Process, Role};
use super::ending::{died, of_all, of_the_others};
use super::usage::Meter;
use crate::clean::sweep_dead;
use crate::machine::interrupts::Interrupts;
use crate::machine::{SystemRoot, dma_latency};
use masseter_terminal::{Exit, Failure, OrFailure, status};

/// How often the processes are looked after.
const WATCH: Duration = Duration::from_millis(2);
/// How much later than another process this one may hear a signal that both get.
const HEARD_WITHIN: Duration = Duration::from_millis(100);
/// From the word to begin to the first SYNC, ns.
const LEAD_NS: u64 = 100_000_000;
/// How long a process may take to end when asked to, beyond what it has to do first.
const END_WITHIN_NS: u64 = 5 * SECOND_NS;
/// How long the logger may take to write what is left: as long as a slow disk needs, ns.
const RECORD_WITHIN_NS: u64 = 60 * SECOND_NS;
/// How a controller died that the plant had to end without.
const SILENT: &str = "it sent no command any more, and was killed";
/// How long the plant goes on after its master has noticed the controller's death, to stop the drives, ns.
const SAFE_STOP_NS: u64 = SECOND_NS / 2;

/// How the processes ended, and with which scheduling they ran.
#[derive(Debug)]
pub struct Ended {
    /// The end.
    pub ending: Ending,
    /// What each process obtained.
    pub scheduling: BTreeMap<String, Obtained>,
    /// What became of `/dev/cpu_dma_latency`, if it came to that.
    pub cpu_dma_latency: Option<DmaLatency>,
    /// What the processes used.
    pub usage: RunUsage,
}

/// Of a run that came to no process, or has none.
impl From<Ending> for Ended {
    fn from(ending: Ending) -> Self {
        let (scheduling, usage) = (BTreeMap::new(), RunUsage::default());
        Self { ending, scheduling, cpu_dma_latency: None, usage }
    }
}

/// The names that a rig has to itself.
#[derive(Debug)]
pub struct Claimed {
    domain: Domain,
    claim: Claim,
}

/// Claims the name, or one that no other rig has.
pub fn claim(name: Option<&str>) -> Result<Claimed, DomainError> {
    sweep_dead()?;
    let unique = || format!("{}-{:x}", std::process::id(), clock::now_ns());
    let domain = Domain::named(&name.map_or_else(unique, str::to_owned))?;
    let claim = domain.claim()?;
    Ok(Claimed { domain, claim })
}

/// Runs the rig in real time, and gives its names back.
pub fn run(
    Claimed { domain, claim }: Claimed,
    plan: &Plan,
    folder: &RunFolder,
    args: &RunArgs,
) -> Result<Ended, Failure> {
    let interrupts = Interrupts::listen().context("cannot listen for signals").died()?;
    let result = Rig::spawn(plan, folder, &domain, args).and_then(|mut rig| rig.run(plan, args, &interrupts));
    drop(claim);
    interrupts.let_go();
    if let Err(error) = domain.sweep() {
        status!("masseter: {error}; `masseter clean` removes what is left of this run");
    }
    // Whatever can be wrong with the input was looked for before.
    result.died()
}

/// The three processes, in the order of their starting.
struct Rig {
    /// How long the controller may take to end when asked to.
    stop_within_ns: u64,
    /// How long the plant goes on without the controller.
    plant_alone_ns: u64,
    logger: Process,
    plant: Process,
    controller: Process,
}

impl Rig {
    fn spawn(plan: &Plan, folder: &RunFolder, domain: &Domain, args: &RunArgs) -> anyhow::Result<Self> {
        let scenario = folder.scenario();
        let scenario = scenario.to_str().context("the run folder's path is not UTF-8")?;
        let recording = folder.recording();
        let recording = recording.to_str().context("the run folder's path is not UTF-8")?;
        let common = ["--scenario", scenario, "--domain", domain.id()];
        let live = args.live.map(|address| format!("--live={address}"));
        let motion_s = plan.trajectory.motion_time_s(plan.trajectory.duration_s());
        let motion = format!("--motion-s={motion_s}");
        let mut for_logger = [&common[..], &["--recording", recording, &motion]].concat();
        for_logger.extend(args.quiet.then_some("--quiet"));
        for_logger.extend(live.as_deref());
        let for_controller = [&common[..], &["--kind", args.controller.name()]].concat();
        let Scenario { controller, can, .. } = &plan.scenario;
        // The motion stops, is held, and the drives are switched off.
        let stop_s = controller.stop_ramp_s + controller.hold_s + controller.start_timeout_s;
        Ok(Self {
            stop_within_ns: ((stop_s * 1e9) as u64).saturating_add(END_WITHIN_NS),
            plant_alone_ns: u64::from(can.command_timeout_cycles) * plan.scenario.period_ns() + SAFE_STOP_NS,
            logger: Process::spawn(Role::Logger, &for_logger)?,
            plant: Process::spawn(Role::Plant, &common)?,
            controller: Process::spawn(Role::Controller, &for_controller)?,
        })
    }

    fn run(&mut self, plan: &Plan, args: &RunArgs, interrupts: &Interrupts) -> anyhow::Result<Ended> {
        let Some(scheduling) = self.wait_ready(interrupts)? else {
            return Ok(Ending::Interrupted.into());
        };
        let is_virtual = SystemRoot::of_this_machine().is_virtual();
        let hold = dma_latency::Hold::new(plan.scenario.realtime.cpu_dma_latency, is_virtual);
        let cpu_dma_latency = Some(hold.obtained().clone());
        let refusals = show_refusals(&scheduling, hold.obtained());
        if args.require_rt && refusals > 0 {
            status!("masseter: real time was required and not granted; nothing was started");
            return Ok(Ended { scheduling, cpu_dma_latency, ..Ending::NotStarted.into() });
        }
        let epoch_ns = self.start(plan.scenario.period_ns())?;
        let processes = [&self.logger, &self.plant, &self.controller];
        let names_and_ids = processes.map(|process| (process.role().name(), process.id()));
        let mut meter = Meter::new(SystemRoot::of_this_machine(), epoch_ns, names_and_ids);
        let ending = self.watch(interrupts, &mut meter)?;
        Ok(Ended { ending, scheduling, cpu_dma_latency, usage: meter.finish() })
    }

    /// What each process obtained; none when the user has had enough before all were ready.
    fn wait_ready(
        &mut self,
        interrupts: &Interrupts,
    ) -> Result<Option<BTreeMap<String, Obtained>>, ChildError> {
        let mut scheduling = BTreeMap::new();
        for process in [&mut self.logger, &mut self.plant, &mut self.controller] {
            match process.wait_ready(|| interrupts.is_stop_asked()) {
                Ok(Some(ready)) => scheduling.insert(process.role().name().to_owned(), ready.scheduling),
                Ok(None) => return Ok(None),
                Err(error) => {
                    // A terminal's signal reaches the processes too: one that was getting ready may have ended of it.
                    clock::sleep(HEARD_WITHIN);
                    return if interrupts.is_stop_asked() { Ok(None) } else { Err(error) };
                }
            };
        }
        Ok(Some(scheduling))
    }

    /// Gives the word to begin; returns the time of the first SYNC.
    fn start(&mut self, period_ns: u64) -> io::Result<u64> {
        let millisecond = SECOND_NS / 1000;
        let earliest = clock::now_ns() + LEAD_NS;
        let epoch_ns = earliest.next_multiple_of(millisecond.max(period_ns)) + OFF_TICK_NS.min(period_ns / 4);
        let loops = [self.controller.id(), self.plant.id()];
        for process in [&mut self.logger, &mut self.plant, &mut self.controller] {
            process.start(Start { epoch_ns, loops })?;
        }
        Ok(epoch_ns)
    }

    /// Watches until the controller's part is over, then ends plant and logger.
    fn watch(&mut self, interrupts: &Interrupts, meter: &mut Meter) -> anyhow::Result<Ending> {
        let mut broken_off = None;
        let mut give_up_ns = None;
        let status = loop {
            if interrupts.is_end_insisted() {
                return Ok(Ending::Interrupted);
            }
            if broken_off.is_none() {
                broken_off = self.disturbance(interrupts)?;
            }
            if let Some(status) = self.controller.ended()? {
                break Some(status);
            }
            let now_ns = clock::now_ns();
            let give_up_after_ns = now_ns.saturating_add(self.stop_within_ns);
            if broken_off.is_some() && now_ns > *give_up_ns.get_or_insert(give_up_after_ns) {
                self.controller.kill();
                break None;
            }
            meter.look(now_ns);
            clock::sleep(WATCH);
        };
        let controller = self.after_controller(status, interrupts)?;
        let plant = end(&mut self.plant, END_WITHIN_NS, interrupts)?;
        let logger = end(&mut self.logger, RECORD_WITHIN_NS, interrupts)?;
        if interrupts.is_end_insisted() {
            return Ok(Ending::Interrupted);
        }
        Ok(of_all(broken_off, controller, of_the_others(plant, logger)))
    }

    /// What ends the run before the controller's part is over, if anything does: the controller is asked to end then.
    /// Without the plant its own watchdog stops it on the way, unless it still waits for the first readings.
    fn disturbance(&mut self, interrupts: &Interrupts) -> io::Result<Option<Ending>> {
        let ending = if interrupts.is_stop_asked() {
            Ending::Interrupted
        } else if let Some(status) = self.logger.ended()? {
            died(Role::Logger, Some(status))
        } else if let Some(status) = self.plant.ended()? {
            if status.code() == Some(Exit::SafeStop as i32) {
                self.controller.kill();
                return Ok(Some(Ending::died(Role::Controller.name(), SILENT.to_owned())));
            }
            died(Role::Plant, Some(status))
        } else {
            return Ok(None);
        };
        self.controller.terminate();
        Ok(Some(ending))
    }

    /// How the controller ended; if it died, the plant's master is given time to stop the drives.
    fn after_controller(
        &mut self,
        status: Option<ExitStatus>,
        interrupts: &Interrupts,
    ) -> io::Result<Ending> {
        match status.and_then(|status| status.code()) {
            Some(code) if code == Exit::Passed as i32 => Ok(Ending::Completed),
            Some(code) if code == Exit::SafeStop as i32 => Ok(Ending::SafeStop),
            _ => {
                wait_for(&mut self.plant, self.plant_alone_ns, interrupts)?;
                Ok(died(Role::Controller, status))
            }
        }
    }
}

/// Asks a process to end, and ends it if it does not; its status if it did.
fn end(process: &mut Process, within_ns: u64, interrupts: &Interrupts) -> io::Result<Option<ExitStatus>> {
    process.terminate();
    let status = wait_for(process, within_ns, interrupts)?;
    if status.is_none() {
        process.kill();
    }
    Ok(status)
}

fn wait_for(
    process: &mut Process,
    within_ns: u64,
    interrupts: &Interrupts,
) -> io::Result<Option<ExitStatus>> {
    let deadline_ns = clock::now_ns() + within_ns;
    loop {
        let status = process.ended()?;
        if status.is_some() || interrupts.is_end_insisted() || clock::now_ns() >= deadline_ns {
            return Ok(status);
        }
        clock::sleep(WATCH);
    }
}

/// Says on the screen what the kernel refused; returns how much that was.
fn show_refusals(scheduling: &BTreeMap<String, Obtained>, latency: &DmaLatency) -> usize {
    let of_processes = scheduling.iter().flat_map(|(name, obtained)| {
        obtained.refusals.iter().map(move |refusal| format!("  {name}: {refusal}"))
    });
    let of_latency = latency.refusal.iter().map(|refusal| format!("  {refusal}"));
    of_processes.chain(of_latency).map(|line| status!("{line}")).count()
}
