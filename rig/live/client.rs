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

use masseter_recording::{Recorded, Scene, Topic};
use masseter_shared::clock;
use masseter_shared::named::Declared;
use masseter_shared::transport::Domain;

use super::handshake::{self, Protocol};
use super::page::{self, Feed};
use super::request::Peeked;
use super::{foxglove, supervisor::Supervisor};

/// Length of a client's queue: almost half a second of every topic at 1 kHz.
pub(super) const QUEUE: usize = 8192;
/// A client that takes nothing for this long is disconnected.
const WRITE_TIMEOUT: Duration = Duration::from_secs(30);
/// Time that the thread waits for a request before it sends what is queued.
pub(super) const INTERVAL: Duration = Duration::from_millis(10);

/// Looks, one each [`INTERVAL`], for the connection of a client that has named the secret.
const CONNECTION_POLLS: u32 = 100;

/// A message, and when it was received, ns.
pub(super) type Queued = (u64, Recorded);

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

/// What clients may see and do: the secret that they must name, the run's scene, signals and parameters, its page, and who ends
/// the run.
#[derive(Debug, Clone)]
pub(super) struct Host {
    pub secret: String,
    pub scene: Scene,
    pub declared: Arc<Declared>,
    pub domain: Domain,
    pub feed: Arc<Feed>,
    pub supervisor: Supervisor,
}

const _: () =
    assert!(Topic::ALL.len() <= u16::BITS as usize, "every topic has a bit in `Client::subscribed`");

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

/// The bit of a topic in [`Client::subscribed`].
pub(super) fn bit(topic: Topic) -> u16 {
    1 << topic as u8
}

/// The client is disconnected.
#[derive(Debug)]
pub(super) struct Disconnected;

impl From<io::Error> for Disconnected {
    fn from(_: io::Error) -> Self {
        Self
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
