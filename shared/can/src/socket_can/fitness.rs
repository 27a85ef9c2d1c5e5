//! Whether an interface can carry the traffic of drives: what of its settings and state forbids that, what is risky, and the
//! command that mends each. This module changes no interface.

use std::io;

use super::details::InterfaceDetails;

/// Queueing disciplines that send every frame in its order, or refuse the frame with an error.
const FAITHFUL: [&str; 5] = ["pfifo_fast", "pfifo", "bfifo", "noqueue", "mq"];
/// Modes in which drives cannot be controlled, and why.
const FORBIDDEN: [(&str, &str); 3] = [
    ("listen-only", "it sends and acknowledges nothing"),
    ("loopback", "it hears itself, and its frames may not reach the wire"),
    ("one-shot", "a frame that loses arbitration or is disturbed is never sent again"),
];
/// Longest useful queue, in cycles.
const LONGEST_CYCLES: u32 = 10;
/// The advised length of a queue, frames.
const QUEUE_LENGTH: u32 = 50;
/// The driver whose automatic restart has crashed kernels.
const CRASHES: &str = "mcp251xfd";

/// What drives need of their interface.
#[derive(Debug, Clone, Copy)]
pub struct InterfaceNeeds {
    /// Bit rate, bit/s.
    pub bitrate_bps: u32,
    /// Most frames that this node sends in a cycle.
    pub frames: u32,
}

/// An interface as the kernel has it, judged by the needs of drives.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct JudgedInterface {
    /// Its name.
    pub name: String,
    /// Its settings and state.
    #[serde(flatten)]
    pub details: InterfaceDetails,
    /// Why nothing may be sent over the interface, each with the command that mends it.
    pub faults: Vec<String>,
    /// What may go wrong, likewise.
    pub doubts: Vec<String>,
}

impl JudgedInterface {
    /// Asks the kernel.
    ///
    /// # Errors
    /// Those of [`InterfaceDetails::read`].
    pub fn read(interface: &str, needs: InterfaceNeeds) -> io::Result<Self> {
        Ok(Self::new(interface, InterfaceDetails::read(interface)?, needs))
    }

    /// An interface with these details.
    pub fn new(interface: &str, details: InterfaceDetails, needs: InterfaceNeeds) -> Self {
        let (mut faults, mut doubts) = (Vec::new(), Vec::new());
        let bitrate_bps = Some(needs.bitrate_bps).filter(|_| !details.is_virtual);
        let bring_up = bring_up_command(interface, details.driver.as_deref(), bitrate_bps);
        if !details.is_up {
            faults.push(format!("{interface} is down; '{bring_up}' brings it up"));
        } else if !details.is_virtual {
            faults = find_faults(interface, &details, needs.bitrate_bps, &bring_up);
            doubts = find_doubts(interface, &details, needs);
        }
        Self { name: interface.to_owned(), details, faults, doubts }
    }
}

/// The command that brings an interface up. Only a controller of hardware has a bit rate, and only a driver whose restart
/// crashes no kernel is told to restart by itself.
pub fn bring_up_command(interface: &str, driver: Option<&str>, bitrate_bps: Option<u32>) -> String {
    let restart = if driver == Some(CRASHES) { "" } else { " restart-ms 100" };
    let controller = bitrate_bps.map_or_else(String::new, |bps| format!(" type can bitrate {bps}{restart}"));
    format!("ip link set {interface} up txqueuelen {QUEUE_LENGTH}{controller}")
}

fn find_faults(name: &str, details: &InterfaceDetails, wanted: u32, bring_up: &str) -> Vec<String> {
    let modes = FORBIDDEN.iter().filter(|(mode, _)| details.modes.contains(mode));
    let modes = modes
        .map(|(mode, why)| format!("{name} is in the mode {mode}: {why}; {}", change(name, mode, "off")));
    let bitrate = details.bitrate_bps.filter(|&found| found != wanted).map(|found| {
        format!(
            "{name} has {found} bit/s, can.bitrate_bps is {wanted}; 'ip link set {name} down' and '{bring_up}' change it"
        )
    });
    let state = details.state.and_then(|state| match state {
        "bus-off" if details.restart_ms.unwrap_or(0) == 0 => Some(format!(
            "{name} is bus-off and restart-ms is 0; check bit rate, termination and wiring, then 'ip link set {name} type can \
             restart'"
        )),
        "stopped" | "sleeping" => Some(format!(
            "{name} is {state}; 'ip link set {name} down' and 'ip link set {name} up' start its controller"
        )),
        _ => None,
    });
    modes.chain(bitrate).chain(state).collect()
}

