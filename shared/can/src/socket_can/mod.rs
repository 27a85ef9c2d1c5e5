//! A node's port on a real wire: a raw `SocketCAN` socket that never blocks.
//!
//! Frames leave through the queue of the interface (`txqueuelen`) in the order of sending: a caller sends urgent frames
//! first. Frames of other sockets on the same interface are received
//! like those of other nodes, and in the order in which they were on the wire; so a second port on the
//! interface is a tap.
//!
//! # Time stamps
//! The kernel stamps a frame when the driver hands it over, in wall-clock time; the stamp is converted to
//! `CLOCK_MONOTONIC` when the frame is fetched. Stamps of a port never run
//! backwards. Hardware stamps are not used: they count in the adapter's own clock, which has another
//! origin.
//!
//! # Fault confinement
//! The driver reports it by error frames, which change [`status`](Bus::status) and are handed on to a
//! [tap](SocketCan::tap) alone: changes of state and, where the driver reports them (`berr-reporting on`), errors on the
//! wire. Warnings, lost arbitration and faults of the line are passed over. A port
//! counts as error active until the first error frame. A port that is bus-off refuses to send until the
//! driver reports a restart (`ip link set … type can restart-ms 100`) or the interface was taken down.
//!
//! # Losses
//! Frames lost because the socket was not emptied in time are counted by the kernel. The kernel does
//! not count the frames that the controller itself lost, so each such report means at least one frame.
//!
//! # Frames
//! Remote frames and frames in FD format are passed over.
//!
//! An adapter that is unplugged is gone for good: its port reports [`ReceiveError::Os`](crate::ReceiveError::Os) until it
//! is opened anew; one that was only taken down works again when it is up.

mod clock;
mod confinement;
mod conversion;
mod details;
mod errno;
mod interface;
mod port;

pub use details::InterfaceDetails;
pub use interface::{Interface, OpenError, is_supported};
pub use port::SocketCan;
