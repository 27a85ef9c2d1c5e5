//! A Foxglove program as client: the channels, schemas and bytes of the recording, and the parameters of the controller.
//!
//! There are no services, assets or publishing clients.

mod protocol;

use std::sync::Arc;
use std::sync::atomic::{AtomicU16, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError};

use masseter_recording::{Channel, Encoded, Encoder, Recorded, Topic};
use masseter_runtime::messages::Parameters;
use masseter_runtime::named::{Parameter, access};

use super::host::Host;
use super::queue::{Disconnected, QUEUE, Queued, bit};
use super::socket::Socket;
pub(super) use protocol::choose_subprotocol;
use protocol::{ClientMessage, Level, WantedValue};

/// Why a request is not fulfilled.
type Refusal = (Level, String);

/// A client's connection.
pub(super) struct Session {
    socket: Socket,
    encoder: Encoder,
    /// The client's subscription id of each channel.
    subscriptions: [Option<u32>; Channel::COUNT],
    subscribed: Arc<AtomicU16>,
    host: Host,
    /// Whether it wants the changes of parameters.
    wants_parameters: bool,
}

impl Session {
    /// Publishes in `subscribed` which topics the recorder should queue.
    pub(super) fn new(socket: Socket, subscribed: Arc<AtomicU16>, host: Host) -> Self {
        let subscriptions = [None; Channel::COUNT];
        let encoder = Encoder::new(host.scene.clone());
        Self { socket, encoder, subscriptions, subscribed, host, wants_parameters: false }
    }

    /// Serves the client until the queue has ended and the client has read everything.
    pub(super) fn serve(mut self, queue: &Receiver<Queued>) -> Result<(), Disconnected> {
        self.socket.text(&protocol::server_info(self.host.domain.id(), &self.host.declared))?;
        self.socket.text(&protocol::advertise(&self.host.declared))?;
        loop {
            if let Some(text) = self.socket.receive()? {
                self.answer(&text)?;
            }
            for _ in 0..QUEUE {
                match queue.try_recv() {
                    Ok((log_time_ns, message)) => self.send(log_time_ns, &message)?,
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => return self.socket.close(),
                }
            }
            self.socket.flush()?;
        }
    }

    /// Sends the parameters of these names, or all.
    fn send_parameters(
        &mut self,
        names: &[String],
        id: Option<&str>,
    ) -> Result<Option<Refusal>, Disconnected> {
        match access::list(&self.host.domain) {
            Ok(parameters) => {
                let is_asked = |parameter: &&Parameter| names.is_empty() || names.contains(&parameter.name);
                let asked = parameters.iter().filter(is_asked).map(|parameter| (parameter, parameter.value));
                self.socket.text(&protocol::parameter_values(asked, id))?;
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
                    access::set(&self.host.domain, name, number).map_err(|error| error.to_string())
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
            self.socket.text(&protocol::status(level, &text))?;
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
            let named = self.host.declared.parameters.iter().zip(values);
            self.socket.text(&protocol::parameter_values(named, None))?;
        }
        let Self { socket, encoder, subscriptions, .. } = self;
        encoder.encode(message, |message: Encoded| match subscriptions[message.channel.place()] {
            Some(id) => socket.write(protocol::message_data(id, log_time_ns, &message)),
            None => Ok(()),
        })
    }
}