fn find_doubts(name: &str, details: &InterfaceDetails, needs: InterfaceNeeds) -> Vec<String> {
    let InterfaceNeeds { bitrate_bps: wanted, frames } = needs;
    let InterfaceDetails { state, restart_ms, queueing, errors, .. } = details;
    let mut doubts = Vec::new();
    let mut doubt = |applies: bool, words: String| {
        if applies {
            doubts.push(format!("{name} {words}"));
        }
    };
    let no_bitrate =
        format!("reports no bit rate; make sure that it has {wanted} bit/s, that of can.bitrate_bps");
    doubt(details.bitrate_bps.is_none(), no_bitrate);
    let check = "check bit rate, termination and wiring";
    doubt(
        *state == Some("error passive"),
        format!("is error passive; {check}, and that the drives have power"),
    );
    let [sent, received] = errors.unwrap_or_default();
    let counters = format!("has the error counters {sent} for sending and {received} for receiving; {check}");
    doubt(sent > 0 || received > 0, counters);
    let presumes = change(name, "presume-ack", "off");
    doubt(
        details.modes.contains(&"presume-ack"),
        format!("is in the mode presume-ack: frames count as sent that no node has; {presumes}"),
    );
    let (is_off, crashes) = (*state == Some("bus-off"), details.driver.as_deref() == Some(CRASHES));
    if let Some(ms) = *restart_ms {
        doubt(is_off && ms > 0, format!("is bus-off and restarts within {ms} ms; {check}"));
        let by_itself = change(name, "restart-ms", "100");
        let never = format!(
            "has restart-ms 0: after bus-off it stays off until 'ip link set {name} type can restart'; to let it restart by \
             itself, {by_itself}"
        );
        doubt(ms == 0 && !crashes && !is_off, never);
        let off = change(name, "restart-ms", "0");
        let crash = format!(
            "has restart-ms {ms} with the driver {CRASHES}, whose automatic restart has crashed kernels (raspberrypi/linux \
             #6916); {off}"
        );
        doubt(ms > 0 && crashes, crash);
    }
    let queueing = queueing.as_deref().unwrap_or("noqueue");
    let unfaithful = format!(
        "has the queueing discipline {queueing}, which may drop, delay or reorder frames without an error; expected is \
         pfifo_fast: 'tc qdisc replace dev {name} root pfifo_fast'"
    );
    doubt(!FAITHFUL.contains(&queueing), unfaithful);
    if let Some(found) = details.queue_length.filter(|_| queueing != "noqueue") {
        let mend = format!("'ip link set {name} txqueuelen {QUEUE_LENGTH}'");
        let short = format!(
            "has txqueuelen {found}, and a cycle has up to {frames} frames: others are refused (ENOBUFS); {mend}"
        );
        doubt(found < frames, short);
        let long = format!(
            "has txqueuelen {found}: after a hang, a step of the bring-up sends so many old frames at once; {mend}"
        );
        doubt(found > LONGEST_CYCLES * frames, long);
    }
    doubts
}

/// The commands that change a setting of a controller, for which the interface must be down.
fn change(name: &str, setting: &str, value: &str) -> String {
    let set = format!("ip link set {name}");
    format!("'{set} down', '{set} type can {setting} {value}' and '{set} up' change it")
}

#[cfg(test)]
mod tests {
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
        let judged = JudgedInterface::new("can0", details.clone(), NEEDS);
        (judged.faults, judged.doubts)
    }

    #[test]
    fn what_cannot_carry_drives_is_a_fault_with_its_command() {
        assert_eq!(said(&good()), (vec![], vec![]));
        let modes = |modes: &[_]| InterfaceDetails { modes: modes.to_vec(), ..good() };
        let table = [
            (
                InterfaceDetails { is_up: false, ..good() },
                "'ip link set can0 up txqueuelen 50 type can bitrate 1000000 restart-ms 100'",
            ),
            (
                modes(&["listen-only"]),
                "listen-only: it sends and acknowledges nothing; 'ip link set can0 down', 'ip link set can0 type can listen-only off'",
            ),
            (modes(&["loopback"]), "loopback off"),
            (modes(&["one-shot"]), "one-shot off"),
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
            said(&modes(&["triple-sampling", "berr-reporting"])),
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
            (InterfaceDetails { modes: vec!["presume-ack"], ..good() }, "presume-ack off"),
            (InterfaceDetails { restart_ms: Some(0), ..good() }, "type can restart-ms 100'"),
            (InterfaceDetails { driver: driver(), ..good() }, "#6916); 'ip link set can0 down'"),
            (
                InterfaceDetails { queueing: Some("fq_codel".to_owned()), ..good() },
                "'tc qdisc replace dev can0 root pfifo_fast'",
            ),
            (InterfaceDetails { queue_length: Some(8), ..good() }, "'ip link set can0 txqueuelen 50'"),
            (InterfaceDetails { queue_length: Some(1000), ..good() }, "so many old frames"),
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
        assert_eq!(of(false).0, ["can0 is down; 'ip link set can0 up txqueuelen 50' brings it up"]);
    }
}
