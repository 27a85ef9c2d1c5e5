//! The domain of a run: its names, lock and private folder, and the opening of its topics on iceoryx2.
//!
//! Code of a start is here, and no code of a cycle: messages are sent and received in `masseter-runtime`. Opening a
//! topic is a third of the runtime's machine code, because iceoryx2's ports are generic; unoptimised it compiles in a
//! fraction of the time (notes/realtime-log.md#the-first-build).

mod domain;
mod folder;
mod ports;

pub use domain::{Domain, DomainLock, ScratchDomain, Swept};
pub use folder::{DomainError, file_error, secret};
pub use ports::{
    BATCH, Inlet, Node, Opened, Outlet, Port, TransportError, failed, frame_inlet, frame_outlet,
};
