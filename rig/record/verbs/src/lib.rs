//! Verbs that read recordings: `masseter export` makes tables of them, `masseter recording` examines and mends them.
//!
//! None of them judges a run: `masseter report` judges.

mod export;
mod survey;
mod tables;
mod verbs;

pub use export::{ExportArgs, FileFormat, export};
pub use verbs::{RecordingArgs, RecordingVerb, execute};
