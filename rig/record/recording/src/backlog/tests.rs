use std::io::{self, Cursor, Write};
use std::sync::mpsc::{Receiver, channel};

use masseter_model::geometry::{Mechanism, MechanismConfig};
use masseter_runtime::messages::Reading;
use masseter_scenario::JawConfig;

use super::*;
use crate::Scene;

fn scene() -> Scene {
    Scene::new(&Mechanism::new(&MechanismConfig::default()).unwrap(), &JawConfig::default())
}

/// A disk that blocks until the test releases it.
struct Stuck {
    definitions: u64,
    bytes: Cursor<Vec<u8>>,
    go_on: Receiver<()>,
    then: io::ErrorKind,
}

/// What fits into a batch in real time.
const BATCH: u64 = Pace::RealTime.batch_messages() as u64;

/// The result of a released disk.
const WELL: io::ErrorKind = io::ErrorKind::Other;

impl Write for Stuck {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.bytes.position() >= self.definitions {
            // An error means that the test let go.
            let _ = self.go_on.recv();
            if self.then != WELL {
                return Err(self.then.into());
            }
        }
        self.bytes.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Medium for Stuck {
    fn close(self) -> io::Result<()> {
        Ok(())
    }
}

/// Length of a recording that holds nothing but its definitions.
fn definitions() -> u64 {
    let mut bytes = Cursor::new(Vec::new());
    std::mem::forget(Recorder::new(&mut bytes, scene()).unwrap());
    bytes.position()
}

fn reading(seq: u64) -> Recorded {
    Recorded::Reading(Reading { seq, ..Default::default() })
}

/// Offers so many readings to a disk that is stuck meanwhile.
fn record_on_a_stuck_disk(offered: u64, then: io::ErrorKind) -> (u64, WriteOutcome) {
    let (let_go, go_on) = channel();
    let disk = Stuck { definitions: definitions(), bytes: Cursor::default(), go_on, then };
    let mut backlog = Backlog::start(Recorder::new(disk, scene()).unwrap(), Pace::RealTime);
    for seq in 1..=offered {
        backlog.record(&reading(seq), seq);
    }
    let dropped = backlog.dropped();
    drop(let_go);
    (dropped, backlog.finish())
}

#[test]
fn a_disk_that_hangs_for_a_while_loses_nothing() {
    let (dropped, recorded) = record_on_a_stuck_disk(BATCH / 2, WELL);
    assert_eq!((dropped, recorded.lost), (0, 0));
    assert!(recorded.error.is_none());
}

#[test]
fn a_disk_that_hangs_too_long_loses_what_memory_cannot_hold_and_no_more() {
    let (dropped, recorded) = record_on_a_stuck_disk(BATCH * 4, WELL);
    assert!(dropped > 0);
    assert_eq!(recorded.lost, dropped);
    assert!(recorded.error.is_none());
}

#[test]
fn a_disk_that_is_gone_loses_everything_behind_the_last_flush() {
    let (_, recorded) = record_on_a_stuck_disk(BATCH / 2, io::ErrorKind::StorageFull);
    assert_eq!(recorded.lost, BATCH / 2);
    assert!(recorded.error.is_some());
}

#[test]
fn a_disk_failure_is_reported_once_during_the_recording_and_again_at_its_end() {
    let (let_go, go_on) = channel();
    let then = io::ErrorKind::StorageFull;
    let disk = Stuck { definitions: definitions(), bytes: Cursor::default(), go_on, then };
    let mut backlog = Backlog::start(Recorder::new(disk, scene()).unwrap(), Pace::RealTime);
    for seq in 1..=BATCH / 2 {
        backlog.record(&reading(seq), seq);
    }
    backlog.hand_over();
    assert!(backlog.new_failure().is_none());
    drop(let_go);
    while backlog.new_failure().is_none() {
        clock::sleep(Duration::from_millis(1));
    }
    assert!(backlog.new_failure().is_none());
    let loss = backlog.finish().loss().unwrap();
    assert!(loss.starts_with("cannot write the recording: "), "{loss}");
    assert!(loss.ends_with("messages did not reach the disk"), "{loss}");
}

#[test]
fn what_a_recording_lacks_is_said_with_its_reason_and_never_as_nothing() {
    let loss = |lost, error: Option<io::ErrorKind>| {
        WriteOutcome { lost, error: error.map(|kind| WriteError::Create(kind.into())) }.loss()
    };
    let full = Some(io::ErrorKind::StorageFull);
    assert_eq!(loss(0, None), None);
    assert_eq!(loss(3, None).unwrap(), "3 messages did not reach the disk");
    assert_eq!(loss(0, full).unwrap(), "cannot create the recording: no storage space");
    assert_eq!(
        loss(3, full).unwrap(),
        "cannot create the recording: no storage space; 3 messages did not reach the disk"
    );
}

#[test]
fn a_caller_that_may_wait_loses_nothing_on_a_slow_disk() {
    let (let_go, go_on) = channel();
    let disk = Stuck { definitions: definitions(), bytes: Cursor::default(), go_on, then: WELL };
    let mut backlog = Backlog::start(Recorder::new(disk, scene()).unwrap(), Pace::Virtual);
    let offering = thread::spawn(move || {
        for seq in 1..=4 * Pace::Virtual.batch_messages() as u64 {
            backlog.record(&reading(seq), seq);
        }
        (backlog.dropped(), backlog.finish())
    });
    drop(let_go);
    let (dropped, recorded) = offering.join().unwrap();
    assert_eq!((dropped, recorded.lost), (0, 0));
    assert!(recorded.error.is_none());
}
