//! The folder of a run: manifest and recording, written and read.
//!
//! A recording is an MCAP file with every message of every topic. A message's body is written as it lay in shared
//! memory, behind the four bytes that make it CDR, under a ROS 2 message definition: MCAP tools and `rosbags` read it
//! without this program. CAN frames that were received together are one message; `recording.frames = false` leaves them
//! out. For 3-D views it also holds the mechanism in messages of ROS 2, and the scenario is attached. Chunks are compressed
//! by zstd and carry checksums; each can be read without the others.
//!
//! [`Recorder`] writes recordings, [`Backlog`] does so without delaying its caller, and [`Reader`] reads them, also
//! damaged ones. This crate computes no figures; see `masseter-analysis`.

mod backlog;
mod chunk;
mod circumstances;
mod columns;
mod definitions;
mod description;
mod digests;
mod encapsulation;
mod encoding;
mod folder;
mod frames;
mod manifest;
pub mod output;
mod reader;
mod recover;
mod ros;
mod scene;
#[cfg(test)]
mod tests;
mod thin;
mod topic;
mod walk;
mod writer;

pub use backlog::{Backlog, Pace, WriteOutcome};
pub use circumstances::{DmaLatency, Ending, Machine as MachineInfo, ProcessFault, RunUsage, Usage};
pub use columns::{Columns, Field, Number};
pub use description::Description;
pub use digests::{Digester, Digests};
pub use encapsulation::CDR_LITTLE_ENDIAN;
pub use encoding::{Channel, Encoded, Encoder, SCHEMA_ENCODING, definitions};
pub use folder::{FolderError, RunFolder};
pub use manifest::{FullSpeed, Manifest};
pub use reader::{Chunks, Entry, ReadError, Reader};
pub use recover::{RecoverError, Recovered, recover};
pub use scene::{Scene, jaw_points};
pub use thin::{ThinError, is_kept, thin};
pub use topic::{Recorded, Topic};
pub use walk::Damage;
pub use writer::{DurableFile, Medium, Recorder, WriteError};
