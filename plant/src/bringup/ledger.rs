//! Old values of objects that a step has changed, kept where the end of the program does not lose them.

use std::io;

use masseter_scenario::ObjectKey;
use serde::{Deserialize, Serialize};

/// A changed object with its old value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct OldValue {
    /// The object.
    pub object: ObjectKey,
    /// Its value before the change.
    pub value: u32,
    /// Bytes of the value.
    pub bytes: usize,
}

/// Where old values are kept.
pub trait Ledger: Send {
    /// Replaces what is kept of the drive of an axis by these values, the oldest change first; by nothing without values.
    ///
    /// # Errors
    /// When the values cannot be kept.
    fn keep(&mut self, axis: usize, values: &[OldValue]) -> io::Result<()>;
}
