//! The real-time loop: absolute deadlines, and the scheduling that keeps them.
//!
//! [`Cycle`] waits for deadlines and owns the overrun policy; [`Waiter`] waits and notices when the
//! machine stood still; [`scheduling`] asks the system for a
//! core, a real-time priority and locked memory, and reads back what was granted. What runs inside
//! a cycle is not decided here.

mod cycle;
mod load;
mod preparation;
mod reserve;
pub mod scheduling;
mod waiter;

pub use cycle::{Cycle, Wake};
pub use waiter::{Account, Spin, Waiter};
