//! The rig as an object that steps: master, simulated buses, emulated drives and mechanism of a scenario. Its caller
//! decides when the next step comes.
//!
//! Every step happens exactly when the time table has it, so the same scenario, seed and commands leave the same
//! bytes. Computing takes no time here: readings and commands go out at the latest times that the time table allows.
//! Only the buses vary. A rig has no controller and no operator: commands come from outside, and nobody sets
//! parameters or requests a stop. Interfaces that the scenario names are not used.

#[cfg(test)]
mod tests;

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

/// Why a rig cannot be made or restored.
#[derive(Debug, thiserror::Error)]
pub enum RigError {
    /// The scenario does not fit its mechanism, drives or buses.
    #[error("{0:#}")]
    Scenario(anyhow::Error),
    /// The plant cannot be built.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The snapshot is one of another scenario or seed.
    #[error(
        "the snapshot is one of scenario '{snapshot}' with seed {of_seed}, the rig plays '{rig}' with seed {seed}, or other \
             values of their keys; restore it on a rig of its own scenario"
    )]
    OtherScenario {
        /// Name of the snapshot's scenario.
        snapshot: String,
        /// Seed of the snapshot's scenario.
        of_seed: u64,
        /// Name of the rig's scenario.
        rig: String,
        /// Seed of the rig's scenario.
        seed: u64,
    },
}

/// What a rig published last: reading, truth and contact of the present cycle, and the events of the last step.
#[derive(Debug, Clone, Default)]
pub struct Latest {
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

/// Master, buses, drives and mechanism of a scenario. A cycle begins with a reading and ends with a command.
///
/// After an error a cycle is incomplete: go on by [`reset`](Self::reset) or [`restore`](Self::restore) alone.
///
/// ```
/// use masseter_runtime::messages::Command;
/// use masseter_scenario::Scenario;
/// use masseter_virtual_time::Rig;
///
/// let mut rig = Rig::new(&Scenario::default(), 7)?;
/// rig.reset()?;
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
pub struct Rig<S = Latest> {
    scenario: Arc<Scenario>,
    schedule: CycleSchedule,
    registry: Option<Registry>,
    plant: PlantCore,
    ports: Ports<S>,
    /// The number of the cycle, from 1 on.
    cycle: u64,
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
}

impl Rig {
    /// A rig of the scenario with this seed instead of the scenario's, before its first cycle. The values of the
    /// scenario are expected to be valid: [`Scenario::validate`] is not called.
    ///
    /// # Errors
    /// When the scenario does not fit its mechanism, drives or buses.
    pub fn new(scenario: &Scenario, seed: u64) -> Result<Self, RigError> {
        let scenario = Scenario { seed, ..scenario.clone() };
        let plan = RunPlan::new(scenario).map_err(RigError::Scenario)?;
        let mut rig = Self::with_sink(&plan.scenario, plan.schedule, Latest::default())?;
        rig.registry = Some(Registry::new(&plan.scenario, &Declared::default()));
        Ok(rig)
    }

    /// Makes the rig new and begins the first cycle; returns its reading. The plant's files (tables of pushes, memory
    /// of the drives) are read again.
    ///
    /// # Errors
    /// When the plant fails.
    pub fn reset(&mut self) -> Result<&Reading, RigError> {
        self.plant = PlantCore::new(&self.scenario, EPOCH_NS)?;
        self.ports = Ports::new(Latest::default());
        self.cycle = 0;
        self.begin_next_cycle()?;
        Ok(&self.ports.reading)
    }

    /// Ends the cycle with a command and begins the next one; returns its reading. Number, cycle and time of the
    /// command are set here. In a new rig without a [reset](Self::reset), the first call also begins the first cycle.
    ///
    /// # Errors
    /// When the plant fails. A command that the master refuses is no error: the drives stop, and an event says why.
    pub fn step(&mut self, command: &Command) -> Result<&Reading, RigError> {
        if self.cycle == 0 {
            self.begin_next_cycle()?;
        }
        self.ports.sink_mut().events.clear();
        self.ports.now_ns = self.controller_at_ns();
        let (cycle, now_ns) = (self.cycle, self.ports.now_ns);
        let command = self.ports.log.record(Publisher::Command, now_ns, |message: &mut Command| {
            *message = Command { cycle, ..*command };
        });
        self.end_cycle(Some(command))?;
        self.begin_next_cycle()?;
        Ok(&self.ports.reading)
    }

