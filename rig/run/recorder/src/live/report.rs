//! The report in the place of the live page: at the same address, once the run is judged, for those who watched its end.
//!
//! The recorder ends before the verdict. So it leaves address and secret in the run's private folder, and the supervisor listens
//! there. A request waits until the report is written.

use std::{fs, time::Duration};

use masseter_runtime::clock::{self, SECOND_NS};
use masseter_runtime::conversation::{Limits, Newcomers};
use masseter_runtime::transport::Domain;
use masseter_scenario::input::{MOST_KEPT_BYTES, read_text};
use tungstenite::http::StatusCode;

use super::request::{self, Wish, http_answer};

/// The file's name in the private folder.
const NAME: &str = "live-page";
/// The page asks twice, first whether the report is there. This long after a request, nobody asks again, ns.
const QUIET_NS: u64 = 3 * SECOND_NS;
/// Most connections at a time that have not asked.
const MOST_NEWCOMERS: usize = 16;
/// Longest time for which the report is served, ns.
const SERVED_NS: u64 = 15 * SECOND_NS;
const INTERVAL: Duration = Duration::from_millis(50);

/// Where the page was watched.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Address {
    pub(super) address: std::net::SocketAddr,
    pub(super) secret: String,
}

impl Address {
    /// Leaves it for the supervisor. Without it, the page stays as it is.
    pub(super) fn leave(&self, domain: &Domain) {
        let _ = serde_json::to_string(self).map(|text| fs::write(domain.root().join(NAME), text));
    }
}

/// Listens at the address of a page that was watched to the end.
pub struct ReportServer {
    newcomers: Newcomers,
    secret: String,
}

impl ReportServer {
    /// Listens at once; none where nobody watched the end, or where the system refuses.
    pub fn take_over(domain: &Domain) -> Option<Self> {
        let text = read_text(&domain.root().join(NAME), MOST_KEPT_BYTES).ok()?;
        let Address { address, secret } = serde_json::from_str(&text).ok()?;
        let listener = std::net::TcpListener::bind(address).ok()?;
        let newcomers =
            Newcomers::at(listener.into(), MOST_NEWCOMERS, Limits::newcomer(request::LONGEST)).ok()?;
        Some(Self { newcomers, secret })
    }

    /// Answers whoever names the secret with the report, for 3 s after the last request and at most 15 s.
    pub fn serve(mut self, html: &str) {
        let began_ns = clock::now_ns();
        let end_ns = began_ns + SERVED_NS;
        let mut asked_ns = began_ns;
        while clock::now_ns() < end_ns.min(asked_ns + QUIET_NS) {
            self.newcomers.wait(INTERVAL);
            for mut conversation in self.newcomers.look(clock::now_ns(), request::is_whole).asking {
                match request::wish(conversation.heard(), &self.secret) {
                    Ok((Wish::Page, _)) => conversation.say(&http_answer(StatusCode::OK, "text/html", &html)),
                    Ok((Wish::Socket { .. }, _)) => {
                        conversation.say(&http_answer(StatusCode::GONE, "text/plain", &"the run is over"));
                    }
                    Err(refusal) => conversation.say(&refusal),
                }
                conversation.send_rest(end_ns);
                asked_ns = clock::now_ns();
            }
        }
    }
}
