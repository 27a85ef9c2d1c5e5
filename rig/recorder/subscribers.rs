//! One subscriber per topic.

use masseter_recording::Recorded;
use masseter_shared::clock;
use masseter_shared::messages::{Command, Event, FrameTap, Message, Reading, State, Truth};
use masseter_shared::transport::{BatchSubscriber, Node, Subscriber, TransportError};

use super::sinks::Sinks;

pub(super) struct Subscribers {
    commands: Subscriber<Command>,
    readings: Subscriber<Reading>,
    states: Subscriber<State>,
    truths: Subscriber<Truth>,
    frames: BatchSubscriber<FrameTap>,
    events: Subscriber<Event>,
}

impl Subscribers {
    pub(super) fn open(node: &Node) -> Result<Self, TransportError> {
        Ok(Self {
            commands: node.subscriber()?,
            readings: node.subscriber()?,
            states: node.subscriber()?,
            truths: node.subscriber()?,
            frames: BatchSubscriber::open(node)?,
            events: node.subscriber()?,
        })
    }

    /// Hands everything that has arrived to `sinks`, topic by topic.
    pub(super) fn drain(&self, sinks: &mut Sinks) -> Result<(), TransportError> {
        drain(&self.commands, sinks, Recorded::Command)?;
        drain(&self.readings, sinks, Recorded::Reading)?;
        drain(&self.states, sinks, Recorded::State)?;
        drain(&self.truths, sinks, Recorded::Truth)?;
        drain_batches(&self.frames, sinks, Recorded::Frame)?;
        drain(&self.events, sinks, Recorded::Event)
    }
}

/// Drains one topic, at most its queue's length, so that a flood cannot delay the other topics. Each message gets its own
/// log time, because some are published during the drain.
fn drain<M: Message>(
    subscriber: &Subscriber<M>,
    sinks: &mut Sinks,
    on_topic: impl Fn(M) -> Recorded,
) -> Result<(), TransportError> {
    for _ in 0..M::DEPTH {
        let Some(message) = subscriber.receive()? else { break };
        sinks.write(&*message, clock::now_ns(), &on_topic);
    }
    Ok(())
}

/// The same for a topic that travels in batches.
fn drain_batches<M: Message>(
    subscriber: &BatchSubscriber<M>,
    sinks: &mut Sinks,
    on_topic: impl Fn(M) -> Recorded,
) -> Result<(), TransportError> {
    for _ in 0..M::DEPTH {
        let Some(batch) = subscriber.receive()? else { break };
        let now_ns = clock::now_ns();
        batch.iter().for_each(|message| sinks.write(message, now_ns, &on_topic));
    }
    Ok(())
}
