//! The logger's process: drains every topic into the recording and to whoever watches the run.
//!
//! It runs at ordinary priority on no core of its own, beside the controller's where only two are left, since the
//! plant's has less time to spare. It judges nothing: whatever is said of a run is computed from the recording
//! afterwards.

mod machine_watch;
mod screen;
mod view;

use std::net::SocketAddr;
use std::path::Path;
use std::time::Duration;

use masseter_shared::clock;
use masseter_shared::geometry::Mechanism;
use masseter_shared::lifecycle::Assignment;
use masseter_shared::messages::{Command, Event, FrameTap, Message, Reading, State, Truth};
use masseter_shared::realtime::scheduling::keep_off;
use masseter_shared::transport::{BatchInlet, Inlet, Node, TransportError};

use crate::live::{Live, Missed};
use crate::machine::SystemRoot;
use machine_watch::MachineWatch;
use masseter_recording::{Backlog, Pace, Recorded, Recorder, Scene};
use masseter_terminal::Exit;
use screen::Screen;
use view::{Losses, Mode, View};

/// How often the topics are drained; a fraction of what their buffers hold.
const DRAIN: Duration = Duration::from_millis(10);

/// To whom a run is shown while it goes on.
#[derive(Debug, Clone, Copy)]
pub struct Show {
    /// Where Foxglove may watch, if anywhere.
    pub live: Option<SocketAddr>,
    /// Whether standard error is spared the progress.
    pub quiet: bool,
    /// How far the motion will come, s, if that is known.
    pub motion_s: Option<f64>,
}

/// Records until asked to stop, then drains what is left. [`Exit::Incomplete`] when anything that was
/// received is not safe in the recording.
pub fn run(assignment: &Assignment, recording: &Path, show: Show) -> anyhow::Result<Exit> {
    let post = assignment.take_up()?;
    // Before its threads are started.
    keep_off(&post.scenario.realtime.cores);
    let topics = Topics::open(&post.node)?;
    let scene = Scene::new(&Mechanism::new(&post.scenario.mechanism)?, &post.scenario.jaw);
    let live = match show.live {
        Some(address) => Some(Live::start(address, scene.clone(), &assignment.domain)?),
        None => None,
    };
    let backlog = Backlog::start(Recorder::create(recording, scene)?, Pace::RealTime);
    let start = post.ready()?;

    let rates = post.scenario.can.rates()?;
    let view = View::new(Mode::suitable(show.quiet), rates, show.motion_s, start.epoch_ns);
    let mut takers = Takers { backlog, live, view, screen: Screen::start() };
    takers.announce(show.quiet);
    let mut watch = MachineWatch::new(SystemRoot::of_this_machine(), start.loops, start.epoch_ns);
    loop {
        let last = post.stop.is_made();
        topics.drain(&mut takers)?;
        let now_ns = clock::now_ns();
        if let Some(machine) = watch.look(now_ns) {
            takers.take(&machine, clock::now_ns(), Recorded::Machine);
        }
        if last {
            return Ok(takers.end(now_ns));
        }
        takers.backlog.hand_over();
        takers.show(now_ns);
        clock::sleep(DRAIN);
    }
}

/// Who gets what is drained.
struct Takers {
    backlog: Backlog,
    live: Option<Live>,
    view: View,
    screen: Screen,
}

impl Takers {
    fn announce(&self, quiet: bool) {
        if let Some(live) = self.live.as_ref().filter(|_| !quiet) {
            self.screen.say(format!("live on {} for Foxglove\n", live.url()));
        }
    }

    fn take<M: Message>(&mut self, message: &M, now_ns: u64, of_topic: impl Fn(M) -> Recorded) {
        self.backlog.record(message, now_ns);
        if self.live.is_none() && !self.view.looks() {
            return;
        }
        let message = of_topic(*message);
        self.view.take(&message);
        if let Some(live) = &self.live {
            live.offer(&message, now_ns);
        }
    }

