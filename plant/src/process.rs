//! The plant's process: binds the pure core to iceoryx2 and to real time, and decides nothing.

use masseter_shared::clock;
use masseter_shared::config::Scenario;
use masseter_shared::lifecycle::{ProcessArguments, ProcessContext, ProcessError};
use masseter_shared::messages::{Command, Event, FrameTap, Reading, Truth};
use masseter_shared::realtime::{Cycle, Wake};
use masseter_shared::schedule::CycleSchedule;
use masseter_shared::transport::{Node, Publisher, Received, Subscriber, TransportError};

use crate::core::{PlantCore, PlantError};
use crate::cycle::{PlantPorts, run_cycle};
use crate::link::Link;

/// How long the drives may take to stop after the end has been asked for, ns.
const STOP_WITHIN_NS: u64 = 500_000_000;
/// Cycles that they may take at least: the word goes out in one, holds from the next, and is answered in the one after
/// the ramp.
const STOP_WITHIN_CYCLES: u64 = 10;
/// Silence after which no command will come any more, beyond the one that stops the drives, ns.
const ABANDONED_AFTER_NS: u64 = 5_000_000_000;

/// Why the plant ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// A stop was requested.
    Requested,
    /// Its controller was silent for longer than a controller can be that still runs.
    Abandoned,
}

/// Why the plant could not do its work.
#[derive(Debug, thiserror::Error)]
pub enum PlantProcessError {
    /// What any process may meet.
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
    frames: Publisher<[FrameTap]>,
    events: Publisher<Event>,
}

impl Ports {
    fn open(node: &Node) -> Result<Self, TransportError> {
        Ok(Self {
            commands: node.newest_subscriber()?,
            readings: node.publisher()?,
            truths: node.publisher()?,
            frames: node.batch_publisher()?,
            events: node.publisher()?,
        })
    }

    /// Connects to the ports of the other processes before the first cycle, since a connection makes and maps files.
    fn connect(&self) -> Result<(), TransportError> {
        self.commands.connect()?;
        self.readings.connect()?;
        self.truths.connect()?;
        self.frames.connect()?;
        self.events.connect()
    }

    /// Touches the memory of the next messages.
    fn warm_up(&self) -> Result<(), TransportError> {
        self.readings.warm_up()?;
        self.truths.warm_up()?;
        self.frames.warm_up()?;
        self.events.warm_up()
    }
}

/// Runs the plant until it is asked to end or its controller hangs, then until its drives are off.
pub fn run(arguments: &ProcessArguments) -> Result<Reason, PlantProcessError> {
    let context = arguments.init()?;
    if context.scenario.can.is_virtual() {
        serve(&context, PlantCore::new)
    } else {
        serve(&context, PlantCore::on_interfaces)
    }
}

/// Ports and deadlines of the plant's process.
struct RealTime<'a> {
    ports: Ports,
    cycle: Cycle,
    schedule: &'a CycleSchedule,
    /// Whether commands are received; at the end they no longer are.
    takes_commands: bool,
}

impl<L: Link> PlantPorts<L> for RealTime<'_> {
    type Command = Received<Command>;
    type Error = PlantProcessError;

    fn now_ns(&self) -> u64 {
        clock::now_ns()
    }

    fn wait_until(&mut self, due_ns: u64, latest_ns: u64) -> u64 {
        self.cycle.waiter().until_between(due_ns, latest_ns)
    }

    fn wait_for_frames(&mut self, link: &mut L, latest_ns: u64) -> u64 {
        link.wait(latest_ns, self.cycle.waiter())
    }

    fn publish_reading(&mut self, fill: impl FnOnce(&mut Reading)) -> Result<(), PlantProcessError> {
        Ok(self.ports.readings.publish(fill)?)
    }

    fn publish_truth(&mut self, truth: &Truth) -> Result<(), PlantProcessError> {
        Ok(self.ports.truths.publish(|message| *message = *truth)?)
    }

    fn command(&mut self, wake: &Wake) -> Result<Option<Received<Command>>, PlantProcessError> {
        if !self.takes_commands {
            return Ok(None);
        }
        // No command can arrive before the controller wakes.
        let command_by_ns = wake.due_ns + self.schedule.command_by_ns;
        let waiter = self.cycle.waiter();
        waiter.until_between(wake.due_ns + self.schedule.controller_at_ns, command_by_ns);
        let is_awaited = |command: &Command| command.cycle >= wake.cycle;
        Ok(self.ports.commands.latest_by(command_by_ns, waiter, is_awaited)?)
    }

    fn publish_frames_and_events(&mut self, plant: &mut PlantCore<L>) -> Result<(), PlantProcessError> {
        let Ports { frames, events, .. } = &mut self.ports;
        let mut result = frames.publish(plant.drain_frames());
        plant.drain_events(&mut |event| {
            if result.is_ok() {
                result = events.publish(|message| *message = event);
            }
        });
        Ok(result?)
    }
}

fn serve<L: Link>(
    context: &ProcessContext,
    build: impl Fn(&Scenario, u64) -> Result<PlantCore<L>, PlantError>,
) -> Result<Reason, PlantProcessError> {
    let (scenario, schedule) = (&context.scenario, &context.schedule);
    let timeout_cycles = u64::from(scenario.can.command_timeout_cycles);
    let abandoned_cycles = timeout_cycles + ABANDONED_AFTER_NS / scenario.period_ns();
    // Built once before the start, so that a plant that cannot be built is never reported ready.
    build(scenario, 0)?;
    let ports = Ports::open(&context.node)?;
    ports.warm_up()?;
    let start = context.ready(Some(scenario.realtime.cores[1]))?;
    ports.connect()?;

    let mut plant = build(scenario, start.epoch_ns)?;
    let cycle = Cycle::new(start.epoch_ns, scenario.period_ns());
    let mut real_time = RealTime { ports, cycle, schedule, takes_commands: true };
    while !context.stop.is_made() && u64::from(plant.silent_cycles()) <= abandoned_cycles {
        let RealTime { cycle, ports, .. } = &mut real_time;
        let wake = cycle.wait_warm(|| -> Result<(), PlantProcessError> {
            // Works out what has happened on the wires by now.
            plant.advance(clock::now_ns())?;
            Ok(ports.warm_up()?)
        })?;
        run_cycle(&mut plant, &mut real_time, schedule, &wake)?;
    }
    plant.stop();
    real_time.takes_commands = false;
    let give_up_ns = clock::now_ns() + STOP_WITHIN_NS.max(STOP_WITHIN_CYCLES * scenario.period_ns());
    while !plant.drives_are_off() && clock::now_ns() < give_up_ns {
        let wake = real_time.cycle.wait();
        run_cycle(&mut plant, &mut real_time, schedule, &wake)?;
    }
    // The last cycle's process data are on the wire only by now.
    plant.collect(real_time.cycle.wait().woke_ns)?;
    real_time.publish_frames_and_events(&mut plant)?;
    Ok(if context.stop.is_made() { Reason::Requested } else { Reason::Abandoned })
}
