//! The recording of a run: an MCAP file with every message of every topic.
//!
//! A message's body is written as it lay in shared memory, behind the four bytes that make them
//! CDR, under a ROS 2 message definition: MCAP tools read them without knowing Masseter. Beside them
//! stands the mechanism in Foxglove's own schemas, for 3-D views. Chunks are compressed by zstd and carry
//! checksums, so that any of them can be read without the others.

mod backlog;
mod chunk;
mod circumstances;
mod definitions;
mod encoding;
mod ending;
mod folder;
mod manifest;
mod reader;
mod recover;
mod scene;
#[cfg(test)]
mod tests;
mod topic;
mod walk;
mod writer;

use masseter_shared::messages::{Command, Event, FrameTap, Machine, Message, Reading, State, Truth};

pub use backlog::{Backlog, Outcome, Pace};
pub use circumstances::{DmaLatency, Machine as MachineInfo, RunUsage, Usage};
pub use definitions::Schema;
pub use encoding::{Channel, Definition, Encoded, Encoder};
pub use ending::Ending;
pub use folder::{FolderError, MOTION, RunFolder};
pub use manifest::Manifest;
pub use reader::{Chunks, Entry, ReadError, Reader};
pub use recover::{RecoverError, Recovered, recover};
pub use scene::Scene;
pub use scene::jaw_points;
use topic::Stamps;
pub use topic::Topic;
pub use walk::Damage;
pub use writer::{DurableFile, Medium, Recorder, WriteError};

/// Encapsulation header of plain little-endian CDR (version 1).
pub const CDR_LITTLE_ENDIAN: [u8; 4] = [0x00, 0x01, 0x00, 0x00];
const MESSAGE_ENCODING: &str = "cdr";
/// Encoding of the schemas of the rig's own topics.
pub const SCHEMA_ENCODING: &str = "ros2msg";

/// A message of any topic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Recorded {
    /// Controller to plant.
    Command(Command),
    /// Plant to controller.
    Reading(Reading),
    /// What the controller made of a reading.
    State(State),
    /// What the mechanism really did.
    Truth(Truth),
    /// A CAN frame.
    Frame(FrameTap),
    /// An occurrence.
    Event(Event),
    /// What the kernel counted.
    Machine(Machine),
}

impl Recorded {
    /// Its topic.
    pub fn topic(&self) -> Topic {
        match self {
            Self::Command(_) => Topic::Command,
            Self::Reading(_) => Topic::Reading,
            Self::State(_) => Topic::State,
            Self::Truth(_) => Topic::Truth,
            Self::Frame(_) => Topic::Frame,
            Self::Event(_) => Topic::Event,
            Self::Machine(_) => Topic::Machine,
        }
    }

    /// Its number among those of its publisher on its topic.
    pub fn seq(&self) -> u64 {
        Stamps::read(self.body()).expect("every message begins with its stamps").seq
    }

    /// Its body, as it lay in shared memory.
    pub fn body(&self) -> &[u8] {
        match self {
            Self::Command(message) => message.body(),
            Self::Reading(message) => message.body(),
            Self::State(message) => message.body(),
            Self::Truth(message) => message.body(),
            Self::Frame(message) => message.body(),
            Self::Event(message) => message.body(),
            Self::Machine(message) => message.body(),
        }
    }
}
