//! Messages of a node beside process data and SDO: network management, heartbeat, emergencies and SYNC (CiA 301, 7.2).

use std::fmt;

use super::{Cob, LengthError, NodeId, exactly};
use crate::frame::Frame;

codes! {
    /// A command to a node.
    NmtCommand as u8 {
        /// Enter operational.
        Start = 0x01 "start",
        /// Enter stopped.
        Stop = 0x02 "stop",
        /// Enter pre-operational.
        EnterPreOperational = 0x80 "enter_pre_operational",
        /// Restart the application.
        ResetNode = 0x81 "reset_node",
        /// Restart the communication.
        ResetCommunication = 0x82 "reset_communication",
    }
}

/// The nodes of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NmtTarget {
    /// Every node (node id 0 on the wire).
    All,
    /// One node.
    Node(NodeId),
}

impl NmtTarget {
    /// Whether the command reaches that node.
    pub fn includes(self, node: NodeId) -> bool {
        self == Self::All || self == Self::Node(node)
    }
}

/// A network management message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Nmt {
    /// The command.
    pub command: NmtCommand,
    /// The nodes that execute the command.
    pub target: NmtTarget,
}

impl Nmt {
    /// The frame that carries the command.
    pub fn frame(self) -> Frame {
        let target = match self.target {
            NmtTarget::All => 0,
            NmtTarget::Node(node) => node.get(),
        };
        Frame::fixed(Cob::Nmt.into(), [self.command.code(), target])
    }

    /// Reads the data bytes; `None` for another length than 2, an unknown command or a target above 127.
    pub fn decode(data: &[u8]) -> Option<Self> {
        let &[code, target] = data else { return None };
        let command = NmtCommand::try_from(code).ok()?;
        let target = if target == 0 { NmtTarget::All } else { NmtTarget::Node(NodeId::new(target).ok()?) };
        Some(Self { command, target })
    }
}

codes! {
    /// State of a node's network management.
    NmtState as u8 {
        /// Just booted: the one boot-up message before pre-operational.
        BootUp = 0x00 "boot_up",
        /// NMT and heartbeat only.
        Stopped = 0x04 "stopped",
        /// Everything, PDOs included.
        Operational = 0x05 "operational",
        /// Everything but PDOs.
        PreOperational = 0x7F "pre_operational",
    }
}

/// One heartbeat (object 1017 sets its period); the first after a reset is the boot-up message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Heartbeat {
    /// State of the node that sends it.
    pub state: NmtState,
}

/// Data that is no heartbeat.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum HeartbeatError {
    /// Wrong length.
    #[error(transparent)]
    Length(#[from] LengthError),
    /// A state that CiA 301 does not define; with bit 7 set it may be node guarding, which is not
    /// supported.
    #[error("{code:02X}h is no NMT state of a heartbeat")]
    UnknownState {
        /// The received number.
        code: u8,
    },
}

impl Heartbeat {
    /// The frame in which that node sends it.
    pub fn frame(self, node: NodeId) -> Frame {
        Frame::fixed(Cob::Heartbeat(node).into(), [self.state.code()])
    }

    /// Reads the data byte.
    ///
    /// # Errors
    /// [`HeartbeatError`] for another length than 1 or an unknown state.
    pub fn decode(data: &[u8]) -> Result<Self, HeartbeatError> {
        let [code] = exactly("heartbeat", data)?;
        let state = NmtState::try_from(code).map_err(|_| HeartbeatError::UnknownState { code })?;
        Ok(Self { state })
    }
}

/// Emergency error code. Every number is a valid code; the constants are common codes of CiA 301 and 402.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub struct EmergencyCode(pub u16);

impl EmergencyCode {
    /// All errors are gone.
    pub const RESET: Self = Self(0x0000);
    /// The logic supply of the drive, 24 V, is too low (CiA 402: control supply U1).
    pub const LOGIC_SUPPLY: Self = Self(0x5112);
    /// Communication error without further detail.
    pub const COMMUNICATION: Self = Self(0x8100);
    /// The CAN controller became error passive.
    pub const ERROR_PASSIVE: Self = Self(0x8120);
    /// The CAN controller is back on the bus.
    pub const WAS_BUS_OFF: Self = Self(0x8140);
    /// A heartbeat or node guarding is overdue.
    pub const HEARTBEAT: Self = Self(0x8130);
    /// A PDO was too short to be used.
    pub const PDO_LENGTH: Self = Self(0x8210);
    /// A PDO was longer than its mapping.
    pub const PDO_LENGTH_EXCEEDED: Self = Self(0x8220);
    /// The length of SYNC does not follow object 1019.
    pub const SYNC_LENGTH: Self = Self(0x8240);
    /// An RPDO is overdue.
    pub const RPDO_TIMEOUT: Self = Self(0x8250);
    /// The encoder jumps, or the one at the joint is too far away.
    pub const POSITION_SENSOR: Self = Self(0x7320);
    /// An axis that stops leaves its ramp.
    pub const VELOCITY: Self = Self(0x8400);
    /// The following error exceeded its window (6065) for longer than allowed (6066).
    #[doc(alias("position deviation", "contouring error", "lag error"))]
    pub const FOLLOWING_ERROR: Self = Self(0x8611);
}

