//! Fault confinement as the driver's error frames tell it.
//!
//! Layout of an error frame: `linux/can/error.h`. Drivers differ in what they tell: most tell every change
//! of state, newer ones with both counters.

use socketcan::errors::{CAN_ERR_BUSOFF, CAN_ERR_CNT, CAN_ERR_CRTL, CAN_ERR_RESTARTED, ControllerProblems};

use crate::can::bus::{BusStatus, ErrorState};

/// Transmit error counter at which a controller is bus-off; error frames have no room for more than 255.
const BUS_OFF_TEC: u16 = 256;

/// What is known of one port.
#[derive(Debug)]
pub(super) struct Confinement(BusStatus);

impl Default for Confinement {
    fn default() -> Self {
        Self(BusStatus { state: ErrorState::Active, tec: 0, rec: 0 })
    }
}

impl Confinement {
    pub(super) fn status(&self) -> BusStatus {
        self.0
    }

    /// Takes an error frame; how many frames the controller lost as far as it tells.
    pub(super) fn take(&mut self, classes: u32, data: &[u8]) -> u64 {
        let has = |class| classes & class != 0;
        let [_, problems, _, _, _, _, tec, rec] = *data else { return 0 };
        let problems = ControllerProblems::from_bits_truncate(problems);
        if has(CAN_ERR_RESTARTED) {
            *self = Self::default();
        }
        if has(CAN_ERR_CNT) {
            (self.0.tec, self.0.rec) = (u16::from(tec), u16::from(rec));
        }
        if has(CAN_ERR_CRTL) {
            self.0.state = state_after(self.0.state, problems);
        }
        if has(CAN_ERR_BUSOFF) {
            (self.0.state, self.0.tec) = (ErrorState::BusOff, BUS_OFF_TEC);
        }
        u64::from(has(CAN_ERR_CRTL) && problems.contains(ControllerProblems::RX_OVERFLOW))
    }
}

/// A warning is no state of ISO 11898-1: below passive a controller is active.
fn state_after(before: ErrorState, problems: ControllerProblems) -> ErrorState {
    let passive = ControllerProblems::RX_PASSIVE | ControllerProblems::TX_PASSIVE;
    let active = ControllerProblems::ACTIVE | ControllerProblems::RX_WARNING | ControllerProblems::TX_WARNING;
    if problems.intersects(passive) {
        ErrorState::Passive
    } else if problems.intersects(active) {
        ErrorState::Active
    } else {
        before
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TX_PASSIVE: u8 = ControllerProblems::TX_PASSIVE.bits();
    const TX_WARNING: u8 = ControllerProblems::TX_WARNING.bits();
    const ACTIVE: u8 = ControllerProblems::ACTIVE.bits();

    #[test]
    fn a_port_goes_through_warning_passive_bus_off_and_restart_as_the_driver_tells() {
        let mut confinement = Confinement::default();
        let table = [
            (CAN_ERR_CRTL | CAN_ERR_CNT, [0, TX_WARNING, 0, 0, 0, 0, 96, 0], ErrorState::Active, 96, 0),
            (CAN_ERR_CRTL | CAN_ERR_CNT, [0, TX_PASSIVE, 0, 0, 0, 0, 128, 7], ErrorState::Passive, 128, 7),
            (CAN_ERR_CNT, [0, 0, 0, 0, 0, 0, 248, 7], ErrorState::Passive, 248, 7),
            (CAN_ERR_BUSOFF, [0; 8], ErrorState::BusOff, 256, 7),
            (CAN_ERR_RESTARTED, [0; 8], ErrorState::Active, 0, 0),
            (CAN_ERR_CRTL, [0, TX_PASSIVE, 0, 0, 0, 0, 0, 0], ErrorState::Passive, 0, 0),
            (CAN_ERR_CRTL, [0, ACTIVE, 0, 0, 0, 0, 0, 0], ErrorState::Active, 0, 0),
        ];
        for (classes, data, state, tec, rec) in table {
            assert_eq!(confinement.take(classes, &data), 0);
            assert_eq!(confinement.status(), BusStatus { state, tec, rec }, "{classes:x} {data:?}");
        }
    }

    #[test]
    fn a_controller_that_lost_frames_changes_no_state_and_tells_of_one() {
        let mut confinement = Confinement::default();
        let data = [0, ControllerProblems::RX_OVERFLOW.bits(), 0, 0, 0, 0, 0, 0];
        assert_eq!(confinement.take(CAN_ERR_CRTL, &data), 1);
        assert_eq!(confinement.status().state, ErrorState::Active);
    }
}
