//! Settings, state and queue of a CAN interface in the kernel, asked over rtnetlink. This module judges nothing.

use std::fmt::{self, Display, Formatter};
use std::{fs, io, path::Path};

// `socketcan` reads some of these attributes with its feature `netlink`, at the price of a dozen crates.
use libc::{
    IFF_UP, IFLA_CAN_BERR_COUNTER, IFLA_CAN_BITTIMING, IFLA_CAN_CTRLMODE, IFLA_CAN_DATA_BITTIMING,
    IFLA_CAN_RESTART_MS, IFLA_CAN_STATE, IFLA_INFO_DATA, IFLA_INFO_KIND, IFLA_LINKINFO, IFLA_MTU, IFLA_QDISC,
    IFLA_TXQLEN, NLA_TYPE_MASK, NLM_F_REQUEST, RTM_GETLINK, RTM_NEWLINK,
};
use rustix::net::netlink::SocketAddrNetlink;
use rustix::net::{AddressFamily, RecvFlags, SendFlags, SocketType, recv, sendto, socket};

use super::interface::driver;

/// States of fault confinement, by their number in the kernel.
const STATES: [&str; 6] =
    ["error active", "error warning", "error passive", "bus-off", "stopped", "sleeping"];
/// Control modes (`CAN_CTRLMODE_…`) as `ip` names them, by their bit.
const MODES: [&str; 11] = [
    "loopback",
    "listen-only",
    "triple-sampling",
    "one-shot",
    "berr-reporting",
    "fd",
    "presume-ack",
    "fd-non-iso",
    "cc-len8-dlc",
    "tdc-auto",
    "tdc-manual",
];

/// Bytes of the header of a message, and of the link's description before its attributes.
const HEADER: usize = 16;
const LINK: usize = 16;
/// Place of the flags in a message.
const FLAGS: usize = HEADER + 8;

/// Settings and state of an interface and its controller. A driver may report only some of them; a virtual interface has
/// no controller and no bit timing.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize)]
pub struct InterfaceDetails {
    /// Whether the interface is up.
    pub is_up: bool,
    /// Whether the interface has no hardware: `vcan` or `vxcan`.
    pub is_virtual: bool,
    /// The kernel's driver, such as `mcp251xfd`.
    pub driver: Option<String>,
    /// Longest frame, bytes: 16, or 72 with frames in FD format.
    pub mtu: Option<u32>,
    /// Queueing discipline, such as `pfifo_fast`.
    pub queueing: Option<String>,
    /// Length of the transmit queue (`txqueuelen`), frames.
    pub queue_length: Option<u32>,
    /// Bit rate, bit/s; none also before the first setting.
    pub bitrate_bps: Option<u32>,
    /// Bit rate of the data of frames in FD format, bit/s.
    pub data_bitrate_bps: Option<u32>,
    /// Sample point, ‰ of a bit.
    pub sample_point_permille: Option<u32>,
    /// The control modes that are on, as `ip` names them.
    pub modes: Vec<&'static str>,
    /// Time from bus-off to the controller's own restart, ms; 0 for never.
    pub restart_ms: Option<u32>,
    /// State of its fault confinement.
    pub state: Option<&'static str>,
    /// Error counters for sending, and for receiving.
    pub errors: Option<[u16; 2]>,
}

impl InterfaceDetails {
    /// Asks the kernel. The query needs no rights.
    ///
    /// # Errors
    /// The system's error, for instance for an interface that does not exist.
    pub fn read(interface: &str) -> io::Result<Self> {
        let folder = Path::new("/sys/class/net").join(interface);
        let index = fs::read_to_string(folder.join("ifindex"))?;
        let index: u32 = index.trim().parse().map_err(io::Error::other)?;
        let socket = socket(AddressFamily::NETLINK, SocketType::RAW, None)?;
        let mut request = [0; HEADER + LINK];
        request[..4].copy_from_slice(&((HEADER + LINK) as u32).to_ne_bytes());
        request[4..6].copy_from_slice(&RTM_GETLINK.to_ne_bytes());
        request[6..8].copy_from_slice(&(NLM_F_REQUEST as u16).to_ne_bytes());
        request[20..24].copy_from_slice(&index.to_ne_bytes());
        sendto(&socket, &request, SendFlags::empty(), &SocketAddrNetlink::new(0, 0))?;
        let mut answer = vec![0; 1 << 15];
        let (length, _) = recv(&socket, &mut answer[..], RecvFlags::empty())?;
        let details = Self::parse(&answer[..length])
            .ok_or_else(|| io::Error::other("the kernel's answer describes no link"))?;
        Ok(Self { driver: driver(&folder), ..details })
    }

