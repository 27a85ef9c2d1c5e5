//! The plant's process binds the pure core to iceoryx2, and to real time or lockstep. This module decides nothing.

use masseter_runtime::lifecycle::{Party, ProcessArguments, ProcessContext, ProcessError, StopRequest};
use masseter_runtime::lockstep::{Clock, Lockstep};
use masseter_runtime::messages::{Command, Contact, Event, Reading, Truth};
use masseter_runtime::transport::{
    FramePublisher, Node, Publisher, ReceivedMessage, Subscriber, TransportError,
};
use masseter_runtime::{clock, control::Deadline, named::Declared, realtime::Wake, schedule::CycleSchedule};
use masseter_scenario::Scenario;

use crate::cycle::{PlantPorts, run_after_controller, run_cycle};
use crate::{core::PlantCore, error::PlantError, master::link::Link};

/// Longest played silence of the controller in lockstep, beyond the silence that stops the drives, ns.
const SILENCE_NS: u64 = 500_000_000;
/// Silence that means the end of the controller, beyond the silence that stops the drives, ns.
const ABANDONED_AFTER_NS: u64 = 5_000_000_000;

/// The reason for the plant's end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// A request to stop.
    Requested,
    /// A silence of the controller longer than any running controller's.
    Abandoned,
    /// A controller that did not begin its motion, or did not end, by its deadline.
    Overdue,
}

/// The failure of the plant.
#[derive(Debug, thiserror::Error)]
pub enum PlantProcessError {
    /// A failure common to all processes.
    #[error(transparent)]
    Process(#[from] ProcessError),
    /// The plant itself.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// iceoryx2.
    #[error(transparent)]
    Transport(#[from] TransportError),
}

/// The plant's ports.
struct Ports {
    commands: Subscriber<Command>,
    readings: Publisher<Reading>,
    truths: Publisher<Truth>,
    contacts: Publisher<Contact>,
    frames: FramePublisher,
    events: Publisher<Event>,
}

impl Ports {
    fn open(node: &Node) -> Result<Self, TransportError> {
        Ok(Self {
            commands: Subscriber::of_newest(node)?,
            readings: Publisher::open(node)?,
            truths: Publisher::open(node)?,
            contacts: Publisher::open(node)?,
            frames: FramePublisher::open(node)?,
            events: Publisher::open(node)?,
        })
    }

    /// Connects to the ports of the other processes before the first cycle, because a connection makes and maps files.
    fn connect(&self) -> Result<(), TransportError> {
        self.commands.connect()?;
        self.readings.connect()?;
        self.truths.connect()?;
        self.contacts.connect()?;
        self.frames.connect()?;
        self.events.connect()
    }

    /// Touches the memory of the next messages.
    fn warm_up(&self) -> Result<(), TransportError> {
        self.readings.warm_up()?;
        self.truths.warm_up()?;
        self.contacts.warm_up()?;
        self.frames.warm_up()?;
        self.events.warm_up()
    }
}

/// Runs the plant until a request to end, or a controller that hangs or waits for ever. Then stops the drives, and goes on for a
/// while. A motion that lasts `motion_s` has a deadline; without a motion there is none.
pub fn run(arguments: &ProcessArguments, motion_s: Option<f64>) -> Result<Reason, PlantProcessError> {
    let context = arguments.init()?;
    if context.scenario.can.is_virtual() {
        serve(&context, motion_s, PlantCore::new)
    } else {
        serve(&context, motion_s, PlantCore::on_interfaces)
    }
}

/// Ports and clock of the plant's process.
struct Binding<'a> {
    ports: Ports,
    clock: Clock,
    schedule: &'a CycleSchedule,
    /// Whether the plant receives commands: not at the end.
    takes_commands: bool,
    deadline: Option<Deadline>,
    /// Cycles that the loop did not skip: a machine that stands still for long is not the controller's delay.
    played: u64,
    /// The largest number of the last cycle's samples on one topic.
    samples: usize,
}

impl Binding<'_> {
    /// Whether the run goes on. In lockstep, a plant that has lost its controller continues until its master has stopped the
    /// drives.
    fn goes_on(&self, stop: &StopRequest) -> bool {
        match &self.clock {
            Clock::RealTime(_) => !stop.is_made(),
            Clock::Lockstep(lockstep) => match lockstep.lost() {
                None => !lockstep.is_last() && !stop.is_made(),
                Some(lost) => lost == Party::Controller,
            },
        }
    }