/// The meaning of codes by their leading digits (CiA 301, table 21; CiA 402, error codes). The longest match counts.
#[rustfmt::skip]
const MEANINGS: [(&str, &str); 64] = [
    ("0000", "no error"), ("10", "generic error"),
    ("2", "current"), ("21", "current at the input"), ("22", "current inside the device"),
    ("23", "current at the output"), ("231", "continuous overcurrent"), ("232", "short circuit or earth leakage"),
    ("233", "earth leakage"), ("234", "short circuit in the motor"), ("235", "load too high (I²t)"),
    ("3", "voltage"), ("31", "mains voltage"), ("311", "mains overvoltage"), ("312", "mains undervoltage"),
    ("313", "mains phase missing"), ("32", "voltage inside the device"), ("321", "DC link overvoltage"),
    ("322", "DC link undervoltage"), ("33", "output voltage"),
    ("4", "temperature"), ("41", "ambient temperature"), ("42", "temperature of the device"),
    ("43", "temperature of the drive"), ("44", "temperature of the supply"),
    ("5", "hardware"), ("51", "supply"), ("511", "logic supply too low"), ("54", "power section"),
    ("541", "output stage"), ("55", "data memory"),
    ("6", "software"), ("601", "software reset by the watchdog"), ("61", "internal software"),
    ("62", "user software"), ("63", "data record"), ("631", "parameters lost"), ("632", "wrong parameters"),
    ("7", "additional module"), ("711", "brake chopper"), ("712", "motor"), ("7121", "motor blocked"),
    ("7122", "motor error or commutation"), ("73", "sensor"), ("7305", "incremental encoder 1"),
    ("731", "speed sensor"), ("732", "position sensor"), ("75", "communication module"),
    ("8", "monitoring"), ("81", "communication"), ("812", "CAN controller error passive"),
    ("813", "heartbeat or node guarding missing"), ("814", "CAN controller was off the bus"), ("82", "protocol"),
    ("821", "PDO too short"), ("822", "PDO too long"), ("825", "process data missing"), ("83", "torque control"),
    ("84", "speed control"), ("85", "position control"), ("86", "positioning"), ("8611", "following error"),
    ("90", "external error"), ("FF", "of the maker: see the drive's manual"),
];

impl EmergencyCode {
    /// The meaning of the code, by its leading digits; none for codes of no class of the standards.
    pub fn meaning(self) -> Option<&'static str> {
        let digits = format!("{:04X}", self.0);
        let known = MEANINGS.iter().filter(|(leading, _)| digits.starts_with(leading));
        known.max_by_key(|(leading, _)| leading.len()).map(|(_, meaning)| *meaning)
    }
}

impl fmt::Display for EmergencyCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h", self.0)?;
        self.meaning().map_or(Ok(()), |meaning| write!(f, " ({meaning})"))
    }
}

/// An emergency message.
///
/// # Examples
/// ```
/// use masseter_can::canopen::{Emergency, EmergencyCode, NodeId};
///
/// let emergency = Emergency { code: EmergencyCode::FOLLOWING_ERROR, register: 0x21, vendor: [0; 5] };
/// let frame = emergency.frame(NodeId::new(2)?);
/// assert_eq!(frame.to_string(), "082#1186210000000000");
/// assert_eq!(Emergency::decode(frame.data())?, emergency);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Emergency {
    /// The error.
    pub code: EmergencyCode,
    /// Error register, object 1001: the kinds of errors that persist.
    pub register: u8,
    /// Additional bytes of the vendor.
    pub vendor: [u8; 5],
}

impl Emergency {
    /// Bytes of the message.
    pub const LENGTH: usize = 8;

    /// All errors are gone.
    pub const RESET: Self = Self { code: EmergencyCode::RESET, register: 0, vendor: [0; 5] };

    /// Whether the message reports the end of an error.
    pub fn is_reset(&self) -> bool {
        self.code == EmergencyCode::RESET
    }

