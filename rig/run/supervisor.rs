//! Starts the three processes, watches them, stops them in order, and sweeps what they leave.
//!
//! Order of ending: the controller first (it brings the drives to rest), then the plant, then the
//! logger, which drains what is left. A process that dies is not restarted: the survivors come to a
//! safe stop by their own watchdogs, and the supervisor only waits for them.

use std::collections::BTreeMap;
use std::io;
use std::process::ExitStatus;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use anyhow::Context;
use masseter_shared::clock::{self, SECOND_NS};
use masseter_shared::lifecycle::Start;
use masseter_shared::realtime::scheduling::Obtained;
use masseter_shared::transport::Domain;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use super::child::{Process, Role, describe};
use super::dma_latency::{self, DmaLatency};
use super::folder::RunFolder;
use super::plan::Plan;
use super::usage::{Meter, RunUsage};
use crate::clean::sweep_dead;
use crate::cli::RunArgs;
use crate::exit::Exit;
use crate::machine::SystemRoot;
use crate::report::verdict::Ending;

/// How often the processes are looked after.
const WATCH: Duration = Duration::from_millis(2);
/// From the word to begin to the first SYNC, ns.
const LEAD_NS: u64 = 100_000_000;
/// SYNC and the controller's deadline keep this clear of whole milliseconds, where the kernel's timer
/// tick falls, ns.
const OFF_TICK_NS: u64 = 230_000;
/// How long a process may take to end when asked to.
const END_WITHIN_NS: u64 = 5 * SECOND_NS;
/// How long the logger may take to write what is left: as long as a slow disk needs, ns.
const RECORD_WITHIN_NS: u64 = 60 * SECOND_NS;
/// How long the plant goes on after the controller has died, so that its master notices and stops the
/// drives, ns.
const SAFE_STOP_NS: u64 = SECOND_NS / 2;

/// How the processes ended, and with which scheduling they ran.
#[derive(Debug)]
pub struct Ended {
    /// The end.
    pub ending: Ending,
    /// What each process obtained.
    pub scheduling: BTreeMap<String, Obtained>,
    /// What became of `/dev/cpu_dma_latency`.
    pub cpu_dma_latency: DmaLatency,
    /// What the processes used.
    pub usage: RunUsage,
}

/// Runs the rig in real time.
pub fn run(plan: &Plan, folder: &RunFolder, args: &RunArgs) -> anyhow::Result<Ended> {
    sweep_dead()?;
    let interrupts = count_interrupts().context("cannot listen for signals")?;
    let domain = Domain::named(&format!("{}-{:x}", std::process::id(), clock::now_ns()))?;
    let claim = domain.claim()?;
    let result = Rig::spawn(plan, folder, &domain, args)
        .and_then(|mut rig| rig.run(plan, args.require_rt, &interrupts));
    drop(claim);
    domain.sweep()?;
    result
}

/// Counts SIGINT and SIGTERM: the first asks for an orderly stop, the second ends at once.
fn count_interrupts() -> io::Result<Arc<AtomicUsize>> {
    let count = Arc::new(AtomicUsize::new(0));
    let mut signals = Signals::new([SIGINT, SIGTERM])?;
    std::thread::spawn({
        let count = Arc::clone(&count);
        move || {
            for _ in signals.forever() {
                count.fetch_add(1, Ordering::Relaxed);
            }
        }
    });
    Ok(count)
}

