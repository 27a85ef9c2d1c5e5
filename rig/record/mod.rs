//! What is done with recordings of past runs by the controllers of this build: the replay.

mod recorded_run;
pub(crate) mod replay;
