//! The channels and the encoding of their messages, for recordings and for live viewers alike.

use foxglove::Encode;
use foxglove::messages::{FrameTransforms, SceneUpdate};

use super::scene::Scene;
use super::schema::{CDR_LITTLE_ENDIAN, MESSAGE_ENCODING, SCHEMA_ENCODING, Schema};
use super::topic::{Stamps, Topic};

/// A channel of messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// The rig's own messages.
    Topic(Topic),
    /// Poses of the frames of a 3-D view.
    Transforms,
    /// Shapes in these frames.
    Entities,
}

impl Channel {
    /// How many there are.
    pub const COUNT: usize = Topic::ALL.len() + 2;

    /// Its place in [`Definition::all`].
    pub fn place(self) -> usize {
        match self {
            Self::Topic(topic) => topic as usize,
            Self::Transforms => Topic::ALL.len(),
            Self::Entities => Topic::ALL.len() + 1,
        }
    }

    /// The channels that carry a topic's messages, or a view of them.
    pub fn for_topic(topic: Topic) -> Vec<Self> {
        match topic {
            Topic::State => vec![Self::Topic(topic), Self::Transforms],
            Topic::Truth => vec![Self::Topic(topic), Self::Transforms, Self::Entities],
            _ => vec![Self::Topic(topic)],
        }
    }
}

/// The definition of a channel, for readers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Definition {
    /// The topic.
    pub topic: &'static str,
    /// The schema of its messages.
    pub schema: Schema,
    /// The encoding of its messages.
    pub message_encoding: String,
}

impl Definition {
    /// Every channel, by its place.
    pub fn all() -> Vec<Self> {
        let topics = Topic::ALL.map(Self::for_topic);
        let transforms = Self::for_foxglove::<FrameTransforms>(Scene::TRANSFORMS);
        let entities = Self::for_foxglove::<SceneUpdate>(Scene::ENTITIES);
        topics.into_iter().chain([transforms, entities]).collect()
    }

    fn for_topic(topic: Topic) -> Self {
        let (name, definition) = topic.definition();
        let (name, encoding) = (name.to_owned(), SCHEMA_ENCODING.to_owned());
        let schema = Schema { name, encoding, data: definition.into() };
        Self { topic: topic.name(), schema, message_encoding: MESSAGE_ENCODING.to_owned() }
    }

    fn for_foxglove<E: Encode>(topic: &'static str) -> Self {
        let foxglove::Schema { name, encoding, data } =
            E::get_schema().expect("Foxglove's own messages have schemas");
        let schema = Schema { name, encoding, data: data.into_owned() };
        Self { topic, schema, message_encoding: E::get_message_encoding() }
    }
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
    cdr: Vec<u8>,
    protobuf: Vec<u8>,
}

impl Encoder {
    /// An encoder that also draws the mechanism of `scene`.
    pub fn new(scene: Scene) -> Self {
        Self { scene, cdr: Vec::new(), protobuf: Vec::new() }
    }

    /// Passes to `put` the message of a topic with this body, and its view in 3-D.
    pub fn encode<E>(
        &mut self,
        topic: Topic,
        body: &[u8],
        put: impl FnMut(Encoded) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut cdr = std::mem::take(&mut self.cdr);
        cdr.clear();
        cdr.extend_from_slice(&CDR_LITTLE_ENDIAN);
        cdr.extend_from_slice(body);
        let result = self.encode_cdr(topic, &cdr, put);
        self.cdr = cdr;
        result
    }

    /// The same for a message that is CDR already.
    pub(super) fn encode_cdr<E>(
        &mut self,
        topic: Topic,
        cdr: &[u8],
        mut put: impl FnMut(Encoded) -> Result<(), E>,
    ) -> Result<(), E> {
        let body = &cdr[CDR_LITTLE_ENDIAN.len()..];
        let stamps = Stamps::read(body).expect("every message begins with its stamps");
        put(Encoded {
            channel: Channel::Topic(topic),
            sequence: stamps.seq as u32,
            publish_time_ns: stamps.published_ns,
            bytes: cdr,
        })?;
        self.show(topic, body, put)
    }

    /// Passes to `put` the view of a message in 3-D, if one is due.
    fn show<E>(
        &mut self,
        topic: Topic,
        body: &[u8],
        mut put: impl FnMut(Encoded) -> Result<(), E>,
    ) -> Result<(), E> {
        let shown = match topic {
            Topic::State => self.scene.state(&bytemuck::pod_read_unaligned(body)),
            Topic::Truth => self.scene.truth(&bytemuck::pod_read_unaligned(body)),
            _ => return Ok(()),
        };
        let Some(shown) = shown else { return Ok(()) };
        put(self.foxglove(Channel::Transforms, &shown.transforms, shown.time_ns))?;
        match &shown.entities {
            Some(entities) => put(self.foxglove(Channel::Entities, entities, shown.time_ns)),
            None => Ok(()),
        }
    }

    fn foxglove(&mut self, channel: Channel, message: &impl Encode, publish_time_ns: u64) -> Encoded<'_> {
        self.protobuf.clear();
        if message.encode(&mut self.protobuf).is_err() {
            unreachable!("protobuf refuses only buffers that cannot grow");
        }
        Encoded { channel, sequence: 0, publish_time_ns, bytes: &self.protobuf }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_channel_stands_at_its_place() {
        let definitions = Definition::all();
        let mut found = Vec::new();
        for topic in Topic::ALL {
            assert_eq!(definitions[Channel::Topic(topic).place()].topic, topic.name());
            found.extend(Channel::for_topic(topic));
        }
        assert_eq!(definitions[Channel::Transforms.place()].topic, Scene::TRANSFORMS);
        assert_eq!(definitions[Channel::Entities.place()].topic, Scene::ENTITIES);
        assert!((0..definitions.len()).all(|place| found.iter().any(|channel| channel.place() == place)));
    }
}
