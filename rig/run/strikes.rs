//! The faults of processes, carried out: killed, stopped for a while, robbed of a core, or without room on the disk.
//!
//! The controller reports when one is due. A fault that cannot be carried out has not struck; the reason is printed.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;

use anyhow::{Context, bail};
use masseter_recording::{ProcessFault, RunFolder};
use masseter_shared::clock;
use masseter_shared::config::{FaultConfig, FaultKindConfig, RealtimeConfig, Scenario};
use masseter_shared::realtime::scheduling::{SchedulingRequest, obtain};
use masseter_terminal::status;
use rustix::process::{Signal, pidfd_send_signal};

use super::child::Process;
use super::controller::Controller;
use super::reports::Due;

/// The faults of a run, and those of processes that have struck.
pub(super) struct Strikes {
    faults: Vec<FaultConfig>,
    realtime: RealtimeConfig,
    recording: PathBuf,
    is_lockstep: bool,
    struck: Vec<ProcessFault>,
}

/// The processes that a fault may act on.
pub(super) struct Victims<'a> {
    pub(super) controller: &'a mut Controller,
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
        while let Some(Due { fault, now_ns }) = victims.controller.due() {
            let Some(config) = self.faults.get(fault) else { continue };
            let struck_ns = if self.is_lockstep { now_ns } else { clock::now_ns() };
            match self.strike(config, victims) {
                Ok(()) => self.struck.push(ProcessFault { number: fault + 1, struck_ns }),
                Err(error) => status!("masseter: fault {} ({config}) did not strike: {error:#}", fault + 1),
            }
            if self.is_lockstep {
                victims.controller.go_on();
            }
        }
    }

    /// The faults that have struck.
    pub(super) fn finish(self) -> Vec<ProcessFault> {
        self.struck
    }

    fn strike(&self, fault: &FaultConfig, victims: &mut Victims<'_>) -> anyhow::Result<()> {
        use FaultKindConfig as Kind;
        let size = Duration::from_secs_f64(fault.size_si());
        match fault.kind {
            Kind::ControllerKill if !victims.controller.kill() => {
                bail!("the rig kills only a controller that it has started: use --controller with its path")
            }
            Kind::ControllerKill => {}
            Kind::PlantKill => victims.plant.kill(),
            Kind::RecorderKill => victims.recorder.kill(),
            Kind::PlantStall => stall(victims.plant, size)?,
            Kind::RecorderStall => stall(victims.recorder, size)?,
            Kind::CoreStall => stall_core(&self.realtime, size)?,
            Kind::DiskFull => fill_disk(&self.recording, victims.recorder)?,
            _ => bail!("it is no fault of a process"),
        }
        Ok(())
    }
}

/// Stops a process; a thread lets it go on after this time.
fn stall(process: &Process, size: Duration) -> io::Result<()> {
    let handle = process.handle()?;
    pidfd_send_signal(&handle, Signal::STOP)?;
    thread::spawn(move || {
        clock::sleep(size);
        // It may have been killed meanwhile.
        let _ = pidfd_send_signal(&handle, Signal::CONT);
    });
    Ok(())
}

/// Keeps the controller's core busy above the priority of the loops.
fn stall_core(realtime: &RealtimeConfig, size: Duration) -> anyhow::Result<()> {
    let request = SchedulingRequest {
        core: Some(realtime.cores[0]),
        fifo_priority: Some(realtime.priority + 1),
        locked_memory: false,
    };
    let (report, reported) = channel();
    thread::spawn(move || {
        let obtained = obtain(request);
        let until_ns = clock::now_ns() + size.as_nanos() as u64;
        let is_granted = obtained.refusals.is_empty();
        let _ = report.send(obtained);
        while is_granted && clock::now_ns() < until_ns {
            std::hint::spin_loop();
        }
    });
    let obtained = reported.recv().context("the thread that takes the core has ended")?;
    obtained.refusals.into_iter().next().map_or(Ok(()), |refusal| Err(anyhow::anyhow!(refusal)))
}

/// Lets the recording grow no further.
fn fill_disk(recording: &Path, recorder: &Process) -> anyhow::Result<()> {
    let length =
        fs::metadata(recording).with_context(|| format!("cannot see {}", recording.display()))?.len();
    recorder.limit_files(length).context("the limit on the size of its files cannot be set")
}
