//! The named numbers of a controller: signals, which it publishes, and parameters, which its user sets.
//!
//! A controller [declares](Declared) both once, before the start. [`NamedValues`] holds the values of a run. [`access`] lets
//! other programs read and set the parameters meanwhile. What a controller does with a parameter is not known here.

pub mod access;
mod declaration;
mod values;

pub use declaration::{Declared, NameError, Parameter, PlayedMotion, Signal};
pub use values::{Change, NamedValues, Settings};
