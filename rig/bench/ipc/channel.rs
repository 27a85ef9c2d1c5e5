//! The channels between two processes that are compared.

use std::os::unix::net::UnixStream;

use clap::ValueEnum;
use masseter_shared::transport::{Domain, Node};

use super::exchange::Ends;
use super::topics::Numbered;
use super::{socket, topics};

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Channel {
    Rig,
    Iceoryx2,
    Socket,
}

impl Channel {
    /// Opens the ends of one side: in the domain, or on its half of the socket.
    pub(super) fn open<Sent: Numbered, Got: Numbered>(
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
