//! The channels and the encoding of their messages, for recordings and for live viewers alike.

use std::collections::BTreeMap;
use std::sync::Arc;

use cdr::{CdrLe, Infinite};

use super::ros::{MarkerArray, RosMessage, TfMessage};
use super::scene::Scene;
use super::topic::{Recorded, Stamps, Topic};

/// Encapsulation header of plain little-endian CDR (version 1, OMG CDR).
pub const CDR_LITTLE_ENDIAN: [u8; 4] = [0x00, 0x01, 0x00, 0x00];
/// Encoding of all messages.
const MESSAGE_ENCODING: &str = "cdr";
/// Encoding of all schemas.
pub const SCHEMA_ENCODING: &str = "ros2msg";

/// A channel of messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// The rig's own messages.
    Topic(Topic),
    /// Poses of the frames of a 3-D view.
    Transforms,
    /// Shapes in these frames.
    Markers,
}

impl Channel {
    /// How many there are.
    pub const COUNT: usize = Topic::ALL.len() + 2;

    /// Its place in [`definitions`].
    pub fn place(self) -> usize {
        match self {
            Self::Topic(topic) => topic as usize,
            Self::Transforms => Topic::ALL.len(),
            Self::Markers => Topic::ALL.len() + 1,
        }
    }

    /// The channels that carry a topic's messages, or a view of them.
    pub fn for_topic(topic: Topic) -> Vec<Self> {
        match topic {
            Topic::State => vec![Self::Topic(topic), Self::Transforms],
            Topic::Truth => vec![Self::Topic(topic), Self::Transforms, Self::Markers],
            _ => vec![Self::Topic(topic)],
        }
    }
}

/// The definition of every channel, by its place; numbered from 1.
pub fn definitions() -> Vec<mcap::Channel<'static>> {
    let topics = Topic::ALL.map(|topic| {
        let (name, definition) = topic.definition();
        (topic.name(), name, definition)
    });
    let views = [view::<TfMessage>(Scene::TRANSFORMS), view::<MarkerArray>(Scene::MARKERS)];
    let channel = |(id, (topic, name, definition)): (u16, (&str, String, String))| {
        let (encoding, data) = (SCHEMA_ENCODING.to_owned(), definition.into_bytes().into());
        mcap::Channel {
            id,
            topic: topic.to_owned(),
            schema: Some(Arc::new(mcap::Schema { id, name, encoding, data })),
            message_encoding: MESSAGE_ENCODING.to_owned(),
            metadata: BTreeMap::new(),
        }
    };
    (1..).zip(topics.into_iter().chain(views)).map(channel).collect()
}

fn view<M: RosMessage>(topic: &'static str) -> (&'static str, String, String) {
    (topic, M::TYPE_NAME.to_owned(), M::DEFINITION.to_owned())
}

/// A message as its channel carries it.
#[derive(Debug, Clone, Copy)]
pub struct Encoded<'a> {
    /// Its channel.
    pub channel: Channel,
    /// Its sequence number; 0 on the channels for 3-D views.
    pub sequence: u32,
    /// When it was published, ns.
    pub publish_time_ns: u64,
    /// Its bytes.
    pub bytes: &'a [u8],
}

/// Encodes the rig's messages for the channels.
#[derive(Debug)]
pub struct Encoder {
    scene: Scene,
    bytes: Vec<u8>,
}

impl Encoder {
    /// An encoder that also draws the mechanism of `scene`.
    pub fn new(scene: Scene) -> Self {
        Self { scene, bytes: Vec::new() }
    }

    /// Passes to `put` a message, and its view in 3-D if one is due.
    pub fn encode<E>(
        &mut self,
        message: &Recorded,
        mut put: impl FnMut(Encoded) -> Result<(), E>,
    ) -> Result<(), E> {
        let body = message.body();
        let stamps = Stamps::read(body).expect("every message begins with its stamps");
        self.bytes.clear();
        self.bytes.extend_from_slice(&CDR_LITTLE_ENDIAN);
        self.bytes.extend_from_slice(body);
        put(Encoded {
            channel: Channel::Topic(message.topic()),
            sequence: stamps.seq as u32,
            publish_time_ns: stamps.published_ns,
            bytes: &self.bytes,
        })?;
        let shown = match message {
            Recorded::State(state) => self.scene.state(state),
            Recorded::Truth(truth) => self.scene.truth(truth),
            _ => None,
        };
        let Some(shown) = shown else { return Ok(()) };
        put(self.view(Channel::Transforms, &shown.transforms, shown.time_ns))?;
        match &shown.markers {
            Some(markers) => put(self.view(Channel::Markers, markers, shown.time_ns)),
            None => Ok(()),
        }
    }

    fn view(&mut self, channel: Channel, message: &impl RosMessage, publish_time_ns: u64) -> Encoded<'_> {
        self.bytes.clear();
        if cdr::serialize_into::<_, _, _, CdrLe>(&mut self.bytes, message, Infinite).is_err() {
            unreachable!("a buffer that grows takes every number, string and list");
        }
        Encoded { channel, sequence: 0, publish_time_ns, bytes: &self.bytes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_channel_stands_at_its_place() {
        let definitions = definitions();
        let mut found = Vec::new();
        for topic in Topic::ALL {
            assert_eq!(definitions[Channel::Topic(topic).place()].topic, topic.name());
            found.extend(Channel::for_topic(topic));
        }
        assert_eq!(definitions[Channel::Transforms.place()].topic, Scene::TRANSFORMS);
        assert_eq!(definitions[Channel::Markers.place()].topic, Scene::MARKERS);
        assert!((0..definitions.len()).all(|place| found.iter().any(|channel| channel.place() == place)));
    }
}
