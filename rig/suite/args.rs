//! The arguments of `masseter test`.

use std::path::PathBuf;

use anyhow::ensure;
use clap::{Args, ValueEnum};

use crate::arguments::{ControllerChoice, parse_controller};
use crate::run::args::ClockKind;

/// The arguments of `test`.
#[derive(Debug, Clone, Default, Args)]
#[command(
    after_help = "Examples:\n  masseter test scenarios\n  masseter test scenarios --filter encoder --junit junit.xml"
)]
pub(crate) struct TestArgs {
    /// Folders with scenarios (*.toml), and scenarios
    #[arg(required = true, value_name = "DIR|FILE")]
    pub paths: Vec<PathBuf>,
    /// Clock of the runs
    #[arg(long, value_enum, default_value_t)]
    pub clock: TestClock,
    /// Who controls the robot: motion, hold, or the path of your own program
    #[arg(
        long,
        value_name = "motion|hold|PATH",
        value_parser = parse_controller,
        default_value = "motion",
        hide_default_value = true
    )]
    pub controller: ControllerChoice,
    /// Run only the scenarios with this text in their names
    #[arg(long, value_name = "TEXT")]
    pub filter: Option<String>,
    /// Run a failed scenario up to this many times again, in lockstep and in real time
    #[arg(long, value_name = "N", default_value_t, hide_default_value = true)]
    pub retries: u32,
    /// Exit with 0 in spite of scenarios that left something untested
    #[arg(long)]
    pub allow_untested: bool,
    /// Write every scenario and its checks into this file, as CI systems read them
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Folder for the runs that failed; must not exist [default: runs/test-UTC_TIME]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

impl TestArgs {
    /// Refuses a controller that somebody else would have to start, and a suite without one.
    pub(super) fn check_controller(&self) -> anyhow::Result<()> {
        let is_started = !matches!(self.controller, ControllerChoice::External | ControllerChoice::None);
        ensure!(
            is_started,
            "a suite starts its controllers itself: use --controller motion, hold, or a path"
        );
        Ok(())
    }
}

/// The clock of the runs of a suite.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum TestClock {
    /// Virtual time, on all cores; what needs processes runs in lockstep
    #[default]
    Virtual,
    /// Simulated time in three processes, one scenario after the other
    Lockstep,
    /// Real time, one scenario after the other
    Rt,
}

impl From<TestClock> for ClockKind {
    fn from(clock: TestClock) -> Self {
        match clock {
            TestClock::Virtual => Self::Virtual,
            TestClock::Lockstep => Self::Lockstep,
            TestClock::Rt => Self::Rt,
        }
    }
}
