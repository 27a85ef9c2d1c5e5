//! The channels between two processes that are compared.

use std::os::unix::net::UnixStream;

use clap::ValueEnum;
use masseter_runtime::messages::{Command, Reading};
use masseter_runtime::transport::{Domain, Node};

use crate::exchange::Ends;
use crate::topics::Numbered;
use crate::{socket, topics};

/// A channel between two processes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Channel {
    /// The rig's transport.
    Rig,
    /// The same messages over iceoryx2 alone.
    Iceoryx2,
    /// A Unix socket.
    Socket,
}

impl Channel {
    /// The ends of the side that sends commands: in the domain, or on its half of the socket.
    ///
    /// # Errors
    /// When they cannot be opened.
    pub fn asking(self, domain: &Domain, socket: UnixStream) -> anyhow::Result<Ends> {
        self.open::<Command, Reading>(domain, socket)
    }

    /// The ends of the side that answers with readings.
    ///
    /// # Errors
    /// When they cannot be opened.
    pub fn answering(self, domain: &Domain, socket: UnixStream) -> anyhow::Result<Ends> {
        self.open::<Reading, Command>(domain, socket)
    }

    fn open<Sent: Numbered, Got: Numbered>(
        self,
        domain: &Domain,
        socket: UnixStream,
    ) -> anyhow::Result<Ends> {
        match self {
            Self::Rig => topics::of_the_rig::<Sent, Got>(&Node::join(domain)?),
            Self::Iceoryx2 => topics::bare::<Sent, Got>(&Node::join(domain)?),
            Self::Socket => socket::ends(socket),
        }
    }
}
