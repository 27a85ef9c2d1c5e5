//! One client: its handshake, its subscriptions, and the messages sent to it.
//!
//! The socket never blocks. Unread bytes stay in a buffer of fixed size; once it is full, messages for this client are
//! dropped and counted.

use std::io::ErrorKind;
use std::net::TcpStream;

use masseter_recording::{Channel, Encoded};
use tungstenite::handshake::server::{ErrorResponse, Request, Response, ServerHandshake};
use tungstenite::handshake::{HandshakeError, MidHandshake};
use tungstenite::http::{HeaderValue, StatusCode, header::SEC_WEBSOCKET_PROTOCOL};
use tungstenite::protocol::frame::{CloseFrame, coding::CloseCode};
use tungstenite::protocol::{Message, WebSocket, WebSocketConfig};
use tungstenite::{Error, accept_hdr_with_config};

use super::protocol::{self, ClientMessage, Level, Subscription};
use super::socket::Socket;

/// Most bytes that wait for a client: half a second of every topic at 1 kHz.
const UNREAD_BYTES: usize = 1 << 20;
/// Bytes gathered per write to the system.
const WRITE_BYTES: usize = 1 << 16;
/// The longest message from a client, bytes; clients only subscribe.
const MAX_REQUEST_BYTES: usize = 1 << 16;
/// Polls that a handshake may take: 5 s, so that an idle connection does not keep a client's place.
const HANDSHAKE_POLLS: u32 = 500;
/// Most requests of a client per poll, so that none delays the others.
const REQUESTS_PER_POLL: usize = 16;

type Callback = fn(&Request, Response) -> Result<Response, ErrorResponse>;
type Handshake = MidHandshake<ServerHandshake<Socket, Callback>>;
type HandshakeResult = Result<WebSocket<Socket>, HandshakeError<ServerHandshake<Socket, Callback>>>;

pub(super) struct Client {
    link: Link,
    /// Polls left for the handshake.
    polls: u32,
    /// The client's subscription id of each channel.
    subscriptions: [Option<u32>; Channel::COUNT],
}

enum Link {
    /// Taken out while the handshake continues.
    Handshake(Option<Handshake>),
    Open(WebSocket<Socket>),
}

/// The client is disconnected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Disconnected;

impl Client {
    /// Begins the handshake; `greeting` is sent once it is complete.
    pub(super) fn accept(stream: TcpStream, greeting: &[String]) -> Result<Self, Disconnected> {
        let socket = Socket::new(stream).map_err(|_| Disconnected)?;
        let config = WebSocketConfig::default()
            .read_buffer_size(MAX_REQUEST_BYTES)
            .write_buffer_size(WRITE_BYTES)
            .max_write_buffer_size(UNREAD_BYTES)
            .max_message_size(Some(MAX_REQUEST_BYTES))
            .max_frame_size(Some(MAX_REQUEST_BYTES));
        let subscriptions = [None; Channel::COUNT];
        let mut client = Self { link: Link::Handshake(None), polls: HANDSHAKE_POLLS, subscriptions };
        let callback: Callback = choose_subprotocol;
        client.open(accept_hdr_with_config(socket, callback, Some(config)), greeting)?;
        Ok(client)
    }

    fn open(&mut self, result: HandshakeResult, greeting: &[String]) -> Result<(), Disconnected> {
        match result {
            Ok(socket) => {
                self.link = Link::Open(socket);
                greeting.iter().try_for_each(|text| self.send_text(text.clone()))
            }
            Err(HandshakeError::Interrupted(handshake)) => {
                self.link = Link::Handshake(Some(handshake));
                Ok(())
            }
            Err(HandshakeError::Failure(_)) => Err(Disconnected),
        }
    }

    pub(super) fn is_subscribed_to(&self, channel: Channel) -> bool {
        self.subscriptions[channel.place()].is_some()
    }

    /// Continues the handshake, or answers the client's requests.
    pub(super) fn receive(&mut self, greeting: &[String]) -> Result<(), Disconnected> {
        if let Link::Handshake(handshake) = &mut self.link {
            self.polls = self.polls.checked_sub(1).ok_or(Disconnected)?;
            let handshake = handshake.take().ok_or(Disconnected)?;
            self.open(handshake.handshake(), greeting)?;
        }
        if let Link::Open(socket) = &mut self.link {
            socket.get_mut().begin_poll();
        }
        for _ in 0..REQUESTS_PER_POLL {
            let Link::Open(socket) = &mut self.link else { break };
            match socket.read() {
                Ok(Message::Text(text)) => self.answer(&text)?,
                Ok(_) => {}
                Err(error) => return if would_block(&error) { Ok(()) } else { Err(Disconnected) },
            }
        }
        Ok(())
    }

