//! What a new connection wants, the page or a WebSocket; and the answer to one that gets neither.
//!
//! A browser lets any page of the world connect to this machine, and other users reach its ports. So a client names the
//! secret of the URL. A web page is Foxglove's or one of this machine. The host is an address: a name could be another
//! site's that now leads here.

use std::{fmt::Display, net::IpAddr};

use tungstenite::handshake::server::{Request, create_response, write_response};
use tungstenite::http::header::{HOST, ORIGIN, SEC_WEBSOCKET_PROTOCOL, UPGRADE};
use tungstenite::http::uri::{Authority, Uri};
use tungstenite::http::{HeaderValue, Method, StatusCode};

/// Longest request, bytes.
pub(super) const LONGEST: usize = 8192;
/// Most headers of a request.
const HEADERS: usize = 64;
/// The protocol of the page's updates.
const PAGE: &str = "masseter.page.v1";

/// The protocol on a WebSocket.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Protocol {
    /// Topics, with their schemas.
    Foxglove,
    /// Changes of the page, after the update that the page shows already.
    Page {
        /// The number of that update.
        after: Option<u64>,
    },
}

/// What an admitted client wants.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Wish {
    /// The page's text.
    Page,
    /// A WebSocket.
    Socket {
        protocol: Protocol,
        /// The answer that opens it.
        opening: Vec<u8>,
    },
}

/// Whether the bytes begin with a whole request, or with none at all.
pub(super) fn is_whole(bytes: &[u8]) -> bool {
    !matches!(parse_request(bytes), Ok(None))
}

/// The wish of a whole request, and the request's length; or the answer to a client that is refused, empty for what is no
/// request.
pub(super) fn wish(bytes: &[u8], secret: &str) -> Result<(Wish, usize), Vec<u8>> {
    let Ok(Some((request, length))) = parse_request(bytes) else { return Err(Vec::new()) };
    admit(&request, secret).map_err(|refusal| http_answer(refusal.status(), "text/plain", &refusal))?;
    let upgrade = request.headers().get(UPGRADE).and_then(|upgrade| upgrade.to_str().ok());
    if upgrade.is_some_and(|upgrade| upgrade.eq_ignore_ascii_case("websocket")) {
        let refused = |reason: &dyn Display| http_answer(StatusCode::BAD_REQUEST, "text/plain", reason);
        let (protocol, name) = choose_protocol(&request)
            .ok_or_else(|| refused(&"offer a protocol of Foxglove or of the page"))?;
        let opening = opening(&request, name).map_err(|error| refused(&error))?;
        return Ok((Wish::Socket { protocol, opening }, length));
    }
    Ok((Wish::Page, length))
}

/// A whole answer of HTTP, after which the connection ends.
pub(super) fn http_answer(status: StatusCode, kind: &str, text: &dyn Display) -> Vec<u8> {
    let text = format!("{text}\n");
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}; charset=utf-8\r\nContent-Length: {}\r\nCache-Control: no-store\r\n\
         Referrer-Policy: no-referrer\r\nX-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n",
        text.len()
    );
    (head + &text).into_bytes()
}

/// `None` if the request has not come completely; an error where the bytes are no request of HTTP.
fn parse_request(bytes: &[u8]) -> anyhow::Result<Option<(Request, usize)>> {
    let mut headers = [httparse::EMPTY_HEADER; HEADERS];
    let mut parsed = httparse::Request::new(&mut headers);
    let httparse::Status::Complete(length) = parsed.parse(bytes)? else { return Ok(None) };
    let mut request = Request::builder().method(parsed.method.unwrap_or("")).uri(parsed.path.unwrap_or(""));
    for header in parsed.headers.iter() {
        request = request.header(header.name, header.value);
    }
    Ok(Some((request.body(())?, length)))
}

/// The first offered protocol that this server speaks, and its name.
fn choose_protocol(request: &Request) -> Option<(Protocol, &'static str)> {
    let query = request.uri().query().unwrap_or("");
    let after = query.strip_prefix("after=").and_then(|number| number.parse().ok());
    let mut offers = request.headers().get_all(SEC_WEBSOCKET_PROTOCOL).iter();
    offers.find_map(|offer| {
        let offer = offer.to_str().ok()?;
        let is_page = offer.split(',').any(|offer| offer.trim() == PAGE);
        let page = is_page.then_some((Protocol::Page { after }, PAGE));
        page.or_else(|| super::foxglove::choose_subprotocol(offer).map(|name| (Protocol::Foxglove, name)))
    })
}

