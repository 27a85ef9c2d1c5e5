//! A run that is left at an instant, again and again: what it comes to from there, with and without its faults and stimuli.
//!
//! Nothing here decides what a verdict is, or which instants are worth a look.

use masseter_controller::process::BuildController;
use masseter_judge::{Analysis, Figures};
use masseter_plan::RunPlan;
use masseter_plant::PlantError;
use masseter_recording::Manifest;
use masseter_runtime::named::{Declared, NameError};
use masseter_runtime::{control::NoBranch, messages::tap::TapError};

use crate::log::Stream;
use crate::run::{Control, Requests, RestoreError, Run, RunSnapshot, Without, built};

/// Why a branch cannot be played.
#[derive(Debug, thiserror::Error)]
pub enum BranchError {
    /// The plant failed.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The controller cannot be copied.
    #[error(transparent)]
    Controller(#[from] NoBranch),
    /// The run cannot go back.
    #[error(transparent)]
    Restore(#[from] RestoreError),
    /// The controller has no such parameter.
    #[error(transparent)]
    Name(#[from] NameError),
    /// A message of the topic 'frame' is no CAN frame.
    #[error(transparent)]
    Tap(#[from] TapError),
}

/// A run by a controller of the rig, at an instant between two cycles.
pub struct Branches {
    run: Run<Stream>,
    declared: Declared,
}

/// An instant of a run with all that came before.
pub struct Mark {
    /// The number of the last cycle before that instant.
    pub cycle: u64,
    snapshot: RunSnapshot,
    stream: Stream,
}

impl Branches {
    /// A planned run before its first cycle.
    ///
    /// # Errors
    /// When the scenario does not fit the plant, or what the controller declares.
    pub fn new(plan: &RunPlan, build: BuildController) -> anyhow::Result<Self> {
        let mut declared = Declared::default();
        let control = Control::new(plan, built(plan, build), &mut declared)?;
        let stream = Stream::new(Analysis::without_report(&plan.scenario, &declared));
        Ok(Self { run: Run::of_control(plan, control, stream)?, declared })
    }

    /// What the controller declares.
    pub fn declared(&self) -> &Declared {
        &self.declared
    }

    /// Plays until this many cycles are over, or the controller has ended; returns how many are.
    ///
    /// # Errors
    /// When the plant fails.
    pub fn advance_to(&mut self, cycle: u64) -> Result<u64, PlantError> {
        while self.run.cycle() < cycle && !self.run.has_ended() {
            self.run.play_cycle()?;
        }
        Ok(self.run.cycle())
    }

    /// This instant.
    ///
    /// # Errors
    /// Where the controller cannot be copied.
    pub fn mark(&self) -> Result<Mark, NoBranch> {
        let (snapshot, stream) = (self.run.snapshot()?, self.run.sink().clone());
        Ok(Mark { cycle: self.run.cycle(), snapshot, stream })
    }

    /// Goes to an instant.
    ///
    /// # Errors
    /// Where the instant is one of another scenario or seed.
    pub fn go_to(&mut self, mark: &Mark) -> Result<(), RestoreError> {
        self.run.restore(&mark.snapshot)?;
        self.run.sink_mut().clone_from(&mark.stream);
        Ok(())
    }

    /// Plays from here to the end, without this, and stays there. Enters the ending into the manifest.
    ///
    /// # Errors
    /// [`NameError`] for a parameter that the controller does not have. When a message of the topic `frame` holds no CAN frame.
    pub fn end(
        &mut self,
        without: Option<&Without>,
        manifest: &mut Manifest,
        interrupts: &dyn Requests,
    ) -> Result<Figures, BranchError> {
        if let Some(without) = without {
            self.run.go_without(without)?;
        }
        manifest.declared.clone_from(&self.declared);
        manifest.ending = self.run.play(interrupts);
        Ok(self.run.sink().clone().figures()?)
    }
}
