//! `masseter can`: what concerns the CAN link alone.

mod client;
mod describe;
mod serve;

pub(crate) use describe::{dbc, eds};
pub(crate) use serve::{ServeArgs, serve};
