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

pub use can::{CanConfig, MASTER_NODE};
pub use control::{
    AFTER_STOP_S, ChecksConfig, ControllerConfig, ControllerState, CpuDmaLatency, DryConfig,
    MOST_LEAD_CYCLES, RealtimeConfig, RecordingConfig, TimingConfig, TrajectoryLimitsConfig,
};
pub use drive_profile::{
    AccelerationUnit, BrakeConfig, DcfRead, DriveProfile, HomingConfig, INCREMENTS, IdentityConfig,
    ObjectConfig, ObjectKey, ObjectRule, PdosConfig, StoreConfig, UnitsConfig, VelocityUnit,
};
pub use drives::{AxisScale, DriveConfig, DrivesConfig};
pub use error::ScenarioError;
pub use faults::{
    AxisFault, BusFault, CommandFault, DriveFault, EncoderFault, FaultConfig, FaultDeclaration,
    FaultKindConfig, FaultSize, Overlap, PlatformFault, ProcessFault,
};
pub use force::{
    BiteProfile, ForceControlConfig, ForceEstimateConfig, ForceFusion, ForceSource, LateralForceConfig,
    LoadCellConfig, ProbeConfig,
};
pub use jaw::{FoodConfig, JawConfig, MOST_PAIRS, Material, TeethConfig, ToothConfig};
pub use masseter_model::dynamics::{AxesConfig, DynamicsConfig, FrictionConfig, FrictionModel};
pub use masseter_model::section::{Key, Range, unit_of};
pub use matrix::{Matrix, MatrixCase};
pub use motion::*;
pub use quantity::{Dimension, Quantity, QuantityError, UNITS, Unit};
pub use quirks::{INCREMENTS_PER_TURN, QuirkConfig, QuirkKindConfig};
pub use requirements::{During, ExpectConfig, ExpectedVerdict, RequirementConfig, Statistic, TimeWindow};
pub use scenario::{RATES_HZ, Scenario};
pub use stimuli::{Shape, StimulusConfig};
pub use study::StudyConfig;
pub use when::{EntryNames, Start, When};
