//! The page as client: its text, its updates, and what its user asks for.
//!
//! The page is that of the report, filled with the figures so far; the feed computes them. An update changes what has changed.
//! A page that falls behind loads itself again.

use std::sync::mpsc::{Receiver, TryRecvError};

use masseter_runtime::clock::{self, SECOND_NS};
use masseter_runtime::{conversation::Conversation, named::access};
use serde_json::json;
use tungstenite::http::StatusCode;

use super::connection::{Disconnected, Host, Queued, Socket};
use super::{feed::Next, request::http_answer};

/// Time in which a browser takes the page's text, however it divides it, ns.
const TEXT_NS: u64 = 10 * SECOND_NS;

/// Answers a request for the page's text.
pub(super) fn send_page(mut conversation: Conversation, host: &Host) {
    let answer = match host.feed.html() {
        Ok(html) => http_answer(StatusCode::OK, "text/html", &html),
        Err(error) => http_answer(StatusCode::INTERNAL_SERVER_ERROR, "text/plain", &error),
    };
    conversation.say(&answer);
    conversation.send_rest(clock::now_ns() + TEXT_NS);
}

/// What the page asks for.
#[derive(Debug, PartialEq, serde::Deserialize)]
#[serde(tag = "op", rename_all = "snake_case")]
enum Wish {
    /// Another value of a parameter.
    Set { name: String, value: f64 },
    /// An orderly end of the run.
    Stop,
}

/// A page's connection.
pub(super) struct Session {
    socket: Socket,
    /// The update that the page shows already.
    shown: u64,
    host: Host,
}

impl Session {
    /// For a page that shows the update of this number.
    pub(super) fn new(socket: Socket, shown: Option<u64>, host: Host) -> Self {
        Self { socket, shown: shown.unwrap_or(0), host }
    }

    /// Serves the page until the run is over.
    pub(super) fn serve(mut self, queue: &Receiver<Queued>) -> Result<(), Disconnected> {
        loop {
            if let Some(text) = self.socket.receive()? {
                self.answer_request(&text)?;
            }
            let is_over = matches!(queue.try_recv(), Err(TryRecvError::Disconnected));
            if is_over {
                self.host.feed.refresh();
            }
            self.send_updates()?;
            if is_over {
                self.socket.send_json(&json!({ "over": true }))?;
                return self.socket.close_after_all();
            }
        }
    }

    fn send_updates(&mut self) -> Result<(), Disconnected> {
        loop {
            match self.host.feed.after(self.shown) {
                Next::Update(text) => self.socket.send_text(&text)?,
                Next::None => return Ok(()),
                Next::Lost => {
                    self.socket.send_json(&json!({ "reload": true }))?;
                    return self.socket.close_after_all();
                }
            }
            self.shown += 1;
        }
    }

    fn answer_request(&mut self, text: &str) -> Result<(), Disconnected> {
        let answer = match serde_json::from_str(text) {
            Ok(Wish::Set { name, value }) => match access::set(&self.host.domain, &name, value) {
                Ok(_) => json!({ "set": name }),
                Err(error) => json!({ "refused": error.to_string() }),
            },
            Ok(Wish::Stop) => {
                self.host.supervisor.stop();
                return Ok(());
            }
            Err(error) => json!({ "refused": format!("the request is not valid: {error}") }),
        };
        self.socket.send_json(&answer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wishes_are_parsed() {
        let parse = |text: &str| serde_json::from_str::<Wish>(text).ok();
        let set = Wish::Set { name: "gain".to_owned(), value: 3.0 };
        assert_eq!(parse(r#"{"op": "set", "name": "gain", "value": 3}"#), Some(set));
        assert_eq!(parse(r#"{"op": "stop"}"#), Some(Wish::Stop));
        assert_eq!(parse(r#"{"op": "set", "name": "gain", "value": "high"}"#), None);
    }
}
