//! SYNC and process data (CiA 301): what arrives takes effect, what the axis does is sampled and sent.

use masseter_can::Frame;

use super::dictionary::{PDOS, names};
use super::errors::DriveError;
use super::node::DriveNode;
use super::pdo::{RpdoFault, Tpdo};

impl DriveNode {
    /// Process data wait for the next SYNC, or take effect at once where their PDO is event-driven.
    pub(super) fn take_process_data(&mut self, now_ns: u64, frame: &Frame) {
        if !self.is_operational() {
            return;
        }
        let Some(number) = self.rpdos.iter().position(|rpdo| rpdo.id() == Some(frame.id())) else { return };
        self.rpdos[number].take(now_ns, frame.data());
        self.judge_rpdos();
        if !self.rpdos[number].is_synchronous() {
            self.apply(number, now_ns);
        }
    }

    /// An error of process data is present as long as any RPDO has it.
    pub(super) fn judge_rpdos(&mut self) {
        for fault in RpdoFault::ALL {
            let error = match fault {
                RpdoFault::Short => DriveError::PdoShort,
                RpdoFault::Long => DriveError::PdoLong,
                RpdoFault::Overdue => DriveError::RpdoTimeout,
            };
            if self.rpdos.iter().any(|rpdo| rpdo.has(fault)) {
                self.raise(error);
            } else {
                self.clear(error);
            }
        }
    }

    /// Lets a received PDO take effect.
    fn apply(&mut self, number: usize, now_ns: u64) {
        let Some(effects) = self.rpdos[number].apply(&mut self.objects) else { return };
        self.new_targets.position |= effects.targets.position;
        self.new_targets.torque |= effects.targets.torque;
        if effects.configures {
            self.axis.configure(now_ns, &self.objects);
        }
        if effects.commands {
            self.control(now_ns);
        }
    }

    /// SYNC: buffered process data take effect, actual values are sampled and sent.
    pub(super) fn take_sync(&mut self, now_ns: u64, data: &[u8], position_m: f64) {
        if !self.is_served() {
            return;
        }
        let counter = match (data, self.objects.get(names::SYNC_OVERFLOW)) {
            ([], 0) => 0,
            ([counter], 2..) => *counter,
            _ => return self.raise(DriveError::SyncLength),
        };
        self.clear(DriveError::SyncLength);
        if self.is_operational() {
            for number in 0..PDOS {
                if self.rpdos[number].waits_for_sync() {
                    self.apply(number, now_ns);
                }
            }
        }
        let new_targets = std::mem::take(&mut self.new_targets);
        self.axis.synchronise(now_ns, new_targets, &self.objects);
        if self.is_operational() {
            self.axis.sample(position_m);
            self.axis.show(now_ns, &mut self.objects);
            for tpdo in &mut self.tpdos {
                if let Some(frame) = tpdo.at_sync(now_ns, counter, &self.objects) {
                    self.outbox.add(frame);
                }
            }
        }
    }

    /// TPDOs that no SYNC drives.
    pub(super) fn send_events(&mut self, now_ns: u64) {
        if !self.is_operational() || !self.tpdos.iter().any(Tpdo::is_event_driven) {
            return;
        }
        self.axis.show(now_ns, &mut self.objects);
        for tpdo in &mut self.tpdos {
            if let Some(frame) = tpdo.at_event(now_ns, &self.objects) {
                self.outbox.add(frame);
            }
        }
    }
}
