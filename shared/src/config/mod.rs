//! Scenario files: the configuration of a run, resolved and validated before the run starts.
//!
//! A scenario is TOML. Every key has a default, so an empty file is the default run. This module checks values
//! within the scenario; checks against other parts, such as a trajectory against the strokes, are made where these parts are built.

#[macro_use]
mod section;

mod axes;
mod can;
mod circle;
mod control;
mod document;
mod drive_profile;
mod drives;
mod dry;
mod dynamics;
mod error;
mod expect;
mod faults;
mod food;
mod force;
mod friction;
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
mod scenario;
mod stimuli;
mod teeth;
mod when;

pub use axes::AxesConfig;
pub use can::{CanConfig, MASTER_NODE};
pub use control::{
    ChecksConfig, ControllerConfig, CpuDmaLatency, MOST_LEAD_CYCLES, RealtimeConfig, TimingConfig,
};
pub use drive_profile::{
    AccelerationUnit, AxisScale, BrakeConfig, DriveProfile, HomingConfig, INCREMENTS, IdentityConfig,
    ObjectConfig, ObjectKey, ObjectRule, PdosConfig, StoreConfig, UnitsConfig, VelocityUnit,
};
pub use drives::{DriveConfig, DrivesConfig};
pub use dry::DryConfig;
pub use dynamics::DynamicsConfig;
pub use error::ScenarioError;
pub use expect::{ExpectConfig, ExpectedVerdict};
pub use faults::{FaultConfig, FaultKindConfig, FaultLayer, FaultPlace, FaultSize};
pub use food::{FoodConfig, Material};
pub use force::{BiteProfile, ForceControlConfig, ForceEstimateConfig, ForceSource};
pub use friction::{FrictionConfig, FrictionModel};
pub use jaw::JawConfig;
pub use limits::TrajectoryLimitsConfig;
pub use load_cell::LoadCellConfig;
pub use motion::*;
pub use quantity::{Dimension, Quantity, QuantityError, UNITS, Unit};
pub use quirks::{INCREMENTS_PER_TURN, QuirkConfig, QuirkKindConfig};
pub use recording::RecordingConfig;
pub use requirements::{During, RequirementConfig, Statistic, TimeWindow};
pub(crate) use scenario::RATES_HZ;
pub use scenario::Scenario;
pub use stimuli::{Shape, StimulusConfig};
pub use teeth::{TeethConfig, ToothConfig};
pub use when::{EntryNames, Start, When};
