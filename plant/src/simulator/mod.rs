//! The emulated robot: drives and mechanism, neither of which depends on the other, and what injects faults into
//! them.
//!
//! [`emulation`] steps drives and mechanism together, on simulated wires or on real interfaces.

mod acting;
pub(crate) mod drive;
pub mod emulation;
pub(crate) mod injection;
pub(crate) mod mechanism;