    /// None for a message that is no whole description of a link: without its end, a forbidden mode might be missing.
    fn parse(message: &[u8]) -> Option<Self> {
        let message = message.get(..long(message)? as usize)?;
        if short(message.get(4..)?)? != RTM_NEWLINK {
            return None;
        }
        let link = message.get(HEADER + LINK..)?;
        let info = find(link, IFLA_LINKINFO).unwrap_or_default();
        let data = find(info, IFLA_INFO_DATA).unwrap_or_default();
        let timing = find(data, IFLA_CAN_BITTIMING).unwrap_or_default();
        let errors =
            find(data, IFLA_CAN_BERR_COUNTER).and_then(|pair| Some([short(pair)?, short(pair.get(2..)?)?]));
        // The first number is a mask.
        let modes = find(data, IFLA_CAN_CTRLMODE).and_then(|modes| long(modes.get(4..)?)).unwrap_or(0);
        let modes = MODES.into_iter().enumerate().filter(|(bit, _)| modes & 1 << bit != 0);
        let bits_per_s = |timing: &[u8]| long(timing).filter(|&bps| bps > 0);
        Some(Self {
            is_up: long(message.get(FLAGS..)?)? & IFF_UP as u32 != 0,
            is_virtual: find(info, IFLA_INFO_KIND).and_then(text).is_some_and(|kind| kind != "can"),
            driver: None,
            mtu: find(link, IFLA_MTU).and_then(long),
            queueing: find(link, IFLA_QDISC).and_then(text),
            queue_length: find(link, IFLA_TXQLEN).and_then(long),
            bitrate_bps: bits_per_s(timing),
            data_bitrate_bps: find(data, IFLA_CAN_DATA_BITTIMING).and_then(bits_per_s),
            sample_point_permille: timing.get(4..).and_then(long),
            modes: modes.map(|(_, name)| name).collect(),
            restart_ms: find(data, IFLA_CAN_RESTART_MS).and_then(long),
            state: find(data, IFLA_CAN_STATE)
                .and_then(long)
                .and_then(|state| STATES.get(state as usize).copied()),
            errors,
        })
    }
}

impl Display for InterfaceDetails {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let number = |name: &str, value: Option<u32>| value.map(|value| format!("{name} {value}"));
        let parts = [
            Some(if self.is_up { "up" } else { "down" }.to_owned()),
            self.driver.clone(),
            self.is_virtual.then(|| "virtual: no bit timing, no control modes".to_owned()),
            self.bitrate_bps.map(|bps| format!("{bps} bit/s")),
            self.data_bitrate_bps.map(|bps| format!("{bps} bit/s for data")),
            self.sample_point_permille.map(|permille| format!("sample point {permille} ‰")),
            self.state.map(str::to_owned),
            self.errors.map(|[sent, received]| format!("error counters {sent} and {received}")),
            (!self.modes.is_empty()).then(|| self.modes.join(" ")),
            number("restart-ms", self.restart_ms),
            number("txqueuelen", self.queue_length),
            self.queueing.clone(),
            number("mtu", self.mtu),
        ];
        f.write_str(&parts.into_iter().flatten().collect::<Vec<_>>().join(", "))
    }
}

fn short(bytes: &[u8]) -> Option<u16> {
    Some(u16::from_ne_bytes(*bytes.first_chunk()?))
}

fn long(bytes: &[u8]) -> Option<u32> {
    Some(u32::from_ne_bytes(*bytes.first_chunk()?))
}

fn text(bytes: &[u8]) -> Option<String> {
    String::from_utf8(bytes.split(|&byte| byte == 0).next()?.to_vec()).ok()
}