    /// Whether the run goes on, and the controller has not begun or ended by its deadline.
    fn is_overdue(&self, stop: &StopRequest) -> bool {
        self.goes_on(stop) && self.deadline.is_some_and(|deadline| deadline.is_over(self.played))
    }

    /// Waits for the next cycle. Before it, warms up; in lockstep, lets the recorder catch up.
    fn wait<L: Link>(&mut self, plant: &mut PlantCore<L>) -> Result<Wake, PlantProcessError> {
        let Self { clock, ports, .. } = self;
        self.played += 1;
        match clock {
            Clock::RealTime(cycle) => cycle.wait_warm(|| {
                // Simulates the wires up to now.
                plant.advance(clock::now_ns())?;
                Ok(ports.warm_up()?)
            }),
            Clock::Lockstep(lockstep) => {
                lockstep.await_recorder(self.samples)?;
                Ok(lockstep.begin_cycle())
            }
        }
    }
}

impl<L: Link> PlantPorts<L> for Binding<'_> {
    type Command = ReceivedMessage<Command>;
    type Error = PlantProcessError;

    fn now_ns(&self) -> u64 {
        self.clock.now_ns()
    }

    fn wait_until(&mut self, due_ns: u64, latest_ns: u64) -> u64 {
        match &mut self.clock {
            Clock::RealTime(cycle) => cycle.waiter().until_between(due_ns, latest_ns),
            Clock::Lockstep(lockstep) => lockstep.advance(latest_ns),
        }
    }

    fn wait_for_frames(&mut self, link: &mut L, latest_ns: u64) -> u64 {
        match &mut self.clock {
            Clock::RealTime(cycle) => link.wait(latest_ns, cycle.waiter()),
            Clock::Lockstep(lockstep) => lockstep.advance(latest_ns),
        }
    }

    fn publish_reading(&mut self, fill: impl FnOnce(&mut Reading)) -> Result<(), PlantProcessError> {
        Ok(self.ports.readings.publish_by(|| self.clock.now_ns(), fill)?)
    }

    fn publish_truth(&mut self, truth: &Truth) -> Result<(), PlantProcessError> {
        Ok(self.ports.truths.publish_by(|| self.clock.now_ns(), |message| *message = *truth)?)
    }

    fn publish_contact(&mut self, contact: &Contact) -> Result<(), PlantProcessError> {
        Ok(self.ports.contacts.publish_by(|| self.clock.now_ns(), |message| *message = *contact)?)
    }

    fn command(&mut self, wake: &Wake) -> Result<Option<ReceivedMessage<Command>>, PlantProcessError> {
        // No command can arrive before the controller wakes.
        let controller_at_ns = wake.due_ns + self.schedule.controller_at_ns;
        let is_awaited = |command: &Command| command.cycle >= wake.cycle;
        let command = match &mut self.clock {
            Clock::RealTime(_) if !self.takes_commands => None,
            Clock::RealTime(cycle) => {
                let command_by_ns = wake.due_ns + self.schedule.command_by_ns;
                let waiter = cycle.waiter();
                waiter.until_between(controller_at_ns, command_by_ns);
                self.ports.commands.latest_by(command_by_ns, waiter, is_awaited)?
            }
            Clock::Lockstep(lockstep) => {
                lockstep.advance(controller_at_ns);
                if !self.takes_commands {
                    return Ok(None);
                }
                lockstep.end_turn(false).map_err(ProcessError::from)?;
                if !lockstep.await_turn()? {
                    return Ok(None);
                }
                self.ports.commands.latest_by(0, lockstep.waiter(), is_awaited)?
            }
        };
        if let (Some(deadline), Some(command)) = (&mut self.deadline, &command) {
            deadline.note(self.played, command.controller_state);
        }
        Ok(command)
    }

    fn publish_frames_and_events(&mut self, plant: &mut PlantCore<L>) -> Result<(), PlantProcessError> {
        let Ports { frames, events, .. } = &mut self.ports;
        let now_ns = || self.clock.now_ns();
        let tapped = plant.drain_frames();
        let mut occurred = 0;
        self.samples = FramePublisher::samples(tapped.len());
        let mut result = frames.publish_by(now_ns, tapped);
        plant.drain_events(&mut |event| {
            occurred += 1;
            if result.is_ok() {
                result = events.publish_by(now_ns, |message| *message = event);
            }
        });
        self.samples = self.samples.max(occurred + 1);
        Ok(result?)
    }
}

