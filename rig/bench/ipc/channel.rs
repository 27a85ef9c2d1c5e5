//! The channels that are compared.

use clap::ValueEnum;

/// A channel between two processes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Channel {
    /// The rig's transport.
    Rig,
    /// Bare iceoryx2.
    Iceoryx2,
    /// A Unix stream socket.
    Socket,
    /// Two pipes.
    Pipe,
}

impl Channel {
    /// The name in tables.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Rig => "masseter transport",
            Self::Iceoryx2 => "bare iceoryx2",
            Self::Socket => "Unix socket",
            Self::Pipe => "pipe",
        }
    }
}
