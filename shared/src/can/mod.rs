//! The CAN link: frames and what they cost on the wire, the CANopen objects the rig exchanges, the
//! drive profile, the bus trait and its two implementations: simulated and `SocketCAN`.
//!
//! Everything here but [`SocketCan`] is a value or a pure step: no clock, no thread, no I/O. Remote frames are not
//! represented.

mod bus;
pub mod candump;
pub mod canopen;
pub mod cia402;
pub mod conformance;
mod error_frame;
pub mod faults;
mod frame;
mod id;
mod pdo;
mod plan;
mod socket_can;
pub mod socketcand;
pub mod tap;
mod virtual_bus;
pub mod wire;
pub mod wrapped;

pub use bus::{Bus, BusStatus, ErrorState, ReceiveError, Received, SendError};
pub use error_frame::{ErrorKind, ErrorReport, ErrorReportError};
pub use frame::{Frame, FrameError, FrameFormat};
pub use id::{CanId, CanIdError};
pub use pdo::{EVERY_SYNC, Rpdo1, Tpdo1};
pub use plan::{BusPlan, NoReleaser, Overload, PeriodicMessage, PlannedMessage, Release};
pub use socket_can::{OpenError, SocketCan};
pub use tap::{TapError, Tapped, TappedFrame};
pub use virtual_bus::{Port, Statistics, VirtualWire, WireConfig};
pub use wire::{Bitrate, BitrateError, FrameBits, Rates};
