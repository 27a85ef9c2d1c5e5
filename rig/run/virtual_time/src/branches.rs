//! A run that is left at an instant, again and again: what it comes to from there, with and without its faults and stimuli.
//!
//! Nothing here decides what a verdict is, or which instants are worth a look.

use masseter_controller::process::BuildController;
use masseter_judge::{Analysis, Figures};
use masseter_runtime::named::{Declared, NameError};

use crate::log::Stream;
use crate::run::{Requests, RestoreError, Run, RunSnapshot, Without, built};

/// Why a branch cannot be played.
#[derive(Debug, thiserror::Error)]
pub enum BranchError {
    /// The controller has no such parameter.
    #[error(transparent)]
    Name(#[from] NameError),
    /// A message of the topic 'frame' is no CAN frame.
    #[error(transparent)]
    Tap(#[from] masseter_runtime::messages::tap::TapError),
}

/// A run by a controller of the rig, at an instant between two cycles.
pub struct Branches(Run<Stream>);

/// An instant of a run with all that came before.
pub struct Mark {
    /// The number of the last cycle before that instant.
    pub cycle: u64,
    snapshot: RunSnapshot<Stream>,
}

impl Branches {
    /// A planned run before its first cycle.
    ///
    /// # Errors
    /// When the scenario does not fit the plant, or what the controller declares.
    pub fn new(plan: &masseter_plan::RunPlan, build: BuildController) -> anyhow::Result<Self> {
        let stream = |declared: &_| Ok(Stream::new(Analysis::without_report(&plan.scenario, declared)));
        Run::with_sink(plan, built(plan, build), stream).map(Self)
    }

    /// What the controller declares.
    pub fn declared(&self) -> &Declared {
        self.0.declared()
    }

    /// Plays until this many cycles are over, or the controller has ended; returns how many are.
    ///
    /// # Errors
    /// When the plant fails.
    pub fn advance_to(&mut self, cycle: u64) -> Result<u64, masseter_plant::PlantError> {
        while self.0.cycle() < cycle && !self.0.has_ended() {
            self.0.play_cycle()?;
        }
        Ok(self.0.cycle())
    }

    /// This instant.
    ///
    /// # Errors
    /// Where the controller cannot be copied.
    pub fn mark(&self) -> Result<Mark, masseter_runtime::control::NoBranch> {
        Ok(Mark { cycle: self.0.cycle(), snapshot: self.0.snapshot()? })
    }

    /// Goes to an instant.
    ///
    /// # Errors
    /// Where the instant is one of another scenario or seed.
    pub fn go_to(&mut self, mark: &Mark) -> Result<(), RestoreError> {
        self.0.restore(&mark.snapshot)
    }

    /// Plays from here to the end, without this, and stays there. Enters the ending into the manifest.
    ///
    /// # Errors
    /// [`NameError`] for a parameter that the controller does not have. When a message of the topic `frame` holds no CAN frame.
    pub fn end(
        &mut self,
        without: Option<&Without>,
        manifest: &mut masseter_recording::Manifest,
        interrupts: &dyn Requests,
    ) -> Result<Figures, BranchError> {
        if let Some(without) = without {
            self.0.go_without(without)?;
        }
        manifest.declared.clone_from(self.declared());
        manifest.ending = self.0.play(interrupts);
        Ok(self.0.sink().clone().figures()?)
    }
}
