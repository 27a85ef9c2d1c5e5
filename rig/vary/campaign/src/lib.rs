//! Campaigns: one scenario with many values of its keys, faults and motions, their runs and results.
//!
//! A [`CampaignFile`] names a scenario, the [factors](Factor) that vary, and a [sampler](Sampler). A [`Campaign`]
//! makes a [`Case`] of every point: a whole scenario. A [`CampaignFolder`] keeps the [result](CaseResult) of each
//! case once. This crate runs no case: see the verb `campaign`.

mod campaign;
mod case;
mod factor;
mod fault_matrix;
mod files;
mod folder;
mod influence;
mod laws;
mod page;
mod report;
mod search;
mod shrink;
mod storm;

pub use campaign::{Campaign, CampaignFile, FileError, Sampler, StopRules, digest_of_program};
pub use case::{Case, CaseCheck, CaseResult};
pub use factor::{Distribution, Factor, Setting};
pub use fault_matrix::{Coverage, FaultRow, fault_matrix_in_words, write_fault_matrix};
pub use files::write;
pub use folder::{Attempt, CampaignFolder, FolderError};
pub use laws::{Broken, Law};
pub use report::{Report, SuccessRate, WorstCase};
pub use search::{Method, Search, Value};
pub use shrink::Shrink;
pub use storm::Storms;
