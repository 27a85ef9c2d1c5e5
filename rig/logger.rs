//! The logger's process: drains every topic into the recording and shows how the run goes.
//!
//! It runs at ordinary priority on no core of its own, and judges nothing: whatever is said of a run
//! is computed from the recording afterwards.

mod view;

use std::path::Path;
use std::time::Duration;

use masseter_shared::clock;
use masseter_shared::geometry::Mechanism;
use masseter_shared::lifecycle::Assignment;
use masseter_shared::messages::{Command, Event, FrameTap, Message, Reading, State, Truth};
use masseter_shared::transport::{Inlet, Node, TransportError};

use crate::exit::Exit;
use crate::recording::{Backlog, Pace, Recorded, Recorder, Scene};
use view::{Mode, View};

/// How often the topics are drained; a fraction of what their buffers hold.
const DRAIN: Duration = Duration::from_millis(10);

/// Records until asked to stop, then drains what is left. [`Exit::Incomplete`] when anything that was
/// received is not safe in the recording.
pub fn run(assignment: &Assignment, recording: &Path, quiet: bool) -> anyhow::Result<Exit> {
    let post = assignment.take_up()?;
    let topics = Topics::open(&post.node)?;
    let scene = Scene::new(&Mechanism::new(&post.scenario.mechanism)?, &post.scenario.jaw);
    let mut backlog = Backlog::start(Recorder::create(recording, scene)?, Pace::RealTime);
    let start = post.ready()?;

    let mut view = View::new(Mode::suitable(quiet), post.scenario.can.rates()?, start.epoch_ns);
    loop {
        let last = post.stop.is_made();
        let now_ns = clock::now_ns();
        topics.drain(&mut backlog, now_ns, &mut view)?;
        if last {
            return Ok(end(backlog));
        }
        backlog.hand_over();
        view.show(now_ns, backlog.dropped());
        clock::sleep(DRAIN);
    }
}

/// Ends the recording and says what it lacks.
fn end(backlog: Backlog) -> Exit {
    let outcome = backlog.finish();
    if outcome.lost == 0 && outcome.error.is_none() {
        return Exit::Passed;
    }
    eprintln!("masseter: {} messages did not reach the disk", outcome.lost);
    Exit::Incomplete
}

/// One inlet a topic.
struct Topics {
    commands: Inlet<Command>,
    readings: Inlet<Reading>,
    states: Inlet<State>,
    truths: Inlet<Truth>,
    frames: Inlet<FrameTap>,
    events: Inlet<Event>,
}

impl Topics {
    fn open(node: &Node) -> Result<Self, TransportError> {
        Ok(Self {
            commands: node.inlet()?,
            readings: node.inlet()?,
            states: node.inlet()?,
            truths: node.inlet()?,
            frames: node.inlet()?,
            events: node.inlet()?,
        })
    }

    fn drain(&self, backlog: &mut Backlog, now_ns: u64, view: &mut View) -> Result<(), TransportError> {
        drain(&self.commands, backlog, now_ns, view, Recorded::Command)?;
        drain(&self.readings, backlog, now_ns, view, Recorded::Reading)?;
        drain(&self.states, backlog, now_ns, view, Recorded::State)?;
        drain(&self.truths, backlog, now_ns, view, Recorded::Truth)?;
        drain(&self.frames, backlog, now_ns, view, Recorded::Frame)?;
        drain(&self.events, backlog, now_ns, view, Recorded::Event)
    }
}

/// Records what has arrived on one topic; bounded, so that a flood cannot hold the others up.
fn drain<M: Message>(
    inlet: &Inlet<M>,
    backlog: &mut Backlog,
    now_ns: u64,
    view: &mut View,
    of_topic: impl Fn(M) -> Recorded,
) -> Result<(), TransportError> {
    for _ in 0..M::DEPTH {
        let Some(message) = inlet.receive()? else { break };
        backlog.record(&*message, now_ns);
        view.take(&of_topic(*message));
    }
    Ok(())
}