    fn losses(&self) -> Losses {
        Losses { lost: self.backlog.dropped(), live: self.live.as_ref().map(Live::watched) }
    }

    /// Shows how the run goes, if it is time to and somebody reads.
    fn show(&mut self, now_ns: u64) {
        if let Some(error) = self.backlog.new_failure() {
            let words = format!("masseter: {error}; the rig goes on, what follows is not recorded\n");
            self.screen.say(words);
            self.view.leave_picture();
        }
        if self.view.is_due(now_ns) && self.screen.is_free() {
            let text = self.view.next(now_ns, self.losses(), screen::rows());
            self.screen.say(text);
        }
    }

    /// Ends what is recorded and shown, and says what either lacks. The recording comes first: whoever watches can
    /// hold up what comes later.
    fn end(mut self, now_ns: u64) -> Exit {
        if let Some(text) = self.view.last(now_ns, self.losses(), screen::rows()) {
            self.screen.say(text);
        }
        let loss = self.backlog.finish().loss();
        if let Some(loss) = &loss {
            self.screen.say(format!("masseter: {loss}\n"));
        }
        if let Some(unseen) = self.live.and_then(|live| unseen(live.finish())) {
            self.screen.say(format!("masseter: {unseen}\n"));
        }
        self.screen.end();
        if loss.is_some() { Exit::Incomplete } else { Exit::Passed }
    }
}

/// What watchers missed in words, if anything.
fn unseen(Missed { dropped, cut_off }: Missed) -> Option<String> {
    let dropped = (dropped > 0)
        .then(|| format!("{dropped} messages were not shown live: their watchers read too slowly"));
    let cut_off = (cut_off > 0).then(|| format!("{cut_off} watchers did not read to the end"));
    let said: Vec<_> = [dropped, cut_off].into_iter().flatten().collect();
    (!said.is_empty()).then(|| said.join("; "))
}

/// One inlet a topic.
struct Topics {
    commands: Inlet<Command>,
    readings: Inlet<Reading>,
    states: Inlet<State>,
    truths: Inlet<Truth>,
    frames: BatchInlet<FrameTap>,
    events: Inlet<Event>,
}

impl Topics {
    fn open(node: &Node) -> Result<Self, TransportError> {
        Ok(Self {
            commands: node.inlet()?,
            readings: node.inlet()?,
            states: node.inlet()?,
            truths: node.inlet()?,
            frames: node.batch_inlet()?,
            events: node.inlet()?,
        })
    }

    fn drain(&self, takers: &mut Takers) -> Result<(), TransportError> {
        drain(&self.commands, takers, Recorded::Command)?;
        drain(&self.readings, takers, Recorded::Reading)?;
        drain(&self.states, takers, Recorded::State)?;
        drain(&self.truths, takers, Recorded::Truth)?;
        drain_batches(&self.frames, takers, Recorded::Frame)?;
        drain(&self.events, takers, Recorded::Event)
    }
}

/// Records what has arrived on one topic; bounded, so that a flood cannot hold the others up. Each message is logged at a
/// time of its own: some are published only while others are drained.
fn drain<M: Message>(
    inlet: &Inlet<M>,
    takers: &mut Takers,
    of_topic: impl Fn(M) -> Recorded,
) -> Result<(), TransportError> {
    for _ in 0..M::DEPTH {
        let Some(message) = inlet.receive()? else { break };
        takers.take(&*message, clock::now_ns(), &of_topic);
    }
    Ok(())
}

/// The same for a topic that travels in batches.
fn drain_batches<M: Message>(
    inlet: &BatchInlet<M>,
    takers: &mut Takers,
    of_topic: impl Fn(M) -> Recorded,
) -> Result<(), TransportError> {
    for _ in 0..M::DEPTH {
        let Some(batch) = inlet.receive()? else { break };
        let now_ns = clock::now_ns();
        batch.iter().for_each(|message| takers.take(message, now_ns, &of_topic));
    }
    Ok(())
}
