//! Sentences for events: place, fault and remedy.

use masseter_model::geometry::AXIS_NAMES;
use masseter_scenario::wording::counted;

use super::Event;
use super::codes::{Cause, EventKind, NoPose, Source};
use masseter_can::canopen::{AbortCode, EmergencyCode, ObjectAddress};
use masseter_can::cia402::{DriveState, Statusword};
use masseter_can::explain_errno;

/// The sentence for an event with a node, a bus, an object, or the reason for a missing pose; `None` for other events.
/// A bus also has the name of its interface, if it is among these.
pub fn explain(event: &Event, interfaces: &[String]) -> Option<String> {
    let cause = Cause::try_from(event.cause).ok().filter(|_| event.kind != EventKind::Transition.code())?;
    let interface = interfaces.get(usize::from(event.bus)).map(String::as_str);
    let words = words_of_start(cause, event).or_else(|| words_of_run(cause, event, interface))?;
    Some(format!("{}: {words}", place_of(event, interface)))
}

fn place_of(event: &Event, interface: Option<&str>) -> String {
    let Event { node, bus, .. } = event;
    let bus = interface.map_or_else(|| bus.to_string(), |name| format!("{bus}, {name}"));
    match (AXIS_NAMES.get(event.axis as usize), node) {
        _ if event.cause == Cause::LawFailed.code() => "the pose law".to_owned(),
        _ if [Cause::ForceLimit, Cause::WrongStiffness].map(Cause::code).contains(&event.cause) => {
            "the bite".to_owned()
        }
        _ if event.cause == Cause::MotionLate.code() => "the motion".to_owned(),
        _ if event.cause == Cause::FoodBroke.code() => format!("tooth {}", event.object),
        (None, 0) if event.source == Source::Controller.code() => "the mechanism".to_owned(),
        (Some(axis), 1..) => format!("axis {axis} (node {node} on bus {bus})"),
        (Some(axis), 0) => format!("axis {axis}"),
        (None, 1..) => format!("node {node} on bus {bus}"),
        (None, 0) => format!("bus {bus}"),
    }
}

/// The cycle of the interpolation (CiA 402).
const INTERPOLATION_TIME: u16 = 0x60C2;

