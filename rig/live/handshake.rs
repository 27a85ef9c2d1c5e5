//! The handshake of a WebSocket: who is admitted, and which protocol the connection has.

use std::fmt::Display;
use std::net::TcpStream;

use tungstenite::accept_hdr_with_config;
use tungstenite::handshake::server::{Callback, ErrorResponse, Request, Response};
use tungstenite::http::{HeaderValue, StatusCode, header::SEC_WEBSOCKET_PROTOCOL};
use tungstenite::protocol::WebSocketConfig;

use super::admission::admit;
use super::foxglove::choose_subprotocol;
use super::queue::{Disconnected, INTERVAL};
use super::socket::Socket;

/// The longest message from a client, bytes; clients only ask.
const MAX_REQUEST_BYTES: usize = 1 << 16;
/// The protocol of the page's updates.
const PAGE: &str = "masseter.page.v1";

/// What is spoken on a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Protocol {
    /// Topics, with their schemas.
    Foxglove,
    /// Changes of the page.
    Page,
}

/// A connection of an admitted client.
pub(super) struct Accepted {
    pub socket: Socket,
    pub protocol: Protocol,
    /// The update that the page shows already.
    pub after: Option<u64>,
}

/// Accepts a client that names the secret and offers a protocol of this server, and refuses every other.
pub(super) fn accept(stream: TcpStream, secret: &str) -> Result<Accepted, Disconnected> {
    let config = WebSocketConfig::default()
        .max_message_size(Some(MAX_REQUEST_BYTES))
        .max_frame_size(Some(MAX_REQUEST_BYTES));
    let (mut protocol, mut after) = (Protocol::Foxglove, None);
    let handshake = Handshake { secret, protocol: &mut protocol, after: &mut after };
    let socket = accept_hdr_with_config(stream, handshake, Some(config)).map_err(|_| Disconnected)?;
    socket.get_ref().set_read_timeout(Some(INTERVAL))?;
    Ok(Accepted { socket: Socket::new(socket), protocol, after })
}

struct Handshake<'a> {
    secret: &'a str,
    protocol: &'a mut Protocol,
    after: &'a mut Option<u64>,
}

impl Callback for Handshake<'_> {
    fn on_request(self, request: &Request, mut response: Response) -> Result<Response, ErrorResponse> {
        admit(request, self.secret).map_err(|refusal| refused(StatusCode::FORBIDDEN, &refusal))?;
        let mut offers = request.headers().get_all(SEC_WEBSOCKET_PROTOCOL).iter();
        let chosen = offers.find_map(|offer| choose(offer.to_str().ok()?));
        let Some((protocol, name)) = chosen else {
            return Err(refused(StatusCode::BAD_REQUEST, &"offer a protocol of Foxglove or of the page"));
        };
        *self.protocol = protocol;
        let query = request.uri().query().unwrap_or("");
        *self.after = query.strip_prefix("after=").and_then(|number| number.parse().ok());
        response.headers_mut().insert(SEC_WEBSOCKET_PROTOCOL, HeaderValue::from_static(name));
        Ok(response)
    }
}

/// The protocol of an offer, a list separated by commas, and its name.
fn choose(offered: &str) -> Option<(Protocol, &'static str)> {
    let is_page = offered.split(',').any(|offer| offer.trim() == PAGE);
    let page = is_page.then_some((Protocol::Page, PAGE));
    page.or_else(|| choose_subprotocol(offered).map(|name| (Protocol::Foxglove, name)))
}

fn refused(status: StatusCode, reason: &dyn Display) -> ErrorResponse {
    let mut refusal = ErrorResponse::new(Some(format!("{reason}\n")));
    *refusal.status_mut() = status;
    refusal
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_and_foxglove_have_protocols_of_their_own() {
        assert_eq!(choose("masseter.page.v1"), Some((Protocol::Page, "masseter.page.v1")));
        assert_eq!(choose("foxglove.sdk.v1"), Some((Protocol::Foxglove, "foxglove.sdk.v1")));
        assert_eq!(choose("chat"), None);
    }
}
