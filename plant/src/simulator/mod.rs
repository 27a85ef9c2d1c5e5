//! The emulated robot: independent drives and mechanism, and the injection of faults into both.
//!
//! [`emulation`] steps drives and mechanism together, on simulated wires or on real interfaces. [`injection`] follows
//! the times of faults; the emulation does not depend on it.

pub mod emulation;
pub(crate) mod injection;
pub(crate) mod mechanism;
