//! The replay of past runs by the controllers of this build. The crates in this folder write and read recordings.

mod recorded_run;
pub(crate) mod replay;
