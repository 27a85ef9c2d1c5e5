//! A WebSocket server for Foxglove: shows a run while it goes on, with the channels, schemas and bytes of the recording.
//!
//! A thread of its own serves the clients. The recorder puts subscribed messages into a queue of fixed length and never
//! waits; no other process is involved. A message without room, in the queue or with a client that reads too slowly, is
//! dropped and counted. The server of the `foxglove` crate counts no drops and brings an asynchronous runtime, so it is
//! not used. There are no parameters, services, assets or publishing clients, and no authentication.

mod client;
mod error;
mod protocol;
mod queue;
mod server;
mod socket;
#[cfg(test)]
mod tests;

use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::{self, JoinHandle};

use masseter_recording::{Recorded, Scene};

pub use error::ListenError;
use queue::{Counters, QueuedMessage, bit};
use server::Server;

/// The default address: this machine only, on Foxglove's usual port.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:8765";

/// Connected clients, and what they missed so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ClientCounts {
    /// Clients.
    pub connected: usize,
    /// Dropped messages, summed over the clients.
    pub dropped: u64,
}

/// What clients missed in a whole run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClientLosses {
    /// Dropped messages, summed over the clients.
    pub dropped: u64,
    /// Clients that had not read everything when the server closed.
    pub cut_off: usize,
}

/// A running server.
#[derive(Debug)]
pub struct FoxgloveServer {
    address: SocketAddr,
    queue: SyncSender<QueuedMessage>,
    counters: Arc<Counters>,
    serving: JoinHandle<()>,
}

/// Whether a server can listen on `address`.
///
/// # Errors
/// When the system refuses the address.
pub fn check(address: SocketAddr) -> Result<(), ListenError> {
    bind(address).map(drop)
}

fn bind(address: SocketAddr) -> Result<TcpListener, ListenError> {
    let bound = TcpListener::bind(address).and_then(|listener| {
        listener.set_nonblocking(true)?;
        Ok(listener)
    });
    bound.map_err(|error| ListenError { address, error })
}

impl FoxgloveServer {
    /// Listens for clients. `session` differs between runs.
    ///
    /// # Errors
    /// When the system refuses the address.
    pub fn start(address: SocketAddr, scene: Scene, session: &str) -> Result<Self, ListenError> {
        let listener = bind(address)?;
        let address = listener.local_addr().map_err(|error| ListenError { address, error })?;
        let counters = Arc::new(Counters::default());
        let (queue, queued) = sync_channel(queue::LENGTH);
        let server = Server::new(listener, scene, session, Arc::clone(&counters));
        let serving = thread::spawn(move || server.serve(&queued));
        Ok(Self { address, queue, counters, serving })
    }

    /// The URL for clients.
    pub fn url(&self) -> String {
        format!("ws://{}", self.address)
    }

    /// Queues a message that was received at `log_time_ns`, if a client subscribes to its topic. Never waits.
    pub fn offer(&self, message: &Recorded, log_time_ns: u64) {
        if self.counters.subscribed.load(Ordering::Relaxed) & bit(message.topic()) == 0 {
            return;
        }
        if self.queue.try_send(QueuedMessage { log_time_ns, message: *message }).is_err() {
            self.counters.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// The clients at this moment.
    pub fn counts(&self) -> ClientCounts {
        ClientCounts {
            connected: self.counters.connected.load(Ordering::Relaxed),
            dropped: self.counters.dropped.load(Ordering::Relaxed),
        }
    }

    /// Sends what is queued, gives clients half a second to read it, and closes; returns what they missed.
    pub fn finish(self) -> ClientLosses {
        drop(self.queue);
        // A panic of the serving thread is on standard error already, and does not concern the recording.
        let _ = self.serving.join();
        ClientLosses {
            dropped: self.counters.dropped.load(Ordering::Relaxed),
            cut_off: self.counters.cut_off.load(Ordering::Relaxed),
        }
    }
}
