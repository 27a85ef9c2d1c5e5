//! The folder of a run: manifest and recording, written and read.
//!
//! A recording is an MCAP file with every message of every topic. A message's body is written as it lay in shared
//! memory, behind the four bytes that make it CDR, under a ROS 2 message definition: MCAP tools and `rosbags` read it
//! without this program. CAN frames that were received together are one message; `recording.frames = false` leaves them
//! out. For 3-D views it also holds the mechanism in messages of ROS 2, and the scenario is attached. Chunks are compressed
//! by zstd and carry checksums; each can be read without the others.
//!
//! [`Recorder`] writes recordings, [`Backlog`] does so without delaying its caller, and [`Reader`] reads them, also
//! damaged ones. This crate computes no figures; see `masseter-judge`.

mod backlog;
mod columns;
mod encoding;
mod folder;
mod manifest;
mod past;
mod reader;
mod rewrite;
mod scene;
#[cfg(test)]
mod tests;
mod topic;
mod walk;
mod writer;

pub use backlog::{Backlog, Pace, WriteOutcome};
pub use columns::{Columns, Description, Field, Number};
pub use encoding::{Channel, Encoded, Encoder, SCHEMA_ENCODING, definitions};
pub use folder::{
    FolderError, OutputError, RunFolder, new_file, new_folder, recording_at, time_in_names, write_whole,
};
pub use manifest::{
    DmaLatency, Ending, FullSpeed, LoopInterval, Machine as MachineInfo, Manifest, ProcessFault, RunUsage,
    Usage,
};
pub use past::manifest_of;
pub use reader::{Chunks, Entry, ReadError, Reader};
pub use rewrite::{Digester, Digests, RecoverError, Recovered, ThinError, is_kept, recover, thin};
pub use scene::{Scene, jaw_points};
pub use topic::{CDR_LITTLE_ENDIAN, Recorded, Topic};
pub use walk::Damage;
pub use writer::{DurableFile, Medium, Recorder, WriteError};
