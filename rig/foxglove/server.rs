//! The serving thread: accepts clients, reads their requests, and sends queued messages.
//!
//! It polls its sockets and its queue a hundred times a second and blocks on none of them.

use std::convert::Infallible;
use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Duration;

use masseter_recording::{Channel, Definition, Encoded, Encoder, Scene, Topic};
use masseter_shared::clock;

use super::client::{Client, Disconnected};
use super::protocol;
use super::queue::{self, Counters, QueuedMessage, bit};

/// Polling interval.
const INTERVAL: Duration = Duration::from_millis(10);
/// Polling interval without clients.
const IDLE_INTERVAL: Duration = Duration::from_millis(100);
/// Polls in which clients may read what is left at the end: 0.5 s.
const CLOSING_POLLS: u32 = 50;
/// Most clients at a time; each has a buffer of its own.
const MAX_CLIENTS: usize = 8;

pub(super) struct Server {
    listener: TcpListener,
    encoder: Encoder,
    /// The first messages to every client.
    greeting: [String; 2],
    clients: Vec<Client>,
    counters: Arc<Counters>,
}

impl Server {
    pub(super) fn new(listener: TcpListener, scene: Scene, session: &str, counters: Arc<Counters>) -> Self {
        let definitions = Definition::all();
        Self {
            listener,
            encoder: Encoder::new(scene),
            greeting: [protocol::server_info(session), protocol::advertise(&definitions)],
            clients: Vec::new(),
            counters,
        }
    }

    /// Serves until the queue's sender is gone.
    pub(super) fn serve(mut self, queue: &Receiver<QueuedMessage>) {
        loop {
            self.accept_clients();
            self.for_each_client(Client::receive);
            self.publish_subscriptions();
            if self.send_queued(queue) {
                return self.close();
            }
            self.for_each_client(|client, _| client.flush());
            clock::sleep(if self.clients.is_empty() { IDLE_INTERVAL } else { INTERVAL });
        }
    }

    /// Closes every connection once its client has read everything; counts those that are too slow.
    fn close(mut self) {
        for _ in 0..CLOSING_POLLS {
            self.for_each_client(|client, _| client.close());
            self.for_each_client(Client::receive);
            if self.clients.is_empty() {
                return;
            }
            clock::sleep(INTERVAL);
        }
        self.counters.cut_off.store(self.clients.len(), Ordering::Relaxed);
    }

    /// Accepts clients while there is room and disconnects the others; a bounded number per call.
    fn accept_clients(&mut self) {
        for _ in 0..MAX_CLIENTS {
            let Ok((stream, _)) = self.listener.accept() else { return };
            if self.clients.len() < MAX_CLIENTS {
                self.clients.extend(Client::accept(stream, &self.greeting));
            }
        }
    }

    /// Calls `action` with each client and the greeting, and removes clients that are disconnected.
    fn for_each_client(
        &mut self,
        mut action: impl FnMut(&mut Client, &[String]) -> Result<(), Disconnected>,
    ) {
        let greeting = &self.greeting;
        self.clients.retain_mut(|client| action(client, greeting).is_ok());
    }

    /// Publishes which topics the recorder should queue.
    fn publish_subscriptions(&self) {
        let is_subscribed =
            |channel: Channel| self.clients.iter().any(|client| client.is_subscribed_to(channel));
        let topics =
            Topic::ALL.into_iter().filter(|topic| Channel::of(*topic).into_iter().any(is_subscribed));
        self.counters.subscribed.store(topics.fold(0, |bits, topic| bits | bit(topic)), Ordering::Relaxed);
        self.counters.connected.store(self.clients.len(), Ordering::Relaxed);
    }

    /// Sends what is queued. True once the sender is gone and the queue is empty.
    fn send_queued(&mut self, queue: &Receiver<QueuedMessage>) -> bool {
        for _ in 0..queue::LENGTH {
            match queue.try_recv() {
                Ok(queued) => self.send(&queued),
                Err(TryRecvError::Empty) => return false,
                Err(TryRecvError::Disconnected) => return true,
            }
        }
        false
    }

    fn send(&mut self, QueuedMessage { log_time_ns, message }: &QueuedMessage) {
        let Self { encoder, clients, counters, .. } = self;
        let to_clients = |message: Encoded| -> Result<(), Infallible> {
            clients.retain_mut(|client| match client.send_message(*log_time_ns, &message) {
                Ok(is_sent) => {
                    counters.dropped.fetch_add(u64::from(!is_sent), Ordering::Relaxed);
                    true
                }
                Err(Disconnected) => false,
            });
            Ok(())
        };
        let Ok(()) = encoder.encode(message.topic(), message.body(), to_clients);
    }
}
