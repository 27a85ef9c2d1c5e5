//! The rig as an object that steps: master, simulated buses, emulated drives and mechanism of a scenario. Its caller
//! decides when the next step comes.
//!
//! Every step happens exactly when the time table has it, so the same scenario, seed and commands leave the same
//! bytes. Computing takes no time here: readings and commands go out at the latest times that the time table allows.
//! Only the buses vary. A rig has no controller and no operator: commands come from outside, and nobody sets
//! parameters or requests a stop. A scenario of real interfaces is refused.

#[cfg(test)]
mod tests;

use std::error::Error;
use std::sync::Arc;

use masseter_analysis::signals::{CycleMessages, Registry, UnknownSignal};
use masseter_plan::RunPlan;
use masseter_plant::PlantError;
use masseter_plant::core::PlantCore;
use masseter_plant::cycle::{PlantPorts, begin_cycle, end_cycle};
use masseter_plant::emulation::VirtualLink;
use masseter_recording::Recorded;
use masseter_runtime::control::{Controller, Duties};
use masseter_runtime::lockstep::EPOCH_NS;
use masseter_runtime::messages::{Command, Contact, Event, Reading, Truth};
use masseter_runtime::named::Declared;
use masseter_runtime::realtime::Wake;
use masseter_runtime::schedule::CycleSchedule;
use masseter_scenario::Scenario;

use crate::log::{Log, LoggedPorts, Publisher, Sink};

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
    Plant(#[from] PlantError),
    /// A step failed before, in the middle of a cycle.
    #[error("the rig failed in cycle {cycle}; reset it, or restore a snapshot")]
    Failed {
        /// That cycle.
        cycle: u64,
    },
    /// The snapshot is one of another scenario or seed.
    #[error(
        "the snapshot is of scenario '{snapshot}', seed {snapshot_seed}, the rig of scenario '{rig}', seed {rig_seed}"
    )]
    OtherScenario {
        /// Name of the snapshot's scenario.
        snapshot: String,
        /// Its seed.
        snapshot_seed: u64,
        /// Name of the rig's scenario.
        rig: String,
        /// Its seed.
        rig_seed: u64,
    },
    /// The scenarios have the same name and seed.
    #[error("the snapshot is of a scenario '{name}' with other values of its keys than the rig's")]
    OtherKeys {
        /// Name of both scenarios.
        name: String,
    },
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

/// The state of a rig at an instant, to go on from there again and again. It holds mechanism, drives, buses with
/// their error counters, master, faults and random streams, and what the rig published last.
///
/// It does not hold the caller's controller, nor any file. A rig reads tables of pushes and the memory of the drives
/// when it is made and at a reset. It writes no file, so what drives store stays in the rig. A snapshot lives in
/// memory; it cannot be saved.
#[derive(Debug, Clone)]
pub struct Snapshot {
    scenario: Arc<Scenario>,
    plant: PlantCore,
    ports: Ports<Latest>,
    cycle: u64,
    has_failed: bool,
}

impl Rig {
    /// A rig of the scenario with this seed instead of the scenario's, in its first cycle.
    ///
    /// # Errors
    /// When the scenario has real interfaces, a wrong value, or does not fit its mechanism, drives or buses.
    pub fn new(scenario: &Scenario, seed: u64) -> Result<Self, RigError> {
        if !scenario.can.is_virtual() {
            return Err(RigError::Interfaces(scenario.can.interfaces.clone()));
        }
        let scenario = Scenario { seed, ..scenario.clone() };
        scenario.validate().map_err(|error| RigError::Scenario(error.into()))?;
        let plan = RunPlan::new(scenario).map_err(|error| RigError::Scenario(error.into()))?;
        let stepper = Stepper::new(&plan.scenario, plan.schedule, Latest::default())?;
        let registry = Registry::new(&plan.scenario, &Declared::default());
        let mut rig = Self { scenario: Arc::new(plan.scenario), registry, stepper, has_failed: false };
        rig.stepper.begin_next_cycle()?;
        Ok(rig)
    }

