//! Schemas of channels, and how the rig's own messages are encoded.

/// Encapsulation header of plain little-endian CDR (version 1, OMG CDR).
pub const CDR_LITTLE_ENDIAN: [u8; 4] = [0x00, 0x01, 0x00, 0x00];
/// Encoding of the rig's own messages.
pub(super) const MESSAGE_ENCODING: &str = "cdr";
/// Encoding of the schemas of the rig's own topics.
pub const SCHEMA_ENCODING: &str = "ros2msg";

/// A schema that channels refer to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Schema {
    /// Its type name.
    pub name: String,
    /// The language it is written in.
    pub encoding: String,
    /// The definition.
    pub data: Vec<u8>,
}
