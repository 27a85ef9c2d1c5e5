//! One subscriber per topic.

use masseter_recording::Recorded;
use masseter_runtime::messages::{
    Command, Contact, Event, FrameTap, Message, Parameters, Reading, Signals, State, Truth,
};
use masseter_runtime::transport::{FrameSubscriber, Node, Subscriber, TransportError};

pub(super) struct Subscribers {
    commands: Subscriber<Command>,
    readings: Subscriber<Reading>,
    states: Subscriber<State>,
    signals: Subscriber<Signals>,
    parameters: Subscriber<Parameters>,
    truths: Subscriber<Truth>,
    contacts: Subscriber<Contact>,
    frames: FrameSubscriber,
    events: Subscriber<Event>,
}

impl Subscribers {
    pub(super) fn open(node: &Node) -> Result<Self, TransportError> {
        Ok(Self {
            commands: node.subscriber()?,
            readings: node.subscriber()?,
            states: node.subscriber()?,
            signals: node.subscriber()?,
            parameters: node.subscriber()?,
            truths: node.subscriber()?,
            contacts: node.subscriber()?,
            frames: FrameSubscriber::open(node)?,
            events: node.subscriber()?,
        })
    }

    /// Hands everything that has arrived to `take`, topic by topic. Readings come first: what was published before the
    /// last of them follows in the same drain.
    pub(super) fn drain(&self, take: &mut impl FnMut(&Recorded)) -> Result<(), TransportError> {
        drain(&self.readings, take)?;
        drain(&self.commands, take)?;
        drain(&self.states, take)?;
        drain(&self.signals, take)?;
        drain(&self.parameters, take)?;
        drain(&self.truths, take)?;
        drain(&self.contacts, take)?;
        drain_frames(&self.frames, take)?;
        drain(&self.events, take)
    }
}

/// Drains one topic, at most its queue's length, so that a flood cannot delay the other topics.
fn drain<M: Message + Into<Recorded>>(
    subscriber: &Subscriber<M>,
    take: &mut impl FnMut(&Recorded),
) -> Result<(), TransportError> {
    for _ in 0..M::DEPTH {
        let Some(message) = subscriber.receive()? else { break };
        take(&(*message).into());
    }
    Ok(())
}

/// The same for a topic that travels in batches.
fn drain_frames(
    subscriber: &FrameSubscriber,
    take: &mut impl FnMut(&Recorded),
) -> Result<(), TransportError> {
    for _ in 0..FrameTap::DEPTH {
        let Some(batch) = subscriber.receive()? else { break };
        batch.iter().for_each(|&frame| take(&frame.into()));
    }
    Ok(())
}
