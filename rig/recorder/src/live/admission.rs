//! Who may connect: a browser lets any page of the world connect to this machine, and other users reach its ports.
//!
//! A client names the secret of the URL. A web page is Foxglove's or one of this machine. The host is an address: a name
//! could be another site's that now leads here.

use std::net::IpAddr;

use tungstenite::handshake::server::Request;
use tungstenite::http::Method;
use tungstenite::http::header::{HOST, ORIGIN};
use tungstenite::http::uri::{Authority, Uri};

/// Why a client is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(super) enum Refusal {
    #[error("ask with GET: nothing can be sent here")]
    Method,
    #[error("connect to an IP address or to localhost")]
    Host,
    #[error("only pages of foxglove.dev and of this machine may watch")]
    Origin,
    #[error("the address contains a secret: use the one that 'masseter run --live' prints")]
    Secret,
}

/// Checks method, host, origin and secret of a request.
pub(super) fn admit(request: &Request, secret: &str) -> Result<(), Refusal> {
    let header = |name| request.headers().get(name).map(|value| value.to_str().unwrap_or_default());
    if request.method() != Method::GET {
        Err(Refusal::Method)
    } else if !header(HOST).is_some_and(is_address) {
        Err(Refusal::Host)
    } else if !header(ORIGIN).is_none_or(is_allowed) {
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
