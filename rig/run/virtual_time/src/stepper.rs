//! The plant of a scenario that steps from one half of a cycle to the next, in exact time; and its state between them.

use masseter_plant::cycle::{PlantPorts, begin_cycle, end_cycle, run_after_controller};
use masseter_plant::{PlantError, core::PlantCore, emulation::VirtualLink};
use masseter_runtime::control::{self, Controller, Duties, Observed};
use masseter_runtime::messages::{Command, Contact, Reading, Truth};
use masseter_runtime::{injection::Withdrawn, lockstep::EPOCH_NS, realtime::Wake, schedule::CycleSchedule};
use masseter_scenario::Scenario;

use crate::log::{Log, LoggedPorts, Published, Publisher, Sink};

/// The plant of a planned scenario; its messages go to a sink.
#[derive(Debug)]
pub(crate) struct Stepper<S> {
    schedule: CycleSchedule,
    period_ns: u64,
    plant: PlantCore,
    pub(crate) ports: Ports<S>,
    /// The number of the cycle, from 1 on.
    pub(crate) cycle: u64,
}

/// All of it that cycles change, but for the sink.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct StepperState {
    plant: PlantCore,
    published: Published,
    now_ns: u64,
    reading: Reading,
    cycle: u64,
}

impl StepperState {
    /// Takes the rows of the pushes' tables from another state of the scenario; false if the pushes are others.
    pub(crate) fn take_tables_of(&mut self, other: &Self) -> bool {
        self.plant.take_tables_of(&other.plant)
    }
}

impl<S: Sink> Stepper<S> {
    /// Before the first cycle.
    pub(crate) fn new(scenario: &Scenario, schedule: CycleSchedule, sink: S) -> Result<Self, PlantError> {
        let plant = PlantCore::new(scenario, EPOCH_NS)?;
        let ports = Ports::new(sink, schedule.controller_at_ns);
        Ok(Self { schedule, period_ns: scenario.period_ns(), plant, ports, cycle: 0 })
    }

    /// The same before the first cycle again, with another sink.
    pub(crate) fn renew(&mut self, scenario: &Scenario, sink: S) -> Result<(), PlantError> {
        *self = Self::new(scenario, self.schedule, sink)?;
        Ok(())
    }

    /// Begins a cycle, whose reading a controller takes.
    #[inline]
    pub(crate) fn begin_observed(
        &mut self,
        controller: &mut dyn Controller,
        duties: &mut Duties,
    ) -> Result<Observed, PlantError> {
        self.begin_next_cycle()?;
        let (wake, mut ports) = self.controller_ports();
        let Ok(observed) = control::observe(controller, duties, &mut ports, &wake);
        Ok(observed)
    }

    /// Ends that cycle with the controller's command.
    #[inline]
    pub(crate) fn end_decided(
        &mut self,
        controller: &mut dyn Controller,
        duties: &mut Duties,
        observed: Observed,
    ) -> Result<(), PlantError> {
        let (wake, mut ports) = self.controller_ports();
        let Ok(()) = control::decide(controller, duties, &mut ports, &wake, observed);
        let command = ports.into_command();
        self.end_cycle(command)
    }

    /// When the controller of this cycle wakes, and its ports.
    fn controller_ports(&mut self) -> (Wake, LoggedPorts<'_, S>) {
        let now_ns = self.controller_at_ns();
        let wake = Wake::on_time(self.cycle, now_ns);
        (wake, LoggedPorts::new(&mut self.ports.log, [now_ns; 3], Some(&self.ports.reading)))
    }

    /// Ends a cycle with this command, under the cycle's number and time.
    pub(crate) fn end_with(&mut self, command: &Command) -> Result<(), PlantError> {
        let (cycle, now_ns) = (self.cycle, self.controller_at_ns());
        let command = self.ports.log.record(Publisher::Command, now_ns, |message: &mut Command| {
            *message = Command { cycle, ..*command };
        });
        self.end_cycle(Some(command))
    }

    /// Lets these faults and stimuli of its scenario act no more from the next SYNC on; returns that time, ns.
    pub(crate) fn withdraw(&mut self, scenario: &Scenario, withdrawn: Withdrawn) -> u64 {
        let from_ns = sync(self.cycle + 1, self.period_ns).due_ns;
        self.plant.withdraw(scenario, withdrawn, from_ns);
        from_ns
    }

    /// The cycles after the controller's last one.
    pub(crate) fn play_after_controller(&mut self) -> Result<(), PlantError> {
        let Self { schedule, period_ns, plant, ports, cycle } = self;
        run_after_controller(plant, ports, schedule, *period_ns, |_, _| {
            *cycle += 1;
            Ok(sync(*cycle, *period_ns))
        })
    }

    pub(crate) fn begin_next_cycle(&mut self) -> Result<(), PlantError> {
        self.cycle += 1;
        let sync = self.sync();
        begin_cycle(&mut self.plant, &mut self.ports, &self.schedule, &sync)
    }

    /// Ends a cycle with this command, or without one.
    pub(crate) fn end_cycle(&mut self, command: Option<Command>) -> Result<(), PlantError> {
        self.ports.command = command;
        let sync = self.sync();
        end_cycle(&mut self.plant, &mut self.ports, &sync)
    }

    /// The state between two calls.
    pub(crate) fn state(&self) -> StepperState {
        let Self { plant, ports: Ports { log, now_ns, reading, .. }, cycle, .. } = self;
        StepperState {
            plant: plant.clone(),
            published: log.published,
            now_ns: *now_ns,
            reading: *reading,
            cycle: *cycle,
        }
    }

    /// Goes to a state of the same scenario and seed.
    pub(crate) fn set_state(&mut self, state: &StepperState) {
        let StepperState { plant, published, now_ns, reading, cycle } = state;
        self.plant = plant.clone();
        self.ports.log.published = *published;
        // A cycle takes its command before it ends.
        (self.ports.now_ns, self.ports.reading, self.ports.command) = (*now_ns, *reading, None);
        self.cycle = *cycle;
    }

    fn sync(&self) -> Wake {
        sync(self.cycle, self.period_ns)
    }

    fn controller_at_ns(&self) -> u64 {
        self.sync().due_ns + self.schedule.controller_at_ns
    }
}

/// The SYNC of a cycle.
fn sync(cycle: u64, period_ns: u64) -> Wake {
    Wake::on_time(cycle, EPOCH_NS + (cycle - 1) * period_ns)
}

#[derive(Debug)]
pub(crate) struct Ports<S> {
    pub(crate) log: Log<S>,
    /// From SYNC to the controller's command.
    controller_at_ns: u64,
    now_ns: u64,
    /// The reading of this cycle, as published.
    pub(crate) reading: Reading,
    /// The command of this cycle.
    command: Option<Command>,
}

impl<S: Sink> Ports<S> {
    fn new(sink: S, controller_at_ns: u64) -> Self {
        let (log, reading) = (Log::new(sink), Reading::default());
        Self { log, controller_at_ns, now_ns: EPOCH_NS, reading, command: None }
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

    fn command(&mut self, wake: &Wake) -> Result<Option<Command>, PlantError> {
        self.now_ns = wake.due_ns + self.controller_at_ns;
        Ok(self.command.take())
    }

    fn publish_frames_and_events(&mut self, plant: &mut PlantCore) -> Result<(), PlantError> {
        self.log.drain(plant, self.now_ns);
        Ok(())
    }
}
