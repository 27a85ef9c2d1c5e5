//! Campaigns: one scenario with many values of its keys, faults and motions; what is run, and what came of it.
//!
//! A [`CampaignFile`] names a scenario, the [factors](Factor) that vary, and a [sampler](Sampler). A [`Campaign`] makes a
//! [`Case`] of every point: a whole scenario. A [`CampaignFolder`] keeps the [result](CaseResult) of each case once. This crate
//! runs no case: see the verb `campaign`.

mod campaign;
mod case;
mod covariance;
mod factor;
mod file;
mod folder;
mod interruption;
mod page;
mod report;
mod result;
mod results_table;
mod sampler;
mod search;
mod shrink;
mod statistics;
mod write;

pub use campaign::{Campaign, digest_of_program};
pub use case::{Case, Setting};
pub use factor::{Distribution, Factor, FactorError};
pub use file::{CampaignFile, FileError, StopRules};
pub use folder::{Attempt, CampaignFolder, CampaignLock, FolderError};
pub use interruption::Interruption;
pub use report::{Report, WorstCase};
pub use result::{CaseCheck, CaseResult};
pub use sampler::{Sampler, points};
pub use search::{Method, Search, Value};
pub use shrink::Shrink;
pub use statistics::SuccessRate;
pub use write::write;
