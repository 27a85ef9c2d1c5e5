//! One client: greeted, asked what it wants to see, and sent that, as far as it reads.
//!
//! Its socket never blocks. What it does not read in time stays in a buffer of fixed size; when that is
//! full, messages for this client are dropped and counted.

use std::io::ErrorKind;
use std::net::TcpStream;

use tungstenite::handshake::server::{ErrorResponse, Request, Response, ServerHandshake};
use tungstenite::handshake::{HandshakeError, MidHandshake};
use tungstenite::http::{HeaderValue, StatusCode, header::SEC_WEBSOCKET_PROTOCOL};
use tungstenite::protocol::frame::{CloseFrame, coding::CloseCode};
use tungstenite::protocol::{Message, WebSocket, WebSocketConfig};
use tungstenite::{Error, accept_hdr_with_config};

use super::protocol::{self, Asked, Level, Subscription};
use super::socket::Socket;
use masseter_recording::{Channel, Encoded};

/// What may wait for a client that reads slowly, bytes: half a second of every topic at 1 kHz.
const UNREAD_BYTES: usize = 1 << 20;
/// Bytes gathered before they go to the system.
const GATHERED_BYTES: usize = 1 << 16;
/// The longest message a client may send, bytes; it only subscribes.
const LONGEST_ASKED: usize = 1 << 16;
/// Turns in which a client must have said who it is: 5 s, so that strangers keep nobody's place.
const GREETING_TURNS: u32 = 500;
/// Messages of a client that are looked at in one turn, so that none keeps the others waiting.
const ASKED_IN_A_TURN: usize = 16;

type Greeting = fn(&Request, Response) -> Result<Response, ErrorResponse>;
type Handshake = MidHandshake<ServerHandshake<Socket, Greeting>>;

/// A client.
pub(super) struct Client {
    link: Link,
    /// Turns that the greeting may still take.
    turns: u32,
    /// The client's number for each channel that it sees.
    subscriptions: [Option<u32>; Channel::COUNT],
}

enum Link {
    /// Still being greeted; taken out while that goes on.
    Greeted(Option<Handshake>),
    Open(WebSocket<Socket>),
}

/// A client that is no more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Gone;

impl Client {
    /// Takes a new connection in.
    pub(super) fn welcome(stream: TcpStream, welcome: &[String]) -> Result<Self, Gone> {
        let socket = Socket::of(stream).map_err(|_| Gone)?;
        let config = WebSocketConfig::default()
            .read_buffer_size(LONGEST_ASKED)
            .write_buffer_size(GATHERED_BYTES)
            .max_write_buffer_size(UNREAD_BYTES)
            .max_message_size(Some(LONGEST_ASKED))
            .max_frame_size(Some(LONGEST_ASKED));
        let greeting: Greeting = greet;
        let mut client =
            Self { link: Link::Greeted(None), turns: GREETING_TURNS, subscriptions: [None; Channel::COUNT] };
        client.greeted(accept_hdr_with_config(socket, greeting, Some(config)), welcome)?;
        Ok(client)
    }

    fn greeted(
        &mut self,
        result: Result<WebSocket<Socket>, HandshakeError<ServerHandshake<Socket, Greeting>>>,
        welcome: &[String],
    ) -> Result<(), Gone> {
        match result {
            Ok(socket) => {
                self.link = Link::Open(socket);
                welcome.iter().try_for_each(|text| self.say(text.clone()))
            }
            Err(HandshakeError::Interrupted(handshake)) => {
                self.link = Link::Greeted(Some(handshake));
                Ok(())
            }
            Err(HandshakeError::Failure(_)) => Err(Gone),
        }
    }

    /// Whether the client sees a channel.
    pub(super) fn sees(&self, channel: Channel) -> bool {
        self.subscriptions[channel.place()].is_some()
    }