    /// The frame in which that node sends the message.
    pub fn frame(self, node: NodeId) -> Frame {
        Frame::fixed(Cob::Emergency(node).into(), self.encode())
    }

    /// The data bytes.
    pub fn encode(self) -> [u8; Self::LENGTH] {
        let [low, high] = self.code.0.to_le_bytes();
        let [v0, v1, v2, v3, v4] = self.vendor;
        [low, high, self.register, v0, v1, v2, v3, v4]
    }

    /// Reads the data bytes.
    ///
    /// # Errors
    /// [`LengthError`] unless there are exactly 8.
    pub fn decode(data: &[u8]) -> Result<Self, LengthError> {
        let [low, high, register, vendor @ ..] = exactly::<{ Self::LENGTH }>("EMCY", data)?;
        Ok(Self { code: EmergencyCode(u16::from_le_bytes([low, high])), register, vendor })
    }
}

/// SYNC without counter: object 1019 is 0, so the frame is empty.
pub mod sync {
    use crate::canopen::Cob;
    use crate::frame::Frame;

    /// The SYNC frame.
    pub fn frame() -> Frame {
        Frame::fixed(Cob::Sync.into(), [])
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn decoded_bytes_encode_to_the_same_bytes() {
        let mut decoded = 0;
        for (code, target) in (0..=255).flat_map(|code| (0..=255).map(move |target| (code, target))) {
            if let Some(nmt) = Nmt::decode(&[code, target]) {
                assert_eq!(nmt.frame().data(), [code, target]);
                decoded += 1;
            }
        }
        assert_eq!(decoded, 5 * 128, "five commands to all or one of 127 nodes");
    }

    #[test]
    fn another_length_command_or_target_is_refused() {
        let refused: [&[u8]; 5] = [&[], &[1], &[1, 0, 0], &[3, 0], &[1, 128]];
        assert_eq!(refused.map(Nmt::decode), [None; 5]);
    }

    #[test]
    fn a_target_includes_its_nodes_only() {
        let [one, two] = [1, 2].map(|id| NodeId::new(id).unwrap());
        assert!(NmtTarget::All.includes(one));
        assert!(NmtTarget::Node(one).includes(one));
        assert!(!NmtTarget::Node(one).includes(two));
    }

    #[test]
    fn four_bytes_are_states_and_encode_to_themselves() {
        let node = NodeId::new(9).unwrap();
        let known: Vec<u8> = (0..=255)
            .filter(|&code| match Heartbeat::decode(&[code]) {
                Ok(heartbeat) => heartbeat.frame(node).data() == [code],
                Err(error) => {
                    assert_eq!(error, HeartbeatError::UnknownState { code });
                    false
                }
            })
            .collect();
        assert_eq!(known, [0x00, 0x04, 0x05, 0x7F]);
    }

    #[test]
    fn another_length_is_refused() {
        let error = Heartbeat::decode(&[5, 0]).unwrap_err();
        assert_eq!(error.to_string(), "data bytes of heartbeat: 2, expected 1");
    }

    #[test]
    fn the_code_is_little_endian() {
        let emergency =
            Emergency { code: EmergencyCode::FOLLOWING_ERROR, register: 0x21, vendor: [1, 2, 3, 4, 5] };
        assert_eq!(emergency.frame(NodeId::new(2).unwrap()).to_string(), "082#1186210102030405");
        assert!(!emergency.is_reset());
        assert!(Emergency::RESET.is_reset());
    }

    #[test]
    fn a_code_is_explained_by_the_longest_leading_digits_that_are_known() {
        let in_words =
            [0x8611, 0x8612, 0x7305, 0x5112, 0xFF03, 0xA000].map(|code| EmergencyCode(code).to_string());
        assert_eq!(
            in_words,
            [
                "8611h (following error)",
                "8612h (positioning)",
                "7305h (incremental encoder 1)",
                "5112h (logic supply too low)",
                "FF03h (of the maker: see the drive's manual)",
                "A000h"
            ]
        );
    }

    proptest! {
        #[test]
        fn eight_bytes_are_an_emergency_and_nothing_else_is(data in prop::collection::vec(any::<u8>(), 0..=8)) {
            match Emergency::decode(&data) {
                Ok(emergency) => {
                    let frame = emergency.frame(NodeId::new(1).unwrap());
                    prop_assert_eq!(frame.data(), &data);
                }
                Err(error) => {
                    prop_assert_ne!(data.len(), Emergency::LENGTH);
                    prop_assert_eq!(error.actual, data.len());
                }
            }
        }
    }

    #[test]
    fn sync_is_empty() {
        assert_eq!(sync::frame().to_string(), "080#");
    }
}
