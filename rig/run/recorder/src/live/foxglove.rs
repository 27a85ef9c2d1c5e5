//! A Foxglove program as client: the channels, schemas and bytes of the recording, and the parameters of the controller, by
//! the Foxglove WebSocket protocol. There are no services, assets or publishing clients.
//!
//! Text messages are JSON objects with an `op`. Messages of channels are binary and little-endian: opcode, subscription
//! id, time, bytes.

use std::sync::Arc;
use std::sync::atomic::{AtomicU16, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError};

use masseter_recording::{Channel, Encoded, Encoder, Recorded, Topic, definitions};
use masseter_runtime::messages::Parameters;
use masseter_runtime::named::access::{self, AccessError};
use masseter_runtime::named::{Declared, Parameter};
use serde::Deserialize;
use serde_json::{Value, json};

use super::connection::{Disconnected, Host, QUEUE, Queued, Socket, bit};

/// Why a request is not fulfilled.
#[derive(Debug, thiserror::Error)]
enum Refusal {
    #[error(transparent)]
    Disconnected(#[from] Disconnected),
    #[error("the channel does not exist")]
    NoChannel,
    #[error("parameter '{name}' is a number, not {value}")]
    NoNumber { name: String, value: Value },
    #[error("the server offers subscriptions and parameters only")]
    Unsupported,
    #[error("the request is not valid: {0}")]
    Invalid(#[from] serde_json::Error),
    #[error(transparent)]
    Access(#[from] AccessError),
}

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
        let Host { declared, domain, .. } = &self.host;
        let capabilities: &[_] =
            if declared.parameters.is_empty() { &[] } else { &["parameters", "parametersSubscribe"] };
        // Clients discard data of a run with another id.
        let session_id = domain.id();
        self.socket.send_json(&json!({
            "op": "serverInfo",
            "name": "masseter",
            "capabilities": capabilities,
            "sessionId": session_id,
        }))?;
        self.socket.send_json(&advertise(declared))?;
        loop {
            if let Some(text) = self.socket.receive()? {
                self.answer_request(&text)?;
            }
            for _ in 0..QUEUE {
                match queue.try_recv() {
                    Ok((log_time_ns, message)) => self.send(log_time_ns, &message)?,
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => return self.socket.close_after_all(),
                }
            }
            self.socket.flush()?;
        }
    }

    /// Sends the parameters of these names, or all.
    fn send_parameters(&mut self, names: &[String], id: Option<String>) -> Result<(), Refusal> {
        let known = access::list(&self.host.domain)?;
        let is_asked = |parameter: &&Parameter| names.is_empty() || names.contains(&parameter.name);
        let asked = known.iter().filter(is_asked).map(|parameter| (parameter, parameter.value));
        Ok(self.socket.send_json(&parameter_values(asked, id))?)
    }

    /// Sets parameters at the controller, and answers if there is an id: with what holds now. A refused value must not remain
    /// on the client's screen.
    fn set_parameters(&mut self, wanted: Vec<WantedValue>, id: Option<String>) -> Result<(), Refusal> {
        let names: Vec<_> = wanted.iter().map(|WantedValue { name, .. }| name.clone()).collect();
        let set = |WantedValue { name, value }| match value.as_f64() {
            Some(number) => Ok(access::set(&self.host.domain, &name, number).map(drop)?),
            None => Err(Refusal::NoNumber { name, value }),
        };
        let refused = wanted.into_iter().filter_map(|value| set(value).err()).next_back();
        if id.is_none() && refused.is_none() {
            return Ok(());
        }
        let answered = self.send_parameters(&names, id);
        refused.map_or(answered, Err)
    }

    /// Answers a request; a refusal too.
    fn answer_request(&mut self, text: &str) -> Result<(), Disconnected> {
        let done = self.fulfil(text);
        self.publish_subscriptions();
        match done {
            Ok(()) => Ok(()),
            Err(Refusal::Disconnected(disconnected)) => Err(disconnected),
            Err(refusal) => {
                // The levels of the protocol: a warning is 1, an error 2.
                let level = if matches!(refusal, Refusal::Unsupported) { 1 } else { 2 };
                self.socket
                    .send_json(&json!({ "op": "status", "level": level, "message": refusal.to_string() }))
            }
        }
    }

    fn fulfil(&mut self, text: &str) -> Result<(), Refusal> {
        match serde_json::from_str(text)? {
            ClientMessage::Subscribe { subscriptions } => {
                let is_known = |subscription: &Subscription| subscription.channel_id < Channel::COUNT;
                for Subscription { id, channel_id } in subscriptions.iter().filter(|one| is_known(one)) {
                    self.subscriptions[*channel_id] = Some(*id);
                }
                if !subscriptions.iter().all(is_known) {
                    return Err(Refusal::NoChannel);
                }
            }
            ClientMessage::Unsubscribe { subscription_ids } => {
                for id in &mut self.subscriptions {
                    *id = id.filter(|id| !subscription_ids.contains(id));
                }
            }
            ClientMessage::GetParameters { parameter_names, id } => {
                self.send_parameters(&parameter_names, id)?;
            }
            ClientMessage::SetParameters { parameters, id } => self.set_parameters(parameters, id)?,
            ClientMessage::SubscribeParameterUpdates { .. } => self.wants_parameters = true,
            ClientMessage::UnsubscribeParameterUpdates { .. } => self.wants_parameters = false,
            ClientMessage::Unsupported => return Err(Refusal::Unsupported),
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
            self.socket.send_json(&parameter_values(named, None))?;
        }
        let Self { socket, encoder, subscriptions, .. } = self;
        encoder.encode(message, |message: Encoded| match subscriptions[message.channel.place()] {
            Some(id) => socket.write_bytes(message_data(id, log_time_ns, &message)),
            None => Ok(()),
        })
    }
}

/// Supported subprotocols, the newest first. The messages used here are the same in both.
const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
const MESSAGE_DATA: u8 = 1;
/// Bytes of opcode, subscription id and time.
const MESSAGE_HEAD: usize = 1 + 4 + 8;

/// The newest supported subprotocol of a client's offer, a list separated by commas.
pub(super) fn choose_subprotocol(offered: &str) -> Option<&'static str> {
    let offers = |name: &&str| offered.split(',').any(|offer| offer.trim() == *name);
    SUBPROTOCOLS.into_iter().find(offers)
}

