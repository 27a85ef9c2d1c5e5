//! Starts the three processes, monitors them, stops them in order, and removes their shared memory.
//!
//! Order of ending: the controller first (it brings the drives to rest), then the plant, then the recorder, which
//! drains the rest. A process that dies is not restarted: the rig ends in that order, and the watchdogs of the
//! other processes stop the drives. A process that does not end in time is killed. So is a controller that hangs or waits
//! for ever, which the plant detects. The supervisor reads no message of the run and judges nothing.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io;
use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;
use std::time::Duration;

use masseter_machine::{SystemRoot, dma_latency};
use masseter_recorder::live::ReportServer;
use masseter_recording::{DmaLatency, Ending, RunUsage};
use masseter_runtime::clock::{MILLISECOND_NS, SECOND_NS};
use masseter_runtime::lifecycle::attach::Invitation;
use masseter_runtime::lifecycle::{End, Order, Party, Patience, Silence, Start};
use masseter_runtime::lockstep;
use masseter_runtime::named::Declared;
use masseter_runtime::schedule::OFF_TICK_NS;
use masseter_runtime::transport::{Domain, DomainError, DomainLock, Swept};
use masseter_virtual_time::Requests;

use super::child::{CONTROLLER, KILLED, PLANT, Process, RECORDER, Reports, describe};
use super::controller::Controller;
use super::interrupts::Interrupts;
use super::loop_watch::LoopWatch;
use super::request::{ControllerChoice, RunRequest};
use super::strikes::{Strikes, Victims};
use crate::prelude::*;

/// Polling interval of the processes.
const POLL: Duration = Duration::from_millis(2);
/// Longest delay between two processes that receive the same signal of a terminal.
const SIGNAL_DELAY: Duration = Duration::from_millis(100);
/// Time from the start message to the first SYNC, ns.
const START_LEAD_NS: u64 = 100_000_000;
/// Longest time for a process to end after SIGTERM, beyond the work it must finish first, ns.
const END_TIMEOUT_NS: u64 = 5 * SECOND_NS;
/// The same for the plant, which stops the drives and runs on for a while first; in lockstep as fast as the recorder takes it, ns.
const PLANT_END_TIMEOUT_NS: u64 = 3 * END_TIMEOUT_NS;
/// Longest time for the recorder to write the rest to a slow disk, ns.
const RECORD_TIMEOUT_NS: u64 = 60 * SECOND_NS;
/// The cause of death of a process that did not end when it was asked to.
const NOT_ENDED: &str = "it did not end when it was asked to";
/// The cause of death of a controller whose commands stopped.
const SILENT: &str = "it stopped sending commands";
/// Time for the plant to stop the drives once its master has detected the controller's death, ns.
const SAFE_STOP_NS: u64 = SECOND_NS / 2;
/// Claims, each with names that cannot be guessed, until a rig whose names another user takes is given up.
const NAMES: u32 = 4;

/// Sweeps the domains of killed runs, and reserves the domain `name`, or one with a unique name.
///
/// # Errors
/// When a running rig has the name, or shared memory cannot be used. A file that cannot be removed is no error.
pub(super) fn reserve_domain(name: Option<&str>) -> Result<(Domain, DomainLock), DomainError> {
    for domain in Domain::all()? {
        report_remaining(&domain.sweep()?.unwrap_or_default());
    }
    let unique = || format!("{}-{:x}", std::process::id(), clock::now_ns());
    let domain = Domain::named(&name.map_or_else(unique, str::to_owned))?;
    let claim = domain.claim()?;
    Ok((domain, claim))
}

