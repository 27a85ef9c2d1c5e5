//! Service data objects (CiA 301, 7.2.4): one entry of a node's object dictionary read or written,
//! confirmed, expedited (at most 4 bytes) or in segments of 7.
//!
//! A client sends an [`SdoRequest`], a server answers with an [`SdoResponse`]; both have eight bytes. This module only
//! encodes and decodes: client and server keep the order of a transfer, its toggle bits and its time-outs. Block
//! transfer and network indication are not represented.

mod abort;
mod message;
mod object;
mod payload;
mod request;
mod response;
#[cfg(test)]
mod tests;

pub use abort::AbortCode;
pub use message::SdoError;
pub use object::ObjectAddress;
pub use payload::{Expedited, Segment};
pub use request::SdoRequest;
pub use response::SdoResponse;