fn serve<L: Link>(
    context: &ProcessContext,
    motion_s: Option<f64>,
    build: impl Fn(&Scenario, u64) -> Result<PlantCore<L>, PlantError>,
) -> Result<Reason, PlantProcessError> {
    let (scenario, schedule) = (&context.scenario, &context.schedule);
    // A construction before the start, so that an impossible plant never reports ready.
    build(scenario, 0)?;
    let ports = Ports::open(&context.node)?;
    ports.warm_up()?;
    let lockstep = Lockstep::open(context, Party::Plant, Party::Controller).map_err(ProcessError::from)?;
    let start = context.ready(Some(scenario.realtime.cores[1]), Declared::default())?;
    ports.connect()?;

    let mut plant = build(scenario, start.epoch_ns)?;
    let clock = Clock::start(lockstep, start.epoch_ns, scenario.period_ns());
    let deadline = motion_s.map(|motion_s| Deadline::new(scenario, &start.declared, motion_s));
    let mut binding =
        Binding { ports, clock, schedule, takes_commands: true, deadline, played: 0, samples: 0 };
    let most_silent_cycles = most_silent_cycles(context);
    while binding.goes_on(&context.stop)
        && !binding.is_overdue(&context.stop)
        && u64::from(plant.master.silent_cycles()) <= most_silent_cycles
    {
        let wake = binding.wait(&mut plant)?;
        run_cycle(&mut plant, &mut binding, schedule, &wake)?;
    }
    let is_overdue = binding.is_overdue(&context.stop);
    binding.takes_commands = false;
    let wait = |plant: &mut PlantCore<L>, binding: &mut Binding<'_>| binding.wait(plant);
    run_after_controller(&mut plant, &mut binding, schedule, scenario.period_ns(), wait)?;
    let is_stopped = match &binding.clock {
        // The run is over, as under virtual time.
        Clock::Lockstep(lockstep) if lockstep.is_last() => lockstep.await_stop(),
        _ => {
            // Only by now the last cycle's process data are on the wire.
            let last = binding.wait(&mut plant)?;
            plant.collect(last.woke_ns)?;
            binding.publish_frames_and_events(&mut plant)?;
            context.stop.is_made()
        }
    };
    Ok(match (is_overdue, is_stopped) {
        (true, _) => Reason::Overdue,
        (false, true) => Reason::Requested,
        (false, false) => Reason::Abandoned,
    })
}

/// Cycles without commands that mean the end of the controller.
fn most_silent_cycles(context: &ProcessContext) -> u64 {
    let scenario = &context.scenario;
    let until_stopped = u64::from(scenario.can.command_timeout_cycles);
    match context.lockstep {
        None => until_stopped + ABANDONED_AFTER_NS / scenario.period_ns(),
        // The plant has waited before.
        Some(_) => until_stopped + SILENCE_NS / scenario.period_ns(),
    }
}
