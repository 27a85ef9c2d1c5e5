//! The node id.

use std::fmt;

/// A number that is no node id.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{id} is no CANopen node id (1 to 127)")]
pub struct NodeIdError {
    /// The number.
    pub id: u8,
}

/// A CANopen node id, 1 to 127.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct NodeId(u8);

impl NodeId {
    /// The node of that number.
    ///
    /// # Errors
    /// [`NodeIdError`] outside 1 to 127.
    pub const fn new(id: u8) -> Result<Self, NodeIdError> {
        if matches!(id, 1..=127) { Ok(Self(id)) } else { Err(NodeIdError { id }) }
    }

    /// The number, 1 to 127.
    pub const fn get(self) -> u8 {
        self.0
    }
}

impl fmt::Display for NodeId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_1_to_127_are_nodes() {
        for id in 0..=255 {
            assert_eq!(NodeId::new(id).map(NodeId::get).ok(), (1..128).contains(&id).then_some(id));
        }
    }
}
