//! The logger's process: drains every topic into the recording and shows how the run goes.
//!
//! It runs at ordinary priority on no core of its own, and judges nothing: whatever is said of a run
//! is computed from the recording afterwards.

use std::path::Path;
use std::time::Duration;

use masseter_shared::clock::{self, SECOND_NS};
use masseter_shared::lifecycle::Assignment;
use masseter_shared::messages::codes::ControllerState;
use masseter_shared::messages::{Command, Event, FrameTap, Message, Reading, State, Truth};
use masseter_shared::transport::{Inlet, Node, TransportError};

use crate::exit::Exit;
use crate::recording::{Recorder, WriteError};

/// How often the topics are drained; a fraction of what their buffers hold.
const DRAIN: Duration = Duration::from_millis(10);
/// How often what was recorded goes to the system, ns: what a killed logger may lose.
const FLUSH_NS: u64 = SECOND_NS / 4;
/// How often progress is shown, ns.
const PROGRESS_NS: u64 = SECOND_NS;

/// Records until asked to stop, then drains what is left. [`Exit::Incomplete`] when the recording
/// could not be written to its end.
pub fn run(assignment: &Assignment, recording: &Path) -> anyhow::Result<Exit> {
    let post = assignment.take_up()?;
    let topics = Topics::open(&post.node)?;
    let mut sink = Sink { recorder: Some(Recorder::create(recording)?) };
    let start = post.ready()?;

    let mut progress = Progress { next_ns: start.epoch_ns + PROGRESS_NS, latest: State::default() };
    let mut flush_ns = start.epoch_ns + FLUSH_NS;
    loop {
        let last = post.stop.is_made();
        let now_ns = clock::now_ns();
        topics.drain(&mut sink, now_ns, &mut progress)?;
        if last {
            return Ok(sink.finish());
        }
        if now_ns >= flush_ns {
            sink.keep(Recorder::flush);
            flush_ns = now_ns + FLUSH_NS;
        }
        progress.show(now_ns);
        clock::sleep(DRAIN);
    }
}

/// The recording, as long as it can be written. A full disk ends the recording, not the rig.
struct Sink {
    recorder: Option<Recorder>,
}

impl Sink {
    fn keep(&mut self, write: impl FnOnce(&mut Recorder) -> Result<(), WriteError>) {
        if let Some(recorder) = &mut self.recorder
            && let Err(error) = write(recorder)
        {
            eprintln!("masseter: {error}; the rig goes on, what follows is not recorded");
            self.recorder = None;
        }
    }

    fn finish(self) -> Exit {
        match self.recorder.map(Recorder::finish) {
            Some(Ok(())) => Exit::Passed,
            Some(Err(error)) => {
                eprintln!("masseter: {error}; the recording lacks its end");
                Exit::Incomplete
            }
            None => Exit::Incomplete,
        }
    }
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

    fn drain(&self, sink: &mut Sink, now_ns: u64, progress: &mut Progress) -> Result<(), TransportError> {
        drain(&self.commands, sink, now_ns, |_| {})?;
        drain(&self.readings, sink, now_ns, |_| {})?;
        drain(&self.states, sink, now_ns, |state| progress.latest = *state)?;
        drain(&self.truths, sink, now_ns, |_| {})?;
        drain(&self.frames, sink, now_ns, |_| {})?;
        drain(&self.events, sink, now_ns, |_| {})
    }
}

/// Records what has arrived on one topic; bounded, so that a flood cannot hold the others up.
fn drain<M: Message>(
    inlet: &Inlet<M>,
    sink: &mut Sink,
    now_ns: u64,
    mut look: impl FnMut(&M),
) -> Result<(), TransportError> {
    for _ in 0..M::DEPTH {
        let Some(message) = inlet.receive()? else { break };
        look(&message);
        sink.keep(|recorder| recorder.record(&*message, now_ns));
    }
    Ok(())
}

/// A line a second on standard error.
struct Progress {
    next_ns: u64,
    latest: State,
}

impl Progress {
    fn show(&mut self, now_ns: u64) {
        if now_ns < self.next_ns {
            return;
        }
        self.next_ns += PROGRESS_NS;
        let state = &self.latest;
        let name = ControllerState::try_from(state.controller_state).map_or("?", ControllerState::name);
        let wanted = nalgebra::Vector3::from(state.desired_position_m);
        let found = nalgebra::Vector3::from(state.estimated_position_m);
        eprintln!(
            "  {name:<13} cycle {:>8}   motion {:>7.2} s   platform off by {:>6.3} mm   skipped {}",
            state.cycle,
            state.motion_time_s.max(0.0),
            (wanted - found).norm() * 1e3,
            state.skipped_cycles,
        );
    }
}
