//! What most files of the command use: files and paths, errors, arguments, scenarios and their plans, runs, the terminal.
//! Only what other crates define, so that no file of the command reaches another one through here.

pub(crate) use std::fs;
pub(crate) use std::path::{Path, PathBuf};

pub(crate) use anyhow::{Context, anyhow, bail, ensure};
pub(crate) use clap::Args;
pub(crate) use masseter_plan::{RunPlan, scenario_with};
pub(crate) use masseter_recording::{Manifest, RunFolder};
pub(crate) use masseter_runtime::clock;
pub(crate) use masseter_scenario::{Scenario, wording::counted};
pub(crate) use masseter_terminal::{Exit, Failure, Format, OrFailure, result, result_line, status};
