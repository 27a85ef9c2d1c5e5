//! The channels and the encoding of their messages, for recordings and for live viewers alike.

use std::collections::BTreeMap;
use std::sync::Arc;

use cdr::{CdrLe, Infinite};

use masseter_runtime::named::Declared;

use super::encapsulation::CDR_LITTLE_ENDIAN;
use super::frames::FrameBatch;
use super::ros::{MarkerArray, RosMessage, TfMessage};
use super::scene::Scene;
use super::topic::{Recorded, Stamps, Topic};

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
    /// CAN frames, many in a message, as recordings have them in place of the topic's single ones.
    Frames,
}

impl Channel {
    /// How many there are.
    pub const COUNT: usize = Topic::ALL.len() + 3;

    /// Every channel, by its place.
    pub fn all() -> impl Iterator<Item = Self> {
        Topic::ALL.into_iter().map(Self::Topic).chain([Self::Transforms, Self::Markers, Self::Frames])
    }

    /// Its place among all.
    pub fn place(self) -> usize {
        match self {
            Self::Topic(topic) => topic as usize,
            Self::Transforms => Topic::ALL.len(),
            Self::Markers => Topic::ALL.len() + 1,
            Self::Frames => Topic::ALL.len() + 2,
        }
    }

    /// The channels that carry a topic's messages to live viewers, or a view of them.
    pub fn for_topic(topic: Topic) -> Vec<Self> {
        match topic {
            Topic::State => vec![Self::Topic(topic), Self::Transforms],
            Topic::Truth => vec![Self::Topic(topic), Self::Transforms, Self::Markers],
            _ => vec![Self::Topic(topic)],
        }
    }
}

/// The definitions of the channels for live viewers, of a run whose controller declares these signals and parameters, numbered
/// by their places from 1.
pub fn definitions(declared: &Declared) -> Vec<(Channel, mcap::Channel<'static>)> {
    defined(declared, |channel| channel != Channel::Frames)
}

/// The same for recordings.
pub(super) fn recorded_definitions(declared: &Declared) -> Vec<(Channel, mcap::Channel<'static>)> {
    defined(declared, |channel| channel != Channel::Topic(Topic::Frame))
}

fn defined(declared: &Declared, is_needed: fn(Channel) -> bool) -> Vec<(Channel, mcap::Channel<'static>)> {
    let needed = Channel::all().filter(|channel| is_needed(*channel));
    needed.filter_map(|channel| Some((channel, definition(channel, declared)?))).collect()
}

fn definition(channel: Channel, declared: &Declared) -> Option<mcap::Channel<'static>> {
    let (topic, name, definition) = match channel {
        Channel::Topic(topic) => {
            let (name, definition) = topic.definition();
            (topic.name(), name, named_definition(topic, definition, declared)?)
        }
        Channel::Transforms => view::<TfMessage>(Scene::TRANSFORMS),
        Channel::Markers => view::<MarkerArray>(Scene::MARKERS),
        Channel::Frames => {
            (FrameBatch::TOPIC, FrameBatch::TYPE_NAME.to_owned(), FrameBatch::DEFINITION.to_owned())
        }
    };
    let id = channel.place() as u16 + 1;
    let (encoding, data) = (SCHEMA_ENCODING.to_owned(), definition.into_bytes().into());
    Some(mcap::Channel {
        id,
        topic: topic.to_owned(),
        schema: Some(Arc::new(mcap::Schema { id, name, encoding, data })),
        message_encoding: MESSAGE_ENCODING.to_owned(),
        metadata: BTreeMap::new(),
    })
}

/// The definition of a topic in a run; none for signals or parameters that nobody declares. CDR writes the sequence of values
/// as its length and, on their alignment, the values: so each may be a field of its own.
fn named_definition(topic: Topic, definition: String, declared: &Declared) -> Option<String> {
    let fields: Vec<_> = match topic {
        Topic::Signals => {
            declared.signals.iter().map(|signal| field(&signal.name, &signal.unit, &signal.about)).collect()
        }
        Topic::Parameters => {
            declared.parameters.iter().map(|known| field(&known.name, &known.unit, &known.about)).collect()
        }
        _ => return Some(definition),
    };
    let before = definition.lines().filter(|line| !line.contains("[<="));
    let before = before.fold(String::new(), |text, line| text + line + "\n");
    (!fields.is_empty())
        .then(|| before + "uint32 length  # Number of values that follow.\n" + &fields.concat())
}

fn field(name: &str, unit: &str, about: &str) -> String {
    let unit = if unit.is_empty() { String::new() } else { format!("[{unit}] ") };
    format!("float64 {name}  # {unit}{about}\n").replace(['\n', '\r'], " ").trim_end().to_owned() + "\n"
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
    use masseter_runtime::messages::{Message, Signals};
    use masseter_runtime::named::Signal;

    use super::*;

    #[test]
    fn every_channel_stands_at_its_place_and_carries_a_topic() {
        assert!(Channel::all().map(Channel::place).eq(0..Channel::COUNT));
        let found: Vec<_> = Topic::ALL.into_iter().flat_map(Channel::for_topic).collect();
        assert!(Channel::all().all(|channel| found.contains(&channel) != (channel == Channel::Frames)));
    }

    #[test]
    fn signals_are_fields_of_their_message_and_without_any_there_is_no_channel() {
        let is_named = |channel: Channel| channel == Channel::Topic(Topic::Signals);
        let none = definitions(&Declared::default());
        assert!(!none.iter().any(|(channel, _)| is_named(*channel)) && none.len() == Channel::COUNT - 3);
        let signal = |name: &str, unit: &str| Signal {
            name: name.into(),
            unit: unit.into(),
            about: "What\nit is.".into(),
        };
        let declared =
            Declared { signals: vec![signal("grip", "N"), signal("count", "")], ..Declared::default() };
        let definitions = definitions(&declared);
        let (_, channel) = definitions.iter().find(|(channel, _)| is_named(*channel)).unwrap();
        let definition = str::from_utf8(&channel.schema.as_ref().unwrap().data).unwrap();
        let before =
            Signals::definition().lines().take(5).map(|line| line.to_owned() + "\n").collect::<String>();
        assert!(before.ends_with("uint64 cycle  # Cycle of the controller, from 1.\n"), "{before}");
        assert_eq!(
            definition,
            format!(
                "{before}uint32 length  # Number of values that follow.\nfloat64 grip  # [N] What it is.\nfloat64 count  # What it is.\n"
            )
        );
    }
}
