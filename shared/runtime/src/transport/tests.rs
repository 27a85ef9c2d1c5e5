use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use iceoryx2::prelude::ZeroCopySend;

use super::*;
use crate::clock;

/// Every file below a folder.
fn files_below(folder: &Path, found: &mut Vec<PathBuf>) {
    for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if path.is_dir() {
            files_below(&path, found);
        } else {
            found.push(path);
        }
    }
}

#[test]
fn no_other_user_may_touch_a_file_of_a_domain_and_every_path_leaves_room_for_a_session_folder() {
    let domain = ScratchDomain::claim("test-of-the-longest-name").unwrap();
    let node = Node::join(&domain).unwrap();
    let _subscriber = FrameSubscriber::open(&node).unwrap();
    let publisher = FramePublisher::open(&node).unwrap();
    publisher.connect().unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(domain.root()), 0o700);
    assert_eq!(mode(domain.root().parent().unwrap()), 0o700);

    let prefix = domain.prefix().unwrap();
    let shared = fs::read_dir("/dev/shm").unwrap().map(|entry| entry.unwrap());
    let shared: Vec<_> =
        shared.filter(|file| file.file_name().to_string_lossy().starts_with(&prefix)).collect();
    assert!(shared.len() > 3, "{shared:?}");
    for file in shared {
        assert_eq!(mode(&file.path()), 0o600, "{file:?}");
    }
    let mut files = Vec::new();
    files_below(domain.root(), &mut files);
    assert!(!files.is_empty());
    let room = 255 - runtime::LONGEST_SESSION_FOLDER - "/masseter/".len() - 32 - 1;
    // Longest parts: the name has 32 bytes, the user's id 10 digits, the node's number 39.
    let longer = (32 - domain.id().len()) + 9 + 15;
    for file in files {
        let beside_the_id = file.strip_prefix(domain.root()).unwrap().as_os_str().len();
        assert!(beside_the_id + longer <= room, "{file:?}");
    }
}

#[test]
fn the_newest_message_is_found_among_many_and_while_one_is_held() {
    let domain = ScratchDomain::claim("test-ports").unwrap();
    let node = Node::join(&domain).unwrap();
    let subscriber = node.subscriber::<Event>().unwrap();
    let mut publisher = node.publisher::<Event>().unwrap();
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
    let subscriber = node.newest_subscriber::<Event>().unwrap();
    let mut publisher = node.publisher::<Event>().unwrap();
    (1..=100).for_each(|cycle| publisher.publish_by(clock::now_ns, |event| event.cycle = cycle).unwrap());
    let received = std::iter::from_fn(|| subscriber.receive().unwrap()).map(|event| (event.cycle, event.seq));
    assert!(received.eq((97..=100).map(|cycle| (cycle, cycle))));
}

#[test]
fn messages_after_the_awaited_one_are_kept_for_the_next_wait() {
    let domain = ScratchDomain::claim("test-awaited").unwrap();
    let node = Node::join(&domain).unwrap();
    let subscriber = node.subscriber::<Event>().unwrap();
    let mut publisher = node.publisher::<Event>().unwrap();
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
    let subscriber = node.subscriber::<Event>().unwrap();
    let mut publisher = node.publisher::<Event>().unwrap();
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
    let subscriber = node.subscriber::<Event>().unwrap();
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

/// An event, except for the name of its layout.
#[repr(C)]
#[derive(Debug, Clone, Copy, ZeroCopySend)]
#[type_name("masseter/Event/0000000000000000")]
struct OtherLayout([u64; size_of::<Event>() / 8]);

#[test]
fn a_topic_of_another_layout_is_not_opened() {
    let domain = ScratchDomain::claim("test-layout").unwrap();
    let node = Node::join(&domain).unwrap();
    let _publisher = node.publisher::<Event>().unwrap();
    let other = node.topic::<Event, OtherLayout>(Event::DEPTH).unwrap().open_or_create();
    let error = format!("{:?}", other.unwrap_err());
    assert!(error.contains("Incompatible"), "{error}");
}
