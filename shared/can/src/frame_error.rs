//! Identifiers and data lengths that CAN does not have.

/// An identifier or a frame that CAN cannot carry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum FrameError {
    /// More than 11 bits in a standard identifier.
    #[error("identifier {id:X}h does not fit into 11 bits (at most 7FFh)")]
    StandardId {
        /// The identifier asked for.
        id: u32,
    },
    /// More than 29 bits in an extended identifier.
    #[error("identifier {id:X}h does not fit into 29 bits (at most 1FFFFFFFh)")]
    ExtendedId {
        /// The identifier asked for.
        id: u32,
    },
    /// More data than a classical frame carries.
    #[error("{length} data bytes: a classical frame carries at most 8")]
    DataLength {
        /// Bytes asked for.
        length: usize,
    },
}
