//! The plant as a pure step function: master, wires, drives and mechanism.
//!
//! Time is an argument of every call, exact or as irregular as real time. The core reads no clock and publishes
//! nothing; the [process](crate::process) does both.

#[cfg(test)]
mod tests;

use masseter_can::{
    ErrorKind, ErrorReport, ErrorState, ReceiveError, Tapped, canopen::Cob, faults::FaultNote,
};
use masseter_runtime::messages::codes::{Cause, EventKind, Source};
use masseter_runtime::messages::{Command, Contact, Event, FrameTap, Reading, Truth, tap};
use masseter_runtime::{injection::Withdrawn, realtime::Wake};
use masseter_scenario::Scenario;

use crate::error::PlantError;
use crate::master::Master;
use crate::master::boot_plan::shortest_boot;
use crate::master::events::{Journal, overflow};
use crate::master::link::{Link, node_ids};
use crate::master::sockets::SocketLink;
use crate::master::wanted::WantedDrive;
use crate::simulator::emulation::virtual_link::VirtualLink;
use crate::simulator::injection::Injector;

/// Tapped frames kept between two drains. A drain follows every cycle.
const TAPPED: usize = 4096;

/// The plant.
///
/// A cycle is [`begin_cycle`](Self::begin_cycle), [`collect`](Self::collect) until the process data are in,
/// [`fill_reading`](Self::fill_reading) and [`truth`](Self::truth), then [`apply`](Self::apply). `L` is its link to the
/// drives: simulated wires with emulated drives, or real interfaces.
///
/// ```
/// use masseter_plant::core::PlantCore;
/// use masseter_scenario::Scenario;
/// use masseter_runtime::messages::Reading;
/// use masseter_runtime::realtime::Wake;
///
/// let mut plant = PlantCore::new(&Scenario::default(), 0)?;
/// let mut reading = Reading::default();
/// for cycle in 1..=100 {
///     let sync_ns = (cycle - 1) * 1_000_000;
///     plant.begin_cycle(Wake::on_time(cycle, sync_ns))?;
///     plant.collect(sync_ns + 525_000)?;
///     plant.fill_reading(&mut reading);
///     plant.apply(sync_ns + 545_000, None)?;
/// }
/// let truth = plant.truth().expect("the mechanism is emulated");
/// assert_eq!((reading.cycle, truth.cycle), (100, 100));
/// # Ok::<_, masseter_plant::PlantError>(())
/// ```
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct PlantCore<L = VirtualLink> {
    pub(crate) master: Master,
    /// The link to the drives.
    pub(crate) link: L,
    buses: usize,
    /// The number of the last cycle that began; 0 before the first.
    pub(crate) cycle: u64,
    /// The tapped frames, with the index of the bus.
    tapped: Vec<(u16, Tapped)>,
    wire_events: Journal,
    injector: Injector,
    command_sent_ns: u64,
}

impl PlantCore {
    /// The scenario's plant with emulated drives on simulated wires, switched on at `now_ns`.
    pub fn new(scenario: &Scenario, now_ns: u64) -> Result<Self, PlantError> {
        Self::with_link(VirtualLink::new(scenario, 0, now_ns)?, scenario, now_ns)
    }

    /// Takes the rows of the pushes' tables, which no serialised plant has, from another plant of the scenario. False if the
    /// pushes are others.
    pub fn take_tables_of(&mut self, other: &Self) -> bool {
        self.link.emulation.agenda.take_tables_of(&other.link.emulation.agenda)
    }
}

impl PlantCore<SocketLink> {
    /// The scenario's plant on the real interfaces that it names.
    pub fn on_interfaces(scenario: &Scenario, now_ns: u64) -> Result<Self, PlantError> {
        Self::with_link(SocketLink::open(scenario, now_ns)?, scenario, now_ns)
    }
}

/// Refuses a scenario whose plant cannot be built or booted, on simulated or real wires.
pub fn check_scenario(scenario: &Scenario) -> Result<(), PlantError> {
    PlantCore::new(scenario, 0)?;
    check_boot_time(scenario)
}

