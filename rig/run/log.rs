//! The messages of a run in one thread, on their way to a [`Sink`], each with the number and the time that its publisher
//! would give it.

use masseter_plant::core::PlantCore;
use masseter_recording::Recorded;
use masseter_shared::messages::Message;

use super::sink::Sink;

/// The publishers of a run. Each numbers its own messages.
#[derive(Clone, Copy)]
pub(crate) enum Publisher {
    Command,
    Reading,
    State,
    Signals,
    Parameters,
    Truth,
    Contact,
    Frame,
    ControllerEvent,
    PlantEvent,
}

/// The sink, and how many messages of each publisher it took.
pub(crate) struct Log<S> {
    sink: S,
    published: [u64; Publisher::PlantEvent as usize + 1],
}

impl<S: Sink> Log<S> {
    pub(crate) fn new(sink: S) -> Self {
        Self { sink, published: Default::default() }
    }

    pub(crate) fn sink(&self) -> &S {
        &self.sink
    }

    pub(crate) fn sink_mut(&mut self) -> &mut S {
        &mut self.sink
    }

    pub(crate) fn into_sink(self) -> S {
        self.sink
    }

    /// Numbers a message, as its publisher would, and hands it on.
    pub(super) fn record<M: Message + Into<Recorded>>(
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
    pub(super) fn drain(&mut self, plant: &mut PlantCore, now_ns: u64) {
        for frame in plant.drain_frames() {
            self.record(Publisher::Frame, now_ns, |message| *message = frame);
        }
        plant.drain_events(&mut |event| {
            self.record(Publisher::PlantEvent, now_ns, |message| *message = event);
        });
    }
}