/// Runs the rig in real time or in lockstep, then releases its domain. Enters the circumstances and the ending into
/// the manifest. Returns the server for the report, where somebody watches.
pub(super) fn run(
    (domain, mut claim): (Domain, DomainLock),
    plan: &RunPlan,
    folder: &RunFolder,
    request: &RunRequest,
    manifest: &mut Manifest,
    interrupts: &Interrupts,
) -> Result<Option<ReportServer>, Failure> {
    let mut names_left = NAMES;
    let prepared = loop {
        let prepared = Processes::prepare(plan, folder, &domain, request, interrupts);
        names_left -= 1;
        let squatter = domain.foreign_file().ok().flatten().filter(|_| names_left > 0);
        let (Err(failure), Some(path)) = (&prepared, squatter) else { break prepared };
        status!(
            "masseter: {:#}; another user has made {}: trying other names",
            failure.error,
            path.display()
        );
        drop(claim);
        claim = domain.claim().usage()?;
        // The processes that have not started have recorded nothing.
        let _ = fs::remove_file(folder.recording());
    };
    let result = prepared.and_then(|prepared| match prepared {
        Some((mut processes, scheduling)) => {
            manifest.scheduling = scheduling;
            manifest.declared = processes.declared.clone();
            // The supervisor may be killed: a report of the recorded messages then needs the names.
            manifest.write(folder).context("cannot write the manifest").incomplete()?;
            let ending = match request.lockstep() {
                None => processes.run(plan, request.require_rt, interrupts, manifest),
                Some(_) => processes.run_in_lockstep(interrupts),
            };
            manifest.process_faults = processes.strikes.into_struck();
            ending.died()
        }
        None => Ok(Ending::Interrupted),
    });
    let report_server = ReportServer::take_over(&domain);
    drop(claim);
    match domain.sweep() {
        Ok(swept) => report_remaining(&swept.unwrap_or_default()),
        Err(error) => status!("masseter: {error}; 'masseter clean' removes the rest of this run"),
    }
    manifest.ending = result?;
    Ok(report_server)
}

fn report_remaining(swept: &Swept) {
    swept.remaining.iter().for_each(|error| status!("masseter: {error}"));
}

/// What the kernel granted each process.
type Scheduling = BTreeMap<String, masseter_runtime::realtime::scheduling::Obtained>;

/// The three processes, in the order of their start.
struct Processes {
    /// Longest time for the controller to end after SIGTERM, ns.
    stop_timeout_ns: u64,
    /// Time for the plant to stop the drives without the controller, ns.
    plant_alone_ns: u64,
    is_lockstep: bool,
    strikes: Strikes,
    /// The signals and parameters of the controller, once the controller is ready.
    declared: Declared,
    recorder: Process,
    plant: Process,
    controller: Controller,
}

impl Processes {
    fn spawn(
        plan: &RunPlan,
        folder: &RunFolder,
        domain: &Domain,
        request: &RunRequest,
    ) -> anyhow::Result<Self> {
        let mut common: Vec<OsString> =
            vec!["--scenario".into(), folder.scenario().into(), "--domain".into(), domain.id().into()];
        let lockstep = request.lockstep();
        common.extend(lockstep.map(|patience| format!("--lockstep={}", patience_text(patience)).into()));
        let with = |more: Vec<OsString>| [common.clone(), more].concat();
        let motion: OsString = format!("--motion-s={}", plan.trajectory.duration_s()).into();
        let has_controller = request.controller != ControllerChoice::None;
        let plant_arguments = with(has_controller.then(|| motion.clone()).into_iter().collect());
        let mut recorder_arguments = with(vec!["--recording".into(), folder.recording().into(), motion]);
        recorder_arguments.extend(request.quiet.then(|| "--quiet".into()));
        recorder_arguments.extend(request.live.map(|address| format!("--live={address}").into()));
        let invitation = Invitation::new(std::path::absolute(folder.scenario())?, lockstep);
        let Scenario { controller, can, .. } = &plan.scenario;
        // It stops the motion, holds it, and switches the drives off.
        let stop_s = controller.stop_ramp_s + controller.hold_s + controller.start_timeout_s;
        Ok(Self {
            stop_timeout_ns: ((stop_s * 1e9) as u64).saturating_add(END_TIMEOUT_NS),
            plant_alone_ns: match lockstep {
                None => u64::from(can.command_timeout_cycles) * plan.scenario.period_ns() + SAFE_STOP_NS,
                // It waits for the controller until it is asked to end, and then stops the drives.
                Some(_) => 0,
            },
            is_lockstep: lockstep.is_some(),
            strikes: Strikes::new(&plan.scenario, folder, lockstep.is_some()),
            declared: Declared::default(),
            recorder: Process::spawn(RECORDER, &recorder_arguments)?,
            plant: Process::spawn(PLANT, &plant_arguments)?,
            controller: Controller::start_process(
                &request.controller,
                domain,
                invitation,
                common,
                plan.trajectory.duration_s(),
            )?,
        })
    }

