//! One admitted client of the live view: a thread that serves it, and the recorder's end of its queue.

use std::io;
use std::net::{Shutdown, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicU16, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use masseter_recording::Recorded;
use masseter_runtime::conversation::Conversation;

use super::host::Host;
use super::queue::{Disconnected, INTERVAL, QUEUE, Queued, bit};
use super::request::Protocol;
use super::socket::Socket;
use super::{foxglove, page};

/// A client that takes nothing for this long is disconnected.
const WRITE_TIMEOUT: Duration = Duration::from_secs(30);

/// The recorder's end of a client's queue.
#[derive(Debug)]
pub(super) struct Client {
    stream: TcpStream,
    /// None once the server closes.
    queue: Option<SyncSender<Queued>>,
    /// One bit per [`Topic`] that it subscribes to.
    subscribed: Arc<AtomicU16>,
    serving: JoinHandle<()>,
}

impl Client {
    /// Opens the WebSocket of an admitted client and serves it in a thread. `conversation` contains what the client has
    /// sent behind its request.
    pub(super) fn start(
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
        // A client may leave at any time.
        let serve = move || drop(serve(socket, protocol, published, host, &queued));
        let serving = thread::Builder::new().spawn(serve)?;
        Ok(Self { stream, queue: Some(queue), subscribed, serving })
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

fn serve(
    socket: Socket,
    protocol: Protocol,
    subscribed: Arc<AtomicU16>,
    host: Host,
    queued: &Receiver<Queued>,
) -> Result<(), Disconnected> {
    match protocol {
        Protocol::Foxglove => foxglove::Session::new(socket, subscribed, host).serve(queued),
        Protocol::Page { after } => page::Session::new(socket, after, host).serve(queued),
    }
}
