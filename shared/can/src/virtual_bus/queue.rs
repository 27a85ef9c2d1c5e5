//! A port's bounded queues. They allocate when made and never after.

use std::collections::VecDeque;

use crate::bus::{ReceiveError, SendError};
use crate::frame::Frame;
use crate::wire::{Bitrate, frame_bits};

/// A frame waiting for the wire.
#[derive(Debug, Clone, Copy)]
pub(super) struct Queued {
    pub(super) frame: Frame,
    /// Its duration on the wire, interframe space included, computed once, since arbitration needs it many times.
    pub(super) duration_ns: u64,
    pub(super) since_ns: u64,
}

impl Queued {
    pub(super) fn new(frame: Frame, bitrate: Bitrate, since_ns: u64) -> Self {
        Self { frame, duration_ns: bitrate.bits_to_ns(frame_bits(&frame)), since_ns }
    }
}

/// Frames in the order of priority; those of one identifier in the order they were queued.
#[derive(Debug)]
pub(super) struct TransmitQueue {
    frames: Vec<Queued>,
    capacity: usize,
}

impl TransmitQueue {
    pub(super) fn new(capacity: usize) -> Self {
        Self { frames: Vec::with_capacity(capacity), capacity }
    }

    pub(super) fn push(&mut self, queued: Queued) -> Result<(), SendError> {
        if self.frames.len() == self.capacity {
            return Err(SendError::QueueFull { capacity: self.capacity });
        }
        let place = self.frames.partition_point(|other| other.frame.id() <= queued.frame.id());
        self.frames.insert(place, queued);
        Ok(())
    }

    pub(super) fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// When the frame that waits longest was queued.
    pub(super) fn earliest_ns(&self) -> Option<u64> {
        self.frames.iter().map(|queued| queued.since_ns).min()
    }

    /// The most urgent of the frames queued up to that time.
    pub(super) fn most_urgent(&self, at_ns: u64) -> Option<&Queued> {
        self.frames.iter().find(|queued| queued.since_ns <= at_ns)
    }

    /// Removes that frame.
    pub(super) fn remove_most_urgent(&mut self, at_ns: u64) {
        if let Some(place) = self.frames.iter().position(|queued| queued.since_ns <= at_ns) {
            self.frames.remove(place);
        }
    }

    /// Discards all frames; returns their number.
    pub(super) fn clear(&mut self) {
        self.frames.clear();
    }
}

/// Received items that are not fetched yet, oldest first. An item that does not fit is lost and counted.
#[derive(Debug)]
pub(super) struct ReceiveQueue<T> {
    /// Items with their times of arrival, ns.
    arrived: VecDeque<(u64, T)>,
    capacity: usize,
    lost: u64,
}

impl<T> ReceiveQueue<T> {
    pub(super) fn new(capacity: usize) -> Self {
        Self { arrived: VecDeque::with_capacity(capacity), capacity, lost: 0 }
    }

    pub(super) fn push(&mut self, time_ns: u64, item: T) {
        if self.arrived.is_empty() {
            // An empty queue starts at its front again: entries of a long queue would not be in the cache.
            self.arrived.clear();
        }
        if self.arrived.len() == self.capacity {
            self.lost += 1;
        } else {
            self.arrived.push_back((time_ns, item));
        }
    }

    /// The oldest item, if it had arrived by then. Losses are reported first, once.
    pub(super) fn pop(&mut self, now_ns: u64) -> Result<Option<T>, ReceiveError> {
        match std::mem::take(&mut self.lost) {
            0 if self.arrived.front().is_some_and(|(time_ns, _)| *time_ns <= now_ns) => {
                Ok(self.arrived.pop_front().map(|(_, item)| item))
            }
            0 => Ok(None),
            lost => Err(ReceiveError::Overrun { lost }),
        }
    }
}
