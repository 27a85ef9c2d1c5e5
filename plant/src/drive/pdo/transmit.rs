//! A PDO that the drive transmits.

use masseter_can::canopen::ObjectAddress;
use masseter_can::{CanId, Frame};
use masseter_shared::clock::MILLISECOND_NS;

use super::EVENT_DRIVEN;
use super::mapping::{MAX_BYTES, Mapped};
use crate::drive::dictionary::Objects;

/// Unit of an inhibit time, ns.
const INHIBIT_UNIT_NS: u64 = MILLISECOND_NS / 10;
/// Objects that change with every sample. As in most drives that is no event, or their noise alone would fill the bus:
/// the event timer (1800:5) sends them.
const SAMPLED: [u16; 5] = [0x6062, 0x6064, 0x606C, 0x6077, 0x60F4];

/// When a TPDO is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Trigger {
    /// At the next SYNC after a change.
    ChangeThenSync,
    /// At every so many SYNCs, beginning with one whose counter is that (0: any).
    EverySync { every: u8, start: u8 },
    /// At a change, and at the latest after the event timer.
    Event,
}

/// A PDO that the drive transmits.
#[derive(Debug, Clone)]
pub(in crate::drive) struct Tpdo {
    id: Option<CanId>,
    trigger: Trigger,
    inhibit_ns: u64,
    timer_ns: u64,
    mapped: Mapped,
    /// The objects whose change has it sent.
    watched: Mapped,
    /// SYNCs since it was sent last; `None` until the start value came.
    syncs: Option<u8>,
    /// What the watched objects were when it was sent last, and when.
    sent: Option<([u8; MAX_BYTES], u64)>,
}

impl Tpdo {
    /// As configured, nothing sent.
    pub(in crate::drive) fn new(objects: &Objects, number: u16) -> Self {
        let (communication, mapping) = (0x1800 + number, 0x1A00 + number);
        let start = objects.at(communication, 6) as u8;
        let mapped = Mapped::of(objects, mapping);
        let is_event = |object: ObjectAddress| !SAMPLED.contains(&object.index);
        let trigger = match objects.at(communication, 2) as u8 {
            0 => Trigger::ChangeThenSync,
            every if every < EVENT_DRIVEN => Trigger::EverySync { every, start },
            _ => Trigger::Event,
        };
        Self {
            id: objects.cob_id(communication, 1).identifier(),
            trigger,
            inhibit_ns: u64::from(objects.at(communication, 3)) * INHIBIT_UNIT_NS,
            timer_ns: u64::from(objects.at(communication, 5)) * MILLISECOND_NS,
            watched: if trigger == Trigger::Event { mapped.only(is_event) } else { mapped },
            mapped,
            syncs: None,
            sent: None,
        }
    }

    /// Whether it exists and is sent at events rather than at SYNC.
    pub(in crate::drive) fn is_event_driven(&self) -> bool {
        self.id.is_some() && self.trigger == Trigger::Event
    }

    /// Begins anew, as when the node becomes operational.
    pub(in crate::drive) fn clear(&mut self) {
        (self.syncs, self.sent) = (None, None);
    }

    /// The frame to send at a SYNC of that counter (0 where SYNC has none).
    pub(in crate::drive) fn at_sync(&mut self, now_ns: u64, counter: u8, objects: &Objects) -> Option<Frame> {
        let id = self.id?;
        match self.trigger {
            Trigger::Event => None,
            Trigger::ChangeThenSync => self.frame_of_change(id, now_ns, objects),
            Trigger::EverySync { every, start } => {
                let syncs = match self.syncs {
                    None if counter != 0 && start != 0 && counter != start => return None,
                    None => every,
                    Some(syncs) => syncs + 1,
                };
                self.syncs = Some(if syncs >= every { 0 } else { syncs });
                if syncs >= every { self.frame(id, objects) } else { None }
            }
        }
    }

    /// The frame to send because of an event.
    pub(in crate::drive) fn at_event(&mut self, now_ns: u64, objects: &Objects) -> Option<Frame> {
        let id = self.id.filter(|_| self.is_event_driven())?;
        let since_ns = self.sent.map(|(_, sent_ns)| now_ns.saturating_sub(sent_ns));
        if since_ns.is_some_and(|since_ns| since_ns < self.inhibit_ns) {
            return None;
        }
        let is_due = self.timer_ns > 0 && since_ns.is_some_and(|since_ns| since_ns >= self.timer_ns);
        if is_due {
            self.sent = None;
        }
        self.frame_of_change(id, now_ns, objects)
    }

    /// The frame, if a watched object is not what it was when it was sent last.
    fn frame_of_change(&mut self, id: CanId, now_ns: u64, objects: &Objects) -> Option<Frame> {
        let watched = self.watched.pack(objects);
        if self.sent.is_some_and(|(sent, _)| sent == watched) {
            return None;
        }
        self.sent = Some((watched, now_ns));
        self.frame(id, objects)
    }

    fn frame(&self, id: CanId, objects: &Objects) -> Option<Frame> {
        let data = self.mapped.pack(objects);
        Frame::new(id, &data[..self.mapped.length]).ok()
    }
}
