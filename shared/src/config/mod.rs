//! Scenario files: what a run is made of, resolved and validated before anything starts.
//!
//! A scenario is TOML; every table left out has a default, so an empty file is the default run. Each part
//! stands beside what it configures; checks that need more than the values themselves (does a
//! trajectory fit the strokes?) are made by those who own the subject.

mod control;
mod faults;
mod food;
mod limits;
mod motion;
mod need;
mod plant;
mod scenario;

pub use control::{ChecksConfig, ControllerConfig, CpuDmaLatency, RealtimeConfig};
pub use faults::{FaultConfig, FaultKindConfig};
pub use food::FoodConfig;
pub use limits::TrajectoryLimitsConfig;
pub use motion::*;
pub use plant::{CanConfig, DriveConfig, DrivesConfig, DynamicsConfig, IdentityConfig};
pub(crate) use scenario::RATES_HZ;
pub use scenario::{Scenario, ScenarioError};
