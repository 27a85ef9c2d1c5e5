//! The queue between the recorder and the serving thread, and the counters that both use.

use std::sync::atomic::{AtomicU8, AtomicU64, AtomicUsize};

use masseter_recording::{Recorded, Topic};

/// Length of the queue: almost half a second of every topic at 1 kHz.
pub(super) const LENGTH: usize = 8192;

/// A message, and when it was received, ns.
#[derive(Debug, Clone, Copy)]
pub(super) struct QueuedMessage {
    pub log_time_ns: u64,
    pub message: Recorded,
}

/// Written by the serving thread; the recorder also counts what it drops.
#[derive(Debug, Default)]
pub(super) struct Counters {
    /// One bit per [`Topic`] that a client subscribes to.
    pub subscribed: AtomicU8,
    pub connected: AtomicUsize,
    pub dropped: AtomicU64,
    pub cut_off: AtomicUsize,
}

const _: () =
    assert!(Topic::ALL.len() <= u8::BITS as usize, "every topic has a bit in `Counters::subscribed`");

/// The bit of a topic in [`Counters::subscribed`].
pub(super) fn bit(topic: Topic) -> u8 {
    1 << topic as u8
}
