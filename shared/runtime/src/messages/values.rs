//! Numbers in a message of fixed size: a CDR sequence with room for the most that a controller may name.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

use super::schema::FieldType;

/// Room for this many numbers.
pub const MOST_VALUES: usize = 64;

/// Numbers, as CDR writes a sequence: how many, then they themselves on their alignment. Unused ones are zero.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable, ZeroCopySend)]
pub struct Values {
    /// Number of values in use.
    pub length: u32,
    /// The alignment of the first value.
    unused: u32,
    /// The values in use, then zeros.
    pub values: [f64; MOST_VALUES],
}

impl Values {
    /// This many zeros.
    ///
    /// # Panics
    /// With more than there is room for.
    pub fn zeros(length: usize) -> Self {
        assert!(length <= MOST_VALUES, "{length} values have no room");
        Self { length: length as u32, ..Self::zeroed() }
    }

    /// The values in use.
    pub fn as_slice(&self) -> &[f64] {
        &self.values[..self.count()]
    }

    /// The same, to be changed.
    pub fn as_mut_slice(&mut self) -> &mut [f64] {
        let count = self.count();
        &mut self.values[..count]
    }

    fn count(&self) -> usize {
        MOST_VALUES.min(self.length as usize)
    }
}

impl FieldType for Values {
    fn ros_type() -> String {
        format!("{}[<={MOST_VALUES}]", f64::ros_type())
    }

    fn unused_bytes(&self) -> usize {
        (MOST_VALUES - self.count()) * size_of::<f64>()
    }
}
