//! The plan of a bus: worst-case transmission times and response times of its messages.
//!
//! The analysis covers periodic messages. The caller decides which messages a plan contains.

mod bus_plan;
mod message;
mod response_time;
mod table;

pub use bus_plan::{BusPlan, NoReleaser, Overload};
pub use message::{PeriodicMessage, PlannedMessage, Release};
