//! Messages of the Foxglove WebSocket protocol that a server without services, assets or publishing clients needs.
//!
//! Text messages are JSON objects with an `op`. Messages of channels are binary and little-endian: opcode, subscription
//! id, time, bytes.

use serde::{Deserialize, Serialize};

use masseter_recording::{Channel, Encoded, definitions};
use masseter_runtime::named::{Declared, Parameter};

/// Supported subprotocols, the newest first. The messages used here are the same in both.
const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
const MESSAGE_DATA: u8 = 1;
/// Bytes of opcode, subscription id and time.
const MESSAGE_HEAD: usize = 1 + 4 + 8;

/// The newest supported subprotocol of a client's offer, a list separated by commas.
pub(in crate::live) fn choose_subprotocol(offered: &str) -> Option<&'static str> {
    let offers = |name: &&str| offered.split(',').any(|offer| offer.trim() == *name);
    SUBPROTOCOLS.into_iter().find(offers)
}

/// The level of a status message, by its number in the protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Level {
    Warning = 1,
    Error = 2,
}

#[derive(Serialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
enum ServerMessage<'a> {
    ServerInfo {
        name: &'a str,
        capabilities: &'a [&'a str],
        session_id: &'a str,
    },
    Advertise {
        channels: Vec<Advertised>,
    },
    Status {
        level: u8,
        message: &'a str,
    },
    ParameterValues {
        parameters: Vec<ParameterValue>,
        #[serde(skip_serializing_if = "Option::is_none")]
        id: Option<&'a str>,
    },
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Advertised {
    id: u64,
    topic: String,
    encoding: String,
    schema_name: String,
    schema_encoding: String,
    schema: String,
}

/// A parameter with its value. Without a type, a client takes a whole number for an integer.
#[derive(Serialize)]
struct ParameterValue {
    name: String,
    value: f64,
    r#type: &'static str,
}

/// A value that a client gives to a parameter; something else than a number is refused.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(super) struct WantedValue {
    pub name: String,
    #[serde(default)]
    pub value: serde_json::Value,
}

/// A request of a client.
#[derive(Debug, PartialEq, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub(super) enum ClientMessage {
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
pub(super) struct Subscription {
    pub id: u32,
    channel_id: u64,
}

impl Subscription {
    /// Index of the channel in [`definitions`], if it exists.
    pub(super) fn channel_index(self) -> Option<usize> {
        usize::try_from(self.channel_id).ok().filter(|index| *index < Channel::COUNT)
    }
}

/// The first message to a client. `session` differs between runs, so that clients discard data of an earlier run.
pub(super) fn server_info(session: &str, declared: &Declared) -> String {
    let capabilities: &[_] =
        if declared.parameters.is_empty() { &[] } else { &["parameters", "parametersSubscribe"] };
    to_json(&ServerMessage::ServerInfo { name: "masseter", capabilities, session_id: session })
}

/// Parameters with their values; `id` is that of the request, if they answer one.
pub(super) fn parameter_values<'a>(
    parameters: impl Iterator<Item = (&'a Parameter, f64)>,
    id: Option<&str>,
) -> String {
    let value = |(parameter, value): (&Parameter, f64)| ParameterValue {
        name: parameter.name.clone(),
        value,
        r#type: "float64",
    };
    to_json(&ServerMessage::ParameterValues { parameters: parameters.map(value).collect(), id })
}

/// All channels, each with its place as id.
pub(super) fn advertise(declared: &Declared) -> String {
    let channels = definitions(declared);
    let advertised = |(place, channel): &(Channel, mcap::Channel<'static>)| {
        let schema = channel.schema.as_ref().expect("every channel of the rig has a schema");
        Advertised {
            id: place.place() as u64,
            topic: channel.topic.clone(),
            encoding: channel.message_encoding.clone(),
            schema_name: schema.name.clone(),
            schema_encoding: schema.encoding.clone(),
            schema: String::from_utf8_lossy(&schema.data).into_owned(),
        }
    };
    to_json(&ServerMessage::Advertise { channels: channels.iter().map(advertised).collect() })
}

/// A message for the client's user.
pub(super) fn status(level: Level, message: &str) -> String {
    to_json(&ServerMessage::Status { level: level as u8, message })
}

/// A message of a subscribed channel.
pub(super) fn message_data(subscription: u32, log_time_ns: u64, message: &Encoded) -> Vec<u8> {
    let mut data = Vec::with_capacity(MESSAGE_HEAD + message.bytes.len());
    data.push(MESSAGE_DATA);
    data.extend_from_slice(&subscription.to_le_bytes());
    data.extend_from_slice(&log_time_ns.to_le_bytes());
    data.extend_from_slice(message.bytes);
    data
}

fn to_json(message: &ServerMessage) -> String {
    serde_json::to_string(message).expect("the message holds only strings, numbers and lists")
}

#[cfg(test)]
mod tests {
    use masseter_runtime::named::Signal;
    use serde_json::{Value, json};

    use super::*;
    use masseter_recording::Topic;

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
        let message: Value = serde_json::from_str(&advertise(&declared)).unwrap();
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
        assert_eq!((subscriptions[0].id, subscriptions[0].channel_index()), (7, Some(2)));
        let beyond = Subscription { id: 7, channel_id: Channel::COUNT as u64 };
        assert_eq!(beyond.channel_index(), None);
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
