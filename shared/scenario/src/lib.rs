//! Scenario files: the configuration of a run, resolved and validated before its start.
//!
//! A scenario is TOML. Every key has a default, so an empty file is the default run. This crate checks values within
//! the scenario. The builders of other parts make the checks against those parts, such as a trajectory against the
//! strokes.

#[macro_use(keys, section)]
extern crate masseter_model;

mod can;
mod control;
mod document;
mod drive_profile;
mod drives;
mod dynamics;
pub mod embedded;
mod error;
mod faults;
mod force;
pub mod input;
mod jaw;
mod matrix;
mod merge;
mod motion;
mod quantity;
mod quirks;
mod requirements;
pub mod rows;
mod scenario;
mod stimuli;
mod study;
mod when;
pub mod wording;

pub use can::*;
pub use control::*;
pub use document::parse_toml;
pub use drive_profile::*;
pub use drives::*;
pub use error::ScenarioError;
pub use faults::*;
pub use force::*;
pub use jaw::*;
pub use masseter_model::dynamics::{AxesConfig, DynamicsConfig, FrictionConfig, FrictionModel};
pub use masseter_model::section::{Key, Range, unit_of};
pub use matrix::*;
pub use motion::*;
pub use quantity::*;
pub use quirks::*;
pub use requirements::*;
pub use scenario::{RATES_HZ, Scenario};
pub use stimuli::*;
pub use study::StudyConfig;
pub use when::*;
