//! The node from the side of a master.

mod client;
mod communication;
mod motion;
mod wire;