/// The meaning of value, limit and object by the cause, with the remedy, for the start and the power of a drive.
fn words_of_start(cause: Cause, event: &Event) -> Option<String> {
    let object = ObjectAddress::new((event.object >> 8) as u16, event.object as u8);
    let (value, limit) = (event.value as u32, event.limit as u32);
    let (power, fault) = (|| power_words(value, limit), || fault_words(value, limit));
    let expected = |remedy: &str| format!("object {object} is {value:08X}h, expected {limit:08X}h; {remedy}");
    Some(match cause {
        Cause::WrongIdentity => {
            expected("connect the drive that is configured, or correct drive_profile.identity")
        }
        Cause::WrongPdo => expected("give the drive the rig's PDO mapping and store it"),
        Cause::NotAccepted => expected("check whether the drive supports cyclic synchronous position"),
        Cause::HomeOffset => expected("home the drive, or correct drive_profile.homing.home_position_m"),
        Cause::WrongObject => expected("configure the drive, or correct drive_profile.objects"),
        Cause::WrongUnit => expected("correct drive_profile.units, or the unit in the drive"),
        Cause::NotKept => format!(
            "object {object} was written as {limit:08X}h and acknowledged, and reads {value:08X}h; look up when the drive \
             takes this object; its rule in drive_profile.objects says whether the rig writes it"
        ),
        Cause::SdoAborted => {
            let remedy = match object.index {
                INTERPOLATION_TIME => {
                    "the drive counts its cycle in a unit of its own: choose rate_hz so that the cycle is whole in it, and \
                     declare the unit in drive_profile.objects.'60C2h:02'"
                }
                _ => "look the object up in the drive's manual",
            };
            format!("object {object}: {}; {remedy}", AbortCode(value))
        }
        Cause::SdoTimeout => format!(
            "object {object}: no answer for {value} ms, the request was repeated every {limit} ms; check power, wiring and \
             bit rate of this drive"
        ),
        Cause::DuplicateNode => {
            let more = if value == 0 {
                "more answers than SDO requests"
            } else {
                "different process data after one SYNC"
            };
            format!(
                "{more}, again and again; give every node an id of its own, and let no other client use SDO meanwhile"
            )
        }
        Cause::NodeRestarted => {
            "booted although the master did not reset it; check its power supply".to_owned()
        }
        Cause::FaultAtStart => format!(
            "in fault, and a fault reset does not help; {}; remove the cause of the drive's error code, then switch the \
             drive off and on",
            fault()
        ),
        Cause::FaultFound => format!(
            "was found in fault; {}; remove the cause of the error code, then reset the drive, or run with --reset-faults \
             (can.reset_faults = true)",
            fault()
        ),
        Cause::FaultReset => format!("was found in fault, which was reset; {}", fault()),
        Cause::WaitsForDrive => format!("the other drives wait for this one: {}", power()),
        Cause::NotReady => format!(
            "not ready to switch on within can.ready_timeout_ms: {}; release the emergency stop and check the drive's \
             supply; --wait-ready 60s waits longer",
            power()
        ),
        Cause::NotEnabled => format!(
            "not enabled within can.enable_timeout_ms, so all drives are switched off: {}; check its supply and its brake; \
             raise can.enable_timeout_ms if its brake opens late",
            power()
        ),
        Cause::StartTooFar => format!(
            "the jaw is {} from the first pose of the motion, limit {}; bring the jaw closer, begin the \
             motion where the jaw is, or raise controller.start_tolerance_mm",
            millimetres(event.value),
            millimetres(event.limit)
        ),
        _ => return None,
    })
}

/// The meaning of value, limit and object by the cause, with the remedy, for buses and mechanism.
fn words_of_run(cause: Cause, event: &Event, interface: Option<&str>) -> Option<String> {
    let (value, limit) = (event.value as u32, event.limit as u32);
    Some(match cause {
        Cause::FoodBroke => format!("the food broke at {:.0} N", event.value),
        Cause::EndStopHit => format!("ran into its end stop at {:.1} mm/s", event.value.abs() * 1e3),
        Cause::StillPowered => format!(
            "was left switched on, and a quick stop does not switch it off; statusword {value:04X}h; stop the other program \
             that controls the drive, then switch its power off and on"
        ),
        Cause::BootTimeout => format!(
            "not operational after {value} ms; check power, wiring, bit rate and node id of this drive"
        ),
        Cause::HeartbeatLost => format!("silent for {value} ms"),
        Cause::ProcessDataLost => format!("process data missing for {}", counted(value.into(), "cycle")),
        Cause::FollowingError => format!(
            "{} from where its targets should have taken it, limit {}; check its wiring, its load, and \
             controller.lead_cycles if it smooths its targets",
            millimetres(event.value),
            millimetres(event.limit)
        ),
        Cause::MotionLate => format!(
            "late by {:.1} ms, limit {:.1} ms, since frames of the drives or commands were lost or late; check wiring and \
             bit rate, or raise checks.motion_lag_ms",
            event.value * 1e3,
            event.limit * 1e3
        ),
        Cause::NodeStopped => format!(
            "left the NMT state operational without a command of the master; now in state {value}; read the drive's own \
             emergency message, if there is one, and find the node that sends NMT commands"
        ),
        Cause::Emergency if value == 0 => "all errors gone (EMCY 0000h)".to_owned(),
        Cause::Emergency => {
            format!("EMCY {}, error register {limit:02X}h", EmergencyCode(event.value as u16))
        }
        Cause::BusOff => format!(
            "off after too many errors (transmit error counter {value}); check bit rate, termination and wiring"
        ),
        Cause::BusRefused if value != 0 => {
            explain_errno(interface.unwrap_or("the interface"), event.value as i32)
        }
        Cause::BusRefused => {
            "a frame could not be sent; check that the interface is up and that another node acknowledges"
                .to_owned()
        }
        Cause::WrongLength => format!(
            "frame {:03X}h has {}, expected {limit}; find the other sender of this identifier, and check the mapping of the \
             PDO",
            event.object,
            counted(value.into(), "data byte")
        ),
        Cause::UnknownNode => {
            "a node that no axis is configured with; check can.buses and can.node_ids".to_owned()
        }
        Cause::SecondMaster => {
            "another node sends SYNC or NMT, or has the master's id; use one master only: stop the other, \
             or give that node another id"
                .to_owned()
        }
        Cause::LawFailed => {
            let what = match (event.value, event.limit > 0.0) {
                (length, true) => format!("gave no pose: its quaternion has the length {length}, not 1"),
                (0.0, false) => "failed".to_owned(),
                (place_m, false) => format!("gave no pose: its position contains {place_m}"),
            };
            what + "; see the message of your controller"
        }
        Cause::ForceLimit => format!(
            "{value:.1} N, limit {limit:.1} N; close more slowly, state the stiffness of food and teeth in [force_control], \
             or raise its overload"
        ),
        Cause::WrongStiffness => format!(
            "shows {:.0} N/m, but stated are {:.0} N/m: {}; state the stiffness of food and teeth in [force_control], with a \
             damping for it",
            event.value,
            event.limit,
            if event.value > event.limit {
                "the damping grows"
            } else {
                "it follows more slowly than it could"
            }
        ),
        Cause::ForwardKinematics => format!(
            "{}; compare what the encoders count with the rig, and the rig with the scenario's [mechanism]",
            no_pose(NoPose::try_from(event.object).ok()?)
        ),
        Cause::InverseKinematics => format!(
            "{}; check the motion, and the scenario's [mechanism]",
            no_pose(NoPose::try_from(event.object).ok()?)
        ),
        _ => return None,
    })
}

