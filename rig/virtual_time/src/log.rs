//! The messages of a run in one thread, on their way to a [`Sink`], each with the number and the time that its publisher
//! would give it.

use masseter_plant::core::PlantCore;
use masseter_recording::Recorded;
use masseter_runtime::messages::Message;

use crate::sink::Sink;

/// The publishers of a run. Each numbers its own messages.
#[derive(Debug, Clone, Copy)]
pub enum Publisher {
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

/// The sink, and how many messages of each publisher it took.
#[derive(Debug)]
pub struct Log<S> {
    sink: S,
    published: [u64; Publisher::PlantEvent as usize + 1],
}

impl<S: Sink> Log<S> {
    /// The log of a run that begins.
    pub fn new(sink: S) -> Self {
        Self { sink, published: Default::default() }
    }

    /// Where the messages go.
    pub fn sink(&self) -> &S {
        &self.sink
    }

    /// Where the messages go.
    pub fn sink_mut(&mut self) -> &mut S {
        &mut self.sink
    }

    /// The sink, which took all messages.
    pub fn into_sink(self) -> S {
        self.sink
    }

    /// Numbers a message, as its publisher would, and hands it on.
    pub fn record<M: Message + Into<Recorded>>(
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

    /// Hands on the frames and events of a cycle.
    pub fn drain(&mut self, plant: &mut PlantCore, now_ns: u64) {
        for frame in plant.drain_frames() {
            self.record(Publisher::Frame, now_ns, |message| *message = frame);
        }
        plant.drain_events(&mut |event| {
            self.record(Publisher::PlantEvent, now_ns, |message| *message = event);
        });
    }
}
