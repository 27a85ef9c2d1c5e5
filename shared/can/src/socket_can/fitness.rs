//! Whether an interface can carry the traffic of drives: what of its settings and state forbids that, what is risky, and the
//! command that mends each. This module reads and changes no interface.

use super::details::InterfaceDetails;

/// Queueing disciplines that send every frame in its order, or refuse the frame with an error.
const FAITHFUL: [&str; 5] = ["pfifo_fast", "pfifo", "bfifo", "noqueue", "mq"];
/// Longest useful queue, in cycles.
const LONGEST_CYCLES: u32 = 10;
/// The advised length of a queue, frames.
const QUEUE_LENGTH: u32 = 50;
/// Its controller's automatic restart has crashed kernels.
const CRASHES: &str = "mcp251xfd";

/// What drives need of their interface.
#[derive(Debug, Clone, Copy)]
pub struct InterfaceNeeds {
    /// Bit rate, bit/s.
    pub bitrate_bps: u32,
    /// Most frames that this node sends in a cycle.
    pub frames: u32,
}

/// Why nothing may be sent over an interface.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum InterfaceFault {
    /// It is down.
    #[error("is down; '{0}' brings it up")]
    Down(String),
    /// A control mode in which drives cannot be controlled.
    #[error("is in the mode {mode}: {effect}; {}", in_mode(.interface, .mode, "off"))]
    Mode {
        /// The interface.
        interface: String,
        /// The mode as `ip` names it.
        mode: &'static str,
        /// What the mode does.
        effect: &'static str,
    },
    /// Another bit rate than that of the scenario.
    #[error(
        "has {found_bps} bit/s, can.bitrate_bps is {wanted_bps}; 'ip link set {interface} down' and '{command}' change it"
    )]
    Bitrate {
        /// The interface.
        interface: String,
        /// Its bit rate, bit/s.
        found_bps: u32,
        /// That of the scenario, bit/s.
        wanted_bps: u32,
        /// The command that brings the interface up with it.
        command: String,
    },
    /// It is off the bus until somebody restarts it.
    #[error(
        "is bus-off and restart-ms is 0; check bit rate, termination and wiring, then 'ip link set {0} type can restart'"
    )]
    BusOff(String),
    /// It is up, and its controller does not run.
    #[error(
        "is {state}; 'ip link set {interface} down' and 'ip link set {interface} up' start its controller"
    )]
    Asleep {
        /// The interface.
        interface: String,
        /// State of its controller.
        state: &'static str,
    },
}

/// What may go wrong on an interface.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum InterfaceDoubt {
    /// The driver reports no bit rate.
    #[error("reports no bit rate; make sure that it has {0} bit/s, that of can.bitrate_bps")]
    NoBitrate(u32),
    /// Many errors, or nobody who acknowledges.
    #[error("is error passive; check bit rate, termination and wiring, and that the drives have power")]
    Passive,
    /// It is off the bus, and restarts by itself.
    #[error("is bus-off and restarts within {0} ms; check bit rate, termination and wiring")]
    BusOff(u32),
    /// Its controller counts errors.
    #[error(
        "has the error counters {sent} for sending and {received} for receiving; check termination and wiring"
    )]
    Errors {
        /// Counter for sending.
        sent: u16,
        /// Counter for receiving.
        received: u16,
    },
    /// Frames count as sent without an acknowledgement.
    #[error("is in the mode presume-ack: frames count as sent that no node has; {}", in_mode(.0, "presume-ack", "off"))]
    PresumesAcknowledgement(String),
    /// It stays off after bus-off.
    #[error(
        "has restart-ms 0: after bus-off it stays off until 'ip link set {0} type can restart'; 'ip link set {0} down', 'ip \
         link set {0} type can restart-ms 100' and 'ip link set {0} up' let it restart by itself"
    )]
    NeverRestarts(String),
    /// The automatic restart of this driver has crashed kernels.
    #[error(
        "has restart-ms {restart_ms} with the driver {CRASHES}, whose automatic restart has crashed kernels (raspberrypi/linux \
         #6916); {}", in_mode(.interface, "restart-ms", "0")
    )]
    RestartCrashes {
        /// The interface.
        interface: String,
        /// Time to the restart, ms.
        restart_ms: u32,
    },
    /// A queueing discipline that may drop frames without an error, or change their order.
    #[error(
        "has the queueing discipline {found}, which may drop, delay or reorder frames without an error; expected is pfifo_fast: \
         'tc qdisc replace dev {interface} root pfifo_fast'"
    )]
    Queueing {
        /// The interface.
        interface: String,
        /// Its discipline.
        found: String,
    },
    /// A queue that has no room for the frames of a cycle.
    #[error(
        "has txqueuelen {found}, and a cycle has up to {frames} frames: others are refused (ENOBUFS); 'ip link set {interface} \
         txqueuelen {QUEUE_LENGTH}'"
    )]
    ShortQueue {
        /// The interface.
        interface: String,
        /// Frames that its queue holds.
        found: u32,
        /// Most frames of a cycle.
        frames: u32,
    },
    /// A queue that holds the frames of many cycles.
    #[error(
        "has txqueuelen {found}: after a hang it sends the old frames of many cycles; 'ip link set {interface} txqueuelen \
         {QUEUE_LENGTH}'"
    )]
    LongQueue {
        /// The interface.
        interface: String,
        /// Frames that its queue holds.
        found: u32,
    },
}

