//! What stands on each channel and how: the one source for recordings and for whoever watches live.

use foxglove::Encode;
use foxglove::messages::{FrameTransforms, SceneUpdate};
use masseter_shared::messages::{Command, Event, FrameTap, Machine, Message, Reading, State, Truth};

use super::definitions::Schema;
use super::scene::Scene;
use super::topic::{Stamps, Topic};
use super::{CDR_LITTLE_ENDIAN, MESSAGE_ENCODING, SCHEMA_ENCODING};

/// What messages stand on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// The rig's own messages.
    Topic(Topic),
    /// Where things are, for a 3-D view.
    Transforms,
    /// What they look like.
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

    /// The channels that a topic's messages come to stand on.
    pub fn of(topic: Topic) -> Vec<Self> {
        match topic {
            Topic::State => vec![Self::Topic(topic), Self::Transforms],
            Topic::Truth => vec![Self::Topic(topic), Self::Transforms, Self::Entities],
            _ => vec![Self::Topic(topic)],
        }
    }
}

/// A channel as it is told to readers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Definition {
    /// The topic.
    pub topic: &'static str,
    /// What its messages look like.
    pub schema: Schema,
    /// How they are encoded.
    pub message_encoding: String,
}

impl Definition {
    /// Every channel, always in this order.
    pub fn all() -> [Self; Channel::COUNT] {
        [
            Self::of_topic::<Command>(),
            Self::of_topic::<Reading>(),
            Self::of_topic::<State>(),
            Self::of_topic::<Truth>(),
            Self::of_topic::<FrameTap>(),
            Self::of_topic::<Event>(),
            Self::of_topic::<Machine>(),
            Self::of_foxglove::<FrameTransforms>(Scene::TRANSFORMS),
            Self::of_foxglove::<SceneUpdate>(Scene::ENTITIES),
        ]
    }

    fn of_topic<M: Message>() -> Self {
        let schema = Schema {
            name: M::TYPE_NAME.to_owned(),
            encoding: SCHEMA_ENCODING.to_owned(),
            data: M::schema().into(),
        };
        Self { topic: M::TOPIC, schema, message_encoding: MESSAGE_ENCODING.to_owned() }
    }

    fn of_foxglove<E: Encode>(topic: &'static str) -> Self {
        let foxglove::Schema { name, encoding, data } =
            E::get_schema().expect("Foxglove's own messages have schemas");
        let schema = Schema { name, encoding, data: data.into_owned() };
        Self { topic, schema, message_encoding: E::get_message_encoding() }
    }
}

/// A message as it stands on its channel.
#[derive(Debug, Clone, Copy)]
pub struct Encoded<'a> {
    /// Its channel.
    pub channel: Channel,
    /// Its number; 0 on channels that count nothing.
    pub sequence: u32,
    /// When it was published, ns.
    pub publish_time_ns: u64,
    /// Its bytes.
    pub bytes: &'a [u8],
}

/// Puts the rig's messages into the form in which they stand on the channels.
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

    /// Hands `put` the message of a topic that has this body, and what a 3-D view shows of it.
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

    /// Lets the scene follow the mechanism.
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
            found.extend(Channel::of(topic));
        }
        assert_eq!(definitions[Channel::Transforms.place()].topic, Scene::TRANSFORMS);
        assert_eq!(definitions[Channel::Entities.place()].topic, Scene::ENTITIES);
        assert!((0..definitions.len()).all(|place| found.iter().any(|channel| channel.place() == place)));
    }
}