/// The value of the first attribute of a kind. Attributes begin at multiples of four bytes.
fn find(mut attributes: &[u8], kind: impl Into<i32>) -> Option<&[u8]> {
    let kind = kind.into();
    loop {
        let (length, found) = (usize::from(short(attributes)?), short(attributes.get(2..)?)?);
        let value = attributes.get(4..length)?;
        if i32::from(found) & NLA_TYPE_MASK == kind {
            return Some(value);
        }
        attributes = attributes.get(length.next_multiple_of(4)..)?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attribute(kind: impl Into<i32>, value: &[u8]) -> Vec<u8> {
        let kind = kind.into() as u16;
        let mut bytes = [(value.len() as u16 + 4).to_ne_bytes(), kind.to_ne_bytes()].concat();
        bytes.extend(value);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        bytes
    }

    fn numbers(numbers: &[u32]) -> Vec<u8> {
        numbers.iter().flat_map(|number| number.to_ne_bytes()).collect()
    }

    fn message(attributes: &[Vec<u8>]) -> Vec<u8> {
        let mut message = vec![0; HEADER + LINK];
        message[4..6].copy_from_slice(&RTM_NEWLINK.to_ne_bytes());
        message[FLAGS..FLAGS + 4].copy_from_slice(&0x400C1u32.to_ne_bytes());
        message.extend(attributes.concat());
        let length = message.len() as u32;
        message[..4].copy_from_slice(&length.to_ne_bytes());
        message
    }

    #[test]
    fn the_settings_of_a_controller_are_found_among_other_attributes() {
        let data = [
            attribute(IFLA_CAN_BITTIMING, &numbers(&[500_000, 875, 1, 2, 3, 4, 5, 6])),
            attribute(3, &[1, 2, 3]),
            attribute(IFLA_CAN_STATE, &numbers(&[3])),
            attribute(IFLA_CAN_CTRLMODE, &numbers(&[0xFF, 0b1010])),
            attribute(IFLA_CAN_RESTART_MS, &numbers(&[100])),
            attribute(IFLA_CAN_BERR_COUNTER, &[7, 0, 9, 0].map(u8::to_le)),
            attribute(IFLA_CAN_DATA_BITTIMING, &numbers(&[2_000_000])),
        ]
        .concat();
        let info = [attribute(IFLA_INFO_KIND, b"can\0"), attribute(IFLA_INFO_DATA, &data)].concat();
        let message = message(&[
            attribute(3, b"can0\0"),
            attribute(IFLA_MTU, &numbers(&[72])),
            attribute(IFLA_QDISC, b"fq_codel\0"),
            attribute(IFLA_TXQLEN, &numbers(&[10])),
            attribute(IFLA_LINKINFO | 0x8000, &info),
        ]);
        let expected = InterfaceDetails {
            is_up: true,
            is_virtual: false,
            driver: None,
            mtu: Some(72),
            queueing: Some("fq_codel".to_owned()),
            queue_length: Some(10),
            bitrate_bps: Some(500_000),
            data_bitrate_bps: Some(2_000_000),
            sample_point_permille: Some(875),
            modes: vec!["listen-only", "one-shot"],
            restart_ms: Some(100),
            state: Some("bus-off"),
            errors: Some([7, 9]),
        };
        let found = InterfaceDetails::parse(&message).unwrap();
        assert_eq!(found, expected);
        assert_eq!(
            found.to_string(),
            "up, 500000 bit/s, 2000000 bit/s for data, sample point 875 ‰, bus-off, error counters 7 and 9, \
             listen-only one-shot, restart-ms 100, txqueuelen 10, fq_codel, mtu 72"
        );
        for length in 0..message.len() {
            assert_eq!(InterfaceDetails::parse(&message[..length]), None, "{length} bytes of the answer");
        }
    }

    #[test]
    fn a_virtual_interface_has_no_bit_timing() {
        let info = attribute(IFLA_INFO_KIND, b"vxcan\0");
        let found = InterfaceDetails::parse(&message(&[attribute(IFLA_LINKINFO, &info)])).unwrap();
        assert!(found.is_virtual && found.bitrate_bps.is_none(), "{found:?}");
        assert_eq!(found.to_string(), "up, virtual: no bit timing, no control modes");
    }

    #[test]
    fn the_kernel_answers_of_an_interface_that_is_no_can_and_refuses_what_does_not_exist() {
        let found = InterfaceDetails::read("lo").unwrap();
        assert_eq!((found.bitrate_bps, found.state, found.is_virtual), (None, None, false));
        assert!(found.mtu.is_some() && found.queueing.is_some(), "{found:?}");
        assert!(InterfaceDetails::read("nocan9").is_err());
    }
}
