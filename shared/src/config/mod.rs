//! Scenario files: what a run is made of, resolved and validated before anything starts.
//!
//! A scenario is TOML; every table left out has a default, so an empty file is the default run. Each part
//! stands beside what it configures; checks that need more than the values themselves (does a
//! trajectory fit the strokes?) are made by those who own the subject.

mod can;
mod control;
mod drives;
mod dynamics;
mod faults;
mod food;
mod jaw;
mod limits;
mod motion;
mod need;
mod scenario;

pub use can::{CanConfig, IdentityConfig};
pub use control::{ChecksConfig, ControllerConfig, CpuDmaLatency, RealtimeConfig};
pub use drives::{DriveConfig, DrivesConfig};
pub use dynamics::DynamicsConfig;
pub use faults::{FaultConfig, FaultKindConfig};
pub use food::FoodConfig;
pub use jaw::JawConfig;
pub use limits::TrajectoryLimitsConfig;
pub use motion::*;
pub(crate) use scenario::RATES_HZ;
pub use scenario::{Scenario, ScenarioError};
