//! A transmit PDO and its trigger.

use masseter_can::canopen::CobId;
use masseter_can::{CanId, Frame};
use masseter_runtime::clock::MILLISECOND_NS;

use super::mapping::{EVENT_DRIVEN, MAX_BYTES, Mapped};
use crate::drive::dictionary::Objects;

/// Unit of an inhibit time, ns.
const INHIBIT_UNIT_NS: u64 = MILLISECOND_NS / 10;
/// Objects that change with every sample. As in most drives their change is no event, since noise alone would fill the
/// bus; the event timer (1800h:5) sends them.
const SAMPLED: [u16; 6] = [0x6062, 0x6063, 0x6064, 0x606C, 0x6077, 0x60F4];

/// The condition for sending a TPDO.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Trigger {
    /// At the next SYNC after a change.
    ChangeThenSync,
    /// At every n-th SYNC, beginning with one that has the start value as its counter (0: any).
    EverySync { every: u8, start: u8 },
    /// At a change, and at the latest after the event timer.
    Event,
}

/// A transmit PDO.
#[derive(Debug, Clone)]
pub(crate) struct Tpdo {
    id: Option<CanId>,
    trigger: Trigger,
    inhibit_ns: u64,
    timer_ns: u64,
    mapped: Mapped,
    /// The objects whose change triggers transmission.
    watched: Mapped,
    /// SYNCs since the last transmission; none before the start value.
    syncs: Option<u8>,
    /// Data of the watched objects at the last transmission, and its time.
    sent: Option<([u8; MAX_BYTES], u64)>,
}

impl Tpdo {
    /// The configured PDO, nothing sent yet.
    pub(crate) fn new(objects: &Objects, number: usize) -> Self {
        let (communication, mapping) = (0x1800 + number as u16, 0x1A00 + number as u16);
        let start = objects.at(communication, 6) as u8;
        let mapped = Mapped::compile(objects, mapping);
        let trigger = match objects.at(communication, 2) as u8 {
            0 => Trigger::ChangeThenSync,
            every if every < EVENT_DRIVEN => Trigger::EverySync { every, start },
            _ => Trigger::Event,
        };
        let mut watched = mapped.clone();
        if trigger == Trigger::Event {
            watched.retain(|index| !SAMPLED.contains(&index));
        }
        Self {
            id: CobId(objects.at(communication, 1)).identifier(),
            trigger,
            inhibit_ns: u64::from(objects.at(communication, 3)) * INHIBIT_UNIT_NS,
            timer_ns: u64::from(objects.at(communication, 5)) * MILLISECOND_NS,
            mapped,
            watched,
            syncs: None,
            sent: None,
        }
    }

    /// Whether the PDO exists and is sent at events instead of SYNC.
    pub(crate) fn is_event_driven(&self) -> bool {
        self.id.is_some() && self.trigger == Trigger::Event
    }

    /// Restarts transmission, as when the node becomes operational.
    pub(crate) fn clear(&mut self) {
        (self.syncs, self.sent) = (None, None);
    }

    /// The frame due at a SYNC of that counter (0 where SYNC has none).
    pub(crate) fn at_sync(&mut self, now_ns: u64, counter: u8, objects: &Objects) -> Option<Frame> {
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

    /// The frame due because of an event.
    pub(crate) fn at_event(&mut self, now_ns: u64, objects: &Objects) -> Option<Frame> {
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

    /// The frame, if a watched object has changed since the last transmission.
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
        Frame::new(id, &data[..self.mapped.length()]).ok()
    }
}