    /// The processes, ready to start, with the scheduling of each; none if the user interrupts before.
    fn prepare(
        plan: &RunPlan,
        folder: &RunFolder,
        domain: &Domain,
        request: &RunRequest,
        interrupts: &Interrupts,
    ) -> Result<Option<(Self, Scheduling)>, Failure> {
        let mut processes = Self::spawn(plan, folder, domain, request).died()?;
        let Some(scheduling) = processes.wait_ready(interrupts).died()? else { return Ok(None) };
        domain.make_private().usage()?;
        super::room::reserve_shared_memory(domain).usage()?;
        Ok(Some((processes, scheduling)))
    }

    fn run(
        &mut self,
        plan: &RunPlan,
        require_rt: bool,
        interrupts: &Interrupts,
        manifest: &mut Manifest,
    ) -> anyhow::Result<Ending> {
        let is_virtual = masseter_machine::is_virtual(&SystemRoot::of_this_machine());
        let hold = dma_latency::Hold::new(plan.scenario.realtime.cpu_dma_latency, is_virtual);
        manifest.cpu_dma_latency = Some(hold.obtained.clone());
        let refusals = print_refusals(&manifest.scheduling, &hold.obtained);
        if require_rt && refusals > 0 {
            status!(
                "masseter: --require-rt: the kernel did not grant real time, so the motion was not started"
            );
            return Ok(Ending::NotStarted);
        }
        let epoch_ns = next_epoch_ns(plan.scenario.period_ns());
        self.start(epoch_ns)?;
        let names_and_ids =
            [(RECORDER, self.recorder.id()), (PLANT, self.plant.id()), (CONTROLLER, self.controller.id())];
        let mut meter = super::usage::UsageMeter::new(epoch_ns, &names_and_ids);
        let (root, period_ns) = (SystemRoot::of_this_machine(), plan.scenario.period_ns());
        let mut loops = LoopWatch::new(root, is_virtual, period_ns, epoch_ns, &names_and_ids[1..]);
        let ending = self.monitor(interrupts, |now_ns| {
            loops.update(now_ns);
            meter.update(now_ns);
        })?;
        manifest.usage = RunUsage { loops: loops.into_intervals(), ..meter.into_usage() };
        Ok(ending)
    }

    fn run_in_lockstep(&mut self, interrupts: &Interrupts) -> anyhow::Result<Ending> {
        self.start(lockstep::EPOCH_NS)?;
        self.monitor(interrupts, |_| ())
    }

    /// The scheduling of each process once all are ready; none if the user interrupts before.
    fn wait_ready(&mut self, interrupts: &Interrupts) -> anyhow::Result<Option<Scheduling>> {
        self.collect_ready(interrupts).or_else(|error| {
            // Ctrl-C also reaches the processes, and may have ended one before the supervisor sees it.
            clock::sleep(SIGNAL_DELAY);
            if interrupts.is_stop_requested() { Ok(None) } else { Err(error) }
        })
    }

    fn collect_ready(&mut self, interrupts: &Interrupts) -> anyhow::Result<Option<Scheduling>> {
        let Self { recorder, plant, controller, declared, .. } = self;
        let is_cancelled = || interrupts.is_stop_requested();
        let mut scheduling = BTreeMap::new();
        for process in [&mut *recorder, &mut *plant] {
            let Some(ready) = process.wait_ready(is_cancelled)? else { return Ok(None) };
            scheduling.insert(process.role.to_owned(), ready.scheduling);
        }
        if !controller.is_awaited() {
            return Ok(Some(scheduling));
        }
        // A user may take long to start a controller.
        let has_died = || [&mut *recorder, &mut *plant].into_iter().find_map(Process::death);
        let Some(ready) = controller.wait_ready(is_cancelled, has_died)? else { return Ok(None) };
        scheduling.insert(CONTROLLER.to_owned(), ready.scheduling);
        *declared = ready.declared;
        Ok(Some(scheduling))
    }

    /// Sends the start message with the time of the first SYNC, ns.
    fn start(&mut self, epoch_ns: u64) -> io::Result<()> {
        let loops = [self.controller.id(), self.plant.id()];
        let start = Order::Start(Start { epoch_ns, loops, declared: self.declared.clone() });
        self.recorder.order(&start)?;
        self.plant.order(&start)?;
        self.controller.order(&start)
    }

