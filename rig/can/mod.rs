//! `masseter can`: what concerns the CAN link alone.

mod describe;

pub(crate) use describe::{dbc, eds};
