//! `masseter can`: what concerns the CAN link alone.

mod client;
mod describe;
mod plan;
mod serve;

pub(crate) use describe::{EdsArgs, dbc, eds};
pub(crate) use plan::{PlanArgs, plan};
pub(crate) use serve::{ServeArgs, serve};