/// The command that brings an interface up. Only a controller of hardware has a bit rate, and only a driver whose restart
/// crashes no kernel is told to restart by itself.
pub fn bring_up_command(interface: &str, driver: Option<&str>, bitrate_bps: Option<u32>) -> String {
    let restart = if driver == Some(CRASHES) { "" } else { " restart-ms 100" };
    let controller = bitrate_bps.map_or_else(String::new, |bps| format!(" type can bitrate {bps}{restart}"));
    format!("ip link set {interface} up txqueuelen {QUEUE_LENGTH}{controller}")
}

/// The commands that change a setting of a controller, for which the interface must be down.
fn in_mode(interface: &str, setting: &str, value: &str) -> String {
    format!(
        "'ip link set {interface} down', 'ip link set {interface} type can {setting} {value}' and 'ip link set {interface} \
         up' change it"
    )
}

/// Judges an interface. The sentences begin behind its name.
pub fn judge(
    interface: &str,
    details: &InterfaceDetails,
    needs: InterfaceNeeds,
) -> (Vec<InterfaceFault>, Vec<InterfaceDoubt>) {
    let bitrate_bps = Some(needs.bitrate_bps).filter(|_| !details.is_virtual);
    let command = || bring_up_command(interface, details.driver.as_deref(), bitrate_bps);
    if !details.is_up {
        return (vec![InterfaceFault::Down(command())], Vec::new());
    }
    if details.is_virtual {
        return Default::default();
    }
    let mut faults = faults(interface, details);
    if let Some(found_bps) = details.bitrate_bps.filter(|&bps| bps != needs.bitrate_bps) {
        let (interface, wanted_bps, command) = (interface.to_owned(), needs.bitrate_bps, command());
        faults.push(InterfaceFault::Bitrate { interface, found_bps, wanted_bps, command });
    }
    (faults, doubts(interface, details, needs))
}

fn faults(interface: &str, details: &InterfaceDetails) -> Vec<InterfaceFault> {
    let name = || interface.to_owned();
    let forbidden = [
        ("listen-only", "it sends and acknowledges nothing"),
        ("loopback", "it hears itself, and its frames may not reach the wire"),
        ("one-shot", "a frame that loses arbitration or is disturbed is never sent again"),
    ];
    let modes = forbidden.into_iter().filter(|(mode, _)| details.modes.has(mode));
    let mut faults: Vec<_> =
        modes.map(|(mode, effect)| InterfaceFault::Mode { interface: name(), mode, effect }).collect();
    match details.state {
        Some("bus-off") if details.restart_ms.unwrap_or(0) == 0 => {
            faults.push(InterfaceFault::BusOff(name()));
        }
        Some(state @ ("stopped" | "sleeping")) => {
            faults.push(InterfaceFault::Asleep { interface: name(), state });
        }
        _ => {}
    }
    faults
}

fn doubts(interface: &str, details: &InterfaceDetails, needs: InterfaceNeeds) -> Vec<InterfaceDoubt> {
    use InterfaceDoubt::{
        BusOff, Errors, LongQueue, NeverRestarts, NoBitrate, Passive, PresumesAcknowledgement, Queueing,
        RestartCrashes, ShortQueue,
    };
    let name = || interface.to_owned();
    let is_off = details.state == Some("bus-off");
    let restart_ms = details.restart_ms.filter(|&ms| ms > 0);
    let crashes = details.driver.as_deref() == Some(CRASHES);
    let queue = details.queue_length.filter(|_| details.queueing.as_deref() != Some("noqueue"));
    let frames = needs.frames;
    let unfaithful = details.queueing.as_ref().filter(|found| !FAITHFUL.contains(&found.as_str()));
    [
        details.bitrate_bps.is_none().then_some(NoBitrate(needs.bitrate_bps)),
        (details.state == Some("error passive")).then_some(Passive),
        restart_ms.filter(|_| is_off).map(BusOff),
        details.errors.filter(|errors| *errors != [0, 0]).map(|[sent, received]| Errors { sent, received }),
        details.modes.has("presume-ack").then(|| PresumesAcknowledgement(name())),
        (details.restart_ms == Some(0) && !crashes && !is_off).then(|| NeverRestarts(name())),
        restart_ms.filter(|_| crashes).map(|restart_ms| RestartCrashes { interface: name(), restart_ms }),
        unfaithful.map(|found| Queueing { interface: name(), found: found.clone() }),
        queue.filter(|&found| found < frames).map(|found| ShortQueue { interface: name(), found, frames }),
        queue
            .filter(|&found| found > LONGEST_CYCLES * frames)
            .map(|found| LongQueue { interface: name(), found }),
    ]
    .into_iter()
    .flatten()
    .collect()
}

