//! `bench subscribers`: what each observer adds to publishing a reading.
//!
//! The topic is set up as the rig's are, but for more subscribers, which a run does not allow because
//! memory is reserved for each. The observers sit in this process and never receive while it is measured,
//! which is the worst for the sender: every send displaces the oldest message.

use iceoryx2::port::backpressure_strategy::BackpressureStrategy;
use masseter_shared::clock;
use masseter_shared::messages::Reading;
use masseter_shared::transport::{Domain, Node, ScratchDomain};

use super::contender::{Durations, durations, record};
use super::contest::{Outcome, Turn};
use super::on_core;

/// Numbers of observers.
const OBSERVERS: [usize; 5] = [1, 2, 4, 8, 16];
/// Messages that an observer may fall behind.
const DEPTH: usize = 64;
/// Messages a round.
const MESSAGES: usize = 20_000;

pub(super) fn measure(rounds: u32, core: usize) -> anyhow::Result<Outcome> {
    let domain = ScratchDomain::claim("bench")?;
    let turns = OBSERVERS.map(|observers| {
        let domain = &domain;
        let turn: Turn = Box::new(move || Ok(on_core(core, || publish_to(domain, observers))?.into()));
        (name(observers), turn)
    });
    let measures = "loaning, filling and sending one reading".to_owned();
    let outcome = Outcome::of_turns("subscribers", measures, rounds, &[core], turns.into())?;
    let [fewest, more @ ..] = OBSERVERS;
    Ok(outcome.comparing(more.map(|observers| (name(observers), name(fewest)))))
}

fn name(observers: usize) -> String {
    format!("{observers} observer{}", if observers == 1 { "" } else { "s" })
}

fn publish_to(domain: &Domain, observers: usize) -> anyhow::Result<Durations> {
    let node = Node::join(domain)?;
    let topic = node
        .iceoryx()
        .service_builder(&"observed".try_into()?)
        .publish_subscribe::<Reading>()
        .enable_safe_overflow(true)
        .max_subscribers(observers)
        .subscriber_max_buffer_size(DEPTH)
        .create()?;
    let _observers =
        (0..observers).map(|_| topic.subscriber_builder().create()).collect::<Result<Vec<_>, _>>()?;
    let publisher =
        topic.publisher_builder().backpressure_strategy(BackpressureStrategy::DiscardData).create()?;
    let mut taken = durations();
    for message in 0..2 * DEPTH + MESSAGES {
        let from_ns = clock::now_ns();
        let mut sample = publisher.loan()?;
        sample.payload_mut().cycle = message as u64;
        sample.send()?;
        let taken_ns = clock::now_ns() - from_ns;
        if message >= 2 * DEPTH {
            record(&mut taken, taken_ns, 1);
        }
    }
    Ok(taken)
}