fn opening(request: &Request, protocol: &'static str) -> tungstenite::Result<Vec<u8>> {
    let mut response = create_response(request)?;
    response.headers_mut().insert(SEC_WEBSOCKET_PROTOCOL, HeaderValue::from_static(protocol));
    let mut bytes = Vec::new();
    write_response(&mut bytes, &response)?;
    Ok(bytes)
}

/// Why a client is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
enum Refusal {
    #[error("ask with GET: nothing can be sent here")]
    Method,
    #[error("name the host once (RFC 9112, 3.2)")]
    Hosts,
    #[error("connect to an IP address or to localhost")]
    Host,
    #[error("only pages of foxglove.dev and of this machine may watch")]
    Origin,
    #[error("the address contains a secret: use the one that 'masseter run --live' prints")]
    Secret,
}

impl Refusal {
    fn status(self) -> StatusCode {
        match self {
            Self::Hosts => StatusCode::BAD_REQUEST,
            Self::Method | Self::Host | Self::Origin | Self::Secret => StatusCode::FORBIDDEN,
        }
    }
}

/// Checks method, host, origin and secret of a request.
fn admit(request: &Request, secret: &str) -> Result<(), Refusal> {
    let headers =
        |name| request.headers().get_all(name).iter().map(|value| value.to_str().unwrap_or_default());
    if request.method() != Method::GET {
        Err(Refusal::Method)
    } else if headers(HOST).count() != 1 {
        Err(Refusal::Hosts)
    } else if !headers(HOST).all(is_address) {
        Err(Refusal::Host)
    } else if !headers(ORIGIN).all(is_allowed) {
        Err(Refusal::Origin)
    } else if request.uri().path().strip_prefix('/') != Some(secret) {
        Err(Refusal::Secret)
    } else {
        Ok(())
    }
}

fn is_address(host: &str) -> bool {
    // `user@host` is no host.
    !host.contains('@') && host.parse().is_ok_and(|host: Authority| is_local(&host) || ip(&host).is_some())
}

/// Pages have the scheme http or https, or the origin null; other schemes are those of programs.
fn is_allowed(origin: &str) -> bool {
    if let Some(("http" | "https", authority)) = origin.split_once("://") {
        return origin.parse::<Uri>().is_ok()
            && !authority.contains('@')
            && authority.parse().is_ok_and(|host: Authority| {
                is_local(&host) || (origin.starts_with("https:") && is_of_foxglove(&host))
            });
    }
    origin.contains("://")
}

fn is_of_foxglove(host: &Authority) -> bool {
    host.host() == "foxglove.dev" || host.host().ends_with(".foxglove.dev")
}

fn is_local(host: &Authority) -> bool {
    host.host() == "localhost" || ip(host).is_some_and(|ip| ip.is_loopback())
}

