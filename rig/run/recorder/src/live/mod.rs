//! Shows a run while it goes on: as a page in a browser, and in Foxglove with the channels, schemas and bytes of the recording.
//!
//! Each client has a thread and a queue of fixed length of its own. The recorder puts messages into the queues and never
//! waits for a client. A message without room is dropped and counted. The server of the
//! `foxglove` crate counts no drops and brings an asynchronous runtime, so it is not used. Parameters are read and set at the
//! controller, by the client's thread. Who connects must name the secret of the URL: before that, a connection gets a small
//! buffer and neither a thread nor a queue.

mod connection;
mod feed;
mod foxglove;
mod page;
mod report;
mod request;
#[cfg(test)]
mod tests;

use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU16, AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::{self, JoinHandle};
use std::{io, time::Duration};

use masseter_recording::{Manifest, Recorded, Scene};
use masseter_runtime::conversation::{Conversation, Limits, Newcomers};
use masseter_runtime::transport::{Domain, secret};
use masseter_runtime::{clock, named::Declared};
use tungstenite::http::StatusCode;

pub use report::ReportServer;

use connection::{Host, INTERVAL, QUEUE, Queued, Socket, Supervisor, bit};
use feed::Feed;
use request::{Protocol, Wish};

/// The default address: this machine only, on Foxglove's usual port.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:8765";

/// Connected clients, and what they missed so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct ClientCounts {
    /// Clients.
    pub connected: usize,
    /// Dropped messages, summed over the clients.
    pub dropped: u64,
}

/// What clients missed in a whole run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ClientLosses {
    /// Dropped messages, summed over the clients.
    pub dropped: u64,
    /// Clients that had not read everything when the server closed.
    pub cut_off: usize,
}

/// The server cannot listen on its address.
#[derive(Debug, thiserror::Error)]
#[error(
    "cannot listen for browsers and Foxglove on {address}: {error}; choose another with --live=PORT or --live=ADDR:PORT (port 0 takes a free one)"
)]
pub struct ListenError {
    /// The requested address.
    pub address: SocketAddr,
    /// The system's error.
    pub error: io::Error,
}

/// Most clients at a time; each has a thread and a queue of its own.
const MAX_CLIENTS: usize = 8;
/// Most pages that are sent at a time, each by a thread.
const MAX_PAGES: usize = 4;
/// Most connections that have not named the secret; anybody may begin one.
const MAX_NEWCOMERS: usize = 32;
/// Longest wait between two looks whether the server closes.
const CLOSE_INTERVAL: Duration = Duration::from_millis(50);
/// Least time between two looks for new connections, which bounds what they cost.
const ACCEPT_INTERVAL: Duration = Duration::from_millis(5);
/// A client that takes nothing for this long is disconnected.
const WRITE_TIMEOUT: Duration = Duration::from_secs(30);
/// Time that clients have to read the rest.
const CLOSING: Duration = Duration::from_millis(500);
/// Time between two looks whether all have read it.
const CLOSING_POLL: Duration = Duration::from_millis(10);

/// Listens on an address, and does not answer yet.
///
/// # Errors
/// When the system refuses the address.
pub fn listen_on(address: SocketAddr) -> Result<TcpListener, ListenError> {
    TcpListener::bind(address).map_err(|error| ListenError { address, error })
}

/// A running server.
#[derive(Debug)]
pub(crate) struct LiveServer {
    address: SocketAddr,
    secret: String,
    feed: Arc<Feed>,
    clients: Arc<Clients>,
    domain: Domain,
    dropped: AtomicU64,
    accepting: JoinHandle<()>,
}

/// One admitted client: the recorder's end of its queue, and the thread that serves it.
#[derive(Debug)]
struct Client {
    stream: TcpStream,
    /// None once the server closes.
    queue: Option<SyncSender<Queued>>,
    protocol: Protocol,
    /// One bit per topic that it subscribes to.
    subscribed: Arc<AtomicU16>,
    serving: JoinHandle<()>,
}