    /// Goes on greeting, or hears what the client asks.
    pub(super) fn hear(&mut self, welcome: &[String]) -> Result<(), Gone> {
        if let Link::Greeted(handshake) = &mut self.link {
            self.turns = self.turns.checked_sub(1).ok_or(Gone)?;
            let handshake = handshake.take().ok_or(Gone)?;
            self.greeted(handshake.handshake(), welcome)?;
        }
        if let Link::Open(socket) = &mut self.link {
            socket.get_mut().begin_turn();
        }
        for _ in 0..ASKED_IN_A_TURN {
            let Link::Open(socket) = &mut self.link else { break };
            match socket.read() {
                Ok(Message::Text(text)) => self.answer(&text)?,
                Ok(_) => {}
                Err(error) => return if would_block(&error) { Ok(()) } else { Err(Gone) },
            }
        }
        Ok(())
    }

    fn answer(&mut self, text: &str) -> Result<(), Gone> {
        match serde_json::from_str(text) {
            Ok(Asked::Subscribe { subscriptions }) => {
                subscriptions.into_iter().try_for_each(|subscription| self.subscribe(subscription))
            }
            Ok(Asked::Unsubscribe { subscription_ids }) => {
                for id in &mut self.subscriptions {
                    *id = id.filter(|id| !subscription_ids.contains(id));
                }
                Ok(())
            }
            Ok(Asked::Other) => self.say(protocol::status(Level::Warning, "a run can only be watched")),
            Err(error) => self.say(protocol::status(Level::Error, &format!("not understood: {error}"))),
        }
    }

    fn subscribe(&mut self, subscription: Subscription) -> Result<(), Gone> {
        let Some(place) = subscription.place() else {
            return self.say(protocol::status(Level::Error, "there is no such channel"));
        };
        if self.subscriptions[place].is_some() {
            return self.say(protocol::status(Level::Warning, "this channel is subscribed already"));
        }
        self.subscriptions[place] = Some(subscription.id);
        Ok(())
    }

    /// Sends a message if the client sees its channel. False if there was no room for it.
    pub(super) fn show(&mut self, log_time_ns: u64, message: &Encoded) -> Result<bool, Gone> {
        match self.subscriptions[message.channel.place()] {
            Some(id) => self.send(Message::Binary(protocol::message_data(id, log_time_ns, message).into())),
            None => Ok(true),
        }
    }

    /// Says what a client must not miss: one that has no room for it is given up.
    fn say(&mut self, text: String) -> Result<(), Gone> {
        if self.send(Message::Text(text.into()))? { Ok(()) } else { Err(Gone) }
    }

    fn send(&mut self, message: Message) -> Result<bool, Gone> {
        let Link::Open(socket) = &mut self.link else { return Ok(true) };
        match socket.write(message) {
            Ok(()) => Ok(true),
            Err(Error::WriteBufferFull(_)) => Ok(false),
            // It waits in the buffer.
            Err(error) if would_block(&error) => Ok(true),
            Err(_) => Err(Gone),
        }
    }

    /// Hands what was sent to the system, as far as that takes it.
    pub(super) fn flush(&mut self) -> Result<(), Gone> {
        let Link::Open(socket) = &mut self.link else { return Ok(()) };
        match socket.flush() {
            Err(error) if !would_block(&error) => Err(Gone),
            _ => Ok(()),
        }
    }

    /// Says goodbye behind all that was sent. A client that answers has read it all, and is gone.
    pub(super) fn take_leave(&mut self) -> Result<(), Gone> {
        let Link::Open(socket) = &mut self.link else { return Err(Gone) };
        let goodbye = CloseFrame { code: CloseCode::Away, reason: "the run is over".into() };
        match socket.flush().and_then(|()| socket.close(Some(goodbye))) {
            Err(error) if !would_block(&error) => Err(Gone),
            _ => Ok(()),
        }
    }
}

/// Accepts a client that speaks the protocol, and tells others what is missing.
#[expect(clippy::result_large_err, reason = "the library's callback returns it by value")]
fn greet(request: &Request, mut response: Response) -> Result<Response, ErrorResponse> {
    let mut offered = request.headers().get_all(SEC_WEBSOCKET_PROTOCOL).iter();
    let chosen = offered.find_map(|offer| protocol::choose(offer.to_str().ok()?));
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
