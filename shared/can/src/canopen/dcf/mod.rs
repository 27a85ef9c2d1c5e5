//! Device descriptions: electronic data sheets (EDS) and device configuration files (DCF), as CiA 306-1 lays them out.
//!
//! [`Dcf::parse`] reads the entries of the object dictionary with their types, access, limits and values. Sections on the
//! file, on bit rates and on dummy mapping are passed over. The texts of other code pages than UTF-8 are the caller's:
//! `String::from_utf8_lossy` changes names alone.

mod data_type;
mod entry;
mod error;
mod file;
mod ini;
mod value;

#[cfg(test)]
mod tests;

pub use data_type::DataType;
pub use entry::{Access, Entry};
pub use error::{DcfError, Problem};
pub use file::Dcf;
pub use value::Value;
