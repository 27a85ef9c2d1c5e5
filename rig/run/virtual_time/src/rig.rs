//! The rig as an object that steps: master, simulated buses, emulated drives and mechanism of a scenario. Its caller
//! decides when the next step comes.
//!
//! Every step happens exactly when the time table has it, so the same scenario, seed and commands leave the same
//! bytes. Computing takes no time here: readings and commands go out at the latest times that the time table allows.
//! Only the buses vary. A rig has no controller and no operator: commands come from outside, and nothing sets
//! parameters or requests a stop. A scenario of real interfaces is refused.

#[cfg(test)]
mod tests;

use std::{error::Error, path::Path, sync::Arc};

use masseter_judge::signals::{Registry, UnknownSignal};
use masseter_runtime::messages::{Command, Event, Reading, Truth};
use masseter_scenario::Scenario;

use crate::snapshot::{OtherScenario, Snapshot, SnapshotError};
use crate::{log::Latest, stepper::Stepper};

/// Why a rig cannot be made, stepped or restored.
#[derive(Debug, thiserror::Error)]
pub enum RigError {
    /// A value of the scenario is wrong, or the scenario does not fit its mechanism, drives or buses.
    #[error("the scenario cannot be played: {0:#}")]
    Scenario(#[source] Box<dyn Error + Send + Sync>),
    /// The scenario names real interfaces.
    #[error("the scenario has the interfaces {}; a rig that steps has simulated buses: leave can.interfaces out", .0.join(", "))]
    Interfaces(Vec<String>),
    /// The plant failed.
    #[error(transparent)]
    Plant(#[from] masseter_plant::PlantError),
    /// A step failed before, in the middle of a cycle.
    #[error("the rig failed in cycle {cycle}; reset it, or restore a snapshot")]
    Failed {
        /// That cycle.
        cycle: u64,
    },
    /// The snapshot is one of another scenario or seed.
    #[error(transparent)]
    OtherScenario(#[from] OtherScenario),
}

/// Master, buses, drives and mechanism of a scenario. A cycle begins with a reading and ends with a command.
///
/// ```
/// use masseter_runtime::messages::Command;
/// use masseter_scenario::Scenario;
/// use masseter_virtual_time::Rig;
///
/// let mut rig = Rig::new(&Scenario::default(), 7)?;
/// let command = Command::default();
/// for _ in 0..100 {
///     rig.step(&command)?;
/// }
/// let branch = rig.snapshot();
/// let reading = *rig.step(&command)?;
///
/// rig.restore(&branch)?;
/// assert_eq!(*rig.step(&command)?, reading);
/// assert!(rig.signal("incisal.z")?.is_some());
/// # Ok::<(), anyhow::Error>(())
/// ```
#[derive(Debug)]
pub struct Rig {
    scenario: Arc<Scenario>,
    registry: Registry,
    stepper: Stepper<Latest>,
    has_failed: bool,
}

// Methods that take in the whole plant, or the encoding of a state, are inlined: they are compiled where somebody calls them. The
// command, which does neither, takes less to build.
impl Rig {
    /// A rig of the scenario with this seed instead of the scenario's, in its first cycle.
    ///
    /// # Errors
    /// When the scenario has real interfaces, a wrong value, or does not fit its mechanism, drives or buses.
    #[inline]
    pub fn new(scenario: &Scenario, seed: u64) -> Result<Self, RigError> {
        if !scenario.can.is_virtual() {
            return Err(RigError::Interfaces(scenario.can.interfaces.clone()));
        }
        let scenario = Scenario { seed, ..scenario.clone() };
        scenario.validate().map_err(|error| RigError::Scenario(error.into()))?;
        let plan = masseter_plan::RunPlan::new(scenario).map_err(|error| RigError::Scenario(error.into()))?;
        let stepper = Stepper::new(&plan.scenario, plan.schedule, Latest::default())?;
        let registry = Registry::new(&plan.scenario, &masseter_runtime::named::Declared::default());
        let mut rig = Self { scenario: Arc::new(plan.scenario), registry, stepper, has_failed: false };
        rig.stepper.begin_next_cycle()?;
        Ok(rig)
    }

    /// Switches the rig off and on, as it was when new, and begins the first cycle; returns its reading.
    ///
    /// # Errors
    /// When the plant fails.
    #[inline]
    pub fn reset(&mut self) -> Result<&Reading, RigError> {
        self.has_failed = true;
        self.stepper.renew(&self.scenario, Latest::default())?;
        self.stepper.begin_next_cycle()?;
        self.has_failed = false;
        Ok(self.reading())
    }

    /// Ends the cycle with a command and begins the next one; returns its reading. Number and time of the command are
    /// set here. The master refuses a command as it does in a run, such as one that is no number.
    ///
    /// # Errors
    /// When the plant fails. The cycle is then incomplete, and the rig refuses further steps until a
    /// [`reset`](Self::reset) or [`restore`](Self::restore).
    #[inline]
    pub fn step(&mut self, command: &Command) -> Result<&Reading, RigError> {
        let Self { stepper, has_failed, .. } = self;
        if *has_failed {
            return Err(RigError::Failed { cycle: stepper.cycle });
        }
        *has_failed = true;
        stepper.ports.log.sink.events.clear();
        stepper.end_with(command)?;
        stepper.begin_next_cycle()?;
        *has_failed = false;
        Ok(self.reading())
    }

    /// Steps with the commands of a recording, each of which keeps its number. A cycle without a command gets none. `look`
    /// sees every cycle that begins, and ends the steps by `false`.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn follow(
        &mut self,
        commands: &[Option<Command>],
        look: &mut dyn FnMut(&Self) -> bool,
    ) -> Result<(), RigError> {
        for command in commands {
            self.stepper.ports.log.sink.events.clear();
            self.has_failed = true;
            self.stepper.end_cycle(*command)?;
            self.stepper.begin_next_cycle()?;
            self.has_failed = false;
            if !look(self) {
                break;
            }
        }
        Ok(())
    }

    /// The reading of this cycle.
    pub fn reading(&self) -> &Reading {
        &self.stepper.ports.reading
    }

    /// The mechanism's true motion at the SYNC of this cycle.
    pub fn truth(&self) -> Option<&Truth> {
        self.latest().cycle.truth.as_ref()
    }

    /// The events of the last step, in the order of their sources.
    pub fn events(&self) -> &[Event] {
        &self.latest().events
    }

    /// The value of a signal in this cycle, in its unit (`masseter signals`). `None` if it has none, as all of a
    /// controller's, and those that count from the start of the motion.
    ///
    /// # Errors
    /// Where there is no signal of that name, with the most similar one.
    pub fn signal(&self, name: &str) -> Result<Option<f64>, UnknownSignal> {
        self.registry.value(name, &self.latest().cycle)
    }

    /// The state of the rig, to be [restored](Self::restore) later, also on another rig of the same scenario and seed.
    #[inline]
    pub fn snapshot(&self) -> Snapshot {
        Snapshot {
            scenario: self.scenario.clone(),
            stepper: self.stepper.state(),
            latest: self.latest().clone(),
            has_failed: self.has_failed,
        }
    }

    /// The snapshot in a file, which the same build of the rig has [written](Snapshot::write_to).
    ///
    /// # Errors
    /// Where there is no such file, the file is damaged, or it is of another build, scenario or seed.
    #[inline]
    pub fn read_snapshot(&self, path: &Path) -> Result<Snapshot, SnapshotError> {
        self.snapshot().replaced_by(path)
    }

    /// Goes back, or on, to a snapshot. The steps that follow are those that followed it.
    ///
    /// # Errors
    /// Where the snapshot is one of another scenario or seed.
    #[inline]
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), RigError> {
        let Snapshot { scenario, stepper, latest, has_failed } = snapshot;
        OtherScenario::refuse(&self.scenario, scenario)?;
        self.stepper.set_state(stepper);
        self.stepper.ports.log.sink.clone_from(latest);
        self.has_failed = *has_failed;
        Ok(())
    }

    fn latest(&self) -> &Latest {
        &self.stepper.ports.log.sink
    }
}
