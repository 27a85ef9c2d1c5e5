//! What the master makes of a frame that arrived.

use masseter_can::canopen::{
    Cob, Emergency, Heartbeat, HeartbeatError, LengthError, NmtState, NodeId, SdoError, SdoResponse,
};
use masseter_can::{CanId, Received, Tpdo1};
use masseter_shared::messages::Event;
use masseter_shared::messages::codes::{BootPhase, Cause, EventKind, Source, drive_state_code};

use super::cycle::Master;
use super::node::Kind;
use super::supervision::Place;

impl Master {
    /// Takes a frame. Of a malformed one it is told once that it came; it has no other effect.
    pub(super) fn take(&mut self, bus: usize, received: &Received) {
        let Ok(cob) = Cob::try_from(received.frame.id()) else { return };
        let (time_ns, data) = (received.time_ns, received.frame.data());
        // Only a master sends it, and this one's own frames do not come back to it.
        if cob == Cob::Sync {
            return self.give_way(time_ns, bus);
        }
        let Some((kind, id)) = Kind::of(cob) else { return };
        if id == self.settings.id {
            return self.give_way(time_ns, bus);
        }
        let Some(axis) = self.axis_of(id, bus) else { return self.note_unknown(time_ns, id, bus) };
        self.buses[bus].is_heard = true;
        let taken = match kind {
            Kind::Heartbeat => self.take_heartbeat(axis, data, time_ns),
            Kind::ProcessData => Tpdo1::decode(data).map(|tpdo| self.take_process_data(axis, tpdo, time_ns)),
            Kind::Emergency => Emergency::decode(data).map(|emcy| self.note_emergency(axis, emcy, time_ns)),
            Kind::SdoAnswer => self.take_answer(axis, data, time_ns),
        };
        if let Err(error) = taken
            && self.nodes[axis].is_first_wrong_length(kind)
        {
            self.note_wrong_length(axis, cob, &error, time_ns);
        }
    }

    fn axis_of(&self, id: NodeId, bus: usize) -> Option<usize> {
        self.nodes.iter().position(|node| node.id == id && node.bus == bus)
    }

    fn take_heartbeat(&mut self, axis: usize, data: &[u8], time_ns: u64) -> Result<(), LengthError> {
        let state = match Heartbeat::decode(data) {
            Ok(Heartbeat { state }) => state,
            Err(HeartbeatError::Length(error)) => return Err(error),
            // Node guarding of somebody else: it says nothing here.
            Err(HeartbeatError::UnknownState { .. }) => return Ok(()),
        };
        let may_boot = self.may_boot();
        let node = &mut self.nodes[axis];
        node.hear_state(time_ns, state);
        let before = node.boot.phase();
        let mut result = Ok(());
        if state == NmtState::BootUp && node.is_started() {
            node.stop_exchange();
            node.forget(time_ns);
            self.fail(time_ns, Cause::NodeRestarted, Place::Axis(axis), [0.0; 2]);
        } else if may_boot {
            result = node.boot.hear(time_ns, state);
        } else if state == NmtState::BootUp {
            // What was written to it is lost. It is told to boot once more when the stop is over.
            node.boot.forget(time_ns);
        }
        self.note_boot(time_ns, axis, before, result);
        Ok(())
    }

    fn take_answer(&mut self, axis: usize, data: &[u8], time_ns: u64) -> Result<(), LengthError> {
        match SdoResponse::decode(data) {
            Ok(response) => {
                let node = &mut self.nodes[axis];
                node.hear(time_ns);
                let before = node.boot.phase();
                let result = node.boot.take(time_ns, response);
                self.note_boot(time_ns, axis, before, result);
                Ok(())
            }
            Err(SdoError::Length(error)) => Err(error),
            // An answer of a service that was not asked for; the time-out deals with it.
            Err(SdoError::UnknownCommand { .. }) => Ok(()),
        }
    }

    fn take_process_data(&mut self, axis: usize, tpdo: Tpdo1, time_ns: u64) {
        let Some([before, after]) = self.nodes[axis].take(tpdo, time_ns) else { return };
        self.complete_ns = self.complete_ns.max(time_ns);
        if before != after {
            let moved = Event::new(Source::Drive, EventKind::Transition, Cause::Sequence);
            let event = Event { from: drive_state_code(before), to: drive_state_code(after), ..moved };
            self.tell(time_ns, Place::Axis(axis), event);
        }
    }

    /// Before its boot-up a node tells of a time before this master, which resets it.
    fn note_emergency(&mut self, axis: usize, emergency: Emergency, time_ns: u64) {
        let is_past = emergency.is_reset() || self.nodes[axis].boot.phase() == BootPhase::Waiting;
        let kind = if is_past { EventKind::Notice } else { EventKind::Fault };
        let (value, limit) = (f64::from(emergency.code.0), f64::from(emergency.register));
        let event = Event { value, limit, ..Event::new(Source::Drive, kind, Cause::Emergency) };
        self.tell(time_ns, Place::Axis(axis), event);
    }

    fn note_wrong_length(&mut self, axis: usize, cob: Cob, error: &LengthError, time_ns: u64) {
        let (value, limit) = (error.actual as f64, error.expected as f64);
        let wrong = Event::new(Source::Master, EventKind::Notice, Cause::WrongLength);
        let event = Event { object: CanId::from(cob).number(), value, limit, ..wrong };
        self.tell(time_ns, Place::Axis(axis), event);
    }

    /// Tells once of a node that nobody configured.
    fn note_unknown(&mut self, time_ns: u64, id: NodeId, bus: usize) {
        let bit = 1 << id.get();
        let watch = &mut self.buses[bus];
        if watch.unknown_nodes & bit == 0 {
            watch.unknown_nodes |= bit;
            let unknown = Event::new(Source::Master, EventKind::Notice, Cause::UnknownNode);
            self.tell(time_ns, Place::Bus(bus), Event { node: u16::from(id.get()), ..unknown });
        }
    }

    /// Tells how a node's boot went on: a change of phase, or its failure.
    pub(super) fn note_boot(
        &mut self,
        time_ns: u64,
        axis: usize,
        before: BootPhase,
        result: Result<(), super::boot::BootFault>,
    ) {
        if let Err(fault) = result {
            self.nodes[axis].boot.give_up();
            self.fail_boot(time_ns, axis, &fault);
        }
        let after = self.nodes[axis].boot.phase();
        if before != after {
            let moved = Event::new(Source::Master, EventKind::Transition, Cause::Sequence);
            let event = Event { from: before.code(), to: after.code(), ..moved };
            self.tell(time_ns, Place::Axis(axis), event);
        }
    }
}
