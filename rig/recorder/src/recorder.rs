//! The loop of the recorder: drains the topics into the recording and the live page.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use masseter_model::geometry::Mechanism;
use masseter_recording::{Backlog, Manifest, Pace, Recorder, RunFolder, Scene};
use masseter_runtime::clock;
use masseter_runtime::lifecycle::{ProcessArguments, Start, StopRequest};
use masseter_runtime::lockstep::RecorderSignals;
use masseter_runtime::realtime::scheduling::keep_off;
use masseter_runtime::transport::Domain;
use masseter_terminal::Exit;

use crate::live::{Listener, LiveServer};
use crate::lockstep::InOrder;
use crate::progress::Progress;
use crate::sinks::Sinks;
use crate::stderr_writer::StderrWriter;
use crate::subscribers::Subscribers;
use masseter_machine::SystemRoot;
use masseter_machine::sampler::Sampler;

/// Time between two drains of the topics; a fraction of what their buffers hold.
const DRAIN_INTERVAL: Duration = Duration::from_millis(10);

/// What the supervisor passes to the recorder.
#[derive(Debug, Clone, Args)]
pub struct RecorderArgs {
    #[arg(long)]
    recording: PathBuf,
    /// Duration of the motion, s
    #[arg(long)]
    motion_s: f64,
    /// Address of the live page and the Foxglove server
    #[arg(long)]
    live: Option<SocketAddr>,
    #[arg(long)]
    quiet: bool,
}

/// Records until it is asked to stop, then drains what is left. [`Exit::Incomplete`] if a received message is not in the
/// recording.
pub fn record(process_arguments: &ProcessArguments, args: &RecorderArgs) -> anyhow::Result<Exit> {
    let process = process_arguments.init()?;
    let scenario = &process.scenario;
    let is_lockstep = process.lockstep.is_some();
    if !is_lockstep {
        // The threads started below inherit the cores.
        keep_off(&scenario.realtime.cores);
    }
    let subscribers = Subscribers::open(&process.node)?;
    let scene = Scene::new(&Mechanism::new(&scenario.mechanism)?, &scenario.jaw);
    let listener = args.live.map(Listener::bind).transpose()?;
    let pace = if is_lockstep { Pace::Virtual } else { Pace::RealTime };
    let folder = RunFolder::of_recording(&args.recording);
    let mut recorder = Recorder::of_run(&folder, scene.clone())?;
    let mut signals = is_lockstep.then(|| RecorderSignals::open(&process, DRAIN_INTERVAL)).transpose()?;
    let start = process.ready(None)?;
    recorder.declare(&start.declared)?;
    let backlog = Backlog::start(recorder, pace);
    let domain = Domain::named(&process_arguments.domain)?;
    let serve = |listener| -> anyhow::Result<_> {
        let manifest = Manifest::read(&folder)?;
        Ok(LiveServer::start(listener, manifest, scene, start.declared.clone(), domain)?)
    };
    let server = listener.map(serve).transpose()?;

    let stderr = StderrWriter::start();
    if let Some(server) = &server {
        stderr.write(&format!("live in a browser: {}\n", server.page_url()));
        stderr.write(&format!("live on {} for Foxglove\n", server.url()));
    }
    let progress = (!args.quiet).then(|| Progress::new(args.motion_s, scenario.period_s(), clock::now_ns()));
    let sinks = Sinks { backlog, server, progress, stderr };
    match &mut signals {
        None => record_in_real_time(&process.stop, &start, &subscribers, sinks),
        Some(signals) => record_in_lockstep(&process.stop, signals, &subscribers, sinks),
    }
}

fn record_in_real_time(
    stop: &StopRequest,
    start: &Start,
    subscribers: &Subscribers,
    mut sinks: Sinks,
) -> anyhow::Result<Exit> {
    let loops = start.loops.to_vec();
    let root = SystemRoot::of_this_machine();
    let mut sampler = Sampler::new(root, loops, crate::machine_topic::INTERVAL_NS, start.epoch_ns);
    let mut samples = 0;
    loop {
        let is_last = stop.is_made();
        // One time for a drain takes fewer bytes. But some messages are published during it.
        let mut received_ns = clock::now_ns();
        subscribers.drain(&mut |message| {
            if message.published_ns() > received_ns {
                received_ns = clock::now_ns();
            }
            sinks.write(message, received_ns);
        })?;
        let now_ns = clock::now_ns();
        if let Some(sample) = sampler.sample(now_ns)
            && let Some(machine) = crate::machine_topic::message(samples + 1, &sample)
        {
            samples += 1;
            sinks.write(&machine.into(), clock::now_ns());
        }
        if is_last {
            return Ok(sinks.finish());
        }
        sinks.backlog.hand_over();
        sinks.show_progress(now_ns);
        clock::sleep(DRAIN_INTERVAL);
    }
}

/// The same in simulated time: nothing is lost, because the plant waits for the answers.
fn record_in_lockstep(
    stop: &StopRequest,
    signals: &mut RecorderSignals,
    subscribers: &Subscribers,
    mut sinks: Sinks,
) -> anyhow::Result<Exit> {
    let mut in_order = InOrder::default();
    loop {
        let is_last = stop.is_made();
        let is_asked = !is_last && signals.wait()?;
        subscribers.drain(&mut |message| in_order.add(message))?;
        in_order.drain(is_last, |message| sinks.write(message, message.published_ns()));
        if is_asked {
            signals.answer()?;
        }
        if is_last {
            return Ok(sinks.finish());
        }
        sinks.show_progress(clock::now_ns());
    }
}
