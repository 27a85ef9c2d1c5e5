//! The emulated robot: drives and mechanism, neither of which depends on the other, and what injects faults into
//! them.
//!
//! [`emulation`] steps drives and mechanism together, on simulated wires or on real interfaces. [`injection`] wraps it: it
//! knows the times of faults, and the emulation does not know it.

pub(crate) mod drive;
pub mod emulation;
pub(crate) mod injection;
pub(crate) mod mechanism;
