//! The channels and the encoding of their messages, for recordings and for live viewers alike.
//!
//! CAN frames that were received together are one message of a recording, `masseter/msg/Frames`. A message for each frame
//! would take three times the bytes: most of them repeat stamps, or index messages. Every frame keeps all its fields, and
//! its place among the messages of the other topics. Times are those since the frame before: they repeat from cycle to cycle
//! also where the cycle's begin varies.

use std::{array, collections::BTreeMap, sync::Arc};

use masseter_runtime::messages::{CanData, FrameTap};
use masseter_runtime::named::Declared;

use crate::scene::{MarkerArray, RosMessage, Scene, TfMessage};
use crate::topic::{CDR_LITTLE_ENDIAN, Recorded, Stamps, Topic};

/// Encoding of all messages.
const MESSAGE_ENCODING: &str = "cdr";
/// Encoding of all schemas.
pub const SCHEMA_ENCODING: &str = "ros2msg";
/// Most frames of a message; ten cycles of the rig have fewer.
const MOST_FRAMES: u32 = 256;
/// Where the number of frames stands behind the CDR header: behind three stamps, and two times of the first frame.
const COUNT_AT: usize = 40;
/// Bytes up to the first frame.
const HEAD: usize = COUNT_AT + 4;
/// Bytes of a frame before its data: three differences of times, identifier, bus, flags, length of the data.
const FRAME_HEAD: usize = 28;
/// The alignment of a frame.
const ALIGNMENT: usize = 4;

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
/// by their places from 1. Recordings have [`Channel::Frames`] in place of single frames.
pub fn definitions(declared: &Declared) -> Vec<(Channel, mcap::Channel<'static>)> {
    let live = Channel::all().filter(|channel| *channel != Channel::Frames);
    live.filter_map(|channel| Some((channel, definition(channel, declared)?))).collect()
}

/// The definition of one channel; none for signals or parameters that nobody declares.
pub(super) fn definition(channel: Channel, declared: &Declared) -> Option<mcap::Channel<'static>> {
    let (topic, name, definition) = match channel {
        Channel::Topic(topic) => {
            let (name, definition) = topic.definition();
            (topic.name(), name, named_definition(topic, definition, declared)?)
        }
        Channel::Transforms => view_definition::<TfMessage>(Scene::TRANSFORMS),
        Channel::Markers => view_definition::<MarkerArray>(Scene::MARKERS),
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
    let (signals, parameters) = (declared.signals.iter(), declared.parameters.iter());
    let fields: Vec<_> = match topic {
        Topic::Signals => signals.map(|of| field_line(&of.name, &of.unit, &of.about)).collect(),
        Topic::Parameters => parameters.map(|of| field_line(&of.name, &of.unit, &of.about)).collect(),
        _ => return Some(definition),
    };
    let before = definition.lines().filter(|line| !line.contains("[<="));
    let before = before.fold(String::new(), |text, line| text + line + "\n");
    (!fields.is_empty())
        .then(|| before + "uint32 length  # Number of values that follow.\n" + &fields.concat())
}

fn field_line(name: &str, unit: &str, about: &str) -> String {
    let unit = if unit.is_empty() { String::new() } else { format!("[{unit}] ") };
    format!("float64 {name}  # {unit}{about}\n").replace(['\n', '\r'], " ").trim_end().to_owned() + "\n"
}

fn view_definition<M: RosMessage>(topic: &'static str) -> (&'static str, String, String) {
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
            Recorded::State(state) => self.scene.show_state(state),
            Recorded::Truth(truth) => self.scene.show_truth(truth),
            _ => None,
        };
        let Some(shown) = shown else { return Ok(()) };
        put(self.encode_view(Channel::Transforms, &shown.transforms, shown.time_ns))?;
        match &shown.markers {
            Some(markers) => put(self.encode_view(Channel::Markers, markers, shown.time_ns)),
            None => Ok(()),
        }
    }

    fn encode_view(
        &mut self,
        channel: Channel,
        message: &impl RosMessage,
        publish_time_ns: u64,
    ) -> Encoded<'_> {
        self.bytes.clear();
        if cdr::serialize_into::<_, _, _, cdr::CdrLe>(&mut self.bytes, message, cdr::Infinite).is_err() {
            unreachable!("a buffer that grows takes every number, string and list");
        }
        Encoded { channel, sequence: 0, publish_time_ns, bytes: &self.bytes }
    }
}

