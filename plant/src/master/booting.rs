//! Booting the nodes side by side: who may boot, whose SDO request goes out, and when they are started.
//!
//! SDO takes place only with nodes that exchange no process data, with one request a bus and cycle,
//! queued after the process data. So a bus never carries more than the
//! [time table](masseter_shared::schedule) allows for.

use masseter_can::Bus;
use masseter_can::canopen::{Nmt, NmtCommand, NmtTarget};
use masseter_shared::geometry::AXES;
use masseter_shared::messages::Event;
use masseter_shared::messages::codes::{BootPhase, Cause, DriveRequest, EventKind, Source};

use super::boot::BootFault;
use super::cycle::{Master, Stop};
use super::node::Node;
use super::supervision::Place;
use crate::link::Buses;

impl Master {
    /// Whether nodes may be booted: not while a stop is under way, which needs every drive's attention. After one for
    /// good nobody moves them again, and another master may guide them.
    pub(super) fn may_boot(&self) -> bool {
        match self.fault {
            None => true,
            Some(Stop::UntilRestored) => self.drives_are_off(),
            Some(Stop::ForGood) => false,
        }
    }

    /// Sends what the nodes need to boot.
    pub(super) fn boot(&mut self, now_ns: u64, buses: &mut impl Buses) {
        self.complete_nodes(now_ns);
        self.expire(now_ns);
        if self.may_boot() {
            self.command_nodes(now_ns, buses);
            (0..self.settings.buses).for_each(|bus| self.send_sdo(now_ns, bus, buses));
            self.start_nodes(now_ns, buses);
        }
    }

    /// Who has become operational has booted, whatever happens to the others meanwhile.
    fn complete_nodes(&mut self, now_ns: u64) {
        for axis in 0..AXES {
            let node = &mut self.nodes[axis];
            if node.boot.phase() == BootPhase::Starting && node.is_operational() {
                node.boot.complete();
                self.note_boot(now_ns, axis, BootPhase::Starting, Ok(()));
            }
        }
    }

    fn expire(&mut self, now_ns: u64) {
        for axis in 0..AXES {
            let boot = &mut self.nodes[axis].boot;
            let before = boot.phase();
            let result = boot.expire(now_ns);
            self.note_boot(now_ns, axis, before, result);
        }
    }

    fn command_nodes(&mut self, now_ns: u64, buses: &mut impl Buses) {
        for axis in 0..AXES {
            let node = &mut self.nodes[axis];
            if let Some(command) = node.boot.command(now_ns) {
                node.stop_exchange();
                self.send_nmt(now_ns, axis, command, buses);
            }
        }
    }

    fn send_nmt(&mut self, now_ns: u64, axis: usize, command: NmtCommand, buses: &mut impl Buses) {
        let Node { id, bus, .. } = self.nodes[axis];
        let frame = Nmt { command, target: NmtTarget::Node(id) }.frame();
        let result = buses.port(bus).send(now_ns, frame);
        self.check_sent(bus, result);
    }

    /// One request at most; the nodes of a bus take turns.
    fn send_sdo(&mut self, now_ns: u64, bus: usize, buses: &mut impl Buses) {
        let last = self.buses[bus].last_served;
        for axis in (1..=AXES).map(|step| (last + step) % AXES) {
            let node = &mut self.nodes[axis];
            if node.bus != bus {
                continue;
            }
            if let Some(request) = node.boot.client().poll(now_ns) {
                let result = buses.port(bus).send(now_ns, request.frame(node.id));
                self.buses[bus].last_served = axis;
                self.check_sent(bus, result);
                return;
            }
        }
    }

    /// Starts the nodes once every one is verified: none moves beside one that is not known.
    fn start_nodes(&mut self, now_ns: u64, buses: &mut impl Buses) {
        if !self.nodes.iter().all(|node| node.boot.is_verified()) {
            return;
        }
        for axis in 0..AXES {
            let node = &mut self.nodes[axis];
            if node.boot.phase() == BootPhase::Configured {
                node.start(now_ns);
                self.send_nmt(now_ns, axis, NmtCommand::Start, buses);
                self.note_boot(now_ns, axis, BootPhase::Configured, Ok(()));
            }
        }
    }

    /// Tells why a node was given up. Unlike what happens while moving, one node's failure to boot is no
    /// consequence of another's: each is told.
    pub(super) fn fail_boot(&mut self, now_ns: u64, axis: usize, fault: &BootFault) {
        self.fault.get_or_insert(Stop::UntilRestored);
        let object =
            fault.object.map_or(0, |object| u32::from(object.index) << 8 | u32::from(object.subindex));
        let failed = Event::new(Source::Master, EventKind::Fault, fault.cause);
        let event = Event { object, value: fault.value, limit: fault.limit, ..failed };
        self.tell(now_ns, Place::Axis(axis), event);
    }

    /// Ends a stop once every drive is verified again, none has voltage, and the controller has switched
    /// them off: whoever still asks for motion does not know of the stop.
    pub(super) fn restore(&mut self, now_ns: u64) {
        let wants_off = self.silent_cycles == 0
            && self.command.is_some_and(|command| command.request == DriveRequest::Off.code());
        let is_restored = self.fault == Some(Stop::UntilRestored)
            && wants_off
            && self.buses.iter().all(|bus| !bus.is_off)
            && self.nodes.iter().all(Node::is_ready)
            && self.drives_are_off();
        if is_restored {
            (self.fault, self.were_enabled) = (None, false);
            let recovered = Event::new(Source::Master, EventKind::Notice, Cause::Recovered);
            self.tell(now_ns, Place::Nowhere, recovered);
        }
    }
}
