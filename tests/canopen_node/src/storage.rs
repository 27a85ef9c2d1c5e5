//! Values that survive a reset (1010h, 1011h), as lines `6065:00=D0070000`. All groups of 1010h store the same.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::dictionary::{Address, Dictionary};

/// Commands and targets, and storage itself.
const NEVER: [u16; 5] = [0x1003, 0x1010, 0x1011, 0x6040, 0x607A];

const TAKES_ALL: &str = "a text takes any line";

/// A line of a store that this crate has not written.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line} of the store: {text:?} is not like 6065:00=D0070000; remove the file")]
pub struct StoreError {
    /// Number of the line, from 1.
    pub line: usize,
    /// The line.
    pub text: String,
}

/// Stored values, and a change that is under way.
#[derive(Debug, Default)]
pub(crate) struct Storage {
    saved: BTreeMap<Address, Vec<u8>>,
    coming: Option<(u64, BTreeMap<Address, Vec<u8>>)>,
}

impl Storage {
    /// Reads a store.
    pub(crate) fn parse(text: &str) -> Result<Self, StoreError> {
        let line = |(line, text): (usize, &str)| {
            parse_line(text).ok_or_else(|| StoreError { line, text: text.to_owned() })
        };
        let saved = (1..).zip(text.lines()).map(line).collect::<Result<_, _>>()?;
        Ok(Self { saved, coming: None })
    }

    /// Begins to save the present values.
    pub(crate) fn save(&mut self, dictionary: &Dictionary, done_ns: u64) {
        let kept = dictionary.settable().filter(|((index, _), _)| !NEVER.contains(index));
        self.coming = Some((done_ns, kept.map(|(address, value)| (address, value.to_vec())).collect()));
    }

    /// Begins to forget all values; those as delivered take effect with the next reset.
    pub(crate) fn clear(&mut self, done_ns: u64) {
        self.coming = Some((done_ns, BTreeMap::new()));
    }

    /// Whether a change is under way.
    pub(crate) fn is_busy(&self) -> bool {
        self.coming.is_some()
    }

    /// The new text of the store, once a change is complete.
    pub(crate) fn complete(&mut self, now_ns: u64) -> Option<String> {
        let (_, saved) = self.coming.take_if(|(done_ns, _)| now_ns >= *done_ns)?;
        self.saved = saved;
        let mut text = String::new();
        for ((index, subindex), value) in &self.saved {
            write!(text, "{index:04X}:{subindex:02X}=").expect(TAKES_ALL);
            for byte in value {
                write!(text, "{byte:02X}").expect(TAKES_ALL);
            }
            text.push('\n');
        }
        Some(text)
    }

    /// Brings the stored values of indices up to `last` back.
    pub(crate) fn restore(&self, dictionary: &mut Dictionary, last: u16) {
        for (address, value) in self.saved.range(..=(last, u8::MAX)) {
            dictionary.set(*address, value);
        }
    }
}

fn parse_line(text: &str) -> Option<(Address, Vec<u8>)> {
    let (address, digits) = text.split_once('=')?;
    let (index, subindex) = address.split_once(':')?;
    let address = (u16::from_str_radix(index, 16).ok()?, u8::from_str_radix(subindex, 16).ok()?);
    let byte = |at: usize| u8::from_str_radix(digits.get(at..at + 2)?, 16).ok();
    let bytes = (0..digits.len()).step_by(2).map(byte).collect::<Option<_>>()?;
    Some((address, bytes))
}
