#![doc = include_str!("../README.md")]

#[macro_use]
mod codes;

mod bus;
pub mod candump;
pub mod canopen;
pub mod cia402;
pub mod conformance;
mod error_frame;
pub mod faults;
mod frame;
mod frame_error;
mod id;
mod pdo;
mod pdo_mapping;
mod plan;
mod port_faults;
mod socket_can;
pub mod socketcand;
mod tap;
mod virtual_bus;
pub mod wire;

pub use bus::{Bus, BusStatus, ErrorState, ReceiveError, Received, SendError};
pub use codes::UnknownCode;
pub use error_frame::{ERROR_FLAG, ErrorKind, ErrorReport, ErrorReportError};
pub use frame::Frame;
pub use frame_error::FrameError;
pub use id::CanId;
pub use pdo::{EVERY_SYNC, Rpdo1, Tpdo1};
pub use pdo_mapping::{PdoMapping, PdoMappingError};
pub use plan::{BusPlan, NoReleaser, Overload, PeriodicMessage, PlannedMessage, Release};
pub use port_faults::{Faulty, NotByPort, PortFaults};
pub use socket_can::{Interface, InterfaceDetails, OpenError, SocketCan, is_supported};
pub use tap::{Tapped, TappedFrame};
pub use virtual_bus::{Port, VirtualWire, WireConfig};
pub use wire::{Bitrate, BitrateError};