/// The three processes, in the order of their starting.
struct Rig {
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
        let motion = format!("--motion-s={}", plan.trajectory.duration_s());
        let mut for_logger = [&common[..], &["--recording", recording, &motion]].concat();
        for_logger.extend(args.quiet.then_some("--quiet"));
        for_logger.extend(live.as_deref());
        Ok(Self {
            logger: Process::spawn(Role::Logger, &for_logger)?,
            plant: Process::spawn(Role::Plant, &common)?,
            controller: Process::spawn(Role::Controller, &common)?,
        })
    }

    fn run(&mut self, plan: &Plan, require_rt: bool, interrupts: &AtomicUsize) -> anyhow::Result<Ended> {
        let scheduling = self.wait_ready()?;
        let is_virtual = SystemRoot::of_this_machine().is_virtual();
        let hold = dma_latency::Hold::new(plan.scenario.realtime.cpu_dma_latency, is_virtual);
        let cpu_dma_latency = hold.obtained().clone();
        let refusals = show_refusals(&scheduling, &cpu_dma_latency);
        if require_rt && refusals > 0 {
            eprintln!("masseter: real time was required and not granted; nothing was started");
            let (ending, usage) = (Ending::NotStarted, RunUsage::default());
            return Ok(Ended { ending, scheduling, cpu_dma_latency, usage });
        }
        let epoch_ns = self.start(plan.scenario.period_ns())?;
        let processes = [&self.logger, &self.plant, &self.controller];
        let names_and_ids = processes.map(|process| (process.role().name(), process.id()));
        let mut meter = Meter::new(SystemRoot::of_this_machine(), epoch_ns, names_and_ids);
        let ending = self.watch(interrupts, &mut meter)?;
        Ok(Ended { ending, scheduling, cpu_dma_latency, usage: meter.finish() })
    }

    fn wait_ready(&mut self) -> anyhow::Result<BTreeMap<String, Obtained>> {
        let mut scheduling = BTreeMap::new();
        for process in [&mut self.logger, &mut self.plant, &mut self.controller] {
            let ready = process.wait_ready()?;
            scheduling.insert(process.role().name().to_owned(), ready.scheduling);
        }
        Ok(scheduling)
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
    fn watch(&mut self, interrupts: &AtomicUsize, meter: &mut Meter) -> anyhow::Result<Ending> {
        let mut ending = Ending::Completed;
        let status = loop {
            if interrupts.load(Ordering::Relaxed) > 1 {
                return Ok(Ending::Interrupted);
            }
            if ending == Ending::Completed {
                ending = self.disturbance(interrupts)?;
            }
            if let Some(status) = self.controller.ended()? {
                break status;
            }
            meter.look(clock::now_ns());
            clock::sleep(WATCH);
        };
        if ending == Ending::Completed {
            ending = self.after_controller(status)?;
        }
        end(&mut self.plant, END_WITHIN_NS)?;
        let logger_status = end(&mut self.logger, RECORD_WITHIN_NS)?;
        let incomplete = logger_status.is_none_or(|status| status.code() == Some(Exit::Incomplete as i32));
        Ok(if incomplete && ending == Ending::Completed { Ending::RecordingFailed } else { ending })
    }

    /// What ends the run before the controller's part is over, if anything does. Without the plant the
    /// controller stops by its own watchdog; otherwise it is asked to.
    fn disturbance(&mut self, interrupts: &AtomicUsize) -> io::Result<Ending> {
        if interrupts.load(Ordering::Relaxed) > 0 {
            self.controller.terminate();
            return Ok(Ending::Interrupted);
        }
        if let Some(status) = self.logger.ended()? {
            self.controller.terminate();
            return Ok(Ending::died(Role::Logger.name(), describe(status)));
        }
        match self.plant.ended()? {
            Some(status) => Ok(Ending::died(Role::Plant.name(), describe(status))),
            None => Ok(Ending::Completed),
        }
    }

    /// How the controller ended; if it died, the plant's master is given time to stop the drives.
    fn after_controller(&mut self, status: ExitStatus) -> io::Result<Ending> {
        match status.code() {
            Some(code) if code == Exit::Passed as i32 => Ok(Ending::Completed),
            Some(code) if code == Exit::SafeStop as i32 => Ok(Ending::SafeStop),
            _ => {
                wait_for(&mut self.plant, SAFE_STOP_NS)?;
                Ok(Ending::died(Role::Controller.name(), describe(status)))
            }
        }
    }
}

/// Asks a process to end, and ends it if it does not.
fn end(process: &mut Process, within_ns: u64) -> io::Result<Option<ExitStatus>> {
    process.terminate();
    let status = wait_for(process, within_ns)?;
    if status.is_none() {
        process.kill();
    }
    Ok(status)
}

fn wait_for(process: &mut Process, within_ns: u64) -> io::Result<Option<ExitStatus>> {
    let deadline_ns = clock::now_ns() + within_ns;
    loop {
        let status = process.ended()?;
        if status.is_some() || clock::now_ns() >= deadline_ns {
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
    of_processes.chain(of_latency).map(|line| eprintln!("{line}")).count()
}
