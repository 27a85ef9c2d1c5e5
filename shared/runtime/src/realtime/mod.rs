//! The real-time loop: absolute deadlines, and the scheduling that keeps them.
//!
//! [`Cycle`] waits for deadlines and applies the overrun policy. [`Waiter`] waits and measures how long the machine
//! stalled. [`scheduling`] requests a core, a real-time priority and locked memory, and reports what the kernel
//! granted. The work of a cycle is not part of this module.

mod cycle;
pub mod scheduling;
mod spin_margin;
mod waiter;

pub use cycle::{Cycle, Wake};
pub use waiter::{Account, Spin, Waiter};