    fn answer(&mut self, text: &str) -> Result<(), Disconnected> {
        match serde_json::from_str(text) {
            Ok(ClientMessage::Subscribe { subscriptions }) => {
                subscriptions.into_iter().try_for_each(|subscription| self.subscribe(subscription))
            }
            Ok(ClientMessage::Unsubscribe { subscription_ids }) => {
                for id in &mut self.subscriptions {
                    *id = id.filter(|id| !subscription_ids.contains(id));
                }
                Ok(())
            }
            Ok(ClientMessage::Unsupported) => {
                self.send_status(Level::Warning, "the server offers subscriptions only")
            }
            Err(error) => self.send_status(Level::Error, &format!("the request is not valid: {error}")),
        }
    }

    fn subscribe(&mut self, subscription: Subscription) -> Result<(), Disconnected> {
        let Some(index) = subscription.channel_index() else {
            return self.send_status(Level::Error, "the channel does not exist");
        };
        if self.subscriptions[index].is_some() {
            return self.send_status(Level::Warning, "the channel is subscribed already");
        }
        self.subscriptions[index] = Some(subscription.id);
        Ok(())
    }

    /// Sends a message if the client subscribes to its channel. False if the message is dropped for want of room.
    pub(super) fn send_message(&mut self, log_time_ns: u64, message: &Encoded) -> Result<bool, Disconnected> {
        match self.subscriptions[message.channel.place()] {
            Some(id) => self.send(Message::Binary(protocol::message_data(id, log_time_ns, message).into())),
            None => Ok(true),
        }
    }

    fn send_status(&mut self, level: Level, text: &str) -> Result<(), Disconnected> {
        self.send_text(protocol::status(level, text))
    }

    /// Sends a text that the client must not miss: without room for it, the client is disconnected.
    fn send_text(&mut self, text: String) -> Result<(), Disconnected> {
        if self.send(Message::Text(text.into()))? { Ok(()) } else { Err(Disconnected) }
    }

    fn send(&mut self, message: Message) -> Result<bool, Disconnected> {
        let Link::Open(socket) = &mut self.link else { return Ok(true) };
        match socket.write(message) {
            Ok(()) => Ok(true),
            Err(Error::WriteBufferFull(_)) => Ok(false),
            // The message waits in the buffer.
            Err(error) if would_block(&error) => Ok(true),
            Err(_) => Err(Disconnected),
        }
    }

    /// Writes buffered bytes, as many as the system accepts.
    pub(super) fn flush(&mut self) -> Result<(), Disconnected> {
        let Link::Open(socket) = &mut self.link else { return Ok(()) };
        match socket.flush() {
            Err(error) if !would_block(&error) => Err(Disconnected),
            _ => Ok(()),
        }
    }

    /// Sends a close frame behind everything else. A client that answers it has read everything, and is disconnected.
    pub(super) fn close(&mut self) -> Result<(), Disconnected> {
        let Link::Open(socket) = &mut self.link else { return Err(Disconnected) };
        let frame = CloseFrame { code: CloseCode::Away, reason: "the run is over".into() };
        match socket.flush().and_then(|()| socket.close(Some(frame))) {
            Err(error) if !would_block(&error) => Err(Disconnected),
            _ => Ok(()),
        }
    }
}

/// Accepts a handshake that offers one of Foxglove's subprotocols, and refuses every other.
#[expect(clippy::result_large_err, reason = "the library's callback returns it by value")]
fn choose_subprotocol(request: &Request, mut response: Response) -> Result<Response, ErrorResponse> {
    let mut offers = request.headers().get_all(SEC_WEBSOCKET_PROTOCOL).iter();
    let chosen = offers.find_map(|offer| protocol::choose_subprotocol(offer.to_str().ok()?));
    let Some(chosen) = chosen else {
        let mut refusal = ErrorResponse::new(Some("this is a Foxglove WebSocket server\n".to_owned()));
        *refusal.status_mut() = StatusCode::BAD_REQUEST;
        return Err(refusal);
    };
    response.headers_mut().insert(SEC_WEBSOCKET_PROTOCOL, HeaderValue::from_static(chosen));
    Ok(response)
}

fn would_block(error: &Error) -> bool {
    matches!(error, Error::Io(error) if error.kind() == ErrorKind::WouldBlock)
}
