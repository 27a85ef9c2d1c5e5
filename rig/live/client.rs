//! One client: its queue, and the thread that serves it.
//!
//! The thread may wait for its client, since only this client's messages wait with it: once its queue is full, further
//! ones are dropped and counted. A client is a Foxglove program or the page; a request for the page's text is one, too.

use std::io;
use std::net::{Shutdown, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU16, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use masseter_recording::Recorded;
use masseter_shared::clock;

use super::handshake::{self, Protocol};
use super::host::Host;
use super::queue::{Disconnected, INTERVAL, QUEUE, Queued, bit};
use super::request::Peeked;
use super::{foxglove, page};

/// A client that takes nothing for this long is disconnected.
const WRITE_TIMEOUT: Duration = Duration::from_secs(30);
/// Looks, one each [`INTERVAL`], for the connection of a client that has named the secret.
const CONNECTION_POLLS: u32 = 100;

/// The recorder's end of a client's queue.
#[derive(Debug)]
pub(super) struct Client {
    stream: TcpStream,
    /// None once the server closes.
    queue: Option<SyncSender<Queued>>,
    /// One bit per [`Topic`] that it subscribes to.
    subscribed: Arc<AtomicU16>,
    is_admitted: Arc<AtomicBool>,
    is_connected: Arc<AtomicBool>,
    handshake_by_ns: u64,
    serving: JoinHandle<()>,
}

impl Client {
    /// Starts the thread, which makes the handshake and then serves the client.
    pub(super) fn start(stream: TcpStream, host: Host, handshake_by_ns: u64) -> io::Result<Self> {
        // It may be inherited from the listener, and the thread waits for requests.
        stream.set_nonblocking(false)?;
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(WRITE_TIMEOUT))?;
        let served = stream.try_clone()?;
        let (queue, queued) = sync_channel(QUEUE);
        let subscribed = Arc::new(AtomicU16::new(0));
        let is_admitted = Arc::new(AtomicBool::new(false));
        let is_connected = Arc::new(AtomicBool::new(false));
        let served = Served {
            stream: served,
            queued,
            subscribed: Arc::clone(&subscribed),
            is_admitted: Arc::clone(&is_admitted),
            is_connected: Arc::clone(&is_connected),
            host,
        };
        // A client may leave at any time.
        let serving = thread::Builder::new().spawn(move || drop(served.serve()))?;
        Ok(Self {
            stream,
            queue: Some(queue),
            subscribed,
            is_admitted,
            is_connected,
            handshake_by_ns,
            serving,
        })
    }

    /// Queues a message if the client subscribes to its topic. False if the message is dropped for want of room.
    pub(super) fn offer(&self, message: &Recorded, log_time_ns: u64) -> bool {
        let is_subscribed = self.subscribed.load(Ordering::Relaxed) & bit(message.topic()) != 0;
        let Some(queue) = self.queue.as_ref().filter(|_| is_subscribed) else { return true };
        !matches!(queue.try_send((log_time_ns, *message)), Err(TrySendError::Full(_)))
    }

    pub(super) fn is_subscribed(&self) -> bool {
        self.subscribed.load(Ordering::Relaxed) != 0
    }

    /// Whether its handshake takes too long.
    pub(super) fn is_overdue(&self, now_ns: u64) -> bool {
        !self.is_admitted() && now_ns > self.handshake_by_ns
    }

    pub(super) fn is_admitted(&self) -> bool {
        self.is_admitted.load(Ordering::Relaxed)
    }

    /// The recorder offers it messages from now on.
    pub(super) fn connect(&self) {
        self.is_connected.store(true, Ordering::Relaxed);
    }

    pub(super) fn is_gone(&self) -> bool {
        self.serving.is_finished()
    }

    /// Ends the queue: the thread sends the rest and closes the connection.
    pub(super) fn close(&mut self) {
        self.queue = None;
    }

    /// Disconnects the client.
    pub(super) fn cut_off(&self) {
        // It fails where the client has just left.
        let _ = self.stream.shutdown(Shutdown::Both);
    }
}

/// The thread's end.
struct Served {
    stream: TcpStream,
    queued: Receiver<Queued>,
    subscribed: Arc<AtomicU16>,
    is_admitted: Arc<AtomicBool>,
    is_connected: Arc<AtomicBool>,
    host: Host,
}

impl Served {
    fn serve(self) -> Result<(), Disconnected> {
        let peeked = Peeked::wait(&self.stream)?;
        if !peeked.is_for_socket() {
            return page::answer(self.stream, &peeked, &self.host);
        }
        let accepted = handshake::accept(self.stream, &self.host.secret)?;
        self.is_admitted.store(true, Ordering::Relaxed);
        // From here on the client misses no message that it subscribes to.
        await_connection(&self.is_connected)?;
        match accepted.protocol {
            Protocol::Foxglove => {
                foxglove::Session::new(accepted.socket, self.subscribed, self.host).serve(&self.queued)
            }
            Protocol::Page => {
                page::Session::new(accepted.socket, accepted.after, self.host).serve(&self.queued)
            }
        }
    }
}

/// Waits until the recorder offers messages; fails for a client without room.
fn await_connection(is_connected: &AtomicBool) -> Result<(), Disconnected> {
    for _ in 0..CONNECTION_POLLS {
        if is_connected.load(Ordering::Relaxed) {
            return Ok(());
        }
        clock::sleep(INTERVAL);
    }
    Err(Disconnected)
}