    /// The reading of this cycle.
    pub fn reading(&self) -> &Reading {
        &self.ports.reading
    }

    /// The mechanism's true motion at the SYNC of this cycle; none before the first cycle.
    pub fn truth(&self) -> Option<&Truth> {
        self.ports.log.sink().cycle.truth.as_ref()
    }

    /// Events that the last step published. Those since the SYNC of the present cycle come with the next step.
    pub fn events(&self) -> &[Event] {
        &self.ports.log.sink().events
    }

    /// The value of a signal in this cycle, in its unit (`masseter signals` lists them). It is none for signals of
    /// the controller and for those that count from the start of the motion.
    ///
    /// # Errors
    /// When there is no signal of that name; the message names the most similar one.
    pub fn signal(&self, name: &str) -> Result<Option<f64>, UnknownSignal> {
        let registry = self.registry.as_ref().expect("a rig that is new has a registry");
        registry.value(name, &self.ports.log.sink().cycle)
    }

    /// The state of the rig, to be [restored](Self::restore) later, also on another rig of the same scenario and seed.
    pub fn snapshot(&self) -> Snapshot {
        let Self { scenario, plant, ports, cycle, .. } = self;
        Snapshot { scenario: scenario.clone(), plant: plant.clone(), ports: ports.clone(), cycle: *cycle }
    }

    /// Goes to the state of a snapshot. The same commands then give the same steps as they did from there.
    ///
    /// # Errors
    /// When the snapshot is one of another scenario or seed. Contents of files are not compared.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), RigError> {
        if !Arc::ptr_eq(&self.scenario, &snapshot.scenario) && self.scenario != snapshot.scenario {
            return Err(RigError::OtherScenario {
                snapshot: snapshot.scenario.name.clone(),
                of_seed: snapshot.scenario.seed,
                rig: self.scenario.name.clone(),
                seed: self.scenario.seed,
            });
        }
        self.plant.clone_from(&snapshot.plant);
        self.ports.clone_from(&snapshot.ports);
        self.cycle = snapshot.cycle;
        Ok(())
    }
}

impl<S: Sink> Rig<S> {
    /// A rig of a planned scenario; its messages go to the sink. It has no signals.
    pub(crate) fn with_sink(
        scenario: &Scenario,
        schedule: CycleSchedule,
        sink: S,
    ) -> Result<Self, PlantError> {
        Ok(Self {
            scenario: Arc::new(scenario.clone()),
            schedule,
            registry: None,
            plant: PlantCore::new(scenario, EPOCH_NS)?,
            ports: Ports::new(sink),
            cycle: 0,
        })
    }

    /// Plays a whole cycle, whose command comes from a controller. Not to be mixed with `step`, which begins the next
    /// cycle.
    pub(crate) fn play_cycle(
        &mut self,
        controller: &mut dyn Controller,
        duties: &mut Duties,
    ) -> Result<(), PlantError> {
        self.begin_next_cycle()?;
        let now_ns = self.controller_at_ns();
        self.ports.now_ns = now_ns;
        let wake = Wake::on_time(self.cycle, now_ns);
        let mut ports = LoggedPorts::new(&mut self.ports.log, [now_ns; 3], Some(&self.ports.reading));
        let Ok(()) = masseter_runtime::control::run_cycle(controller, duties, &mut ports, &wake);
        let command = ports.into_command();
        self.end_cycle(command)
    }

    pub(crate) fn sink_mut(&mut self) -> &mut S {
        self.ports.sink_mut()
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
        self.ports.command = command;
        let sync = self.sync();
        end_cycle(&mut self.plant, &mut self.ports, &sync)
    }

    fn sync(&self) -> Wake {
        Wake::on_time(self.cycle, EPOCH_NS + (self.cycle - 1) * self.scenario.period_ns())
    }

    fn controller_at_ns(&self) -> u64 {
        self.sync().due_ns + self.schedule.controller_at_ns
    }
}

/// The ports of the plant: its messages, and the time, which jumps from one entry of the time table to the next.
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

    fn sink_mut(&mut self) -> &mut S {
        self.log.sink_mut()
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
