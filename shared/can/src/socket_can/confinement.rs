//! Fault confinement of a port on a real wire, by the error frames of its driver (`linux/can/error.h`).

use libc::{
    CAN_ERR_ACK, CAN_ERR_BUSERROR, CAN_ERR_BUSOFF, CAN_ERR_CNT, CAN_ERR_CRTL, CAN_ERR_PROT, CAN_ERR_RESTARTED,
};
use socketcan::errors::ControllerProblems;

use crate::{BusStatus, ErrorKind, ErrorState, ReceiveError};

/// Traffic so long after bus-off proves a restart that no error frame reported: frames received before are over, ns.
const RESTARTED_NS: u64 = 100_000_000;
/// Transmit error counter at which a controller is bus-off; error frames have no room for more than 255.
const BUS_OFF_TEC: u16 = 256;
const PASSIVE: ControllerProblems = ControllerProblems::RX_PASSIVE.union(ControllerProblems::TX_PASSIVE);
/// A warning is no state of ISO 11898-1: below passive a controller is active.
const ACTIVE: ControllerProblems =
    ControllerProblems::ACTIVE.union(ControllerProblems::RX_WARNING).union(ControllerProblems::TX_WARNING);
/// Status of a port until the first error frame.
pub(super) const UNDISTURBED: BusStatus = BusStatus { state: ErrorState::Active, tec: 0, rec: 0 };

/// Ends bus-off by a frame that arrives so long after it, since a controller in bus-off receives nothing.
pub(super) fn apply_traffic(status: &mut BusStatus, after_ns: u64) {
    if status.state == ErrorState::BusOff && after_ns >= RESTARTED_NS {
        *status = UNDISTURBED;
    }
}

/// Changes a port's status by an error frame of its driver (`linux/can/error.h`). Most drivers report every change of
/// state; newer drivers also report both counters. Returns a change of state, otherwise an error on the wire; `None`
/// for anything else.
///
/// # Errors
/// [`ReceiveError::Overrun`] for frames lost in the controller, without their number.
pub(super) fn apply_error(
    status: &mut BusStatus,
    classes: u32,
    data: &[u8],
) -> Result<Option<ErrorKind>, ReceiveError> {
    let has = |class| classes & class != 0;
    let before = status.state;
    let [_, problems, _, _, _, _, tec, rec] = *data else { return Ok(None) };
    let problems = ControllerProblems::from_bits_truncate(problems);
    if has(CAN_ERR_RESTARTED) {
        *status = UNDISTURBED;
    }
    if has(CAN_ERR_CNT) {
        (status.tec, status.rec) = (u16::from(tec), u16::from(rec));
    }
    let is_off = status.state == ErrorState::BusOff;
    if has(CAN_ERR_CRTL) && problems.contains(ControllerProblems::ACTIVE) && is_off {
        *status = UNDISTURBED;
    } else if has(CAN_ERR_CRTL) && problems.intersects(PASSIVE) && !is_off {
        status.state = ErrorState::Passive;
    } else if has(CAN_ERR_CRTL) && problems.intersects(ACTIVE) && !is_off {
        status.state = ErrorState::Active;
    }
    if has(CAN_ERR_BUSOFF) {
        (status.state, status.tec) = (ErrorState::BusOff, BUS_OFF_TEC);
    }
    if has(CAN_ERR_CRTL) && problems.contains(ControllerProblems::RX_OVERFLOW) {
        return Err(ReceiveError::Overrun { lost: 1 });
    }
    Ok(match status.state {
        state if state != before => Some(ErrorKind::State(state)),
        _ if has(CAN_ERR_ACK) => Some(ErrorKind::Acknowledge),
        _ if has(CAN_ERR_PROT | CAN_ERR_BUSERROR) => Some(ErrorKind::Bit),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use socketcan::errors::CAN_ERR_LOSTARB;

    use super::*;

    const TX_PASSIVE: u8 = ControllerProblems::TX_PASSIVE.bits();
    const TX_WARNING: u8 = ControllerProblems::TX_WARNING.bits();
    const BACK: u8 = ControllerProblems::ACTIVE.bits();

    #[test]
    fn a_port_goes_through_warning_passive_bus_off_and_restart_as_the_driver_reports() {
        let mut port = UNDISTURBED;
        let table = [
            (CAN_ERR_CRTL | CAN_ERR_CNT, [0, TX_WARNING, 0, 0, 0, 0, 96, 0], ErrorState::Active, 96, 0),
            (CAN_ERR_CRTL | CAN_ERR_CNT, [0, TX_PASSIVE, 0, 0, 0, 0, 128, 7], ErrorState::Passive, 128, 7),
            (CAN_ERR_CNT, [0, 0, 0, 0, 0, 0, 248, 7], ErrorState::Passive, 248, 7),
            (CAN_ERR_BUSOFF, [0; 8], ErrorState::BusOff, 256, 7),
            (CAN_ERR_CRTL, [0, TX_WARNING, 0, 0, 0, 0, 0, 0], ErrorState::BusOff, 256, 7),
            (CAN_ERR_CRTL, [0, TX_PASSIVE, 0, 0, 0, 0, 0, 0], ErrorState::BusOff, 256, 7),
            (CAN_ERR_CRTL, [0, BACK, 0, 0, 0, 0, 0, 0], ErrorState::Active, 0, 0),
            (CAN_ERR_BUSOFF, [0; 8], ErrorState::BusOff, 256, 0),
            (CAN_ERR_RESTARTED, [0; 8], ErrorState::Active, 0, 0),
            (CAN_ERR_CRTL, [0, TX_PASSIVE, 0, 0, 0, 0, 0, 0], ErrorState::Passive, 0, 0),
            (CAN_ERR_CRTL, [0, BACK, 0, 0, 0, 0, 0, 0], ErrorState::Active, 0, 0),
        ];
        for (classes, data, state, tec, rec) in table {
            let before = port.state;
            let kind = (state != before).then_some(ErrorKind::State(state));
            assert_eq!(apply_error(&mut port, classes, &data), Ok(kind));
            assert_eq!(port, BusStatus { state, tec, rec }, "{classes:x} {data:?}");
        }
    }

    #[test]
    fn traffic_well_after_bus_off_proves_a_restart_that_no_error_frame_reported() {
        let off = BusStatus { state: ErrorState::BusOff, tec: BUS_OFF_TEC, rec: 3 };
        for (after_ns, is_over) in [(0, false), (RESTARTED_NS - 1, false), (RESTARTED_NS, true)] {
            let mut port = off;
            apply_traffic(&mut port, after_ns);
            assert_eq!(port, if is_over { UNDISTURBED } else { off }, "{after_ns}");
        }
        let passive = BusStatus { state: ErrorState::Passive, ..off };
        let mut port = passive;
        apply_traffic(&mut port, u64::MAX);
        assert_eq!(port, passive);
    }

    #[test]
    fn a_controller_that_lost_frames_changes_no_state_and_reports_one() {
        let mut port = UNDISTURBED;
        let data = [0, ControllerProblems::RX_OVERFLOW.bits(), 0, 0, 0, 0, 0, 0];
        assert_eq!(apply_error(&mut port, CAN_ERR_CRTL, &data), Err(ReceiveError::Overrun { lost: 1 }));
        assert_eq!(port.state, ErrorState::Active);
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
        let mut port = UNDISTURBED;
        for (classes, data, kind) in table {
            assert_eq!(apply_error(&mut port, classes, &data), Ok(kind), "{classes:x}");
        }
    }
}
