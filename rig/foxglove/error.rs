//! The error of a server that cannot start.

use std::io;
use std::net::SocketAddr;

/// The server cannot listen on its address.
#[derive(Debug, thiserror::Error)]
#[error(
    "cannot listen for Foxglove on {address}: {error}; choose another address with --live=ADDR:PORT (port 0 takes a free one)"
)]
pub struct ListenError {
    /// The requested address.
    pub address: SocketAddr,
    /// The system's error.
    pub error: io::Error,
}
