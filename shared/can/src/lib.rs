#![doc = include_str!("../README.md")]

#[macro_use]
mod codes;

mod bus;
pub mod candump;
pub mod canopen;
pub mod cia402;
pub mod faults;
mod frame;
#[cfg(test)]
#[path = "../examples/conformance/laws.rs"]
mod laws;
mod pdo;
mod plan;
mod port_faults;
mod queued_plan;
mod replay;
mod socket_can;
pub mod socketcand;
mod tap;
mod virtual_bus;
pub mod wire;

pub use bus::{Bus, BusStatus, ErrorState, FULL_QUEUE, ReceiveError, Received, SendError};
pub use codes::UnknownCode;
pub use frame::{CanId, Frame, FrameError};
pub use pdo::{EVERY_SYNC, PdoMapping, PdoMappingError, Rpdo1, Tpdo1};
pub use plan::{BusPlan, NoReleaser, Overload, PeriodicMessage, PlannedMessage, Release};
pub use port_faults::{Faulty, NotByPort, PortFaults};
pub use queued_plan::{LatestArrival, Queue, QueuedMessage, Queueing, latest_arrivals};
pub use replay::{Deviation, Difference, ReplayBus, ReplayError, Role};
pub use socket_can::{
    Interface, InterfaceDetails, InterfaceNeeds, JudgedInterface, OpenError, SocketCan, bring_up_command,
    explain_errno, is_supported,
};
pub use tap::{ERROR_FLAG, ErrorKind, ErrorReport, ErrorReportError, Tapped, TappedFrame};
pub use virtual_bus::{Port, VirtualWire, WireConfig};
pub use wire::{Bitrate, BitrateError};
