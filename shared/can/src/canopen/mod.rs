//! CANopen messages (CiA 301): node ids, the predefined connection set, NMT, heartbeat, SYNC, EMCY and SDO; and the
//! [descriptions](dcf) of devices.
//!
//! This module encodes and decodes messages. Supervision, boot-up and reactions are not part of the crate. The PDOs are
//! in the [crate root](crate).

mod cob;
pub mod dcf;
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
pub use nmt::{Nmt, NmtCommand, NmtTarget};
pub use node::{NodeId, NodeIdError};
pub use payload::LengthError;
pub(super) use payload::exactly;
pub use sdo::{AbortCode, Expedited, ObjectAddress, SdoError, SdoRequest, SdoResponse, Segment};