/// Refuses a controller's start time that is too short for the boot of the drives. Every bus carries one SDO exchange a
/// cycle, and then the readings must be steady for some cycles.
fn check_boot_time(scenario: &Scenario) -> Result<(), PlantError> {
    let Scenario { can, controller, rate_hz, .. } = scenario;
    let fullest = can.buses.iter().map(Vec::len).max().unwrap_or(0);
    let longest = node_ids(can)?.into_iter().enumerate().try_fold(0, |longest, (axis, node)| {
        let wanted = WantedDrive::of_axis(scenario, axis, node)?;
        Ok::<_, PlantError>(shortest_boot(&wanted).max(longest))
    })?;
    let cycles = longest * fullest + controller.steady_readings as usize;
    let least_s = cycles as f64 * scenario.period_s();
    if controller.start_timeout_s > least_s {
        return Ok(());
    }
    Err(PlantError::Scenario(format!(
        "controller.start_timeout_s = {}: at {rate_hz} Hz the drives take {least_s:.1} s to boot, since a bus \
         carries one SDO request a cycle; use more, or a higher rate_hz",
        controller.start_timeout_s
    )))
}

/// Refuses interfaces that cannot be used.
pub fn check_interfaces(scenario: &Scenario) -> Result<(), PlantError> {
    if scenario.can.is_virtual() { Ok(()) } else { PlantCore::on_interfaces(scenario, 0).map(drop) }
}

impl<L: Link> PlantCore<L> {
    fn with_link(link: L, scenario: &Scenario, now_ns: u64) -> Result<Self, PlantError> {
        let mut plant = Self {
            master: Master::new(scenario, now_ns)?,
            link,
            injector: Injector::new(scenario, now_ns)?,
            buses: scenario.can.buses.len(),
            cycle: 0,
            tapped: Vec::with_capacity(TAPPED),
            wire_events: Journal::new(),
            command_sent_ns: 0,
        };
        plant.follow_injections();
        Ok(plant)
    }

    /// Lets these faults and stimuli of its scenario act no more from that time on, ns.
    pub fn withdraw(&mut self, scenario: &Scenario, withdrawn: Withdrawn, from_ns: u64) {
        self.injector.withdraw(scenario, withdrawn, from_ns);
        self.follow_injections();
    }

    /// Simulates up to `now_ns` now, instead of at the beginning of the next cycle.
    pub fn advance(&mut self, now_ns: u64) -> Result<(), PlantError> {
        Ok(self.link.advance(now_ns)?)
    }

    /// Begins a cycle: SYNC.
    pub fn begin_cycle(&mut self, wake: Wake) -> Result<(), PlantError> {
        self.cycle = wake.cycle;
        self.link.advance(wake.woke_ns)?;
        self.collect_taps(wake.woke_ns);
        self.master.begin_cycle(wake, &mut self.link);
        Ok(())
    }

    /// Simulates up to `now_ns`, and takes the arrived frames. Returns whether the process data of all drives are in.
    pub fn collect(&mut self, now_ns: u64) -> Result<bool, PlantError> {
        self.link.advance(now_ns)?;
        self.collect_taps(now_ns);
        Ok(self.master.collect(now_ns, &mut self.link))
    }

    /// Writes the cycle's reading.
    pub fn fill_reading(&self, reading: &mut Reading) {
        self.master.fill_reading(reading);
        reading.command_sent_ns = self.command_sent_ns;
        reading.load_cell_n = self.link.load_cell_n();
    }

    /// The mechanism's true motion at the cycle's SYNC, for an emulated mechanism.
    pub fn truth(&self) -> Option<Truth> {
        let mut truth = Truth { cycle: self.cycle, ..self.link.truth()? };
        truth.round();
        Some(truth)
    }

    /// The forces between the jaws in the cycle before this one, for emulated jaws that can touch.
    pub fn contact(&self) -> Option<Contact> {
        let mut contact = Contact { cycle: self.cycle, ..self.link.contact()? };
        contact.round();
        Some(contact)
    }

    /// Answers the cycle with the newest command, if one came.
    pub fn apply(&mut self, now_ns: u64, command: Option<&Command>) -> Result<(), PlantError> {
        self.link.advance(now_ns)?;
        if self.injector.is_empty() {
            self.master.apply(now_ns, command, &mut self.link);
        } else {
            let command = self.inject(now_ns, command);
            self.master.apply(now_ns, command.as_ref(), &mut self.link);
        }
        Ok(())
    }

    /// Begins the faults and stimuli that count from the command's state; returns the command that reaches the master.
    fn inject(&mut self, now_ns: u64, command: Option<&Command>) -> Option<Command> {
        let sampled_ns = self.master.sampled_ns();
        if let Some(command) = command {
            self.injector.note_command(command, sampled_ns);
        }
        self.follow_injections();
        self.injector.alter(self.cycle, sampled_ns, now_ns, command)
    }