impl Client {
    /// Opens the WebSocket of an admitted client and serves it in a thread. `conversation` contains what the client has
    /// sent behind its request.
    fn start(
        mut conversation: Conversation,
        protocol: Protocol,
        opening: &[u8],
        host: Host,
    ) -> io::Result<Self> {
        conversation.say(opening);
        let behind = conversation.heard().to_vec();
        let stream = TcpStream::from(conversation.into_connection()?);
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(WRITE_TIMEOUT))?;
        stream.set_read_timeout(Some(INTERVAL))?;
        let socket = Socket::new(stream.try_clone()?, behind);
        let (queue, queued) = sync_channel(QUEUE);
        let subscribed = Arc::new(AtomicU16::new(0));
        let published = Arc::clone(&subscribed);
        let serve = move || {
            // A client may leave at any time.
            let _ = match protocol {
                Protocol::Foxglove => foxglove::Session::new(socket, published, host).serve(&queued),
                Protocol::Page { after } => page::Session::new(socket, after, host).serve(&queued),
            };
        };
        let serving = thread::Builder::new().spawn(serve)?;
        Ok(Self { stream, queue: Some(queue), protocol, subscribed, serving })
    }

    /// Queues a message if the client subscribes to its topic. False if the message is dropped for want of room.
    fn offer(&self, message: &Recorded, log_time_ns: u64) -> bool {
        let is_subscribed = self.subscribed.load(Ordering::Relaxed) & bit(message.topic()) != 0;
        let Some(queue) = self.queue.as_ref().filter(|_| is_subscribed) else { return true };
        !matches!(queue.try_send((log_time_ns, *message)), Err(TrySendError::Full(_)))
    }

    fn is_subscribed(&self) -> bool {
        self.subscribed.load(Ordering::Relaxed) != 0
    }

    fn is_gone(&self) -> bool {
        self.serving.is_finished()
    }
}

#[derive(Debug, Default)]
struct Clients {
    connected: Mutex<Vec<Client>>,
    is_closing: AtomicBool,
}

impl Clients {
    fn connected(&self) -> MutexGuard<'_, Vec<Client>> {
        self.connected.lock().expect("no thread panics with it")
    }

    /// Admits clients until the server closes.
    fn accept(&self, newcomers: &mut Newcomers, host: &Host) {
        let mut pages = Vec::new();
        while !self.is_closing.load(Ordering::Relaxed) {
            newcomers.wait(CLOSE_INTERVAL);
            for conversation in newcomers.look(clock::now_ns(), request::is_whole).asking {
                self.admit(conversation, host, &mut pages);
            }
            // Those who have left are dropped without the lock, for which the recorder waits.
            let gone: Vec<_> = self.connected().extract_if(.., |client| client.is_gone()).collect();
            drop(gone);
            clock::sleep(ACCEPT_INTERVAL);
        }
    }

    /// Serves a client that names the secret, if there is room, and answers every other.
    fn admit(&self, mut conversation: Conversation, host: &Host, pages: &mut Vec<JoinHandle<()>>) {
        let (wish, length) = match request::wish(conversation.heard(), &host.secret) {
            Ok(admitted) => admitted,
            Err(refusal) => return conversation.say(&refusal),
        };
        conversation.consume(length);
        pages.retain(|page| !page.is_finished());
        match wish {
            Wish::Page if pages.len() < MAX_PAGES => {
                let host = host.clone();
                let send = move || page::send_page(conversation, &host);
                // Without a thread for it, the client is disconnected.
                pages.extend(thread::Builder::new().spawn(send));
            }
            Wish::Socket { protocol, opening } if self.connected().len() < MAX_CLIENTS => {
                // The client is known to the recorder before it can subscribe: it misses no message from then on.
                let mut connected = self.connected();
                connected.extend(Client::start(conversation, protocol, &opening, host.clone()));
            }
            Wish::Page | Wish::Socket { .. } => {
                let full = "as many clients watch this run as it shows itself to: close another one";
                conversation.say(&request::http_answer(StatusCode::SERVICE_UNAVAILABLE, "text/plain", &full));
            }
        }
    }
}

