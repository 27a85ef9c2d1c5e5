//! Scenario files: the configuration of a run, resolved and validated before the run starts.
//!
//! A scenario is TOML. Every key has a default, so an empty file is the default run. This crate checks values
//! within the scenario; checks against other parts, such as a trajectory against the strokes, are made where these parts are built.

#[macro_use(section)]
extern crate masseter_model;

mod axes;
mod can;
mod circle;
mod control;
mod controller_state;
mod document;
mod drive_profile;
mod drives;
mod dry;
mod dynamics;
pub mod embedded;
mod error;
mod expect;
mod faults;
mod food;
mod force;
mod friction;
pub mod input;
mod jaw;
mod kinds;
mod limits;
mod load_cell;
mod malformed;
mod merge;
mod motion;
mod need;
mod quantity;
mod quirks;
mod recording;
mod requirements;
mod robot_file;
pub mod rows;
mod scenario;
mod stimuli;
mod teeth;
mod when;
pub mod wording;

pub use can::{CanConfig, MASTER_NODE};
pub use control::{
    ChecksConfig, ControllerConfig, CpuDmaLatency, MOST_LEAD_CYCLES, RealtimeConfig, TimingConfig,
};
pub use controller_state::ControllerState;
pub use drive_profile::{
    AccelerationUnit, AxisScale, BrakeConfig, DriveProfile, HomingConfig, INCREMENTS, IdentityConfig,
    ObjectConfig, ObjectKey, ObjectRule, PdosConfig, StoreConfig, UnitsConfig, VelocityUnit,
};
pub use drives::{DriveConfig, DrivesConfig};
pub use dry::DryConfig;
pub use error::ScenarioError;
pub use expect::{ExpectConfig, ExpectedVerdict};
pub use faults::{FaultConfig, FaultKindConfig, FaultLayer, FaultPlace, FaultSize};
pub use food::{FoodConfig, Material};
pub use force::{BiteProfile, ForceControlConfig, ForceEstimateConfig, ForceSource};
pub use jaw::JawConfig;
pub use limits::TrajectoryLimitsConfig;
pub use load_cell::LoadCellConfig;
pub use masseter_model::dynamics::{AxesConfig, DynamicsConfig, FrictionConfig, FrictionModel};
pub use motion::*;
pub use quantity::{Dimension, Quantity, QuantityError, UNITS, Unit};
pub use quirks::{INCREMENTS_PER_TURN, QuirkConfig, QuirkKindConfig};
pub use recording::RecordingConfig;
pub use requirements::{During, RequirementConfig, Statistic, TimeWindow};
pub use scenario::{RATES_HZ, Scenario};
pub use stimuli::{Shape, StimulusConfig};
pub use teeth::{MOST_PAIRS, TeethConfig, ToothConfig};
pub use when::{EntryNames, Start, When};