fn ip(host: &Authority) -> Option<IpAddr> {
    host.host().trim_matches(['[', ']']).parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECRET: &str = "5ec7e7";

    fn asking(lines: &str) -> Vec<u8> {
        format!("GET /{SECRET} HTTP/1.1\r\nHost: localhost\r\n{lines}\r\n").into_bytes()
    }

    #[test]
    fn a_request_is_whole_with_its_empty_line() {
        let bytes = asking("");
        assert!(!is_whole(&bytes[..bytes.len() - 1]) && is_whole(&bytes));
        assert_eq!(wish(&bytes, SECRET), Ok((Wish::Page, bytes.len())));
        // It is answered at once, with nothing.
        assert!(is_whole(b"\x16\x03\x01 TLS"));
        assert_eq!(wish(b"\x16\x03\x01 TLS", SECRET), Err(Vec::new()));
    }

    #[test]
    fn the_page_and_foxglove_have_protocols_of_their_own() {
        let protocol_of = |offered: &str| {
            let bytes = asking(&format!(
                "Upgrade: WebSocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: \
                 dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: {offered}\r\n"
            ));
            wish(&bytes, SECRET).map(|(wish, _)| match wish {
                Wish::Page => None,
                Wish::Socket { protocol, opening } => {
                    assert!(opening.starts_with(b"HTTP/1.1 101"));
                    Some(protocol)
                }
            })
        };
        assert_eq!(protocol_of("masseter.page.v1"), Ok(Some(Protocol::Page { after: None })));
        assert_eq!(protocol_of("foxglove.sdk.v1"), Ok(Some(Protocol::Foxglove)));
        assert!(protocol_of("chat").unwrap_err().starts_with(b"HTTP/1.1 400"));
    }

    #[test]
    fn without_the_secret_nothing_is_given() {
        assert!(wish(&asking(""), "other").unwrap_err().starts_with(b"HTTP/1.1 403"));
    }

    fn ask(path: &str, host: &str, origin: Option<&str>) -> Result<(), Refusal> {
        let request = Request::builder().uri(path).header(HOST, host);
        let request = origin.into_iter().fold(request, |request, origin| request.header(ORIGIN, origin));
        admit(&request.body(()).unwrap(), "5ec7e7")
    }

    #[test]
    fn only_the_whole_secret_opens() {
        assert_eq!(ask("/5ec7e7", "127.0.0.1:8765", None), Ok(()));
        for path in ["/", "/5ec7e", "/5ec7e7/", "/5ec7e77", "//5ec7e7"] {
            assert_eq!(ask(path, "127.0.0.1:8765", None), Err(Refusal::Secret), "{path}");
        }
    }

    #[test]
    fn only_what_asks_is_answered() {
        let ask = |method: &str| {
            let request = Request::builder().method(method).uri("/5ec7e7").header(HOST, "127.0.0.1");
            admit(&request.body(()).unwrap(), "5ec7e7")
        };
        assert_eq!(ask("GET"), Ok(()));
        for method in ["POST", "PUT", "DELETE", "HEAD", "OPTIONS", "CONNECT", "BREW"] {
            assert_eq!(ask(method), Err(Refusal::Method), "{method}");
        }
    }

    #[test]
    fn a_name_is_no_address() {
        for host in ["127.0.0.1", "[::1]:8765", "localhost:8765", "192.168.1.5:9000"] {
            assert_eq!(ask("/5ec7e7", host, None), Ok(()), "{host}");
        }
        for host in [
            "",
            "evil.example:8765",
            "127.0.0.1.evil.example",
            "localhost.evil.example",
            "a b",
            "user@127.0.0.1",
            "user:word@localhost:8765",
        ] {
            assert_eq!(ask("/5ec7e7", host, None), Err(Refusal::Host), "{host}");
        }
    }

    #[test]
    fn a_request_names_its_host_once_and_no_second_origin_hides_behind_the_first() {
        let answer_to = |lines: &str| {
            let bytes = format!("GET /{SECRET} HTTP/1.1\r\n{lines}\r\n").into_bytes();
            wish(&bytes, SECRET).map_err(|answer| String::from_utf8(answer).unwrap()[9..12].to_owned())
        };
        let local = "Host: localhost\r\n";
        assert!(answer_to(local).is_ok());
        for lines in
            ["", "Host: localhost\r\nHost: localhost\r\n", "Host: localhost\r\nHost: evil.example\r\n"]
        {
            assert_eq!(answer_to(lines), Err("400".to_owned()), "{lines}");
        }
        let origins = format!("{local}Origin: http://localhost\r\nOrigin: https://evil.example\r\n");
        assert_eq!(answer_to(&origins), Err("403".to_owned()));
    }

    #[test]
    fn pages_of_other_sites_are_refused() {
        for origin in [
            "https://app.foxglove.dev",
            "http://localhost:8080",
            "http://127.0.0.1:8080",
            "file://",
            "app://x",
        ] {
            assert_eq!(ask("/5ec7e7", "localhost:8765", Some(origin)), Ok(()), "{origin}");
        }
        for origin in [
            "null",
            "",
            "http://localhost@evil.example",
            "http://evil@localhost",
            "http://app.foxglove.dev",
            "https://evil.example",
            "https://foxglove.dev.evil.example",
            "https://evilfoxglove.dev",
            "http://localhost.evil.example",
            "https://evil.example/https://app.foxglove.dev",
        ] {
            assert_eq!(ask("/5ec7e7", "localhost:8765", Some(origin)), Err(Refusal::Origin), "{origin}");
        }
    }
}
