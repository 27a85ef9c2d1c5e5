use super::*;
use crate::clock;

#[test]
fn the_newest_message_is_found_among_many_and_while_one_is_held() {
    let domain = ScratchDomain::claim("test-ports").unwrap();
    let node = Node::join(&domain).unwrap();
    let subscriber = Subscriber::<Event>::open(&node).unwrap();
    let mut publisher = Publisher::<Event>::open(&node).unwrap();
    let mut waiter = Waiter::new(1_000_000);
    for round in 1..=3 {
        for cycle in 0..5 {
            publisher.publish_by(clock::now_ns, |event| event.cycle = round * 10 + cycle).unwrap();
        }
        let held = subscriber.receive().unwrap().unwrap();
        assert_eq!(held.cycle, round * 10);
        let newest = subscriber.latest_by(0, &mut waiter, |event| event.cycle > 1000).unwrap().unwrap();
        assert_eq!((newest.cycle, newest.seq), (round * 10 + 4, round * 5));
        assert!(subscriber.receive().unwrap().is_none());
    }
}

#[test]
fn a_subscriber_of_the_newest_message_keeps_few_old_ones() {
    let domain = ScratchDomain::claim("test-newest").unwrap();
    let node = Node::join(&domain).unwrap();
    let subscriber = Subscriber::<Event>::of_newest(&node).unwrap();
    let mut publisher = Publisher::<Event>::open(&node).unwrap();
    (1..=100).for_each(|cycle| publisher.publish_by(clock::now_ns, |event| event.cycle = cycle).unwrap());
    let received = std::iter::from_fn(|| subscriber.receive().unwrap()).map(|event| (event.cycle, event.seq));
    assert!(received.eq((97..=100).map(|cycle| (cycle, cycle))));
}

#[test]
fn messages_after_the_awaited_one_are_kept_for_the_next_wait() {
    let domain = ScratchDomain::claim("test-awaited").unwrap();
    let node = Node::join(&domain).unwrap();
    let subscriber = Subscriber::<Event>::open(&node).unwrap();
    let mut publisher = Publisher::<Event>::open(&node).unwrap();
    for cycle in 1..=5 {
        publisher.publish_by(clock::now_ns, |event| event.cycle = cycle).unwrap();
    }
    let mut waiter = Waiter::new(1_000_000);
    let deadline_ns = clock::now_ns() + 1_000_000_000;
    let mut wait = |cycle| {
        let found = subscriber.latest_by(deadline_ns, &mut waiter, |event| event.cycle >= cycle).unwrap();
        found.map(|event| event.cycle)
    };
    assert_eq!([3, 4, 2].map(&mut wait), [Some(3), Some(4), Some(5)]);
}

/// Each look of a wait may find messages while the subscriber still holds the newest of the last look.
#[test]
fn a_wait_that_keeps_finding_messages_never_holds_too_many() {
    let domain = ScratchDomain::claim("test-wait").unwrap();
    let node = Node::join(&domain).unwrap();
    let subscriber = Subscriber::<Event>::open(&node).unwrap();
    let mut publisher = Publisher::<Event>::open(&node).unwrap();
    let deadline_ns = clock::now_ns() + 1_000_000_000;
    let mut waiter = Waiter::new(1_000_000);
    publisher.publish_by(clock::now_ns, |event| event.cycle = 1).unwrap();
    let publisher = std::cell::RefCell::new(publisher);
    let newest = subscriber.latest_by(deadline_ns, &mut waiter, |event| {
        let next = event.cycle + 1;
        publisher.borrow_mut().publish_by(clock::now_ns, |event| event.cycle = next).unwrap();
        publisher.borrow_mut().publish_by(clock::now_ns, |event| event.cycle = next + 1).unwrap();
        event.cycle >= 9
    });
    assert_eq!(newest.unwrap().unwrap().cycle, 9);
}

/// A sender of another version with the same layout.
#[test]
fn a_message_of_another_version_is_refused() {
    let domain = ScratchDomain::claim("test-version").unwrap();
    let node = Node::join(&domain).unwrap();
    let subscriber = Subscriber::<Event>::open(&node).unwrap();
    let service = node.topic::<Event, Event>(Event::DEPTH).unwrap().open_or_create().unwrap();
    let publisher = service.publisher_builder().create().unwrap();
    let mut sample = publisher.loan().unwrap();
    sample.payload_mut().stamp(1, 1);
    sample.payload_mut().version += 1;
    sample.send().unwrap();
    let error = subscriber.receive().unwrap_err().to_string();
    let other = format!("IncompatibleVersion({}", LAYOUT_VERSION + 1);
    assert!(error.contains(&other) && error.contains("another version"), "{error}");
}
