//! The two topics of commands and readings, through the rig's transport and through bare iceoryx2.

use iceoryx2::port::backpressure_strategy::BackpressureStrategy;
use iceoryx2::prelude::ipc;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use masseter_runtime::messages::{Command, Message, Reading};
use masseter_runtime::transport::{Node, Publisher, Subscriber, Topic};

use crate::exchange::Ends;

/// A message that can carry the number of a round trip.
pub(crate) trait Numbered: Topic {
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
pub(crate) fn of_the_rig<Sent: Numbered, Got: Numbered>(node: &Node) -> anyhow::Result<Ends> {
    let mut publisher: Publisher<Sent> = node.publisher()?;
    let subscriber: Subscriber<Got> = node.newest_subscriber()?;
    Ok(Ends {
        send: Box::new(move |number| Ok(publisher.publish(|message| message.set_number(number))?)),
        receive: Box::new(move || Ok(subscriber.receive()?.map(|message| message.number()))),
    })
}

/// iceoryx2 without the rig's transport.
pub(crate) fn bare<Sent: Numbered, Got: Numbered>(node: &Node) -> anyhow::Result<Ends> {
    let service = topic::<Sent>(node)?;
    let publisher =
        service.publisher_builder().backpressure_strategy(BackpressureStrategy::DiscardData).create()?;
    let subscriber = topic::<Got>(node)?.subscriber_builder().create()?;
    Ok(Ends {
        send: Box::new(move |number| {
            let mut sample = publisher.loan()?;
            sample.payload_mut().set_number(number);
            sample.send()?;
            Ok(())
        }),
        receive: Box::new(move || Ok(subscriber.receive()?.map(|sample| sample.payload().number()))),
    })
}

/// A topic with iceoryx2's defaults, except that it never blocks the sender.
fn topic<M: Message>(node: &Node) -> anyhow::Result<PortFactory<ipc::Service, M, ()>> {
    let builder = node.iceoryx().service_builder(&M::TOPIC.try_into()?).publish_subscribe::<M>();
    Ok(builder.enable_safe_overflow(true).open_or_create()?)
}
