//! The domain of a run: its names, lock and private folder, and the opening of its topics on iceoryx2.
//!
//! The functions that only a start runs are compiled here, unoptimised. iceoryx2's ports are generic: their opening was
//! two thirds of the runtime's LLVM code (notes/realtime-log.md#the-first-build). Messages are sent and received in
//! `masseter-runtime`, which also compiles the methods of [`Port`].

mod domain;
mod folder;
mod ports;

pub use domain::{Domain, DomainLock, ScratchDomain, Swept};
pub use folder::{DomainError, file_error, secret};
pub use ports::{
    BATCH, Inlet, Node, Opened, Outlet, Port, TransportError, failed, frame_inlet, frame_outlet,
};