#[cfg(test)]
mod tests {
    use super::super::details::ControlModes;
    use super::*;

    const NEEDS: InterfaceNeeds = InterfaceNeeds { bitrate_bps: 1_000_000, frames: 9 };

    /// An interface of which nothing is to be said.
    fn good() -> InterfaceDetails {
        InterfaceDetails {
            is_up: true,
            driver: Some("kvaser_pci".to_owned()),
            mtu: Some(16),
            queueing: Some("pfifo_fast".to_owned()),
            queue_length: Some(10),
            bitrate_bps: Some(1_000_000),
            sample_point_permille: Some(750),
            restart_ms: Some(100),
            state: Some("error active"),
            errors: Some([0, 0]),
            ..InterfaceDetails::default()
        }
    }

    fn said(details: &InterfaceDetails) -> (Vec<String>, Vec<String>) {
        let (faults, doubts) = judge("can0", details, NEEDS);
        (
            faults.iter().map(InterfaceFault::to_string).collect(),
            doubts.iter().map(InterfaceDoubt::to_string).collect(),
        )
    }

    #[test]
    fn what_cannot_carry_drives_is_a_fault_with_its_command() {
        assert_eq!(said(&good()), (vec![], vec![]));
        let mode = |bits| InterfaceDetails { modes: ControlModes(bits), ..good() };
        let table = [
            (
                InterfaceDetails { is_up: false, ..good() },
                "'ip link set can0 up txqueuelen 50 type can bitrate 1000000 restart-ms 100'",
            ),
            (
                mode(0b10),
                "listen-only: it sends and acknowledges nothing; 'ip link set can0 down', 'ip link set can0 type can listen-only off'",
            ),
            (mode(0b1), "loopback off"),
            (mode(0b1000), "one-shot off"),
            (
                InterfaceDetails { bitrate_bps: Some(500_000), ..good() },
                "has 500000 bit/s, can.bitrate_bps is 1000000; 'ip link set can0 down' and 'ip link set can0 up txqueuelen 50 \
                 type can bitrate 1000000 restart-ms 100'",
            ),
            (
                InterfaceDetails { state: Some("bus-off"), restart_ms: Some(0), ..good() },
                "'ip link set can0 type can restart'",
            ),
            (InterfaceDetails { state: Some("stopped"), ..good() }, "is stopped"),
        ];
        for (details, words) in table {
            let (faults, _) = said(&details);
            assert!(faults.len() == 1 && faults[0].contains(words), "{words}: {faults:?}");
        }
        assert_eq!(
            said(&mode(0b10100)),
            (vec![], vec![]),
            "triple sampling and reported errors disturb nobody"
        );
    }

    #[test]
    fn what_may_go_wrong_is_a_doubt_with_its_command() {
        let driver = || Some(CRASHES.to_owned());
        let table = [
            (InterfaceDetails { bitrate_bps: None, ..good() }, "make sure that it has 1000000 bit/s"),
            (InterfaceDetails { state: Some("error passive"), ..good() }, "is error passive"),
            (InterfaceDetails { state: Some("bus-off"), ..good() }, "restarts within 100 ms"),
            (InterfaceDetails { errors: Some([0, 3]), ..good() }, "0 for sending and 3 for receiving"),
            (InterfaceDetails { modes: ControlModes(0x40), ..good() }, "presume-ack off"),
            (InterfaceDetails { restart_ms: Some(0), ..good() }, "type can restart-ms 100'"),
            (InterfaceDetails { driver: driver(), ..good() }, "#6916); 'ip link set can0 down'"),
            (
                InterfaceDetails { queueing: Some("fq_codel".to_owned()), ..good() },
                "'tc qdisc replace dev can0 root pfifo_fast'",
            ),
            (InterfaceDetails { queue_length: Some(8), ..good() }, "'ip link set can0 txqueuelen 50'"),
            (InterfaceDetails { queue_length: Some(1000), ..good() }, "the old frames of many cycles"),
        ];
        for (details, words) in table {
            let (faults, doubts) = said(&details);
            assert!(
                faults.is_empty() && doubts.len() == 1 && doubts[0].contains(words),
                "{words}: {doubts:?}"
            );
        }
        let never = InterfaceDetails { driver: driver(), restart_ms: Some(0), ..good() };
        assert_eq!(said(&never), (vec![], vec![]), "no advice to restart where a restart crashes");
    }

    #[test]
    fn a_virtual_interface_needs_only_to_be_up() {
        let of = |is_up| {
            let queueing = Some("noqueue".to_owned());
            said(&InterfaceDetails { is_up, is_virtual: true, queueing, ..InterfaceDetails::default() })
        };
        assert_eq!(of(true), (vec![], vec![]));
        assert_eq!(of(false).0, ["is down; 'ip link set can0 up txqueuelen 50' brings it up"]);
    }
}