    /// Switches the rig off and on, as it was when new, and begins the first cycle; returns its reading.
    ///
    /// # Errors
    /// When the plant fails.
    pub fn reset(&mut self) -> Result<&Reading, RigError> {
        self.has_failed = true;
        self.stepper = Stepper::new(&self.scenario, self.stepper.schedule, Latest::default())?;
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
    pub fn step(&mut self, command: &Command) -> Result<&Reading, RigError> {
        let Self { stepper, has_failed, .. } = self;
        if *has_failed {
            return Err(RigError::Failed { cycle: stepper.cycle });
        }
        *has_failed = true;
        stepper.ports.log.sink_mut().events.clear();
        let (cycle, now_ns) = (stepper.cycle, stepper.controller_at_ns());
        let command = stepper.ports.log.record(Publisher::Command, now_ns, |message: &mut Command| {
            *message = Command { cycle, ..*command };
        });
        stepper.end_cycle(Some(command))?;
        stepper.begin_next_cycle()?;
        *has_failed = false;
        Ok(self.reading())
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

    /// The value of a signal in this cycle, in its unit (`masseter signals`). None where it has none, as all of a
    /// controller's, and those that count from the start of the motion.
    ///
    /// # Errors
    /// Where there is no signal of that name, with the most similar one.
    pub fn signal(&self, name: &str) -> Result<Option<f64>, UnknownSignal> {
        self.registry.value(name, &self.latest().cycle)
    }

    /// The state of the rig, to be [restored](Self::restore) later, also on another rig of the same scenario and seed.
    pub fn snapshot(&self) -> Snapshot {
        let Stepper { plant, ports, cycle, .. } = &self.stepper;
        Snapshot {
            scenario: self.scenario.clone(),
            plant: plant.clone(),
            ports: ports.clone(),
            cycle: *cycle,
            has_failed: self.has_failed,
        }
    }

    /// Goes back, or on, to a snapshot. The steps that follow are those that followed it.
    ///
    /// # Errors
    /// Where the snapshot is one of another scenario or seed.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), RigError> {
        let (own, other) = (&self.scenario, &snapshot.scenario);
        if !Arc::ptr_eq(own, other) && own != other {
            return Err(if (&own.name, own.seed) == (&other.name, other.seed) {
                RigError::OtherKeys { name: own.name.clone() }
            } else {
                RigError::OtherScenario {
                    snapshot: other.name.clone(),
                    snapshot_seed: other.seed,
                    rig: own.name.clone(),
                    rig_seed: own.seed,
                }
            });
        }
        self.stepper.plant = snapshot.plant.clone();
        self.stepper.ports = snapshot.ports.clone();
        self.stepper.cycle = snapshot.cycle;
        self.has_failed = snapshot.has_failed;
        Ok(())
    }

    fn latest(&self) -> &Latest {
        self.stepper.ports.log.sink()
    }
}

/// What a rig published last: reading, truth and contact of the present cycle, and the events of the last step.
#[derive(Debug, Clone, Default)]
struct Latest {
    cycle: CycleMessages,
    events: Vec<Event>,
}

impl Sink for Latest {
    fn take(&mut self, message: &Recorded, _: u64) {
        match message {
            Recorded::Reading(reading) => self.cycle.reading = Some(*reading),
            Recorded::Truth(truth) => self.cycle.truth = Some(*truth),
            Recorded::Contact(contact) => self.cycle.contact = Some(*contact),
            Recorded::Event(event) => self.events.push(*event),
            _ => {}
        }
    }

