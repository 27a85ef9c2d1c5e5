//! Network management of the drive (CiA 301): its NMT state, its resets, and what becomes of an axis that nobody guides.

use masseter_can::ErrorState;
use masseter_can::canopen::{Heartbeat, NmtCommand, NmtState};
use masseter_shared::clock::MILLISECOND_NS;

use super::cyclic::NewTargets;
use super::dictionary::{PDOS, names};
use super::errors::{DriveError, Errors};
use super::heartbeats::Consumer;
use super::node::DriveNode;
use super::pdo::{Rpdo, Tpdo};
use super::sdo::SdoServer;

/// From power-on to the boot-up message, ns.
pub(super) const BOOT_NS: u64 = 20 * MILLISECOND_NS;

impl DriveNode {
    /// Obeys a command of network management, once it has booted.
    pub(super) fn command_nmt(&mut self, command: NmtCommand, now_ns: u64) {
        if self.nmt.is_none() {
            return;
        }
        match command {
            NmtCommand::Start if !self.is_operational() => {
                self.nmt = Some(NmtState::Operational);
                self.tpdos.iter_mut().for_each(Tpdo::clear);
            }
            NmtCommand::Start => {}
            NmtCommand::Stop => self.leave_operational(NmtState::Stopped, now_ns),
            NmtCommand::EnterPreOperational => self.leave_operational(NmtState::PreOperational, now_ns),
            NmtCommand::ResetCommunication => {
                // Until it has booted nobody is heard, whoever guided the drive.
                self.lose_link(now_ns);
                self.end_exchange(NmtState::PreOperational);
                self.reset_communication(now_ns);
            }
            NmtCommand::ResetNode => self.reset_node(now_ns),
        }
    }

    /// Nobody guides the drive any more: it reacts as object 6007 says. A fault lasts longer than its cause.
    pub(super) fn lose_link(&mut self, now_ns: u64) {
        if self.axis.lose_link(now_ns) {
            self.raise(DriveError::LinkLost);
        }
    }

    /// Its CAN controller is in that error state: off the bus the communication has failed, which is told once it is back.
    pub(crate) fn watch_bus(&mut self, now_ns: u64, state: ErrorState) {
        if state == self.confinement {
            return;
        }
        let before = std::mem::replace(&mut self.confinement, state);
        if before == ErrorState::BusOff {
            self.raise(DriveError::WasBusOff);
            self.clear(DriveError::WasBusOff);
        }
        match state {
            ErrorState::Active => self.clear(DriveError::ErrorPassive),
            ErrorState::Passive => self.raise(DriveError::ErrorPassive),
            ErrorState::BusOff => {
                self.clear(DriveError::ErrorPassive);
                self.fail_communication(now_ns);
            }
        }
    }

    /// The communication has failed: objects 6007 and 1029.
    pub(super) fn fail_communication(&mut self, now_ns: u64) {
        self.lose_link(now_ns);
        if self.is_operational() {
            match self.objects.get(names::COMMUNICATION_ERROR) {
                0 => self.leave_operational(NmtState::PreOperational, now_ns),
                2 => self.leave_operational(NmtState::Stopped, now_ns),
                _ => {}
            }
        }
    }

    /// Without process data nobody guides the drive.
    pub(super) fn leave_operational(&mut self, state: NmtState, now_ns: u64) {
        if self.is_operational() || state == NmtState::Stopped {
            self.lose_link(now_ns);
        }
        self.end_exchange(state);
    }

    fn end_exchange(&mut self, state: NmtState) {
        self.nmt = Some(state);
        self.rpdos.iter_mut().for_each(Rpdo::clear);
        self.new_targets = NewTargets::default();
        self.sdo = SdoServer::default();
    }

    /// The communication objects as stored, then boot-up. The history of errors (1003) is kept, as the faults are.
    fn reset_communication(&mut self, now_ns: u64) {
        self.objects.copy_range(&self.stored, 0x1000..=0x1002);
        self.objects.copy_range(&self.stored, 0x1004..=0x1FFF);
        self.errors.forget_communication(&mut self.objects);
        self.producer.configure(&self.objects, now_ns + BOOT_NS);
        self.consumer = Consumer::new(&self.objects);
        for number in 0..PDOS {
            self.compile_rpdo(number);
            self.compile_tpdo(number);
        }
        self.sdo = SdoServer::default();
        (self.nmt, self.boot_at_ns) = (None, now_ns + BOOT_NS);
    }

    /// As after power-on: the brake closes, every object has its stored value, then boot-up.
    fn reset_node(&mut self, now_ns: u64) {
        self.objects = self.stored.clone();
        self.errors = Errors::default();
        self.rpdos.iter_mut().for_each(Rpdo::clear);
        self.new_targets = NewTargets::default();
        self.axis.restart(now_ns, &self.objects);
        self.reset_communication(now_ns);
    }

    /// Boots once it is time to.
    pub(super) fn boot(&mut self, now_ns: u64) {
        if self.nmt.is_none() && now_ns >= self.boot_at_ns {
            self.nmt = Some(NmtState::PreOperational);
            self.send(Heartbeat { state: NmtState::BootUp }.frame(self.node));
        }
    }
}
