//! `masseter plant`: the emulated drives on real interfaces; or, for the supervisor, the plant's process.

use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::Args;
use masseter_plant::emulation::{Emulator, EmulatorCounters};
use masseter_plant::process::{self, Reason};
use masseter_shared::clock;
use masseter_shared::config::Scenario;
use masseter_shared::lifecycle::{Assignment, StopRequest};
use masseter_shared::realtime::scheduling::{Wanted, obtain};

use crate::arguments::{Wires, parse_wires};

use masseter_terminal::{Exit, result_line, status};

/// What `plant` takes.
#[derive(Debug, Clone, Args)]
pub(crate) struct PlantArgs {
    /// Scenario file with the drives and the mechanism; without one, the published mechanism
    #[arg(value_name = "SCENARIO")]
    file: Option<PathBuf>,
    /// The real interface of each bus, such as can0,can1
    #[arg(long, value_name = "IF[,IF]", value_parser = parse_wires)]
    can: Option<Wires>,
    /// Put the emulated drives on the interfaces, until Ctrl-C
    #[arg(long)]
    emulate: bool,
    #[arg(long, hide = true, requires = "domain")]
    scenario: Option<PathBuf>,
    #[arg(long, hide = true, requires = "scenario")]
    domain: Option<String>,
}

impl PlantArgs {
    /// What the supervisor started the plant with, if it was the supervisor.
    fn assignment(&self) -> Option<Assignment> {
        Some(Assignment { scenario: self.scenario.clone()?, domain: self.domain.clone()? })
    }
}

/// Runs the plant until it is asked to end. As the supervisor's process, it also ends by a safe stop for want of a
/// controller.
pub(crate) fn plant(args: &PlantArgs) -> anyhow::Result<Exit> {
    let Some(assignment) = args.assignment() else {
        emulate(args)?;
        return Ok(Exit::Passed);
    };
    Ok(match process::run(&assignment)? {
        Reason::Asked => Exit::Passed,
        Reason::Abandoned => Exit::SafeStop,
    })
}

fn emulate(args: &PlantArgs) -> anyhow::Result<()> {
    let scenario = resolve(args)?;
    let stop = StopRequest::listen_alone().context("cannot listen for signals")?;
    let emulator = Emulator::open(&scenario, clock::now_ns()).context("the drives cannot be emulated")?;
    let realtime = &scenario.realtime;
    let obtained = obtain(Wanted {
        core: None,
        fifo_priority: Some(realtime.priority),
        locked_memory: realtime.lock_memory,
    });
    obtained.refusals.iter().for_each(|refusal| status!("  plant: {refusal}"));
    status!("six drives on {}, until Ctrl-C", scenario.can.interfaces.join(", "));
    tell(emulator.run(&stop)?)
}

fn resolve(args: &PlantArgs) -> anyhow::Result<Scenario> {
    let scenario = masseter_plan::changed(args.file.as_deref(), |scenario| {
        if let Some(wires) = &args.can {
            scenario.can.interfaces.clone_from(&wires.0);
        }
        Ok(())
    })?;
    if scenario.can.is_virtual() {
        bail!("no interface to put the drives on: name one for each bus, such as --can can0,can1");
    }
    if !args.emulate {
        bail!(
            "a plant without controller only emulates: add --emulate, or drive the robot with `masseter run \
             --can {}`",
            scenario.can.interfaces.join(",")
        );
    }
    Ok(scenario)
}

fn tell(counters: EmulatorCounters) -> anyhow::Result<()> {
    result_line!(
        "received {} frames, sent {}, could not send {}; left out {:.1} ms that the machine was too slow for",
        counters.received,
        counters.sent,
        counters.refused,
        counters.skipped_ns as f64 / 1e6
    )
}