/// A value that a client gives to a parameter; something else than a number is refused.
#[derive(Debug, Clone, PartialEq, Deserialize)]
struct WantedValue {
    name: String,
    #[serde(default)]
    value: Value,
}

/// A request of a client.
#[derive(Debug, PartialEq, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
enum ClientMessage {
    /// Subscribes to channels.
    Subscribe { subscriptions: Vec<Subscription> },
    /// Ends subscriptions.
    Unsubscribe { subscription_ids: Vec<u32> },
    /// Asks for parameters: those named, or all.
    GetParameters {
        parameter_names: Vec<String>,
        #[serde(default)]
        id: Option<String>,
    },
    /// Gives values to parameters; an answer is wanted if there is an id.
    SetParameters {
        parameters: Vec<WantedValue>,
        #[serde(default)]
        id: Option<String>,
    },
    /// Asks for changes of parameters.
    SubscribeParameterUpdates { parameter_names: Vec<String> },
    /// Ends that.
    UnsubscribeParameterUpdates { parameter_names: Vec<String> },
    /// An operation that this server does not offer.
    #[serde(other)]
    Unsupported,
}

/// A channel, and the client's id for its messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Subscription {
    id: u32,
    /// The place of the channel.
    channel_id: usize,
}

/// Parameters with their values; `id` is that of the request, if they answer one. Without a type, a client takes a whole
/// number for an integer.
fn parameter_values<'a>(parameters: impl Iterator<Item = (&'a Parameter, f64)>, id: Option<String>) -> Value {
    let value =
        |(known, value): (&Parameter, _)| json!({ "name": known.name, "value": value, "type": "float64" });
    let mut values =
        json!({ "op": "parameterValues", "parameters": parameters.map(value).collect::<Vec<_>>() });
    if let Some(id) = id {
        values["id"] = id.into();
    }
    values
}

