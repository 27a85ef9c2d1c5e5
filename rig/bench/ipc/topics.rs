//! Commands and readings through the rig's transport and through bare iceoryx2.

use std::process::Stdio;
use std::time::Duration;

use iceoryx2::port::backpressure_strategy::BackpressureStrategy;
use iceoryx2::port::publisher::Publisher as IceoryxPublisher;
use iceoryx2::port::subscriber::Subscriber as IceoryxSubscriber;
use iceoryx2::prelude::ipc;
use masseter_shared::clock;
use masseter_shared::messages::{Command, Message, Reading};
use masseter_shared::transport::{Domain, Node, Publisher, ScratchDomain, Subscriber};

use super::channel::Channel;
use super::peer::Peer;
use super::round_trips::{poll, time};
use crate::bench::candidate::Durations;
use crate::bench::thread::on_core;

/// Time between two attempts to reach a peer that may not have opened its ports yet.
const AGAIN_AFTER: Duration = Duration::from_millis(2);
/// Attempts before the bench gives up.
const ATTEMPTS: u32 = 5000;

/// One side of the two topics.
pub(super) trait Ends: Sized {
    /// The commanding side.
    fn commander(node: &Node) -> anyhow::Result<(Self::Out<Command>, Self::In<Reading>)> {
        Ok((Self::publisher(node)?, Self::subscriber(node)?))
    }
    /// Its sending end.
    type Out<M: Message + Numbered>;
    /// Its receiving end.
    type In<M: Message + Numbered>;
    /// Opens a sending end.
    fn publisher<M: Message + Numbered>(node: &Node) -> anyhow::Result<Self::Out<M>>;
    /// Opens a receiving end.
    fn subscriber<M: Message + Numbered>(node: &Node) -> anyhow::Result<Self::In<M>>;
    /// Sends a message with this number.
    fn send<M: Message + Numbered>(out: &mut Self::Out<M>, number: u64) -> anyhow::Result<()>;
    /// The number of the next message, if one is there.
    fn receive<M: Message + Numbered>(subscriber: &Self::In<M>) -> anyhow::Result<Option<u64>>;
}

/// A message that can carry the number of a round trip.
pub(super) trait Numbered {
    fn number(&self) -> u64;
    fn set_number(&mut self, number: u64);
}

impl Numbered for Command {
    fn number(&self) -> u64 {
        self.cycle
    }
    fn set_number(&mut self, number: u64) {
        self.cycle = number;
    }
}

impl Numbered for Reading {
    fn number(&self) -> u64 {
        self.cycle
    }
    fn set_number(&mut self, number: u64) {
        self.cycle = number;
    }
}

/// The rig's ports.
pub(super) struct Ports;

impl Ends for Ports {
    type Out<M: Message + Numbered> = Publisher<M>;
    type In<M: Message + Numbered> = Subscriber<M>;

    fn publisher<M: Message + Numbered>(node: &Node) -> anyhow::Result<Publisher<M>> {
        Ok(node.publisher()?)
    }

    fn subscriber<M: Message + Numbered>(node: &Node) -> anyhow::Result<Subscriber<M>> {
        Ok(node.newest_subscriber()?)
    }

    fn send<M: Message + Numbered>(out: &mut Publisher<M>, number: u64) -> anyhow::Result<()> {
        Ok(out.publish(|message| message.set_number(number))?)
    }

    fn receive<M: Message + Numbered>(subscriber: &Subscriber<M>) -> anyhow::Result<Option<u64>> {
        Ok(subscriber.receive()?.map(|message| message.number()))
    }
}

/// iceoryx2 without the rig's transport.
pub(super) struct Bare;

impl Bare {
    /// A topic with iceoryx2's defaults, except that it never blocks the sender.
    fn topic<M: Message>(
        node: &Node,
    ) -> anyhow::Result<iceoryx2::service::port_factory::publish_subscribe::PortFactory<ipc::Service, M, ()>>
    {
        let builder = node.iceoryx().service_builder(&M::TOPIC.try_into()?).publish_subscribe::<M>();
        Ok(builder.enable_safe_overflow(true).open_or_create()?)
    }
}

impl Ends for Bare {
    type Out<M: Message + Numbered> = IceoryxPublisher<ipc::Service, M, ()>;
    type In<M: Message + Numbered> = IceoryxSubscriber<ipc::Service, M, ()>;

    fn publisher<M: Message + Numbered>(node: &Node) -> anyhow::Result<Self::Out<M>> {
        let topic = Self::topic::<M>(node)?;
        Ok(topic.publisher_builder().backpressure_strategy(BackpressureStrategy::DiscardData).create()?)
    }

    fn subscriber<M: Message + Numbered>(node: &Node) -> anyhow::Result<Self::In<M>> {
        Ok(Self::topic::<M>(node)?.subscriber_builder().create()?)
    }

    fn send<M: Message + Numbered>(out: &mut Self::Out<M>, number: u64) -> anyhow::Result<()> {
        let mut sample = out.loan()?;
        sample.payload_mut().set_number(number);
        sample.send()?;
        Ok(())
    }

    fn receive<M: Message + Numbered>(subscriber: &Self::In<M>) -> anyhow::Result<Option<u64>> {
        Ok(subscriber.receive()?.map(|sample| sample.payload().number()))
    }
}

/// Starts the peer and times commands that it answers with readings of the same number.
pub(super) fn round_trips<E: Ends>(
    channel: Channel,
    [own_core, peer_core]: [usize; 2],
) -> anyhow::Result<Durations> {
    let domain = ScratchDomain::claim("bench")?;
    let _peer = Peer::start(channel, peer_core, Some(&domain), [Stdio::null(), Stdio::null()])?;
    on_core(own_core, || exchange::<E>(&Node::join(&domain)?))
}

fn exchange<E: Ends>(node: &Node) -> anyhow::Result<Durations> {
    let (mut commands, readings) = E::commander(node)?;
    greet::<E>(&mut commands, &readings)?;
    time(|number| {
        E::send(&mut commands, number)?;
        // Answers to greetings may still be in the queue.
        poll(|| Ok(E::receive(&readings)?.filter(|&answered| answered == number)))?;
        Ok(())
    })
}

/// Sends number 0 until the peer answers.
fn greet<E: Ends>(commands: &mut E::Out<Command>, readings: &E::In<Reading>) -> anyhow::Result<()> {
    for _ in 0..ATTEMPTS {
        E::send(commands, 0)?;
        clock::sleep(AGAIN_AFTER);
        if E::receive(readings)?.is_some() {
            return Ok(());
        }
    }
    anyhow::bail!("the other side did not open its ports")
}

/// Answers every command with a reading of the same number, until the process is killed.
pub(super) fn answer<E: Ends>(domain: &Domain) -> anyhow::Result<()> {
    let node = Node::join(domain)?;
    let commands: E::In<Command> = E::subscriber(&node)?;
    let mut readings: E::Out<Reading> = E::publisher(&node)?;
    loop {
        let number = poll(|| E::receive(&commands))?;
        E::send(&mut readings, number)?;
    }
}
