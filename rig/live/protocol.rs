//! The Foxglove WebSocket protocol, as far as a server needs it that only shows: what it says, and what
//! its clients ask. Parameters, services, assets and publishing by clients are not offered.
//!
//! Text messages are JSON objects with an `op`; messages of channels are binary: opcode, subscription,
//! time, bytes, little-endian.

use data_encoding::BASE64;
use serde::{Deserialize, Serialize};

use masseter_recording::{Channel, Definition, Encoded};

/// Names of the protocol that clients ask for, the current one first. What is used here is alike in all.
const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
const MESSAGE_DATA: u8 = 1;
/// Opcode, subscription and time, before the message itself.
const MESSAGE_HEAD: usize = 1 + 4 + 8;

/// Which protocol to speak with a client that offers these, separated by commas.
pub(super) fn choose(offered: &str) -> Option<&'static str> {
    let offers = |name: &&str| offered.split(',').any(|offer| offer.trim() == *name);
    SUBPROTOCOLS.into_iter().find(offers)
}

/// How serious a status is, as the protocol counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Level {
    Warning = 1,
    Error = 2,
}

#[derive(Serialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
enum Said<'a> {
    ServerInfo { name: &'a str, capabilities: [&'a str; 0], session_id: &'a str },
    Advertise { channels: Vec<Advertised<'a>> },
    Status { level: u8, message: &'a str },
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Advertised<'a> {
    id: u64,
    topic: &'a str,
    encoding: &'a str,
    schema_name: &'a str,
    schema_encoding: &'a str,
    schema: String,
}

/// What a client asks.
#[derive(Debug, PartialEq, Eq, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub(super) enum Asked {
    /// To see channels.
    Subscribe { subscriptions: Vec<Subscription> },
    /// To see them no more.
    Unsubscribe { subscription_ids: Vec<u32> },
    /// Something that is not offered.
    #[serde(other)]
    Other,
}

/// A client's own number for a channel that it sees.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Subscription {
    pub id: u32,
    channel_id: u64,
}

impl Subscription {
    /// Place of the channel in [`Definition::all`], if there is such a one.
    pub(super) fn place(self) -> Option<usize> {
        usize::try_from(self.channel_id).ok().filter(|place| *place < Channel::COUNT)
    }
}

/// What every client is told first. `session` differs between runs: clients forget what they had of another.
pub(super) fn server_info(session: &str) -> String {
    in_json(&Said::ServerInfo { name: "masseter", capabilities: [], session_id: session })
}

/// The channels, each under its place in the list.
pub(super) fn advertise(definitions: &[Definition]) -> String {
    let channels = definitions.iter().enumerate().map(|(id, definition)| channel(id, definition));
    in_json(&Said::Advertise { channels: channels.collect() })
}

fn channel(id: usize, Definition { topic, schema, message_encoding }: &Definition) -> Advertised<'_> {
    // JSON holds no bytes: schemas that are text go as they are, compiled ones in base 64.
    let text = match schema.encoding.as_str() {
        "protobuf" => BASE64.encode(&schema.data),
        _ => String::from_utf8_lossy(&schema.data).into_owned(),
    };
    Advertised {
        id: id as u64,
        topic,
        encoding: message_encoding,
        schema_name: &schema.name,
        schema_encoding: &schema.encoding,
        schema: text,
    }
}

/// A word to the user of the client.
pub(super) fn status(level: Level, message: &str) -> String {
    in_json(&Said::Status { level: level as u8, message })
}

/// A message for a subscription.
pub(super) fn message_data(subscription: u32, log_time_ns: u64, message: &Encoded) -> Vec<u8> {
    let mut data = Vec::with_capacity(MESSAGE_HEAD + message.bytes.len());
    data.push(MESSAGE_DATA);
    data.extend_from_slice(&subscription.to_le_bytes());
    data.extend_from_slice(&log_time_ns.to_le_bytes());
    data.extend_from_slice(message.bytes);
    data
}

fn in_json(said: &Said) -> String {
    serde_json::to_string(said).expect("it holds nothing that JSON lacks")
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;
    use masseter_recording::Topic;

    #[test]
    fn the_newest_protocol_that_both_know_is_spoken() {
        assert_eq!(choose("foxglove.websocket.v1, foxglove.sdk.v1"), Some("foxglove.sdk.v1"));
        assert_eq!(choose("foxglove.websocket.v1"), Some("foxglove.websocket.v1"));
        assert_eq!(choose("foxglove.sdk.v1.1,chat"), None);
    }

    #[test]
    fn channels_are_told_as_they_stand_in_recordings() {
        let said: Value = serde_json::from_str(&advertise(&Definition::all())).unwrap();
        assert_eq!(said["op"], "advertise");
        for (id, definition) in Definition::all().iter().enumerate() {
            let channel = &said["channels"][id];
            assert_eq!(channel["id"], id);
            assert_eq!(channel["topic"], definition.topic);
            assert_eq!(channel["encoding"], *definition.message_encoding);
            assert_eq!(channel["schemaName"], *definition.schema.name);
            let schema = channel["schema"].as_str().unwrap();
            match channel["schemaEncoding"].as_str().unwrap() {
                "ros2msg" => assert_eq!(schema.as_bytes(), definition.schema.data),
                "protobuf" => assert_eq!(BASE64.decode(schema.as_bytes()).unwrap(), definition.schema.data),
                other => panic!("{other}"),
            }
        }
    }

    #[test]
    fn clients_are_understood() {
        let ask = |text: &str| serde_json::from_str::<Asked>(text);
        let subscribe = json!({"op": "subscribe", "subscriptions": [{"id": 7, "channelId": 2}]});
        let Ok(Asked::Subscribe { subscriptions }) = ask(&subscribe.to_string()) else { panic!() };
        assert_eq!((subscriptions[0].id, subscriptions[0].place()), (7, Some(2)));
        let beyond = Subscription { id: 7, channel_id: Channel::COUNT as u64 };
        assert_eq!(beyond.place(), None);
        let unsubscribe = r#"{"op": "unsubscribe", "subscriptionIds": [7]}"#;
        assert_eq!(ask(unsubscribe).unwrap(), Asked::Unsubscribe { subscription_ids: vec![7] });
        assert_eq!(ask(r#"{"op": "getParameters", "parameterNames": []}"#).unwrap(), Asked::Other);
        assert!(ask("{}").is_err() && ask("chat").is_err());
    }

    #[test]
    fn a_message_is_opcode_subscription_time_and_bytes() {
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
