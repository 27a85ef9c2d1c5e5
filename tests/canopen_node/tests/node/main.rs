//! The node as a master sees it.

mod client;
mod communication;
mod motion;
mod wire;
