//! Shows a run while it goes on, to Foxglove and whatever else speaks its WebSocket protocol: the
//! channels, schemas and bytes of the recording.
//!
//! A thread of its own serves the clients. The logger only puts messages that somebody wants to see into
//! a queue of fixed size and never waits; no other process knows of it. What finds no room, in the queue
//! or with a client that reads too slowly, is dropped and counted: the recording has it all.

mod client;
mod protocol;
mod server;
mod socket;
#[cfg(test)]
mod tests;

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::{self, JoinHandle};

use masseter_recording::{Recorded, Scene, Topic};
use server::Server;

/// Where a run is shown unless told otherwise: to this machine only, on Foxglove's usual port.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:8765";
/// Messages on their way to the serving thread: almost half a second of every topic at 1 kHz.
const QUEUE: usize = 8192;

/// Why a run cannot be shown.
#[derive(Debug, thiserror::Error)]
#[error(
    "cannot show the run on {address}: {error}; choose another address with --live=ADDR:PORT (port 0 takes a free one)"
)]
pub struct LiveError {
    /// The address asked for.
    pub address: SocketAddr,
    /// What the system said.
    pub error: io::Error,
}

/// How many watch, and what they missed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Watched {
    /// Clients.
    pub clients: usize,
    /// Messages that found no room, summed over the clients.
    pub dropped: u64,
}

/// What those who watched did not get.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Missed {
    /// Messages that found no room, summed over the clients.
    pub dropped: u64,
    /// Clients that did not read what was left when the run was over.
    pub cut_off: usize,
}

/// What the serving thread and the logger know of each other.
#[derive(Debug, Default)]
struct Shared {
    /// A bit for each [`Topic`] that a client wants to see.
    wanted: AtomicU8,
    clients: AtomicUsize,
    dropped: AtomicU64,
    cut_off: AtomicUsize,
}

/// A run being shown.
#[derive(Debug)]
pub struct Live {
    address: SocketAddr,
    queue: SyncSender<Offer>,
    shared: Arc<Shared>,
    serving: JoinHandle<()>,
}

/// A message, and when it was received, ns.
#[derive(Debug, Clone, Copy)]
struct Offer {
    log_time_ns: u64,
    message: Recorded,
}

/// Whether an address is free to show a run on.
pub fn check(address: SocketAddr) -> Result<(), LiveError> {
    bind(address).map(|_| ())
}

fn bind(address: SocketAddr) -> Result<TcpListener, LiveError> {
    let bound = TcpListener::bind(address).and_then(|listener| {
        listener.set_nonblocking(true)?;
        Ok(listener)
    });
    bound.map_err(|error| LiveError { address, error })
}

impl Live {
    /// Begins to listen for clients. `session` tells this run from others.
    pub fn start(address: SocketAddr, scene: Scene, session: &str) -> Result<Self, LiveError> {
        let listener = bind(address)?;
        let address = listener.local_addr().map_err(|error| LiveError { address, error })?;
        let shared = Arc::new(Shared::default());
        let (queue, offers) = sync_channel(QUEUE);
        let server = Server::new(listener, scene, session, Arc::clone(&shared));
        let serving = thread::spawn(move || server.serve(&offers));
        Ok(Self { address, queue, shared, serving })
    }

    /// Where clients find it.
    pub fn url(&self) -> String {
        format!("ws://{}", self.address)
    }

    /// Offers a message that was received at `log_time_ns` to whoever watches. Never waits.
    pub fn offer(&self, message: &Recorded, log_time_ns: u64) {
        if self.shared.wanted.load(Ordering::Relaxed) & bit(message.topic()) == 0 {
            return;
        }
        if self.queue.try_send(Offer { log_time_ns, message: *message }).is_err() {
            self.shared.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// How many watch, and what they missed so far.
    pub fn watched(&self) -> Watched {
        Watched {
            clients: self.shared.clients.load(Ordering::Relaxed),
            dropped: self.shared.dropped.load(Ordering::Relaxed),
        }
    }

    /// Says goodbye to the clients and gives them half a second to read what is left; returns what they missed.
    pub fn finish(self) -> Missed {
        drop(self.queue);
        // A serving thread that failed has said so; the recording does not depend on it.
        let _ = self.serving.join();
        Missed {
            dropped: self.shared.dropped.load(Ordering::Relaxed),
            cut_off: self.shared.cut_off.load(Ordering::Relaxed),
        }
    }
}

const _: () = assert!(Topic::ALL.len() <= u8::BITS as usize, "every topic has a bit in `Shared::wanted`");

fn bit(topic: Topic) -> u8 {
    1 << topic as u8
}