fn millimetres(m: f64) -> String {
    format!("{:.3} mm", m * 1e3)
}

/// Error code and state of a drive in fault.
fn fault_words(code: u32, statusword: u32) -> String {
    format!("error code {}, statusword {statusword:04X}h", EmergencyCode(code as u16))
}

/// State of a drive that is not enabled, with its emergency code if reported.
fn power_words(statusword: u32, code: u32) -> String {
    let state = Statusword(statusword as u16).state();
    let name = state.map_or_else(|_| "unknown state".to_owned(), |state| state.name().replace('_', " "));
    let guess = if state == Ok(DriveState::SwitchOnDisabled) { "; safe torque off?" } else { "" };
    let code = EmergencyCode(code as u16);
    let reported = if code == EmergencyCode::RESET { String::new() } else { format!(", EMCY {code}") };
    format!("{name} ({statusword:04X}h){reported}{guess}")
}

const fn no_pose(reason: NoPose) -> &'static str {
    match reason {
        NoPose::NotFinite => "a coordinate is no finite number",
        NoPose::NoLength => "the leg has no length",
        NoPose::Unassemblable => "cannot be assembled with the positions that were read",
        NoPose::WrongAssembly => "can only be assembled folded over with the positions that were read",
        NoPose::Ambiguous => {
            "the positions that were read fit several poses, and the last pose does not settle which"
        }
        NoPose::Undecided => "the positions that were read fit poses that cannot be distinguished",
        NoPose::NotFound => "is singular with the positions that were read",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codes::NO_AXIS;

    fn event(cause: Cause) -> Event {
        Event {
            kind: EventKind::Fault.code(),
            cause: cause.code(),
            axis: 3,
            node: 4,
            bus: 1,
            ..Event::default()
        }
    }

    #[test]
    fn sentences_for_faults_name_place_fault_and_remedy() {
        let (value, limit) = (f64::from(0x6041_0010), f64::from(0x6040_0010));
        let pdo = Event { object: 0x16_0001, value, limit, ..event(Cause::WrongPdo) };
        assert_eq!(
            explain(&pdo, &[]).unwrap(),
            "axis l1 (node 4 on bus 1): object 1600h:01h is 60410010h, expected 60400010h; give the drive the \
             rig's PDO mapping and store it"
        );
        let value = f64::from(AbortCode::READ_ONLY.0);
        let refused = Event { object: 0x10_1700, value, ..event(Cause::SdoAborted) };
        assert!(
            explain(&refused, &[]).unwrap().contains("object 1017h:00h: 06010002h (object is read-only)")
        );
        let cycle = explain(&Event { object: 0x60_C202, ..refused }, &[]).unwrap();
        assert!(cycle.contains("choose rate_hz so that the cycle is whole in it"), "{cycle}");
        let off = Event { axis: NO_AXIS, node: 0, value: 256.0, ..event(Cause::BusOff) };
        assert!(explain(&off, &[]).unwrap().starts_with("bus 1: off after"));
        let gone = Event { value: 6.0, ..Event { cause: Cause::BusRefused.code(), ..off } };
        assert_eq!(
            explain(&gone, &["can0".to_owned(), "can1".to_owned()]).unwrap(),
            "bus 1, can1: No such device or address (os error 6); can1 is gone: plug its adapter in, bring can1 up again, then \
             start anew"
        );
    }

    #[test]
    fn what_keeps_drives_off_is_said_with_state_code_and_remedy() {
        let at = |cause, value: u16, limit: u16| {
            explain(&Event { value: value.into(), limit: limit.into(), ..event(cause) }, &[]).unwrap()
        };
        assert_eq!(
            at(Cause::FaultFound, 0x8611, 0x0218),
            "axis l1 (node 4 on bus 1): was found in fault; error code 8611h (following error), statusword 0218h; \
             remove the cause of the error code, then reset the drive, or run with --reset-faults \
             (can.reset_faults = true)"
        );
        assert_eq!(
            at(Cause::WaitsForDrive, 0x0250, 0),
            "axis l1 (node 4 on bus 1): the other drives wait for this one: switch on disabled (0250h); safe torque off?"
        );
        assert!(
            at(Cause::NotEnabled, 0x0233, 0x5112)
                .contains("switched on (0233h), EMCY 5112h (logic supply too low);")
        );
    }

    #[test]
    fn a_late_motion_says_by_how_much_and_what_to_check() {
        let late = Event { value: 0.021, limit: 0.02, axis: NO_AXIS, ..event(Cause::MotionLate) };
        let said = explain(&late, &[]).unwrap();
        assert!(said.starts_with("the motion: late by 21.0 ms, limit 20.0 ms, since frames"), "{said}");
    }

    #[test]
    fn kinematics_without_a_pose_says_why() {
        let stopped = |cause: Cause, axis: u32, reason: NoPose| {
            let (source, object) = (Source::Controller.code(), reason.code());
            explain(&Event { source, axis, object, node: 0, bus: 0, ..event(cause) }, &[]).unwrap()
        };
        assert_eq!(
            stopped(Cause::ForwardKinematics, NO_AXIS, NoPose::Unassemblable),
            "the mechanism: cannot be assembled with the positions that were read; compare what the encoders count \
             with the rig, and the rig with the scenario's [mechanism]"
        );
        let short = stopped(Cause::InverseKinematics, 4, NoPose::NoLength);
        assert!(short.starts_with("axis l2: the leg has no length; check the motion"), "{short}");
    }

    #[test]
    fn what_figures_say_alone_is_left_to_them() {
        assert_eq!(explain(&event(Cause::CommandLost), &[]), None);
        // Older recordings do not have the reason.
        assert_eq!(explain(&event(Cause::ForwardKinematics), &[]), None);
        let moved = Event { kind: EventKind::Transition.code(), ..event(Cause::BootTimeout) };
        assert_eq!(explain(&moved, &[]), None);
    }
}
