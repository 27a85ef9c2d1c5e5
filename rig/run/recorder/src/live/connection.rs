//! What the protocols of clients share: the socket to a client, its queue, and what every client may see and do.

use std::{io::ErrorKind, net::TcpStream, sync::Arc, time::Duration};

use masseter_recording::{Recorded, Scene, Topic};
use masseter_runtime::clock::{self, SECOND_NS};
use masseter_runtime::{named::Declared, transport::Domain};
use rustix::process::{Pid, Signal, getppid, kill_process};
use tungstenite::Error;
use tungstenite::protocol::frame::{CloseFrame, coding::CloseCode};
use tungstenite::protocol::{Message, Role, WebSocket, WebSocketConfig};

/// Length of a client's queue: almost half a second of every topic at 1 kHz.
pub(super) const QUEUE: usize = 8192;
/// Time that the thread waits for a request before it sends the queue.
pub(super) const INTERVAL: Duration = Duration::from_millis(10);

/// Time for the answer to a close frame, ns.
const CLOSE_NS: u64 = 2 * SECOND_NS;
/// The longest message from a client, bytes; clients only ask.
const MAX_REQUEST_BYTES: usize = 1 << 16;

/// A message, and when it was received, ns.
pub(super) type Queued = (u64, Recorded);

const _: () = assert!(Topic::ALL.len() <= u16::BITS as usize, "every topic has a bit");

/// The bit of a topic among those that a client subscribes to.
pub(super) fn bit(topic: Topic) -> u16 {
    1 << topic as u8
}

/// The client is disconnected.
#[derive(Debug, thiserror::Error)]
#[error("the client has left")]
pub(super) struct Disconnected;

impl From<Error> for Disconnected {
    fn from(_: Error) -> Self {
        Self
    }
}

/// A WebSocket whose reads end after a moment.
pub(super) struct Socket(WebSocket<TcpStream>);

impl Socket {
    /// A connection with a time-out for reads, whose handshake is done. The client has sent `behind` already.
    pub(super) fn new(stream: TcpStream, behind: Vec<u8>) -> Self {
        let config = WebSocketConfig::default()
            .max_message_size(Some(MAX_REQUEST_BYTES))
            .max_frame_size(Some(MAX_REQUEST_BYTES));
        Self(WebSocket::from_partially_read(stream, behind, Role::Server, Some(config)))
    }

    /// The text of the next request, if one comes in a moment.
    pub(super) fn receive(&mut self) -> Result<Option<String>, Disconnected> {
        match self.0.read() {
            Ok(Message::Text(text)) => Ok(Some(text.as_str().to_owned())),
            Err(Error::Io(error)) if error.kind() != ErrorKind::WouldBlock => Err(Disconnected),
            Ok(_) | Err(Error::Io(_)) => Ok(None),
            Err(_) => Err(Disconnected),
        }
    }

    /// Sends a message as JSON at once.
    pub(super) fn send_json(&mut self, message: &impl serde::Serialize) -> Result<(), Disconnected> {
        self.send_text(
            &serde_json::to_string(message).expect("the message holds only strings, numbers and lists"),
        )
    }

    /// Sends a text at once.
    pub(super) fn send_text(&mut self, text: &str) -> Result<(), Disconnected> {
        Ok(self.0.send(Message::text(text))?)
    }

    /// Writes bytes that go out with the next [`flush`](Self::flush).
    pub(super) fn write_bytes(&mut self, bytes: Vec<u8>) -> Result<(), Disconnected> {
        Ok(self.0.write(Message::Binary(bytes.into()))?)
    }

    /// Sends the written bytes.
    pub(super) fn flush(&mut self) -> Result<(), Disconnected> {
        Ok(self.0.flush()?)
    }

    /// Sends a close frame behind everything else. A client that answers the frame has read everything; one that does not
    /// answer in time keeps no place.
    pub(super) fn close_after_all(&mut self) -> Result<(), Disconnected> {
        let frame = CloseFrame { code: CloseCode::Away, reason: "the run is over".into() };
        self.0.close(Some(frame))?;
        let by_ns = clock::now_ns() + CLOSE_NS;
        while clock::now_ns() < by_ns {
            self.receive()?;
        }
        Err(Disconnected)
    }
}

/// The secret that clients must name, the run's scene, signals and parameters, its page, and who ends the run.
#[derive(Debug, Clone)]
pub(super) struct Host {
    pub secret: String,
    pub scene: Scene,
    pub declared: Arc<Declared>,
    pub domain: Domain,
    pub feed: Arc<super::feed::Feed>,
    pub supervisor: Supervisor,
}

/// The run's supervisor, which a client may ask to end the run: the parent of this process.
#[derive(Debug, Clone)]
pub(super) struct Supervisor {
    process: Option<Pid>,
    is_asked: Arc<std::sync::atomic::AtomicBool>,
}

impl Supervisor {
    /// The parent at this moment.
    pub(super) fn of_this_process() -> Self {
        Self { process: getppid(), is_asked: Arc::default() }
    }

    /// Asks for an orderly end, once: a second signal would end the run at once.
    pub(super) fn stop(&self) {
        let is_first = !self.is_asked.swap(true, std::sync::atomic::Ordering::Relaxed);
        // A process whose parent has died has another parent, which is no supervisor.
        if let Some(process) = self.process.filter(|_| is_first && getppid() == self.process) {
            // It fails where the supervisor has just ended.
            let _ = kill_process(process, Signal::INT);
        }
    }
}
