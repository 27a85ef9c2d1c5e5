//! The topics of a recording and their messages: one table of both.

use masseter_runtime::messages::{
    Command, Contact, Event, FrameTap, Machine, Message, Parameters, Reading, Signals, State, Truth,
};

/// Encapsulation header of plain little-endian CDR (version 1, OMG CDR), before the body of every message.
pub const CDR_LITTLE_ENDIAN: [u8; 4] = [0x00, 0x01, 0x00, 0x00];

macro_rules! topics {
    ($($(#[$doc:meta])* $name:ident: $message:ty),* $(,)?) => {
        /// One of the rig's topics.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        #[repr(u8)]
        pub enum Topic {
            $($(#[$doc])* $name),*
        }

        /// A message of any topic.
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[expect(clippy::large_enum_variant, reason = "a message is copied as it lies, without an allocation")]
        pub enum Recorded {
            $($(#[$doc])* $name($message)),*
        }

        impl Topic {
            /// Every topic.
            pub const ALL: [Self; [$(stringify!($name)),*].len()] = [$(Self::$name),*];

            /// The name in recordings.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$name => <$message>::TOPIC),*
                }
            }

            /// Name and definition of the message type, as ROS 2 has them.
            pub(super) fn definition(self) -> (String, String) {
                match self {
                    $(Self::$name => (<$message>::TYPE_NAME.replacen('/', "/msg/", 1), <$message>::definition())),*
                }
            }
        }

        impl Recorded {
            /// The message of a topic with this body, if its length is one of this topic.
            pub(super) fn read(topic: Topic, body: &[u8]) -> Option<Self> {
                Some(match topic {
                    $(Topic::$name => Self::$name(<$message>::from_body(body)?)),*
                })
            }

            /// Its topic.
            pub fn topic(&self) -> Topic {
                match self {
                    $(Self::$name(_) => Topic::$name),*
                }
            }

            /// Its body, as it lay in shared memory.
            pub fn body(&self) -> &[u8] {
                match self {
                    $(Self::$name(message) => message.body()),*
                }
            }
        }

        $(impl From<$message> for Recorded {
            fn from(message: $message) -> Self {
                Self::$name(message)
            }
        })*
    };
}

topics! {
    /// Targets, from controller to plant.
    Command: Command,
    /// Samples, from plant to controller.
    Reading: Reading,
    /// The controller's result for a reading.
    State: State,
    /// The true motion of the emulated mechanism.
    Truth: Truth,
    /// The forces between the emulated jaws.
    Contact: Contact,
    /// CAN frames.
    Frame: FrameTap,
    /// Events.
    Event: Event,
    /// The kernel's counters.
    Machine: Machine,
    /// The controller's signals.
    Signals: Signals,
    /// The controller's parameters.
    Parameters: Parameters,
}

impl Topic {
    /// The topic of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|topic| topic.name() == name)
    }
}

impl Recorded {
    /// Its sequence number on its topic, counted by its publisher.
    pub fn seq(&self) -> u64 {
        self.stamps().seq
    }

    /// When it was published, ns.
    pub fn published_ns(&self) -> u64 {
        self.stamps().published_ns
    }

    /// The cycle of its publisher; none for what no cycle makes.
    pub fn cycle(&self) -> Option<u64> {
        Some(match self {
            Self::Command(message) => message.cycle,
            Self::Reading(message) => message.cycle,
            Self::State(message) => message.cycle,
            Self::Truth(message) => message.cycle,
            Self::Contact(message) => message.cycle,
            Self::Event(message) => message.cycle,
            Self::Signals(message) => message.cycle,
            Self::Parameters(message) => message.cycle,
            Self::Frame(_) | Self::Machine(_) => return None,
        })
    }

    fn stamps(&self) -> Stamps {
        Stamps::read(self.body()).expect("every message begins with its stamps")
    }
}

/// The fields with which every message begins.
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
