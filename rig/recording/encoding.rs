//! What stands on each channel and how: the one source for recordings and for whoever watches live.

use foxglove::Encode;
use foxglove::messages::{FrameTransforms, SceneUpdate};
use masseter_shared::messages::{Command, Event, FrameTap, Machine, Message, Reading, State, Truth};

use super::reader::Schema;
use super::scene::Scene;
use super::topic::{Stamps, Topic};
use super::{CDR_LITTLE_ENDIAN, MESSAGE_ENCODING, SCHEMA_ENCODING};

/// A channel as it is told to readers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Definition {
    /// The topic.
    pub topic: &'static str,
    /// What its messages look like.
    pub schema: Schema,
    /// How they are encoded.
    pub message_encoding: String,
}

impl Definition {
    /// Every channel, always in this order.
    pub(crate) fn all() -> [Self; 9] {
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
pub(crate) struct Encoded<'a> {
    /// The channel's topic.
    pub topic: &'static str,
    /// Its number; 0 on channels that count nothing.
    pub sequence: u32,
    /// When it was published, ns.
    pub publish_time_ns: u64,
    /// Its bytes.
    pub bytes: &'a [u8],
}

/// Puts the rig's messages into the form in which they stand on the channels.
#[derive(Debug)]
pub(crate) struct Encoder {
    scene: Scene,
    bytes: Vec<u8>,
}

impl Encoder {
    pub(crate) fn new(scene: Scene) -> Self {
        Self { scene, bytes: Vec::new() }
    }

    /// The channels that a topic's messages come to stand on.
    pub(crate) fn channels_of(topic: Topic) -> Vec<&'static str> {
        match topic {
            Topic::State => vec![topic.name(), Scene::TRANSFORMS],
            Topic::Truth => vec![topic.name(), Scene::TRANSFORMS, Scene::ENTITIES],
            _ => vec![topic.name()],
        }
    }

    /// Hands `put` the message of a topic that lies in `body`, and what a 3-D view shows of it.
    pub(crate) fn encode<E>(
        &mut self,
        topic: Topic,
        body: &[u8],
        mut put: impl FnMut(Encoded) -> Result<(), E>,
    ) -> Result<(), E> {
        self.bytes.clear();
        self.bytes.extend_from_slice(&CDR_LITTLE_ENDIAN);
        self.bytes.extend_from_slice(body);
        let stamps = Stamps::read(body).expect("every message begins with its stamps");
        put(Encoded {
            topic: topic.name(),
            sequence: stamps.seq as u32,
            publish_time_ns: stamps.published_ns,
            bytes: &self.bytes,
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
        put(self.foxglove(Scene::TRANSFORMS, &shown.transforms, shown.time_ns))?;
        match &shown.entities {
            Some(entities) => put(self.foxglove(Scene::ENTITIES, entities, shown.time_ns)),
            None => Ok(()),
        }
    }

    fn foxglove(&mut self, topic: &'static str, message: &impl Encode, publish_time_ns: u64) -> Encoded<'_> {
        self.bytes.clear();
        if message.encode(&mut self.bytes).is_err() {
            unreachable!("protobuf refuses only buffers that cannot grow");
        }
        Encoded { topic, sequence: 0, publish_time_ns, bytes: &self.bytes }
    }
}
