//! Serves all clients from one thread: takes what the logger offers, hears what they ask, and sends.
//!
//! It looks at its sockets and its queue a hundred times a second and waits for none of them.

use std::convert::Infallible;
use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Duration;

use masseter_shared::clock;

use super::client::{Client, Gone};
use super::{Offer, QUEUE, Shared, bit, protocol};
use masseter_recording::{Channel, Definition, Encoded, Encoder, Scene, Topic};

/// How often clients are served.
const TURN: Duration = Duration::from_millis(10);
/// How often somebody is looked for while nobody watches.
const IDLE_TURN: Duration = Duration::from_millis(100);
/// Turns in which clients may read what is left when the run is over: 0.5 s.
const LAST_TURNS: u32 = 50;
/// Most clients at a time: what they leave unread is kept for each.
const CLIENTS: usize = 8;

/// The serving end.
pub(super) struct Server {
    listener: TcpListener,
    encoder: Encoder,
    /// What every client is told first.
    welcome: [String; 2],
    clients: Vec<Client>,
    shared: Arc<Shared>,
}

impl Server {
    pub(super) fn new(listener: TcpListener, scene: Scene, session: &str, shared: Arc<Shared>) -> Self {
        let definitions = Definition::all();
        Self {
            listener,
            encoder: Encoder::new(scene),
            welcome: [protocol::server_info(session), protocol::advertise(&definitions)],
            clients: Vec::new(),
            shared,
        }
    }

    /// Serves until nobody offers messages any more.
    pub(super) fn serve(mut self, offers: &Receiver<Offer>) {
        loop {
            self.admit();
            self.keep(Client::hear);
            self.publish_wants();
            if self.show_all(offers) {
                return self.take_leave();
            }
            self.keep(|client, _| client.flush());
            clock::sleep(if self.clients.is_empty() { IDLE_TURN } else { TURN });
        }
    }

    /// Says goodbye to the clients, and lets them read what is left. Those that are slow at that are cut off.
    fn take_leave(mut self) {
        for _ in 0..LAST_TURNS {
            self.keep(|client, _| client.take_leave());
            self.keep(Client::hear);
            if self.clients.is_empty() {
                return;
            }
            clock::sleep(TURN);
        }
        self.shared.cut_off.store(self.clients.len(), Ordering::Relaxed);
    }

    /// Takes in some of those who wait, as long as there is room; others are refused by the end of their connection.
    fn admit(&mut self) {
        for _ in 0..CLIENTS {
            let Ok((stream, _)) = self.listener.accept() else { return };
            if self.clients.len() < CLIENTS {
                self.clients.extend(Client::welcome(stream, &self.welcome));
            }
        }
    }

    /// Does something with each client, and forgets those that are gone.
    fn keep(&mut self, mut each: impl FnMut(&mut Client, &[String]) -> Result<(), Gone>) {
        let welcome = &self.welcome;
        self.clients.retain_mut(|client| each(client, welcome).is_ok());
    }

    /// Lets the logger know what is worth offering.
    fn publish_wants(&self) {
        let is_seen = |channel: Channel| self.clients.iter().any(|client| client.sees(channel));
        let wanted =
            Topic::ALL.into_iter().filter(|topic| Channel::for_topic(*topic).into_iter().any(is_seen));
        self.shared.wanted.store(wanted.fold(0, |bits, topic| bits | bit(topic)), Ordering::Relaxed);
        self.shared.clients.store(self.clients.len(), Ordering::Relaxed);
    }

    /// Shows what was offered since the last turn. True when nothing more will come.
    fn show_all(&mut self, offers: &Receiver<Offer>) -> bool {
        for _ in 0..QUEUE {
            match offers.try_recv() {
                Ok(offer) => self.show(&offer),
                Err(TryRecvError::Empty) => return false,
                Err(TryRecvError::Disconnected) => return true,
            }
        }
        false
    }

    fn show(&mut self, Offer { log_time_ns, message }: &Offer) {
        let Self { encoder, clients, shared, .. } = self;
        let to_all = |message: Encoded| -> Result<(), Infallible> {
            clients.retain_mut(|client| match client.show(*log_time_ns, &message) {
                Ok(true) => true,
                Ok(false) => {
                    shared.dropped.fetch_add(1, Ordering::Relaxed);
                    true
                }
                Err(Gone) => false,
            });
            Ok(())
        };
        let Ok(()) = encoder.encode(message.topic(), message.body(), to_all);
    }
}
