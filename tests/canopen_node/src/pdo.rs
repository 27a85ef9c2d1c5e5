//! Process data by the parameters found in the dictionary.

use masseter_can::{CanId, Frame};

use crate::dictionary::{Address, Dictionary};

const NOT_VALID: i64 = 1 << 31;
const SYNCHRONOUS_MAX: i64 = 240;
const EVENT_DRIVEN: i64 = 254;
/// 1800h:03h counts in 100 µs, 1800h:05h in ms.
const INHIBIT_NS: u64 = 100_000;
const TIMER_NS: u64 = 1_000_000;

/// A received PDO; it waits for SYNC if its type says so.
#[derive(Debug)]
pub(crate) struct Rpdo {
    communication: u16,
    waiting: Option<Frame>,
}

/// A transmitted PDO.
#[derive(Debug)]
pub(crate) struct Tpdo {
    communication: u16,
    last: Option<(u64, Frame)>,
    syncs: i64,
}

/// A frame whose length is not that of the mapping.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LengthError {
    Short,
    Long,
}

impl Rpdo {
    /// Every received PDO of the dictionary.
    pub(crate) fn all(dictionary: &Dictionary) -> Vec<Self> {
        communications(dictionary, 0x1400)
            .map(|communication| Self { communication, waiting: None })
            .collect()
    }

    /// Whether the frame has its identifier.
    pub(crate) fn has(&self, dictionary: &Dictionary, frame: Frame) -> bool {
        identifier(dictionary, self.communication) == Some(frame.id())
    }

    /// Takes a frame of its identifier; true if it takes effect now.
    pub(crate) fn take(&mut self, dictionary: &Dictionary, frame: Frame) -> bool {
        if !self.has(dictionary, frame) {
            return false;
        }
        self.waiting = Some(frame);
        dictionary.number((self.communication, 2)) > SYNCHRONOUS_MAX
    }

    /// Forgets a frame that has not taken effect.
    pub(crate) fn clear(&mut self) {
        self.waiting = None;
    }

    /// Writes the waiting frame into the dictionary; the addresses that it wrote.
    pub(crate) fn apply(&mut self, dictionary: &mut Dictionary) -> Result<Vec<Address>, LengthError> {
        let Some(frame) = self.waiting.take() else { return Ok(Vec::new()) };
        let mut data = frame.data();
        let mapping = mapping(dictionary, self.communication);
        if mapping.iter().map(|(_, bytes)| bytes).sum::<usize>() > data.len() {
            return Err(LengthError::Short);
        }
        for (address, bytes) in &mapping {
            let (value, rest) = data.split_at(*bytes);
            dictionary.set(*address, value);
            data = rest;
        }
        if data.is_empty() {
            Ok(mapping.into_iter().map(|(address, _)| address).collect())
        } else {
            Err(LengthError::Long)
        }
    }
}

impl Tpdo {
    /// Every transmitted PDO of the dictionary.
    pub(crate) fn all(dictionary: &Dictionary) -> Vec<Self> {
        communications(dictionary, 0x1800)
            .map(|communication| Self { communication, last: None, syncs: 0 })
            .collect()
    }

    /// Forgets what was sent: a node that becomes operational begins anew.
    pub(crate) fn restart(&mut self) {
        (self.last, self.syncs) = (None, 0);
    }

    /// The frame due at SYNC.
    pub(crate) fn at_sync(&mut self, dictionary: &Dictionary, now_ns: u64) -> Option<Frame> {
        let every = dictionary.number((self.communication, 2));
        self.syncs += 1;
        let frame = self.frame(dictionary)?;
        let is_new = self.last.is_none_or(|(_, last)| last != frame);
        let is_due = if every == 0 { is_new } else { every <= SYNCHRONOUS_MAX && self.syncs >= every };
        is_due.then(|| {
            (self.last, self.syncs) = (Some((now_ns, frame)), 0);
            frame
        })
    }

    /// The frame due because a value changed, or because its timer ran out.
    pub(crate) fn at_event(&mut self, dictionary: &Dictionary, now_ns: u64) -> Option<Frame> {
        let parameter = |subindex| dictionary.number((self.communication, subindex)) as u64;
        if dictionary.number((self.communication, 2)) < EVENT_DRIVEN {
            return None;
        }
        let frame = self.frame(dictionary)?;
        let (inhibit_ns, timer_ns) = (parameter(3) * INHIBIT_NS, parameter(5) * TIMER_NS);
        let is_due = self.last.is_none_or(|(at_ns, last)| {
            let age_ns = now_ns - at_ns;
            age_ns >= inhibit_ns && last != frame || timer_ns > 0 && age_ns >= timer_ns
        });
        is_due.then(|| {
            self.last = Some((now_ns, frame));
            frame
        })
    }

    fn frame(&self, dictionary: &Dictionary) -> Option<Frame> {
        let id = identifier(dictionary, self.communication)?;
        let mapping = mapping(dictionary, self.communication);
        let data: Vec<_> =
            mapping.iter().filter_map(|(address, _)| dictionary.bytes(*address)).flatten().copied().collect();
        Frame::new(id, &data).ok()
    }
}

fn communications(dictionary: &Dictionary, first: u16) -> impl Iterator<Item = u16> {
    (first..first + 0x200).filter(|index| dictionary.has((*index, 1)))
}

/// The identifier of a valid PDO that carries something.
fn identifier(dictionary: &Dictionary, communication: u16) -> Option<CanId> {
    let cob_id = dictionary.number((communication, 1));
    let is_used = cob_id & NOT_VALID == 0 && dictionary.number((communication + 0x200, 0)) > 0;
    CanId::standard((cob_id & 0x7FF) as u16).ok().filter(|_| is_used)
}

/// The mapped entries and their bytes.
fn mapping(dictionary: &Dictionary, communication: u16) -> Vec<(Address, usize)> {
    let index = communication + 0x200;
    let count = dictionary.number((index, 0)) as u8;
    let entry = |place| {
        let mapped = dictionary.number((index, place));
        (((mapped >> 16) as u16, (mapped >> 8) as u8), (mapped & 0xFF) as usize / 8)
    };
    (1..=count).map(entry).collect()
}
