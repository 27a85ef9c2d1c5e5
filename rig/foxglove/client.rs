//! One client: its queue, and the thread that serves it.
//!
//! The thread may wait for its client, since only this client's messages wait with it: once its queue is full, further
//! ones are dropped and counted.

use std::fmt::Display;
use std::io::ErrorKind;
use std::net::{Shutdown, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU16, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, TrySendError, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use masseter_recording::{Channel, Encoded, Encoder, Recorded, Scene, Topic};
use masseter_shared::clock;
use masseter_shared::messages::Parameters;
use masseter_shared::named::{Declared, Parameter, access};
use masseter_shared::transport::Domain;
use tungstenite::handshake::server::{Callback, ErrorResponse, Request, Response};
use tungstenite::http::{HeaderValue, StatusCode, header::SEC_WEBSOCKET_PROTOCOL};
use tungstenite::protocol::frame::{CloseFrame, coding::CloseCode};
use tungstenite::protocol::{Message, WebSocket, WebSocketConfig};
use tungstenite::{Error, accept_hdr_with_config};

use super::admission::admit;
use super::protocol::{self, ClientMessage, Level, WantedValue};

/// Length of a client's queue: almost half a second of every topic at 1 kHz.
const QUEUE: usize = 8192;
/// The longest message from a client, bytes; clients only subscribe.
const MAX_REQUEST_BYTES: usize = 1 << 16;
/// A client that takes nothing for this long is disconnected.
const WRITE_TIMEOUT: Duration = Duration::from_secs(30);
/// Time that the thread waits for a request before it sends what is queued.
const INTERVAL: Duration = Duration::from_millis(10);

/// Looks, one each [`INTERVAL`], for the connection of a client that has named the secret.
const CONNECTION_POLLS: u32 = 100;

/// A message, and when it was received, ns.
type Queued = (u64, Recorded);

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

/// The secret that a client must name, the first texts to it, and whose parameters it may set.
#[derive(Debug, Clone)]
pub(super) struct Greeting {
    pub secret: String,
    pub texts: [String; 2],
    pub declared: Arc<Declared>,
    pub domain: Domain,
}

const _: () =
    assert!(Topic::ALL.len() <= u16::BITS as usize, "every topic has a bit in `Client::subscribed`");

impl Client {
    /// Starts the thread, which makes the handshake and then sends the greeting.
    pub(super) fn start(
        stream: TcpStream,
        scene: Scene,
        greeting: Greeting,
        handshake_by_ns: u64,
    ) -> std::io::Result<Self> {
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(WRITE_TIMEOUT))?;
        let served = stream.try_clone()?;
        let (queue, queued) = sync_channel(QUEUE);
        let subscribed = Arc::new(AtomicU16::new(0));
        let published = Arc::clone(&subscribed);
        let is_admitted = Arc::new(AtomicBool::new(false));
        let admitted = Arc::clone(&is_admitted);
        let is_connected = Arc::new(AtomicBool::new(false));
        let connected = Arc::clone(&is_connected);
        let serving = thread::Builder::new().spawn(move || {
            // A client may leave at any time.
            let _ = Session::open(served, scene, published, greeting).and_then(|session| {
                admitted.store(true, Ordering::Relaxed);
                // From here on the client misses no message that it subscribes to.
                await_connection(&connected)?;
                session.serve(&queued)
            });
        })?;
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

/// The bit of a topic in [`Client::subscribed`].
fn bit(topic: Topic) -> u16 {
    1 << topic as u8
}

/// Why a request is not fulfilled.
type Refusal = (Level, String);

/// The client is disconnected.
struct Disconnected;

impl From<Error> for Disconnected {
    fn from(_: Error) -> Self {
        Self
    }
}

struct Session {
    socket: WebSocket<TcpStream>,
    encoder: Encoder,
    /// The client's subscription id of each channel.
    subscriptions: [Option<u32>; Channel::COUNT],
    subscribed: Arc<AtomicU16>,
    greeting: Greeting,
    /// Whether it wants the changes of parameters.
    wants_parameters: bool,
}

impl Session {
    fn open(
        stream: TcpStream,
        scene: Scene,
        subscribed: Arc<AtomicU16>,
        greeting: Greeting,
    ) -> Result<Self, Disconnected> {
        let config = WebSocketConfig::default()
            .max_message_size(Some(MAX_REQUEST_BYTES))
            .max_frame_size(Some(MAX_REQUEST_BYTES));
        let handshake = Handshake { secret: &greeting.secret };
        let socket = accept_hdr_with_config(stream, handshake, Some(config)).map_err(|_| Disconnected)?;
        socket.get_ref().set_read_timeout(Some(INTERVAL)).map_err(Error::Io)?;
        let subscriptions = [None; Channel::COUNT];
        let encoder = Encoder::new(scene);
        Ok(Self { socket, encoder, subscriptions, subscribed, greeting, wants_parameters: false })
    }

    /// Serves the client until the queue has ended and the client has read everything.
    fn serve(mut self, queue: &Receiver<Queued>) -> Result<(), Disconnected> {
        for text in self.greeting.texts.clone() {
            self.text(text)?;
        }
        loop {
            self.receive()?;
            for _ in 0..QUEUE {
                match queue.try_recv() {
                    Ok((log_time_ns, message)) => self.send(log_time_ns, &message)?,
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => return self.close(),
                }
            }
            self.socket.flush()?;
        }
    }

    /// Sends a close frame behind everything else. A client that answers it has read everything.
    fn close(mut self) -> Result<(), Disconnected> {
        let frame = CloseFrame { code: CloseCode::Away, reason: "the run is over".into() };
        self.socket.close(Some(frame))?;
        loop {
            self.receive()?;
        }
    }

    /// Waits a moment for a request, and answers it.
    fn receive(&mut self) -> Result<(), Disconnected> {
        match self.socket.read() {
            Ok(Message::Text(text)) => self.answer(&text),
            Err(Error::Io(error)) if error.kind() != ErrorKind::WouldBlock => Err(Disconnected),
            Ok(_) | Err(Error::Io(_)) => Ok(()),
            Err(_) => Err(Disconnected),
        }
    }

    fn text(&mut self, text: String) -> Result<(), Disconnected> {
        Ok(self.socket.send(Message::Text(text.into()))?)
    }

    /// Sends the parameters of these names, or all.
    fn send_parameters(
        &mut self,
        names: &[String],
        id: Option<&str>,
    ) -> Result<Option<Refusal>, Disconnected> {
        match access::list(&self.greeting.domain) {
            Ok(parameters) => {
                let is_asked = |parameter: &&Parameter| names.is_empty() || names.contains(&parameter.name);
                let asked = parameters.iter().filter(is_asked).map(|parameter| (parameter, parameter.value));
                self.text(protocol::parameter_values(asked, id))?;
                Ok(None)
            }
            Err(error) => Ok(Some((Level::Error, error.to_string()))),
        }
    }

    /// Sets parameters at the controller, and answers if there is an id: with what holds now.
    fn set_parameters(
        &mut self,
        wanted: &[WantedValue],
        id: Option<&str>,
    ) -> Result<Option<Refusal>, Disconnected> {
        let mut refused = None;
        for WantedValue { name, value } in wanted {
            let set = match value.as_f64() {
                Some(number) => {
                    access::set(&self.greeting.domain, name, number).map_err(|error| error.to_string())
                }
                None => Err(format!("parameter '{name}' is a number, not {value}")),
            };
            refused = set.err().map(|error| (Level::Error, error)).or(refused);
        }
        let names: Vec<_> = wanted.iter().map(|WantedValue { name, .. }| name.clone()).collect();
        // A refused value must not remain on the client's screen.
        let unanswered =
            if id.is_some() || refused.is_some() { self.send_parameters(&names, id)? } else { None };
        Ok(refused.or(unanswered))
    }

    fn answer(&mut self, text: &str) -> Result<(), Disconnected> {
        let refused = match serde_json::from_str(text) {
            Ok(ClientMessage::Subscribe { subscriptions }) => {
                let mut are_known = true;
                for subscription in subscriptions {
                    match subscription.channel_index() {
                        Some(index) => self.subscriptions[index] = Some(subscription.id),
                        None => are_known = false,
                    }
                }
                (!are_known).then(|| (Level::Error, "the channel does not exist".to_owned()))
            }
            Ok(ClientMessage::Unsubscribe { subscription_ids }) => {
                for id in &mut self.subscriptions {
                    *id = id.filter(|id| !subscription_ids.contains(id));
                }
                None
            }
            Ok(ClientMessage::GetParameters { parameter_names, id }) => {
                self.send_parameters(&parameter_names, id.as_deref())?
            }
            Ok(ClientMessage::SetParameters { parameters, id }) => {
                self.set_parameters(&parameters, id.as_deref())?
            }
            Ok(ClientMessage::SubscribeParameterUpdates { .. }) => {
                self.wants_parameters = true;
                None
            }
            Ok(ClientMessage::UnsubscribeParameterUpdates { .. }) => {
                self.wants_parameters = false;
                None
            }
            Ok(ClientMessage::Unsupported) => {
                Some((Level::Warning, "the server offers subscriptions and parameters only".to_owned()))
            }
            Err(error) => Some((Level::Error, format!("the request is not valid: {error}"))),
        };
        self.publish_subscriptions();
        if let Some((level, text)) = refused {
            self.text(protocol::status(level, &text))?;
        }
        Ok(())
    }

    /// Publishes which topics the recorder should queue.
    fn publish_subscriptions(&self) {
        let is_subscribed = |channel: Channel| self.subscriptions[channel.place()].is_some();
        let topics =
            Topic::ALL.into_iter().filter(|topic| Channel::for_topic(*topic).into_iter().any(is_subscribed));
        let parameters = if self.wants_parameters { bit(Topic::Parameters) } else { 0 };
        self.subscribed.store(topics.fold(parameters, |bits, topic| bits | bit(topic)), Ordering::Relaxed);
    }

    /// Sends a message on those of its channels that the client subscribes to, and changed parameters to a client that
    /// wants them.
    fn send(&mut self, log_time_ns: u64, message: &Recorded) -> Result<(), Disconnected> {
        if let Recorded::Parameters(Parameters { parameters, .. }) = message
            && self.wants_parameters
        {
            let values = parameters.as_slice().iter().copied();
            let named = self.greeting.declared.parameters.iter().zip(values);
            self.text(protocol::parameter_values(named, None))?;
        }
        let Self { socket, encoder, subscriptions, .. } = self;
        encoder.encode(message, |message: Encoded| match subscriptions[message.channel.place()] {
            Some(id) => {
                Ok(socket.write(Message::Binary(protocol::message_data(id, log_time_ns, &message).into()))?)
            }
            None => Ok(()),
        })
    }
}

/// Accepts the handshake of a client that is admitted and offers one of Foxglove's subprotocols, and refuses every other.
struct Handshake<'a> {
    secret: &'a str,
}

impl Callback for Handshake<'_> {
    fn on_request(self, request: &Request, mut response: Response) -> Result<Response, ErrorResponse> {
        admit(request, self.secret).map_err(|refusal| refused(StatusCode::FORBIDDEN, &refusal))?;
        let mut offers = request.headers().get_all(SEC_WEBSOCKET_PROTOCOL).iter();
        let chosen = offers.find_map(|offer| protocol::choose_subprotocol(offer.to_str().ok()?));
        let Some(chosen) = chosen else {
            return Err(refused(StatusCode::BAD_REQUEST, &"this is a Foxglove WebSocket server"));
        };
        response.headers_mut().insert(SEC_WEBSOCKET_PROTOCOL, HeaderValue::from_static(chosen));
        Ok(response)
    }
}

fn refused(status: StatusCode, reason: &dyn Display) -> ErrorResponse {
    let mut refusal = ErrorResponse::new(Some(format!("{reason}\n")));
    *refusal.status_mut() = status;
    refusal
}