    /// Takes the reports of the emulation, and gives the link the newly known times.
    fn follow_injections(&mut self) {
        while let Some(occurrence) = self.link.next_occurrence() {
            self.injector.note(&occurrence, self.cycle);
        }
        while let Some((injected, window_ns)) = self.injector.next_window() {
            self.link.set_window(injected, window_ns);
        }
    }

    /// Hands out the frames and errors tapped since the last drain. Their encoding comes only now, after the reading.
    pub fn drain_frames(&mut self) -> impl ExactSizeIterator<Item = FrameTap> {
        self.tapped.drain(..).map(|(bus, tapped)| tap::encode(bus, &tapped))
    }

    /// Hands out the events since the last drain.
    pub fn drain_events(&mut self, out: &mut impl FnMut(Event)) {
        self.injector.events.drain(out);
        self.wire_events.drain(out);
        self.master.drain_events(out);
    }

    fn collect_taps(&mut self, now_ns: u64) {
        for bus in 0..self.buses {
            while self.tapped.len() < TAPPED {
                match self.link.tap(bus, now_ns) {
                    Ok(Some(tapped)) => self.note_tapped(bus, tapped),
                    Err(ReceiveError::Overrun { lost }) => {
                        self.wire_events.add(overflow(now_ns, self.cycle, lost));
                    }
                    Ok(None) | Err(ReceiveError::Os { .. }) => break,
                }
            }
            while let Some(note) = self.link.next_note(bus, now_ns) {
                if !note.has_ended {
                    self.injector.note_bus_fault(note.fault, note.time_ns);
                }
                let axis = note.port.and_then(|port| self.link.axis_at(bus, port));
                self.wire_events.add(event_of_note(&note, bus, axis, self.cycle));
            }
        }
        while let Some(mishap) = self.link.next_mishap() {
            self.injector.events.add(Event { cycle: self.cycle, ..mishap });
        }
        if !self.injector.is_empty() {
            self.follow_injections();
        }
    }

    fn note_tapped(&mut self, bus: usize, tapped: Tapped) {
        match &tapped {
            Tapped::Frame(received) => match Cob::try_from(received.frame.id()) {
                Ok(Cob::Rpdo1(_)) => self.command_sent_ns = self.command_sent_ns.max(received.time_ns),
                Ok(Cob::Sync) => self.master.note_sync(bus, received.time_ns),
                _ => {}
            },
            Tapped::Error(report) => {
                let axis = self.link.axis_at(bus, usize::from(report.port));
                if let Some(event) = event_of_report(report, bus, axis, self.cycle) {
                    self.wire_events.add(event);
                }
            }
        }
        self.tapped.push((bus as u16, tapped));
    }
}

/// The highest error counter of an error active controller, and of an error passive one.
const ACTIVE_MAX: f64 = 127.0;
const PASSIVE_MAX: f64 = 255.0;

/// The event for a bus report that is a change of state; `axis` is the axis of its port.
pub(super) fn event_of_report(
    report: &ErrorReport,
    bus: usize,
    axis: Option<usize>,
    cycle: u64,
) -> Option<Event> {
    let ErrorKind::State(state) = report.kind else { return None };
    let (cause, limit) = match state {
        ErrorState::Active => (Cause::ErrorActive, ACTIVE_MAX),
        ErrorState::Passive => (Cause::ErrorPassive, ACTIVE_MAX),
        ErrorState::BusOff => (Cause::BusOff, PASSIVE_MAX),
    };
    let value = f64::from(report.tec);
    Some(Event { time_ns: report.time_ns, cycle, value, limit, ..notice(cause, bus, axis) })
}

/// The event for the beginning or the end of a fault on a bus; `axis` is the axis of the node concerned.
pub(super) fn event_of_note(note: &FaultNote, bus: usize, axis: Option<usize>, cycle: u64) -> Event {
    let cause = if note.has_ended { Cause::FaultEnded } else { Cause::FaultInjected };
    let (value, limit) = ((note.fault + 1) as f64, note.activations as f64);
    Event { time_ns: note.time_ns, cycle, value, limit, ..notice(cause, bus, axis) }
}

fn notice(cause: Cause, bus: usize, axis: Option<usize>) -> Event {
    let event = Event::new(Source::Wire, EventKind::Notice, cause);
    Event { axis: axis.map_or(event.axis, |axis| axis as u32), bus: bus as u16, ..event }
}