    /// Monitors the processes until the controller has ended, then ends plant and recorder. Calls `at` with the time.
    fn monitor(&mut self, interrupts: &Interrupts, mut at: impl FnMut(u64)) -> anyhow::Result<Ending> {
        let mut interruption = None;
        let mut give_up_ns = None;
        let end_of_controller = loop {
            if interrupts.is_abort_requested() {
                return Ok(Ending::Interrupted);
            }
            self.strike();
            // The others first: if one has ended and the controller has not, the controller is not the cause.
            let others = [self.recorder.exit_status()?, self.plant.exit_status()?];
            let end = self.controller.end()?;
            if interruption.is_none() {
                let has_left = end.is_some() || self.controller.has_left();
                interruption = self.interrupt_controller(interrupts, others, has_left);
            }
            if let Some(end) = end {
                break end;
            }
            let now_ns = clock::now_ns();
            let give_up_after_ns = now_ns.saturating_add(self.stop_timeout_ns);
            if interruption.is_some() && now_ns > *give_up_ns.get_or_insert(give_up_after_ns) {
                let fate = self.controller.give_up();
                break End::Failed { reason: format!("{NOT_ENDED}, and {fate}") };
            }
            at(now_ns);
            clock::sleep(POLL);
        };
        let controller = self.controller_ending(end_of_controller, interrupts)?;
        let plant = self.plant.end(PLANT_END_TIMEOUT_NS, interrupts)?;
        let recorder = self.recorder.end(RECORD_TIMEOUT_NS, interrupts)?;
        if interrupts.is_abort_requested() {
            return Ok(Ending::Interrupted);
        }
        Ok(ending_of_run(interruption, controller, ending_by_plant_or_recorder(plant, recorder)))
    }

    /// Carries out the faults of processes that are due.
    fn strike(&mut self) {
        let Self { strikes, controller, plant, recorder, .. } = self;
        strikes.carry_out(&mut Victims { controller, plant, recorder });
    }

    /// Asks the controller to end if the user interrupts, or another process was silent or has ended; returns that
    /// ending. Where the controller has left, the others miss it: only one that was killed has an ending of its own.
    fn interrupt_controller(
        &mut self,
        interrupts: &Interrupts,
        [recorder, plant]: [Option<ExitStatus>; 2],
        has_left: bool,
    ) -> Option<Ending> {
        let is_killed = |status: &ExitStatus| status.signal().is_some();
        let ending = if interrupts.is_stop_requested() {
            Ending::Interrupted
        } else if let Some(ending) = self.end_silent(has_left) {
            ending
        } else if has_left && ![recorder, plant].iter().flatten().any(is_killed) {
            return None;
        } else if recorder.is_some() {
            if self.is_lockstep {
                // It would wait for the recorder.
                self.plant.terminate();
            }
            died(RECORDER, recorder)
        } else if let Some(status) = plant {
            if is_overdue(status) {
                self.controller.give_up();
                return Some(Ending::Overdue);
            }
            if status.code() == Some(Exit::SafeStop as i32) {
                let fate = self.controller.give_up();
                return Some(Ending::died(CONTROLLER, format!("{SILENT}, and {fate}")));
            }
            died(PLANT, Some(status))
        } else {
            return None;
        };
        self.controller.terminate();
        Some(ending)
    }

    /// Kills the first process that was reported to be silent in lockstep, if any. Were it stopped and went on, it
    /// would find the others silent. `has_left`: whether the controller has ended by itself.
    fn end_silent(&mut self, has_left: bool) -> Option<Ending> {
        if !self.is_lockstep {
            return None;
        }
        let of_controller = self.controller.reports().and_then(Reports::silence);
        // Without the controller the recorder may have nothing to answer.
        let of_plant = self.plant.reports.silence();
        let of_plant = of_plant.filter(|of| of.process != Party::Recorder || !has_left);
        let Silence { process, cycle, silent_s } = of_controller.or(of_plant)?;
        let fate = match process {
            Party::Controller => self.controller.give_up(),
            Party::Plant => self.plant.give_up(),
            Party::Recorder => self.recorder.give_up(),
        };
        let how = format!("it did not answer in cycle {cycle} for {silent_s:.1} s (--patience), and {fate}");
        Some(Ending::died(process.name(), how))
    }

    /// The controller's ending. If it died, waits for the plant's master to stop the drives.
    fn controller_ending(&mut self, end: End, interrupts: &Interrupts) -> io::Result<Ending> {
        if let Some(ending) = self.end_silent(matches!(end, End::Failed { .. })) {
            return Ok(ending);
        }
        let reason = match end {
            End::Finished => return Ok(Ending::Completed),
            End::SafeStop => return Ok(Ending::SafeStop),
            End::Failed { reason } => reason,
        };
        self.plant.await_end(self.plant_alone_ns, interrupts)?;
        Ok(Ending::died(CONTROLLER, reason))
    }
}