    fn has_failed(&self) -> bool {
        false
    }
}

/// The plant of a planned scenario, from one half of a cycle to the next; its messages go to a sink.
#[derive(Debug)]
pub(crate) struct Stepper<S> {
    schedule: CycleSchedule,
    period_ns: u64,
    plant: PlantCore,
    ports: Ports<S>,
    /// The number of the cycle, from 1 on.
    cycle: u64,
}

impl<S: Sink> Stepper<S> {
    /// Before the first cycle.
    pub(crate) fn new(scenario: &Scenario, schedule: CycleSchedule, sink: S) -> Result<Self, PlantError> {
        let plant = PlantCore::new(scenario, EPOCH_NS)?;
        Ok(Self { schedule, period_ns: scenario.period_ns(), plant, ports: Ports::new(sink), cycle: 0 })
    }

    /// One cycle whose command a controller gives.
    pub(crate) fn play_cycle(
        &mut self,
        controller: &mut dyn Controller,
        duties: &mut Duties,
    ) -> Result<(), PlantError> {
        self.begin_next_cycle()?;
        let now_ns = self.controller_at_ns();
        let wake = Wake::on_time(self.cycle, now_ns);
        let mut ports = LoggedPorts::new(&mut self.ports.log, [now_ns; 3], Some(&self.ports.reading));
        let Ok(()) = masseter_runtime::control::run_cycle(controller, duties, &mut ports, &wake);
        let command = ports.into_command();
        self.end_cycle(command)
    }

    pub(crate) fn sink_mut(&mut self) -> &mut S {
        self.ports.log.sink_mut()
    }

    pub(crate) fn into_sink(self) -> S {
        self.ports.log.into_sink()
    }

    fn begin_next_cycle(&mut self) -> Result<(), PlantError> {
        self.cycle += 1;
        let sync = self.sync();
        begin_cycle(&mut self.plant, &mut self.ports, &self.schedule, &sync)
    }

    fn end_cycle(&mut self, command: Option<Command>) -> Result<(), PlantError> {
        self.ports.now_ns = self.controller_at_ns();
        self.ports.command = command;
        let sync = self.sync();
        end_cycle(&mut self.plant, &mut self.ports, &sync)
    }

    fn sync(&self) -> Wake {
        Wake::on_time(self.cycle, EPOCH_NS + (self.cycle - 1) * self.period_ns)
    }

    fn controller_at_ns(&self) -> u64 {
        self.sync().due_ns + self.schedule.controller_at_ns
    }
}

#[derive(Debug, Clone)]
struct Ports<S> {
    log: Log<S>,
    now_ns: u64,
    /// The reading of this cycle, as published.
    reading: Reading,
    /// The command of this cycle.
    command: Option<Command>,
}

impl<S: Sink> Ports<S> {
    fn new(sink: S) -> Self {
        Self { log: Log::new(sink), now_ns: EPOCH_NS, reading: Reading::default(), command: None }
    }
}

impl<S: Sink> PlantPorts<VirtualLink> for Ports<S> {
    type Command = Command;
    type Error = PlantError;

    fn now_ns(&self) -> u64 {
        self.now_ns
    }

    fn wait_until(&mut self, _: u64, latest_ns: u64) -> u64 {
        self.now_ns = latest_ns;
        latest_ns
    }

    fn wait_for_frames(&mut self, _: &mut VirtualLink, latest_ns: u64) -> u64 {
        latest_ns
    }

    fn publish_reading(&mut self, fill: impl FnOnce(&mut Reading)) -> Result<(), PlantError> {
        self.reading = self.log.record(Publisher::Reading, self.now_ns, fill);
        Ok(())
    }

    fn publish_truth(&mut self, truth: &Truth) -> Result<(), PlantError> {
        self.log.record(Publisher::Truth, self.now_ns, |message| *message = *truth);
        Ok(())
    }

    fn publish_contact(&mut self, contact: &Contact) -> Result<(), PlantError> {
        self.log.record(Publisher::Contact, self.now_ns, |message| *message = *contact);
        Ok(())
    }

    fn command(&mut self, _: &Wake) -> Result<Option<Command>, PlantError> {
        Ok(self.command.take())
    }

    fn publish_frames_and_events(&mut self, plant: &mut PlantCore) -> Result<(), PlantError> {
        self.log.drain(plant, self.now_ns);
        Ok(())
    }
}
