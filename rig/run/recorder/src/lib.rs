//! The recorder process: writes every message of a run into the recording, and shows the run's progress.
//!
//! It runs at ordinary priority and off the loops' cores. Where only two cores are left it shares the controller's,
//! because the plant has less time to spare. It judges nothing, and computes figures for the live page
//! only: those of the run come from the recording.

// `println!` panics on a closed terminal, which would end a run: see `masseter_terminal`.
#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod live;
mod sinks;

use std::{collections::VecDeque, net::SocketAddr, path::PathBuf, time::Duration};

use anyhow::Context;
use masseter_machine::counters::{Sample, Sampler};
use masseter_recording::{Backlog, Manifest, Pace, Recorded, Recorder, RunFolder, Scene};
use masseter_runtime::lifecycle::{ProcessArguments, Start, StopRequest};
use masseter_runtime::messages::{
    Command, Contact, Event, FrameTap, LAYOUT_VERSION, Machine, Message, Parameters, Reading, Signals, State,
    Truth,
};
use masseter_runtime::transport::{Domain, FrameSubscriber, Node, Subscriber, Topic, TransportError};
use masseter_runtime::{clock, lockstep::RecorderSignals, named::Declared, realtime::scheduling::keep_off};
use masseter_terminal::{Exit, StderrWriter};

use live::{LiveServer, listen_on};
use sinks::{Progress, Sinks};

/// Time between two drains of the topics; a fraction of what their buffers hold.
const DRAIN_INTERVAL: Duration = Duration::from_millis(10);

/// What the supervisor passes to the recorder.
#[derive(Debug, Clone, clap::Args)]
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

/// Records until it is asked to stop, then drains the rest. [`Exit::Incomplete`] if a received message is not in the
/// recording.
pub fn record(process_arguments: &ProcessArguments, args: &RecorderArgs) -> anyhow::Result<Exit> {
    let process = process_arguments.init()?;
    let scenario = &process.scenario;
    let is_lockstep = process.lockstep.is_some();
    if !is_lockstep {
        // The threads started below inherit the cores.
        keep_off(&scenario.realtime.cores);
    }
    let drains = drains_of_topics(&process.node)?;
    let scene = Scene::new(&masseter_model::geometry::Mechanism::new(&scenario.mechanism)?, &scenario.jaw);
    let listener = args.live.map(listen_on).transpose()?;
    let pace = if is_lockstep { Pace::Virtual } else { Pace::RealTime };
    let folder = RunFolder::of_recording(&args.recording);
    let mut recorder = Recorder::of_run(&folder, scene.clone())?;
    let mut signals = is_lockstep.then(|| RecorderSignals::open(&process, DRAIN_INTERVAL)).transpose()?;
    let start = process.ready(None, Declared::default())?;
    recorder.declare(&start.declared)?;
    let backlog = Backlog::start(recorder, pace);
    let domain = Domain::named(&process_arguments.domain)?;
    let serve = |listener| -> anyhow::Result<_> {
        let manifest = Manifest::read(&folder)?;
        LiveServer::start(listener, manifest, scene, start.declared.clone(), domain).context("the live view")
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
        None => record_in_real_time(&process.stop, &start, &drains, sinks),
        Some(signals) => record_in_lockstep(&process.stop, signals, &drains, sinks),
    }
}