/// The time of the first SYNC in real time, ns.
fn next_epoch_ns(period_ns: u64) -> u64 {
    let earliest = clock::now_ns() + START_LEAD_NS;
    earliest.next_multiple_of(MILLISECOND_NS.max(period_ns)) + OFF_TICK_NS.min(period_ns / 4)
}

/// Prints what the kernel refused; returns the number of refusals.
fn print_refusals(scheduling: &Scheduling, latency: &DmaLatency) -> usize {
    let of_processes = scheduling.iter().flat_map(|(name, obtained)| {
        obtained.refusals.iter().map(move |refusal| format!("  {name}: {refusal}"))
    });
    let of_latency = latency.refusal.iter().map(|refusal| format!("  {refusal}"));
    of_processes.chain(of_latency).map(|line| status!("{line}")).count()
}

/// The patience as the command line reads it.
fn patience_text(Patience(patience): Patience) -> String {
    patience.map_or_else(|| "none".to_owned(), |patience| humantime::format_duration(patience).to_string())
}

/// The ending of the run: the first death of a process, else an incomplete recording, else the interruption, else the
/// controller's ending.
fn ending_of_run(interruption: Option<Ending>, controller: Ending, others: Option<Ending>) -> Ending {
    match (interruption, controller, others) {
        (Some(first @ (Ending::Died { .. } | Ending::Overdue)), ..) | (_, first @ Ending::Died { .. }, _) => {
            first
        }
        (_, _, Some(others)) => others,
        (Some(interruption), _, None) => interruption,
        (None, controller, None) => controller,
    }
}

/// The ending that plant or recorder cause, if any. None as a status means that the process was killed.
fn ending_by_plant_or_recorder(plant: Option<ExitStatus>, recorder: Option<ExitStatus>) -> Option<Ending> {
    if plant.is_some_and(is_overdue) {
        return Some(Ending::Overdue);
    }
    if !plant.is_some_and(|status| status.success()) {
        return Some(died(PLANT, plant));
    }
    match recorder.and_then(|status| status.code()) {
        Some(code) if code == Exit::Passed as i32 => None,
        Some(code) if code == Exit::Incomplete as i32 => Some(Ending::RecordingFailed),
        _ => Some(died(RECORDER, recorder)),
    }
}

/// Whether the plant ended the run of a controller that waits for ever.
fn is_overdue(plant: ExitStatus) -> bool {
    plant.code() == Some(Exit::Failed as i32)
}

fn died(role: &str, status: Option<ExitStatus>) -> Ending {
    let how = status.map_or_else(|| format!("{NOT_ENDED}, and {KILLED}"), describe);
    Ending::died(role, how)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_death_outranks_an_incomplete_recording_then_an_interruption_then_a_safe_stop() {
        let died = |role| Ending::died(role, "SIGKILL (9)".to_owned());
        let (recorder, plant, controller) = (died(RECORDER), died(PLANT), died("controller"));
        let (completed, interrupted, safe_stop) = (Ending::Completed, Ending::Interrupted, Ending::SafeStop);
        let (gap, overdue) = (Ending::RecordingFailed, Ending::Overdue);
        for (interruption, by_controller, others, expected) in [
            (None, &completed, None, &completed),
            (None, &safe_stop, None, &safe_stop),
            (None, &safe_stop, Some(&gap), &gap),
            (None, &controller, Some(&gap), &controller),
            (Some(&interrupted), &completed, None, &interrupted),
            (Some(&interrupted), &safe_stop, None, &interrupted),
            (Some(&interrupted), &completed, Some(&gap), &gap),
            (Some(&interrupted), &completed, Some(&plant), &plant),
            (Some(&interrupted), &controller, Some(&plant), &controller),
            (Some(&recorder), &controller, Some(&plant), &recorder),
            (Some(&overdue), &controller, Some(&overdue), &overdue),
            (None, &completed, Some(&overdue), &overdue),
        ] {
            let found = ending_of_run(interruption.cloned(), by_controller.clone(), others.cloned());
            assert_eq!(&found, expected, "{interruption:?}, {by_controller:?}, {others:?}");
        }
    }
}
