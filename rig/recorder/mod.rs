//! The recorder process: writes every message of a run into the recording, and shows the run's progress.
//!
//! It runs at ordinary priority and off the loops' cores. Where only two cores are left it shares the controller's,
//! because the plant has less time to spare. It computes no figure of the run and judges nothing: analysis does, from
//! the recording.

mod machine_topic;
mod progress;
mod sinks;
mod subscribers;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context;
use clap::Args;
use masseter_recording::{Backlog, Pace, Recorded, Recorder, Scene};
use masseter_shared::clock;
use masseter_shared::geometry::Mechanism;
use masseter_shared::realtime::scheduling::keep_off;
use masseter_shared::transport::secret;
use masseter_terminal::Exit;

use crate::arguments::ProcessArgs;
use crate::foxglove::FoxgloveServer;
use crate::machine::SystemRoot;
use crate::machine::sampler::Sampler;
use crate::stderr_writer::StderrWriter;
use progress::Progress;
use sinks::Sinks;
use subscribers::Subscribers;

/// Time between two drains of the topics; a fraction of what their buffers hold.
const DRAIN_INTERVAL: Duration = Duration::from_millis(10);

/// What the supervisor passes to the recorder.
#[derive(Debug, Clone, Args)]
pub(crate) struct RecorderArgs {
    #[command(flatten)]
    process: ProcessArgs,
    #[arg(long)]
    recording: PathBuf,
    /// Duration of the motion, s
    #[arg(long)]
    motion_s: f64,
    /// Address of the Foxglove server
    #[arg(long)]
    live: Option<SocketAddr>,
    #[arg(long)]
    quiet: bool,
}

/// Records until it is asked to stop, then drains what is left. [`Exit::Incomplete`] if a received message is not in the
/// recording.
pub(crate) fn record(args: RecorderArgs) -> anyhow::Result<Exit> {
    let process_arguments = args.process.process_arguments();
    let process = process_arguments.init()?;
    let scenario = &process.scenario;
    // The threads started below inherit the cores.
    keep_off(&scenario.realtime.cores);
    let subscribers = Subscribers::open(&process.node)?;
    let scene = Scene::new(&Mechanism::new(&scenario.mechanism)?, &scenario.jaw);
    let server = match args.live {
        Some(address) => {
            let secret = secret().context("cannot make the secret of the live address")?;
            Some(FoxgloveServer::start(address, scene.clone(), &process_arguments.domain, secret)?)
        }
        None => None,
    };
    let backlog = Backlog::start(Recorder::create(&args.recording, scene)?, Pace::RealTime);
    let start = process.ready(None)?;

    let stderr = StderrWriter::start();
    if let Some(server) = &server {
        stderr.write(&format!("live on {} for Foxglove\n", server.url()));
    }
    let progress = (!args.quiet).then(|| Progress::new(args.motion_s, scenario.period_s(), start.epoch_ns));
    let mut sinks = Sinks { backlog, server, progress, stderr };
    let loops = start.loops.to_vec();
    let root = SystemRoot::of_this_machine();
    let mut sampler = Sampler::new(root, loops, machine_topic::INTERVAL_NS, start.epoch_ns);
    let mut samples = 0;
    loop {
        let is_last = process.stop.is_made();
        subscribers.drain(&mut sinks)?;
        let now_ns = clock::now_ns();
        if let Some(sample) = sampler.sample(now_ns)
            && let Some(machine) = machine_topic::message(samples + 1, &sample)
        {
            samples += 1;
            sinks.write(&machine, clock::now_ns(), Recorded::Machine);
        }
        if is_last {
            return Ok(sinks.finish());
        }
        sinks.backlog.hand_over();
        sinks.show_progress(now_ns);
        clock::sleep(DRAIN_INTERVAL);
    }
}
