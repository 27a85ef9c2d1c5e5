//! The logger's process: drains every topic into the recording and shows how the run goes.
//!
//! It runs at ordinary priority on no core of its own, and judges nothing: whatever is said of a run
//! is computed from the recording afterwards.

use std::path::Path;
use std::time::Duration;

use masseter_shared::clock::{self, SECOND_NS};
use masseter_shared::geometry::Mechanism;
use masseter_shared::lifecycle::Assignment;
use masseter_shared::messages::codes::ControllerState;
use masseter_shared::messages::{Command, Event, FrameTap, Message, Reading, State, Truth};
use masseter_shared::transport::{Inlet, Node, TransportError};

use crate::exit::Exit;
use crate::recording::{Backlog, Recorder, Scene};

/// How often the topics are drained; a fraction of what their buffers hold.
const DRAIN: Duration = Duration::from_millis(10);
/// How often progress is shown, ns.
const PROGRESS_NS: u64 = SECOND_NS;

/// Records until asked to stop, then drains what is left. [`Exit::Incomplete`] when anything that was
/// received is not safe in the recording.
pub fn run(assignment: &Assignment, recording: &Path) -> anyhow::Result<Exit> {
    let post = assignment.take_up()?;
    let topics = Topics::open(&post.node)?;
    let scene = Scene::new(&Mechanism::new(&post.scenario.mechanism)?, &post.scenario.jaw);
    let mut backlog = Backlog::start(Recorder::create(recording, scene)?);
    let start = post.ready()?;

    let mut progress = Progress { next_ns: start.epoch_ns + PROGRESS_NS, latest: State::default() };
    loop {
        let last = post.stop.is_made();
        let now_ns = clock::now_ns();
        topics.drain(&mut backlog, now_ns, &mut progress)?;
        if last {
            return Ok(end(backlog));
        }
        backlog.hand_over();
        progress.show(now_ns, backlog.dropped());
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

    fn drain(
        &self,
        backlog: &mut Backlog,
        now_ns: u64,
        progress: &mut Progress,
    ) -> Result<(), TransportError> {
        drain(&self.commands, backlog, now_ns, |_| {})?;
        drain(&self.readings, backlog, now_ns, |_| {})?;
        drain(&self.states, backlog, now_ns, |state| progress.latest = *state)?;
        drain(&self.truths, backlog, now_ns, |_| {})?;
        drain(&self.frames, backlog, now_ns, |_| {})?;
        drain(&self.events, backlog, now_ns, |_| {})
    }
}

/// Records what has arrived on one topic; bounded, so that a flood cannot hold the others up.
fn drain<M: Message>(
    inlet: &Inlet<M>,
    backlog: &mut Backlog,
    now_ns: u64,
    mut look: impl FnMut(&M),
) -> Result<(), TransportError> {
    for _ in 0..M::DEPTH {
        let Some(message) = inlet.receive()? else { break };
        look(&message);
        backlog.record(&*message, now_ns);
    }
    Ok(())
}

/// A line a second on standard error.
struct Progress {
    next_ns: u64,
    latest: State,
}

impl Progress {
    fn show(&mut self, now_ns: u64, lost: u64) {
        if now_ns < self.next_ns {
            return;
        }
        self.next_ns += PROGRESS_NS;
        let state = &self.latest;
        let name = ControllerState::try_from(state.controller_state).map_or("?", ControllerState::name);
        let wanted = nalgebra::Vector3::from(state.desired_position_m);
        let found = nalgebra::Vector3::from(state.estimated_position_m);
        eprintln!(
            "  {name:<13} cycle {:>8}   motion {:>7.2} s   platform off by {:>6.3} mm   skipped {}   lost {lost}",
            state.cycle,
            state.motion_time_s.max(0.0),
            (wanted - found).norm() * 1e3,
            state.skipped_cycles,
        );
    }
}