impl LiveServer {
    /// Serves clients that name the secret, which is new. The domain is that of the run, whose controller makes the
    /// declaration.
    ///
    /// # Errors
    /// When the system refuses a thread or random numbers.
    pub(crate) fn start(
        listener: TcpListener,
        manifest: Manifest,
        scene: Scene,
        declared: Declared,
        domain: Domain,
    ) -> io::Result<Self> {
        let (address, secret) = (listener.local_addr()?, secret()?);
        let feed = Feed::start(manifest, &declared)?;
        let host = Host {
            secret: secret.clone(),
            scene,
            declared: Arc::new(declared),
            domain: domain.clone(),
            feed: Arc::clone(&feed),
            supervisor: Supervisor::of_this_process(),
        };
        let clients = Arc::new(Clients::default());
        let accepted = Arc::clone(&clients);
        let limits = Limits::newcomer(request::LONGEST);
        let mut newcomers = Newcomers::at(listener.into(), MAX_NEWCOMERS, limits)?;
        let accepting = thread::Builder::new().spawn(move || accepted.accept(&mut newcomers, &host))?;
        Ok(Self { address, secret, feed, clients, domain, dropped: AtomicU64::new(0), accepting })
    }

    /// The address of the page, with the secret.
    pub(crate) fn page_url(&self) -> String {
        format!("http://{}/{}", self.address, self.secret)
    }

    /// The URL for Foxglove, with the secret.
    pub(crate) fn url(&self) -> String {
        format!("ws://{}/{}", self.address, self.secret)
    }

    /// Queues a message that was received at `log_time_ns` for the clients that subscribe to its topic. Never waits for
    /// one.
    pub(crate) fn offer(&self, message: &Recorded, log_time_ns: u64) {
        self.feed.offer(message);
        let clients = self.clients.connected();
        let dropped = clients.iter().filter(|client| !client.offer(message, log_time_ns)).count();
        self.dropped.fetch_add(dropped as u64, Ordering::Relaxed);
    }

    /// The clients at this moment.
    pub(crate) fn counts(&self) -> ClientCounts {
        let connected = self.clients.connected().iter().filter(|client| !client.is_gone()).count();
        ClientCounts { connected, dropped: self.dropped.load(Ordering::Relaxed) }
    }

    /// Sends the queue, gives clients half a second to read it, and closes; returns what they missed.
    pub(crate) fn close(self) -> ClientLosses {
        self.close_within(CLOSING)
    }

    fn close_within(self, time: Duration) -> ClientLosses {
        self.clients.is_closing.store(true, Ordering::Relaxed);
        // A panic of this thread is on standard error already, and does not concern the recording.
        let _ = self.accepting.join();
        let mut clients = self.clients.connected();
        let watches = |client: &Client| matches!(client.protocol, Protocol::Page { .. }) && !client.is_gone();
        if clients.iter().any(watches) {
            report::Address { address: self.address, secret: self.secret }.leave(&self.domain);
        }
        // Without its queue a thread sends the rest and closes the connection.
        clients.iter_mut().for_each(|client| client.queue = None);
        for _ in 0..time.as_millis() / CLOSING_POLL.as_millis() {
            clients.retain(|client| !client.is_gone());
            if clients.is_empty() {
                break;
            }
            clock::sleep(CLOSING_POLL);
        }
        for client in clients.iter() {
            // It fails where the client has just left.
            let _ = client.stream.shutdown(Shutdown::Both);
        }
        let cut_off = clients.iter().filter(|client| client.is_subscribed()).count();
        ClientLosses { dropped: self.dropped.load(Ordering::Relaxed), cut_off }
    }
}
