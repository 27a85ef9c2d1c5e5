//! The messages of a run in one thread, on their way to a [`Sink`]: a recording, the analysis, or the caller of a
//! rig. They get the numbers and times that their publishers would give them.
//!
//! [`LoggedPorts`] are the ports of a controller in this thread. Nothing here steps the plant.

use std::{cell::Cell, convert::Infallible};

use masseter_judge::{Analysis, Figures, Watch, signals::CycleMessages};
use masseter_recording::{Backlog, Recorded};
use masseter_runtime::messages::{self, Command, Event, Message, Parameters, Reading, Signals};
use masseter_runtime::{control::ControllerPorts, messages::tap::TapError, realtime::Wake};

/// Takes every message of a run.
pub trait Sink {
    /// Takes a message that was published at `now_ns`.
    fn take(&mut self, message: &Recorded, now_ns: u64);

    /// Whether a message was lost, so that the rest of the run is useless.
    fn has_failed(&self) -> bool;
}

impl Sink for Backlog {
    fn take(&mut self, message: &Recorded, now_ns: u64) {
        self.record(message, now_ns);
    }

    fn has_failed(&self) -> bool {
        self.dropped() > 0
    }
}

/// The analysis of a run that is not recorded.
#[derive(Debug, Clone)]
pub(crate) struct Stream {
    analysis: Analysis,
    error: Option<TapError>,
}

impl Stream {
    /// A stream into an analysis that has no message yet.
    pub(crate) fn new(analysis: Analysis) -> Self {
        Self { analysis, error: None }
    }

    /// The figures of all messages.
    ///
    /// # Errors
    /// When a message of the topic `frame` held no CAN frame.
    pub(crate) fn figures(self) -> Result<Figures, TapError> {
        self.error.map_or_else(|| Ok(self.analysis.finish(false, &[])), Err)
    }
}

impl Sink for Stream {
    fn take(&mut self, message: &Recorded, _: u64) {
        if let Err(error) = self.analysis.take(message) {
            self.error.get_or_insert(error);
        }
    }

    fn has_failed(&self) -> bool {
        self.error.is_some()
    }
}

impl Sink for Watch {
    fn take(&mut self, message: &Recorded, _: u64) {
        self.take(message);
    }

    fn has_failed(&self) -> bool {
        false
    }
}

/// What a rig published last: reading, truth and contact of the present cycle, and the events of the last step.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Latest {
    pub(crate) cycle: CycleMessages,
    pub(crate) events: Vec<Event>,
}

impl Sink for Latest {
    fn take(&mut self, message: &Recorded, _: u64) {
        match message {
            Recorded::Reading(reading) => self.cycle.reading = Some(*reading),
            Recorded::Truth(truth) => self.cycle.truth = Some(*truth),
            Recorded::Contact(contact) => self.cycle.contact = Some(*contact),
            Recorded::Event(event) => self.events.push(*event),
            _ => {}
        }
    }

    fn has_failed(&self) -> bool {
        false
    }
}

/// The publishers of a run. Each numbers its own messages.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Publisher {
    /// Commands to the actuators.
    Command,
    /// Readings of the encoders.
    Reading,
    /// The state of the controller.
    State,
    /// Named signals of the controller.
    Signals,
    /// Its parameters.
    Parameters,
    /// The true pose and forces.
    Truth,
    /// Contacts of teeth and food.
    Contact,
    /// Frames of the buses.
    Frame,
    /// Events of the controller.
    ControllerEvent,
    /// Events of the plant.
    PlantEvent,
}

/// How many messages each publisher has published.
pub(crate) type Published = [u64; Publisher::PlantEvent as usize + 1];

/// The sink, and how many messages of each publisher it took.
#[derive(Debug)]
pub struct Log<S> {
    /// Where the messages go.
    pub sink: S,
    pub(crate) published: Published,
}

impl<S: Sink> Log<S> {
    /// The log of a run that begins.
    pub fn new(sink: S) -> Self {
        Self { sink, published: Default::default() }
    }

    /// Numbers a message, as its publisher would, and hands it on.
    pub(crate) fn record<M: Message + Into<Recorded>>(
        &mut self,
        publisher: Publisher,
        now_ns: u64,
        fill: impl FnOnce(&mut M),
    ) -> M {
        let mut message = M::default();
        fill(&mut message);
        let number = &mut self.published[publisher as usize];
        *number += 1;
        message.stamp(*number, now_ns);
        self.sink.take(&message.into(), now_ns);
        message
    }

    /// Hands on the frames and events that the plant has kept since the last call.
    pub(crate) fn drain(&mut self, plant: &mut masseter_plant::core::PlantCore, now_ns: u64) {
        for frame in plant.drain_frames() {
            self.record(Publisher::Frame, now_ns, |message| *message = frame);
        }
        plant.drain_events(&mut |event| {
            self.record(Publisher::PlantEvent, now_ns, |message| *message = event);
        });
    }
}

/// The ports of a controller that runs in one thread, with a given reading and given times.
#[derive(Debug)]
pub struct LoggedPorts<'a, S> {
    log: &'a mut Log<S>,
    times_ns: [u64; 3],
    /// How often the time was asked for.
    asked: Cell<usize>,
    reading: Option<Reading>,
    command: Option<Command>,
}

impl<'a, S> LoggedPorts<'a, S> {
    /// The ports of a cycle with this reading, whose parts end at these times: reception, pose, command.
    pub fn new(log: &'a mut Log<S>, times_ns: [u64; 3], reading: Option<&Reading>) -> Self {
        Self { log, times_ns, asked: Cell::new(0), reading: reading.copied(), command: None }
    }

    /// The command that the controller published.
    pub fn into_command(self) -> Option<Command> {
        self.command
    }

    fn published_ns(&self) -> u64 {
        self.times_ns[2]
    }
}

impl<S: Sink> ControllerPorts for LoggedPorts<'_, S> {
    type Reading = Reading;
    type Error = Infallible;

    fn now_ns(&self) -> u64 {
        let asked = self.asked.replace(self.asked.get() + 1);
        self.times_ns[asked.min(2)]
    }

    fn reading(&mut self, _: &Wake) -> Result<Option<Reading>, Infallible> {
        Ok(self.reading.take())
    }

    fn publish_command(&mut self, fill: impl FnOnce(&mut Command)) -> Result<(), Infallible> {
        self.command = Some(self.log.record(Publisher::Command, self.published_ns(), fill));
        Ok(())
    }

    fn publish_state(&mut self, fill: impl FnOnce(&mut messages::State)) -> Result<(), Infallible> {
        self.log.record(Publisher::State, self.published_ns(), fill);
        Ok(())
    }

    fn publish_signals(&mut self, fill: impl FnOnce(&mut Signals)) -> Result<(), Infallible> {
        self.log.record(Publisher::Signals, self.published_ns(), fill);
        Ok(())
    }

    fn publish_parameters(&mut self, fill: impl FnOnce(&mut Parameters)) -> Result<(), Infallible> {
        self.log.record(Publisher::Parameters, self.published_ns(), fill);
        Ok(())
    }

    fn publish_event(&mut self, event: &Event) -> Result<(), Infallible> {
        self.log.record(Publisher::ControllerEvent, self.published_ns(), |message| *message = *event);
        Ok(())
    }
}
