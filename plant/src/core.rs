//! The plant as one pure step function: master, wires, drives and mechanism, moved by the times that
//! are passed in.
//!
//! A cycle is [`PlantCore::begin_cycle`], [`PlantCore::collect`] until the process data are in,
//! [`PlantCore::fill_reading`] and [`PlantCore::truth`], then [`PlantCore::apply`]. Called with irregular
//! times, as real time has them, or with exact ones.

use masseter_can::canopen::Cob;
use masseter_can::{ReceiveError, Tapped};
use masseter_shared::config::Scenario;
use masseter_shared::messages::tap;
use masseter_shared::messages::{Command, Event, FrameTap, Reading, Truth};
use masseter_shared::realtime::Wake;

use crate::build::{build_master, build_sockets, build_virtual};
use crate::checks::check_boot_time;
pub use crate::error::PlantError;
use crate::journal::Journal;
use crate::link::{Link, VirtualLink};
use crate::master::Master;
use crate::socket_link::SocketLink;
use crate::wire_events;

/// Tapped frames kept between two drains; a drain follows every cycle.
const TAPPED: usize = 4096;

/// The plant's whole memory.
#[derive(Debug)]
pub struct PlantCore<L = VirtualLink> {
    master: Master,
    link: L,
    buses: usize,
    cycle: u64,
    /// With the index of its bus.
    tapped: Vec<(u16, Tapped)>,
    wire_events: Journal,
    command_sent_ns: u64,
}

impl PlantCore {
    /// The scenario's plant with emulated drives on simulated wires, switched on at `now_ns`.
    pub fn new(scenario: &Scenario, now_ns: u64) -> Result<Self, PlantError> {
        Self::on(build_virtual(scenario, 0, now_ns)?, scenario, now_ns)
    }
}

impl PlantCore<SocketLink> {
    /// The scenario's plant on the real interfaces that it names, with whatever drives are there.
    pub fn on_interfaces(scenario: &Scenario, now_ns: u64) -> Result<Self, PlantError> {
        Self::on(build_sockets(scenario, now_ns)?, scenario, now_ns)
    }
}

/// Refuses a scenario whose plant cannot be built or booted, whatever its wires are.
pub fn check(scenario: &Scenario) -> Result<(), PlantError> {
    PlantCore::new(scenario, 0)?;
    check_boot_time(scenario)
}

/// Refuses interfaces that cannot be used.
pub fn check_interfaces(scenario: &Scenario) -> Result<(), PlantError> {
    if scenario.can.is_virtual() { Ok(()) } else { PlantCore::on_interfaces(scenario, 0).map(drop) }
}

impl<L: Link> PlantCore<L> {
    fn on(link: L, scenario: &Scenario, now_ns: u64) -> Result<Self, PlantError> {
        Ok(Self {
            master: build_master(scenario, now_ns)?,
            link,
            buses: scenario.can.buses.len(),
            cycle: 0,
            tapped: Vec::with_capacity(TAPPED),
            wire_events: Journal::new(),
            command_sent_ns: 0,
        })
    }

    /// Lets time pass, so that less is left to do when the next cycle begins.
    pub fn advance(&mut self, now_ns: u64) -> Result<(), PlantError> {
        Ok(self.link.advance(now_ns)?)
    }

    /// The wires.
    pub(crate) fn link(&mut self) -> &mut L {
        &mut self.link
    }

    /// Begins a cycle: SYNC.
    pub fn begin_cycle(&mut self, wake: Wake) -> Result<(), PlantError> {
        self.cycle = wake.cycle;
        self.link.advance(wake.woke_ns)?;
        self.collect_taps(wake.woke_ns);
        self.master.begin_cycle(wake, &mut self.link);
        Ok(())
    }

    /// Lets time pass and takes what has arrived; whether the process data of all drives are in.
    pub fn collect(&mut self, now_ns: u64) -> Result<bool, PlantError> {
        self.link.advance(now_ns)?;
        self.collect_taps(now_ns);
        Ok(self.master.collect(now_ns, &mut self.link))
    }

    /// The cycle's reading.
    pub fn fill_reading(&self, reading: &mut Reading) {
        self.master.fill_reading(reading);
        reading.command_sent_ns = self.command_sent_ns;
    }

    /// What the mechanism really did at the cycle's SYNC, where it is emulated here.
    pub fn truth(&self) -> Option<Truth> {
        self.link.truth().map(|truth| Truth { cycle: self.cycle, ..truth })
    }

    /// Answers the cycle with the newest command, if one came.
    pub fn apply(&mut self, now_ns: u64, command: Option<&Command>) -> Result<(), PlantError> {
        self.link.advance(now_ns)?;
        self.master.apply(now_ns, command, &mut self.link);
        Ok(())
    }

    /// Cycles since the last command.
    pub fn silent_cycles(&self) -> u32 {
        self.master.silent_cycles()
    }

    /// Stops the drives with the next process data, for the end.
    pub fn stop(&mut self) {
        self.master.stop();
    }

    /// Whether no drive reports voltage; a lost one reports nothing.
    pub fn drives_are_off(&self) -> bool {
        self.master.drives_are_off()
    }

    /// Hands out what was seen on the wires since the last drain. The messages are made only now, behind the reading.
    pub fn drain_frames(&mut self) -> impl ExactSizeIterator<Item = FrameTap> {
        self.tapped.drain(..).map(|(bus, tapped)| tap::encode(bus, &tapped))
    }

    /// Hands out what happened since the last drain.
    pub fn drain_events(&mut self, out: &mut impl FnMut(Event)) {
        self.wire_events.drain(out);
        self.master.drain_events(out);
    }

    fn collect_taps(&mut self, now_ns: u64) {
        for bus in 0..self.buses {
            while self.tapped.len() < TAPPED {
                match self.link.tap(bus, now_ns) {
                    Ok(Some(tapped)) => self.take_tapped(bus, tapped),
                    Err(ReceiveError::Overrun { lost }) => self.master.note_lost(now_ns, lost),
                    Ok(None) | Err(ReceiveError::InterfaceDown { .. } | ReceiveError::Os { .. }) => break,
                }
            }
            while let Some(note) = self.link.next_note(bus, now_ns) {
                let axis = note.port.and_then(|port| self.link.axis_at(bus, port));
                self.wire_events.add(wire_events::of_note(&note, bus, axis, self.cycle));
            }
        }
    }

    fn take_tapped(&mut self, bus: usize, tapped: Tapped) {
        match &tapped {
            Tapped::Frame(received) => match Cob::try_from(received.frame.id()) {
                Ok(Cob::Rpdo1(_)) => self.command_sent_ns = self.command_sent_ns.max(received.time_ns),
                Ok(Cob::Sync) => self.master.note_sync(bus, received.time_ns),
                _ => {}
            },
            Tapped::Error(report) => {
                let axis = self.link.axis_at(bus, usize::from(report.port));
                if let Some(event) = wire_events::of_report(report, bus, axis, self.cycle) {
                    self.wire_events.add(event);
                }
            }
        }
        self.tapped.push((bus as u16, tapped));
    }
}

#[cfg(test)]
mod tests;