/// Frames that are gathered for a message.
#[derive(Debug, Default)]
pub(super) struct FrameBatch {
    /// Header and body of the message.
    bytes: Vec<u8>,
    first: FrameTap,
    last: FrameTap,
    count: u32,
    /// When the frames were received, ns.
    pub(super) log_time_ns: u64,
}

impl FrameBatch {
    pub(super) const TOPIC: &str = "frames";
    const TYPE_NAME: &str = "masseter/msg/Frames";
    const DEFINITION: &str = include_str!("../schemas/Frames.msg");

    /// Whether a frame that was received at `log_time_ns` belongs behind those gathered.
    pub(super) fn takes(&self, frame: &FrameTap, log_time_ns: u64) -> bool {
        self.count == 0
            || self.count < MOST_FRAMES
                && log_time_ns == self.log_time_ns
                && self.last.seq.checked_add(1) == Some(frame.seq)
                && frame.version == self.last.version
                && differences_ns(&self.last, frame).iter().all(|ns| i32::try_from(*ns).is_ok())
    }

    /// Adds a frame that it [takes](Self::takes).
    pub(super) fn push_frame(&mut self, frame: &FrameTap, log_time_ns: u64) {
        if self.count == 0 {
            self.begin_batch(frame, log_time_ns);
        }
        self.count += 1;
        let body = self.bytes.len() - CDR_LITTLE_ENDIAN.len();
        self.bytes.resize(CDR_LITTLE_ENDIAN.len() + body.next_multiple_of(ALIGNMENT), 0);
        for difference_ns in differences_ns(&self.last, frame) {
            self.bytes.extend_from_slice(&(difference_ns as i32).to_le_bytes());
        }
        let data = frame.data.as_slice();
        for number in [frame.id, frame.bus, frame.flags, data.len() as u32] {
            self.bytes.extend_from_slice(&number.to_le_bytes());
        }
        self.bytes.extend_from_slice(data);
        self.last = *frame;
    }

    fn begin_batch(&mut self, first: &FrameTap, log_time_ns: u64) {
        (self.first, self.last, self.log_time_ns) = (*first, *first, log_time_ns);
        self.bytes.clear();
        self.bytes.extend_from_slice(&CDR_LITTLE_ENDIAN);
        for number in [first.seq, first.published_ns, first.version, first.time_ns, first.queued_ns] {
            self.bytes.extend_from_slice(&number.to_le_bytes());
        }
        self.bytes.extend_from_slice(&[0; HEAD - COUNT_AT]);
    }

    /// The message, with the first frame; none without frames.
    pub(super) fn end_batch(&mut self) -> Option<(&FrameTap, &[u8])> {
        let count = std::mem::take(&mut self.count);
        let at = CDR_LITTLE_ENDIAN.len() + COUNT_AT;
        self.bytes.get_mut(at..at + 4)?.copy_from_slice(&count.to_le_bytes());
        (count > 0).then_some((&self.first, &self.bytes))
    }
}

/// The times of a frame since those of the frame before: on the wire, in the queue, and when it was published.
fn differences_ns(before: &FrameTap, frame: &FrameTap) -> [i64; 3] {
    let times_ns = |frame: &FrameTap| [frame.time_ns, frame.queued_ns, frame.published_ns];
    let [before_ns, after_ns] = [before, frame].map(times_ns);
    array::from_fn(|time| after_ns[time].wrapping_sub(before_ns[time]).cast_signed())
}

/// The frames of a message's body; `None` if they do not fill it.
pub(crate) fn frames_of(body: &[u8]) -> Option<Vec<FrameTap>> {
    let (head, mut rest) = body.split_at_checked(HEAD)?;
    let [seq, published_ns, version, time_ns, queued_ns]: [u64; 5] =
        bytemuck::pod_read_unaligned(&head[..COUNT_AT]);
    let count: u32 = bytemuck::pod_read_unaligned(&head[COUNT_AT..]);
    let mut times_ns = [time_ns, queued_ns, published_ns];
    let mut frames = Vec::new();
    for number in 0..u64::from(count) {
        let (frame, behind) = rest.split_at_checked(FRAME_HEAD)?;
        let after_ns: [i32; 3] = bytemuck::pod_read_unaligned(&frame[..12]);
        let [id, bus, flags, length]: [u32; 4] = bytemuck::pod_read_unaligned(&frame[12..]);
        let (data, behind) = behind.split_at_checked(length as usize)?;
        let data = CanData::checked(data)?;
        // The last one is not padded.
        rest = behind.get(data.as_slice().len().wrapping_neg() % ALIGNMENT..).unwrap_or_default();
        times_ns = array::from_fn(|time| times_ns[time].wrapping_add_signed(after_ns[time].into()));
        let [time_ns, queued_ns, published_ns] = times_ns;
        let seq = seq.checked_add(number)?;
        frames.push(FrameTap { seq, published_ns, version, time_ns, queued_ns, id, bus, flags, data });
    }
    rest.is_empty().then_some(frames)
}

