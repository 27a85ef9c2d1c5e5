//! What the rig uses of CANopen (CiA 301): node ids, the predefined connection set, NMT, heartbeat,
//! SYNC, EMCY and SDO.
//!
//! Codecs only: supervision, boot-up and the reaction to any of it are the master's and the drives'.
//! The PDOs stand in [`can`](super).

mod cob;
mod emcy;
mod heartbeat;
mod nmt;
mod node;
mod payload;
mod sdo;
pub mod sync;

pub use cob::{Cob, CobError, CobId};
pub use emcy::{Emergency, EmergencyCode};
pub use heartbeat::{Heartbeat, HeartbeatError, NmtState};
pub use nmt::{Nmt, NmtCommand, NmtError, NmtTarget};
pub use node::{NodeId, NodeIdError};
pub use payload::LengthError;
pub(super) use payload::exactly;
pub use sdo::{
    AbortCode, Expedited, ObjectAddress, SdoError, SdoPayloadError, SdoRequest, SdoResponse, Segment,
};
