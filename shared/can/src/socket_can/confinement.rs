//! Fault confinement from the driver's error frames.
//!
//! Layout of an error frame: `linux/can/error.h`. Most drivers report every change of state; newer ones also report both
//! counters.

use socketcan::errors::{
    CAN_ERR_ACK, CAN_ERR_BUSERROR, CAN_ERR_BUSOFF, CAN_ERR_CNT, CAN_ERR_CRTL, CAN_ERR_PROT,
    CAN_ERR_RESTARTED, ControllerProblems,
};

use crate::bus::{BusStatus, ErrorState, ReceiveError};
use crate::error_frame::ErrorKind;

/// Transmit error counter at which a controller is bus-off; error frames have no room for more than 255.
const BUS_OFF_TEC: u16 = 256;

/// The last known state of one port.
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

    /// Takes an error frame: a change of state, otherwise an error on the wire; `None` for anything else.
    ///
    /// # Errors
    /// [`ReceiveError::Overrun`] where the controller lost frames; it does not count them.
    pub(super) fn take(&mut self, classes: u32, data: &[u8]) -> Result<Option<ErrorKind>, ReceiveError> {
        let has = |class| classes & class != 0;
        let before = self.0.state;
        let [_, problems, _, _, _, _, tec, rec] = *data else { return Ok(None) };
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
        if has(CAN_ERR_CRTL) && problems.contains(ControllerProblems::RX_OVERFLOW) {
            return Err(ReceiveError::Overrun { lost: 1 });
        }
        Ok(match self.0.state {
            state if state != before => Some(ErrorKind::State(state)),
            _ if has(CAN_ERR_ACK) => Some(ErrorKind::Acknowledge),
            _ if has(CAN_ERR_PROT | CAN_ERR_BUSERROR) => Some(ErrorKind::Bit),
            _ => None,
        })
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
    use socketcan::errors::CAN_ERR_LOSTARB;

    use super::*;

    const TX_PASSIVE: u8 = ControllerProblems::TX_PASSIVE.bits();
    const TX_WARNING: u8 = ControllerProblems::TX_WARNING.bits();
    const ACTIVE: u8 = ControllerProblems::ACTIVE.bits();

    #[test]
    fn a_port_goes_through_warning_passive_bus_off_and_restart_as_the_driver_reports() {
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
            let before = confinement.status().state;
            let kind = (state != before).then_some(ErrorKind::State(state));
            assert_eq!(confinement.take(classes, &data), Ok(kind));
            assert_eq!(confinement.status(), BusStatus { state, tec, rec }, "{classes:x} {data:?}");
        }
    }

    #[test]
    fn a_controller_that_lost_frames_changes_no_state_and_reports_one() {
        let mut confinement = Confinement::default();
        let data = [0, ControllerProblems::RX_OVERFLOW.bits(), 0, 0, 0, 0, 0, 0];
        assert_eq!(confinement.take(CAN_ERR_CRTL, &data), Err(ReceiveError::Overrun { lost: 1 }));
        assert_eq!(confinement.status().state, ErrorState::Active);
    }

    #[test]
    fn an_error_on_the_wire_is_reported_unless_it_changes_the_state() {
        let passive = [0, TX_PASSIVE, 0, 0, 0, 0, 128, 0];
        let table = [
            (CAN_ERR_PROT | CAN_ERR_BUSERROR, [0; 8], Some(ErrorKind::Bit)),
            (CAN_ERR_ACK | CAN_ERR_BUSERROR, [0; 8], Some(ErrorKind::Acknowledge)),
            (CAN_ERR_LOSTARB, [0; 8], None),
            (CAN_ERR_ACK | CAN_ERR_CRTL, passive, Some(ErrorKind::State(ErrorState::Passive))),
            (CAN_ERR_ACK | CAN_ERR_CRTL, passive, Some(ErrorKind::Acknowledge)),
        ];
        let mut confinement = Confinement::default();
        for (classes, data, kind) in table {
            assert_eq!(confinement.take(classes, &data), Ok(kind), "{classes:x}");
        }
    }
}