#[cfg(test)]
mod tests {
    use masseter_runtime::messages::{Message, Signals};
    use masseter_runtime::named::Signal;
    use proptest::prelude::*;

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

    fn frame(seq: u64, published_ns: u64) -> FrameTap {
        let mut frame = FrameTap::default();
        frame.stamp(seq, published_ns);
        frame
    }

    fn body(batch: &mut FrameBatch) -> Vec<u8> {
        let (_, bytes) = batch.end_batch().unwrap();
        bytes.strip_prefix(&CDR_LITTLE_ENDIAN).unwrap().to_vec()
    }

    #[test]
    fn a_frame_behind_a_gap_or_of_another_reception_begins_another_message() {
        let mut batch = FrameBatch::default();
        batch.push_frame(&frame(3, 10), 20);
        assert!(batch.takes(&frame(4, 10), 20) && batch.takes(&frame(4, 11), 20), "of two cycles");
        assert!(!batch.takes(&frame(5, 10), 20) && !batch.takes(&frame(4, 10), 21));
        assert!(batch.end_batch().is_some() && batch.end_batch().is_none());
        assert!(batch.takes(&frame(7, 11), 21));
    }

    #[test]
    fn a_frame_seconds_away_begins_another_message() {
        let mut batch = FrameBatch::default();
        batch.push_frame(&FrameTap { time_ns: 5_000_000_000, queued_ns: 4_999_000_000, ..frame(3, 10) }, 1);
        let takes = |time_ns, queued_ns, published_ns| {
            batch.takes(&FrameTap { time_ns, queued_ns, ..frame(4, published_ns) }, 1)
        };
        assert!(takes(7_000_000_000, 3_000_000_000, 2_000_000_000));
        assert!(!takes(8_000_000_000, 4_999_000_000, 10) && !takes(5_000_100_000, 0, 10));
        assert!(!takes(5_000_100_000, 4_999_000_000, 3_000_000_000));
    }

    #[test]
    fn a_body_that_is_cut_or_continued_holds_no_frames() {
        let mut batch = FrameBatch::default();
        for seq in 1..=2 {
            batch.push_frame(&FrameTap { data: CanData::new(&[7; 5]), ..frame(seq, 1) }, 1);
        }
        let body = body(&mut batch);
        assert_eq!(frames_of(&body).unwrap().len(), 2);
        assert!((0..body.len()).all(|length| frames_of(&body[..length]).is_none()));
        assert!(frames_of(&[&body[..], &[0; 4]].concat()).is_none());
    }

    proptest! {
        #[test]
        fn frames_are_read_as_they_were_written(
            first_ns: [u64; 3],
            seen in prop::collection::vec(
                (any::<[i32; 3]>(), any::<[u32; 3]>(), prop::collection::vec(any::<u8>(), 0..=64)),
                1..20,
            ),
        ) {
            let mut times_ns = first_ns;
            let mut written = vec![];
            for (seq, (after_ns, [id, bus, flags], data)) in (4..).zip(seen) {
                let [time_ns, queued_ns, published_ns] = times_ns;
                let data = CanData::new(&data);
                written.push(FrameTap { time_ns, queued_ns, id, bus, flags, data, ..frame(seq, published_ns) });
                times_ns = array::from_fn(|time| times_ns[time].wrapping_add_signed(after_ns[time].into()));
            }
            let mut batch = FrameBatch::default();
            for frame in &written {
                prop_assert!(batch.takes(frame, 1));
                batch.push_frame(frame, 1);
            }
            prop_assert_eq!(frames_of(&body(&mut batch)), Some(written));
        }
    }
}
