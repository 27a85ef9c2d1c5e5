//! What the recorder's end of a client and the thread that serves the client share.

use std::io;
use std::time::Duration;

use masseter_recording::{Recorded, Topic};

/// Length of a client's queue: almost half a second of every topic at 1 kHz.
pub(super) const QUEUE: usize = 8192;
/// Time that the thread waits for a request before it sends what is queued.
pub(super) const INTERVAL: Duration = Duration::from_millis(10);

/// A message, and when it was received, ns.
pub(super) type Queued = (u64, Recorded);

const _: () = assert!(Topic::ALL.len() <= u16::BITS as usize, "every topic has a bit");

/// The bit of a topic among those that a client subscribes to.
pub(super) fn bit(topic: Topic) -> u16 {
    1 << topic as u8
}

/// The client is disconnected.
#[derive(Debug)]
pub(super) struct Disconnected;

impl From<io::Error> for Disconnected {
    fn from(_: io::Error) -> Self {
        Self
    }
}

impl From<tungstenite::Error> for Disconnected {
    fn from(_: tungstenite::Error) -> Self {
        Self
    }
}
