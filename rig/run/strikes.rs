//! The faults of processes, carried out: killed, stopped for a while, robbed of a core, or without room on the disk.
//!
//! The controller reports when one is due. A fault that cannot be carried out has not struck; the reason is printed.
//! In real time the controller's stall is one of them. In simulated time the plant alone makes it, by withholding the
//! commands.

use std::sync::mpsc::{Receiver, channel};
use std::{os::fd::OwnedFd, thread, time::Duration};

use masseter_recording::{ProcessFault, RunFolder};
use masseter_runtime::realtime::scheduling::{SchedulingRequest, obtain};
use masseter_scenario::{
    CommandFault, FaultConfig, FaultKindConfig, ProcessFault as Kind, RealtimeConfig, Scenario,
};
use rustix::process::{Signal, pidfd_send_signal};

use super::child::{Due, Process, Reports};
use crate::prelude::*;

/// Where the end of a fault is told, ns.
type End = Receiver<u64>;

/// The faults of a run, and those of processes that have struck.
pub(super) struct Strikes {
    faults: Vec<FaultConfig>,
    realtime: RealtimeConfig,
    recording: PathBuf,
    is_lockstep: bool,
    struck: Vec<(ProcessFault, Option<End>)>,
}

/// The processes that a fault may act on.
pub(super) struct Victims<'a> {
    pub(super) controller: &'a mut super::controller::Controller,
    pub(super) plant: &'a mut Process,
    pub(super) recorder: &'a mut Process,
}

impl Strikes {
    pub(super) fn new(scenario: &Scenario, folder: &RunFolder, is_lockstep: bool) -> Self {
        Self {
            faults: scenario.faults.clone(),
            realtime: scenario.realtime,
            recording: folder.recording(),
            is_lockstep,
            struck: Vec::new(),
        }
    }

    /// Carries out every fault that is due.
    pub(super) fn carry_out(&mut self, victims: &mut Victims<'_>) {
        while let Some(Due { fault, now_ns }) = victims.controller.reports().and_then(Reports::due) {
            let Some(config) = self.faults.get(fault) else { continue };
            if self.is_lockstep {
                if config.kind != CommandFault::ControllerStall.into() {
                    self.carry_out_one(fault, now_ns, victims);
                }
                // It may have ended.
                let _ = victims.controller.order(&masseter_runtime::lifecycle::Order::Struck);
            } else {
                self.carry_out_one(fault, clock::now_ns(), victims);
            }
        }
    }

    fn carry_out_one(&mut self, fault: usize, struck_ns: u64, victims: &mut Victims<'_>) {
        let (config, number) = (&self.faults[fault], fault + 1);
        match self.strike(config, victims) {
            Ok(end) => self.struck.push((ProcessFault { number, struck_ns, ended_ns: None }, end)),
            Err(error) => status!("masseter: fault {number} ({config}) did not strike: {error:#}"),
        }
    }

    /// The faults that have struck, once the run is over.
    pub(super) fn into_struck(self) -> Vec<ProcessFault> {
        // Simulated time stands still while a process does.
        let end_ns = |struck_ns, ended_ns| if self.is_lockstep { struck_ns } else { ended_ns };
        let ended = |(fault, end): (ProcessFault, Option<End>)| {
            let ended_ns = end.and_then(|end| end.try_recv().ok());
            ProcessFault { ended_ns: ended_ns.map(|ended_ns| end_ns(fault.struck_ns, ended_ns)), ..fault }
        };
        self.struck.into_iter().map(ended).collect()
    }

    /// Carries out a fault. Returns where its end is told, if it has one.
    fn strike(&self, fault: &FaultConfig, victims: &mut Victims<'_>) -> anyhow::Result<Option<End>> {
        let size = Duration::from_secs_f64(fault.size_si());
        let kind = match fault.kind {
            FaultKindConfig::Process(kind) => kind,
            FaultKindConfig::Command(CommandFault::ControllerStall) => {
                let Some(handle) = victims.controller.handle()? else {
                    bail!("the rig stops only a controller that it has started")
                };
                return stall(handle, size).map(Some);
            }
            FaultKindConfig::Command(_)
            | FaultKindConfig::Bus(_)
            | FaultKindConfig::Encoder(_)
            | FaultKindConfig::Drive(_)
            | FaultKindConfig::Axis(_)
            | FaultKindConfig::Platform(_) => bail!("it is no fault of a process"),
        };
        match kind {
            Kind::ControllerKill if !victims.controller.kill() => {
                bail!("the rig kills only a controller that it has started: use --controller with its path")
            }
            Kind::ControllerKill => {}
            Kind::PlantKill => victims.plant.kill(),
            Kind::RecorderKill => victims.recorder.kill(),
            Kind::PlantStall => return stall(victims.plant.handle()?, size).map(Some),
            Kind::RecorderStall => return stall(victims.recorder.handle()?, size).map(Some),
            Kind::CoreStall => return stall_core(&self.realtime, size).map(Some),
            Kind::DiskFull => fill_disk(&self.recording, victims.recorder)?,
        }
        Ok(None)
    }
}

/// Stops a process; a thread lets it go on after this time.
fn stall(handle: OwnedFd, size: Duration) -> anyhow::Result<End> {
    let (tell, end) = channel();
    pidfd_send_signal(&handle, Signal::STOP)?;
    thread::spawn(move || {
        clock::sleep(size);
        // Told first: the run may end as soon as the process goes on.
        let _ = tell.send(clock::now_ns());
        // It may have been killed meanwhile.
        let _ = pidfd_send_signal(&handle, Signal::CONT);
    });
    Ok(end)
}

/// Keeps the controller's core busy above the priority of the loops.
fn stall_core(realtime: &RealtimeConfig, size: Duration) -> anyhow::Result<End> {
    let request = SchedulingRequest {
        core: Some(realtime.cores[0]),
        fifo_priority: Some(realtime.priority + 1),
        locked_memory: false,
    };
    let ((report, reported), (tell, end)) = (channel(), channel());
    thread::spawn(move || {
        let obtained = obtain(request);
        let until_ns = clock::now_ns() + size.as_nanos() as u64;
        let is_granted = obtained.refusals.is_empty();
        let _ = report.send(obtained);
        while is_granted && clock::now_ns() < until_ns {
            std::hint::spin_loop();
        }
        let _ = tell.send(clock::now_ns());
    });
    let obtained = reported.recv().context("the thread that takes the core has ended")?;
    obtained.refusals.into_iter().next().map_or(Ok(end), |refusal| Err(anyhow::anyhow!(refusal)))
}

/// Lets the recording grow no further.
fn fill_disk(recording: &Path, recorder: &Process) -> anyhow::Result<()> {
    let length =
        fs::metadata(recording).with_context(|| format!("cannot see {}", recording.display()))?.len();
    recorder.limit_files(length).context("the limit on the size of its files cannot be set")
}