fn record_in_real_time(
    stop: &StopRequest,
    start: &Start,
    drains: &[Drain],
    mut sinks: Sinks,
) -> anyhow::Result<Exit> {
    let loops = start.loops.to_vec();
    let root = masseter_machine::SystemRoot::of_this_machine();
    let mut sampler = Sampler::new(root, loops, MACHINE_INTERVAL_NS, start.epoch_ns);
    let mut samples = 0;
    loop {
        let is_last = stop.is_made();
        // One time for a drain takes fewer bytes. But some messages are published during it.
        let mut received_ns = clock::now_ns();
        let mut distribute = |message: &Recorded| {
            if message.published_ns() > received_ns {
                received_ns = clock::now_ns();
            }
            sinks.distribute(message, received_ns);
        };
        drains.iter().try_for_each(|drain| drain(&mut distribute))?;
        let now_ns = clock::now_ns();
        if let Some(sample) = sampler.sample(now_ns)
            && let Some(machine) = machine_message(samples + 1, &sample)
        {
            samples += 1;
            sinks.distribute(&machine.into(), clock::now_ns());
        }
        if is_last {
            return Ok(sinks.close_all());
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
    drains: &[Drain],
    mut sinks: Sinks,
) -> anyhow::Result<Exit> {
    let mut in_order = InOrder::default();
    loop {
        let is_last = stop.is_made();
        let is_asked = !is_last && signals.wait()?;
        drains.iter().try_for_each(|drain| drain(&mut |message| in_order.add_arrived(message)))?;
        in_order.drain_complete(is_last, |message| sinks.distribute(message, message.published_ns()));
        if is_asked {
            signals.answer()?;
        }
        if is_last {
            return Ok(sinks.close_all());
        }
        sinks.show_progress(clock::now_ns());
    }
}

/// Drains one topic: hands everything that has arrived to a sink.
type Drain = Box<dyn Fn(&mut dyn FnMut(&Recorded)) -> Result<(), TransportError>>;

/// One for each topic. Readings come first: all that was published before the last of them follows in the same drain.
fn drains_of_topics(node: &Node) -> Result<Vec<Drain>, TransportError> {
    Ok(vec![
        drain_of::<Reading>(node)?,
        drain_of::<Command>(node)?,
        drain_of::<State>(node)?,
        drain_of::<Signals>(node)?,
        drain_of::<Parameters>(node)?,
        drain_of::<Truth>(node)?,
        drain_of::<Contact>(node)?,
        drain_of_frames(node)?,
        drain_of::<Event>(node)?,
    ])
}

/// Drains at most a queue's length, so that a flood cannot delay the other topics.
fn drain_of<M: Topic + Into<Recorded> + 'static>(node: &Node) -> Result<Drain, TransportError> {
    let subscriber = Subscriber::<M>::open(node)?;
    Ok(Box::new(move |take| {
        for _ in 0..M::DEPTH {
            let Some(message) = subscriber.receive()? else { break };
            take(&(*message).into());
        }
        Ok(())
    }))
}

/// The same for a topic that travels in batches.
fn drain_of_frames(node: &Node) -> Result<Drain, TransportError> {
    let subscriber = FrameSubscriber::open(node)?;
    Ok(Box::new(move |take| {
        for _ in 0..FrameTap::DEPTH {
            let Some(batch) = subscriber.receive()? else { break };
            batch.iter().for_each(|&frame| take(&frame.into()));
        }
        Ok(())
    }))
}

/// Time between two messages of the topic `machine`, ns.
const MACHINE_INTERVAL_NS: u64 = 100_000_000;

/// The message of the topic `machine` from a sample of controller and plant; none once one of them has ended.
fn machine_message(seq: u64, sample: &Sample) -> Option<Machine> {
    let [Some(controller), Some(plant)] = sample.processes[..] else { return None };
    let loops = [controller, plant];
    Some(Machine {
        seq,
        published_ns: sample.time_ns,
        version: LAYOUT_VERSION,
        time_ns: sample.time_ns,
        stolen_ns: sample.stolen_ns.unwrap_or(0),
        involuntary_switches: loops.map(|counters| counters.involuntary_switches),
        page_faults: loops.map(|counters| counters.minor_faults + counters.major_faults),
    })
}

/// The publishers of a run.
const LANES: usize = 10;

/// The order of the messages of a run in lockstep: that in which virtual time records them.
///
/// All messages of a cycle have arrived once the next reading has. They are ordered by their stamps; those with the same
/// stamp, by their publishers.
#[derive(Debug, Default)]
struct InOrder {
    /// Those of each publisher, oldest first; publishers in the order of their work.
    lanes: [VecDeque<Recorded>; LANES],
    /// When the newest reading was published, ns: everything older is there.
    complete_before_ns: u64,
}

impl InOrder {
    /// Adds a message that has arrived.
    fn add_arrived(&mut self, message: &Recorded) {
        let lane = match message {
            Recorded::Reading(reading) => {
                self.complete_before_ns = reading.published_ns;
                0
            }
            Recorded::Truth(_) => 1,
            Recorded::Contact(_) => 2,
            Recorded::Command(_) => 3,
            Recorded::State(_) => 4,
            Recorded::Signals(_) => 5,
            Recorded::Parameters(_) => 6,
            Recorded::Event(event) if event.is_of_controller() => 7,
            Recorded::Frame(_) => 8,
            Recorded::Event(_) | Recorded::Machine(_) => 9,
        };
        self.lanes[lane].push_back(*message);
    }

    /// Hands out, in order, the messages of complete cycles, or all of them at the end.
    fn drain_complete(&mut self, is_last: bool, mut take: impl FnMut(&Recorded)) {
        let before_ns = if is_last { u64::MAX } else { self.complete_before_ns };
        let stamp = |lane: &VecDeque<Recorded>| lane.front().map_or(u64::MAX, Recorded::published_ns);
        // The first of equals.
        while let Some(lane) = self.lanes.iter_mut().min_by_key(|lane| stamp(lane))
            && stamp(lane) < before_ns
            && let Some(message) = lane.pop_front()
        {
            take(&message);
        }
    }
}

#[cfg(test)]
mod tests {
    use masseter_machine::counters::Counters;
    use masseter_runtime::messages::codes::Source;

    use super::*;

    #[test]
    fn a_message_holds_the_counters_of_both_loops_while_both_run() {
        let counters = |involuntary_switches, minor_faults| Counters {
            involuntary_switches,
            minor_faults,
            major_faults: 1,
            ..Counters::default()
        };
        let processes = vec![Some(counters(3, 100)), Some(counters(4, 200))];
        let mut sample = Sample { time_ns: 1000, stolen_ns: Some(25), processes };
        let machine = machine_message(2, &sample).unwrap();
        assert_eq!((machine.seq, machine.time_ns, machine.stolen_ns), (2, 1000, 25));
        assert_eq!((machine.involuntary_switches, machine.page_faults), ([3, 4], [101, 201]));
        sample.processes[1] = None;
        assert_eq!(machine_message(3, &sample), None);
    }

    fn stamped<M: Message + Into<Recorded>>(mut message: M, published_ns: u64) -> Recorded {
        message.stamp(1, published_ns);
        message.into()
    }

    #[test]
    fn messages_of_complete_cycles_come_in_the_order_of_virtual_time() {
        let of_controller = Event { source: Source::Controller.code(), ..Event::default() };
        let of_plant = Event { source: Source::Master.code(), ..Event::default() };
        let cycle = |start_ns: u64| {
            [
                stamped(Reading::default(), start_ns + 5),
                stamped(Truth::default(), start_ns + 5),
                stamped(Contact::default(), start_ns + 5),
                stamped(Command::default(), start_ns + 6),
                stamped(State::default(), start_ns + 6),
                stamped(of_controller, start_ns + 6),
                stamped(FrameTap::default(), start_ns + 6),
                stamped(of_plant, start_ns + 6),
            ]
        };
        let [first, second] = [cycle(0), cycle(10)];
        let mut in_order = InOrder::default();
        // Topic by topic, the events in any order of their publishers.
        for place in [0, 3, 4, 1, 2, 6, 7, 5] {
            in_order.add_arrived(&first[place]);
            in_order.add_arrived(&second[place]);
        }
        let drained = |in_order: &mut InOrder, is_last| {
            let mut drained = Vec::new();
            in_order.drain_complete(is_last, |message| drained.push(*message));
            drained
        };
        assert_eq!(drained(&mut in_order, false), first);
        assert_eq!(drained(&mut in_order, false), []);
        assert_eq!(drained(&mut in_order, true), second);
    }
}
