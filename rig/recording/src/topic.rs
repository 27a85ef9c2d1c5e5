//! The topics of a recording, and the layout of their messages.

use masseter_shared::messages::{Command, Event, FrameTap, Machine, Message, Reading, State, Truth};

use super::Recorded;

/// One of the rig's topics.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Topic {
    /// Controller to plant.
    Command,
    /// Plant to controller.
    Reading,
    /// What the controller made of a reading.
    State,
    /// What the mechanism really did.
    Truth,
    /// CAN frames.
    Frame,
    /// Occurrences.
    Event,
    /// What the kernel counted.
    Machine,
}

impl Topic {
    /// Every topic.
    pub const ALL: [Self; 7] =
        [Self::Command, Self::Reading, Self::State, Self::Truth, Self::Frame, Self::Event, Self::Machine];

    /// The topic that messages of this type travel on.
    pub fn of<M: Message>() -> Self {
        Self::named(M::TOPIC).expect("every message type has its topic here")
    }

    /// The topic of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|topic| topic.name() == name)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Command => Command::TOPIC,
            Self::Reading => Reading::TOPIC,
            Self::State => State::TOPIC,
            Self::Truth => Truth::TOPIC,
            Self::Frame => FrameTap::TOPIC,
            Self::Event => Event::TOPIC,
            Self::Machine => Machine::TOPIC,
        }
    }

    /// Bytes of its messages' bodies, at most.
    pub fn body_bytes(self) -> usize {
        match self {
            Self::Command => size_of::<Command>(),
            Self::Reading => size_of::<Reading>(),
            Self::State => size_of::<State>(),
            Self::Truth => size_of::<Truth>(),
            Self::Frame => size_of::<FrameTap>(),
            Self::Event => size_of::<Event>(),
            Self::Machine => size_of::<Machine>(),
        }
    }

    /// The message with this body, if one can have it.
    pub(super) fn read(self, body: &[u8]) -> Option<Recorded> {
        Some(match self {
            Self::Command => Recorded::Command(Command::from_body(body)?),
            Self::Reading => Recorded::Reading(Reading::from_body(body)?),
            Self::State => Recorded::State(State::from_body(body)?),
            Self::Truth => Recorded::Truth(Truth::from_body(body)?),
            Self::Frame => Recorded::Frame(FrameTap::from_body(body)?),
            Self::Event => Recorded::Event(Event::from_body(body)?),
            Self::Machine => Recorded::Machine(Machine::from_body(body)?),
        })
    }
}

/// What every message begins with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Stamps {
    pub seq: u64,
    pub published_ns: u64,
    pub version: u64,
}

impl Stamps {
    /// Reads them, if `body` is long enough for any message.
    pub(super) fn read(body: &[u8]) -> Option<Self> {
        let [seq, published_ns, version] = bytemuck::pod_read_unaligned(body.get(..24)?);
        Some(Self { seq, published_ns, version })
    }
}