/// All channels, each with its place as id.
fn advertise(declared: &Declared) -> Value {
    let advertised = |(place, channel): (Channel, mcap::Channel<'static>)| {
        let schema = channel.schema.expect("every channel of the rig has a schema");
        json!({
            "id": place.place(),
            "topic": channel.topic,
            "encoding": channel.message_encoding,
            "schemaName": schema.name,
            "schemaEncoding": schema.encoding,
            "schema": String::from_utf8_lossy(&schema.data),
        })
    };
    let channels: Vec<_> = definitions(declared).into_iter().map(advertised).collect();
    json!({ "op": "advertise", "channels": channels })
}

/// A message of a subscribed channel.
fn message_data(subscription: u32, log_time_ns: u64, message: &Encoded) -> Vec<u8> {
    let mut data = Vec::with_capacity(MESSAGE_HEAD + message.bytes.len());
    data.push(MESSAGE_DATA);
    data.extend_from_slice(&subscription.to_le_bytes());
    data.extend_from_slice(&log_time_ns.to_le_bytes());
    data.extend_from_slice(message.bytes);
    data
}

#[cfg(test)]
mod tests {
    use masseter_runtime::named::Signal;

    use super::*;

    #[test]
    fn the_newest_common_subprotocol_is_chosen() {
        assert_eq!(choose_subprotocol("foxglove.websocket.v1, foxglove.sdk.v1"), Some("foxglove.sdk.v1"));
        assert_eq!(choose_subprotocol("foxglove.websocket.v1"), Some("foxglove.websocket.v1"));
        assert_eq!(choose_subprotocol("foxglove.sdk.v1.1,chat"), None);
    }

    #[test]
    fn channels_are_advertised_as_recordings_define_them() {
        let signal = Signal { name: "grip".into(), unit: "N".into(), about: String::new() };
        let declared = Declared { signals: vec![signal], ..Declared::default() };
        let message = advertise(&declared);
        assert_eq!(message["op"], "advertise");
        assert!(message.to_string().contains("float64 grip"));
        for (index, (place, definition)) in definitions(&declared).iter().enumerate() {
            let (channel, defined) = (&message["channels"][index], definition.schema.as_ref().unwrap());
            assert_eq!(channel["id"], place.place());
            assert_eq!(channel["topic"], definition.topic);
            assert_eq!(channel["encoding"], *definition.message_encoding);
            assert_eq!(channel["schemaName"], *defined.name);
            assert_eq!(channel["schemaEncoding"], "ros2msg");
            assert_eq!(channel["schema"].as_str().unwrap().as_bytes(), &*defined.data);
        }
    }

    #[test]
    fn requests_are_parsed() {
        let parse = |text: &str| serde_json::from_str::<ClientMessage>(text);
        let subscribe = json!({"op": "subscribe", "subscriptions": [{"id": 7, "channelId": 2}]});
        let Ok(ClientMessage::Subscribe { subscriptions }) = parse(&subscribe.to_string()) else { panic!() };
        assert_eq!(subscriptions, [Subscription { id: 7, channel_id: 2 }]);
        let unsubscribe = r#"{"op": "unsubscribe", "subscriptionIds": [7]}"#;
        assert_eq!(parse(unsubscribe).unwrap(), ClientMessage::Unsubscribe { subscription_ids: vec![7] });
        let set = json!({"op": "setParameters", "parameters": [{"name": "gain", "value": 3}], "id": "7"});
        let Ok(ClientMessage::SetParameters { parameters, id }) = parse(&set.to_string()) else { panic!() };
        assert_eq!(
            (&*parameters[0].name, parameters[0].value.as_f64(), id.as_deref()),
            ("gain", Some(3.0), Some("7"))
        );
        assert_eq!(parse(r#"{"op": "fetchAsset", "uri": "x"}"#).unwrap(), ClientMessage::Unsupported);
        assert!(parse("{}").is_err() && parse("chat").is_err());
    }

    #[test]
    fn a_message_is_opcode_subscription_id_time_and_bytes() {
        let message = Encoded {
            channel: Channel::Topic(Topic::State),
            sequence: 1,
            publish_time_ns: 2,
            bytes: &[0xaa, 0xbb],
        };
        let data = message_data(0x0102_0304, 5, &message);
        assert_eq!(data, [1, 4, 3, 2, 1, 5, 0, 0, 0, 0, 0, 0, 0, 0xaa, 0xbb]);
    }
}
