//! The recording of a run: an MCAP file with every message of every topic.
//!
//! A message's bytes are written as they lay in shared memory, behind the four bytes that make them
//! CDR, under a ROS 2 message definition: MCAP tools read them without knowing Masseter.

mod reader;
mod writer;

use masseter_shared::messages::{Command, Event, FrameTap, Reading, State, Truth};

pub use reader::{ReadError, Reader};
pub use writer::{Recorder, WriteError};

/// Encapsulation header of plain little-endian CDR (version 1).
const CDR_LITTLE_ENDIAN: [u8; 4] = [0x00, 0x01, 0x00, 0x00];
const MESSAGE_ENCODING: &str = "cdr";
const SCHEMA_ENCODING: &str = "ros2msg";

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
}
