//! `masseter plant`: the emulated drives on real CAN interfaces; with the supervisor's hidden arguments, the plant's
//! process.

use masseter_plant::emulation::{Emulator, EmulatorCounters};
use masseter_plant::process::{self, Reason};
use masseter_runtime::realtime::scheduling::{SchedulingRequest, obtain};

use super::arguments::{ProcessArgs, Wires, parse_wires};
use crate::prelude::*;

/// The arguments of `plant`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  masseter plant --emulate --can can0,can1")]
pub(super) struct PlantArgs {
    /// Scenario file with drives and mechanism [default: the built-in scenario]
    #[arg(value_name = "SCENARIO")]
    file: Option<PathBuf>,
    /// CAN interface of each bus, such as can0,can1
    #[arg(long, value_name = "IF[,IF]", value_parser = parse_wires)]
    can: Option<Wires>,
    /// Connect the emulated drives to the interfaces, until Ctrl-C
    #[arg(long)]
    emulate: bool,
    #[command(flatten)]
    process: Option<ProcessArgs>,
    /// Duration of the controller's motion, s
    #[arg(long, hide = true, requires = "domain")]
    motion_s: Option<f64>,
}

/// Emulates until Ctrl-C, or runs as the supervisor's process until asked to end. That process also ends, by a safe
/// stop, when commands stop arriving, or the controller waits for ever.
pub(super) fn plant(args: PlantArgs) -> anyhow::Result<Exit> {
    let Some(process) = args.process else {
        emulate(&args)?;
        return Ok(Exit::Passed);
    };
    Ok(match process::run(&process.process_arguments(), args.motion_s)? {
        Reason::Requested => Exit::Passed,
        Reason::Abandoned => Exit::SafeStop,
        Reason::Overdue => Exit::Failed,
    })
}

fn emulate(args: &PlantArgs) -> anyhow::Result<()> {
    let scenario = resolve(args)?;
    let stop =
        masseter_runtime::lifecycle::StopRequest::listen_alone().context("cannot listen for signals")?;
    let emulator = Emulator::open(&scenario, clock::now_ns()).context("the drives cannot be emulated")?;
    let realtime = &scenario.realtime;
    let obtained = obtain(SchedulingRequest {
        core: None,
        fifo_priority: Some(realtime.priority),
        locked_memory: realtime.lock_memory,
    });
    obtained.refusals.iter().for_each(|refusal| status!("  plant: {refusal}"));
    status!("emulating six drives on {}; stop with Ctrl-C", scenario.can.interfaces.join(", "));
    print_counters(emulator.run(&stop)?)
}

fn resolve(args: &PlantArgs) -> anyhow::Result<Scenario> {
    let scenario = masseter_plan::read_scenario_with(args.file.as_deref(), |scenario| {
        if let Some(wires) = &args.can {
            scenario.can.interfaces.clone_from(&wires.0);
        }
        Ok(())
    })?;
    if scenario.can.is_virtual() {
        bail!("the emulated drives need an interface for each bus, such as --can can0,can1");
    }
    if !args.emulate {
        bail!(
            "this verb only emulates drives: add --emulate; to drive a robot, use 'masseter run --can {}'",
            scenario.can.interfaces.join(",")
        );
    }
    Ok(scenario)
}

fn print_counters(counters: EmulatorCounters) -> anyhow::Result<()> {
    result_line!(
        "received {} frames, sent {}, failed to send {}; skipped {:.1} ms of emulated time, since the machine was too slow",
        counters.received,
        counters.sent,
        counters.refused,
        counters.skipped_ns as f64 / 1e6
    )
}
