//! The CAN interfaces of this machine, the state of their controllers in the kernel, and the remedy for every refusal.
//! This module changes no interface.

use std::fs;
use std::io;
use std::path::Path;

use rustix::net::netlink::SocketAddrNetlink;
use rustix::net::{AddressFamily, RecvFlags, SendFlags, SocketType, recv, sendto, socket};
use socketcan::{CanSocket, Socket};

/// Hardware type of CAN interfaces (`ARPHRD_CAN`).
const CAN_TYPE: u32 = 280;
/// Flag of an interface that is up (`IFF_UP`).
const UP: u32 = 1;

/// Why an interface is not usable, with its name first, and the number of the system's error.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum OpenError {
    /// The kernel has no CAN.
    #[error(
        "{0}: this kernel has no CAN (no AF_CAN); load its modules with 'modprobe can-raw', or use --can virtual"
    )]
    NoCan(String),
    /// No CAN interface of that name.
    #[error("no CAN interface '{interface}'; there {}", existing(.there))]
    NoInterface {
        /// The requested interface.
        interface: String,
        /// The existing interfaces.
        there: Vec<String>,
    },
    /// The interface is down.
    #[error("{0} is down; 'ip link set {0} up type can bitrate …' brings it up")]
    Down(String),
    /// The kernel forbids it.
    #[error(
        "{0}: no permission for raw CAN sockets ({error}); run where the network namespace of the \
         interface is yours, or as root",
        error = io::Error::from_raw_os_error(*.1)
    )]
    Forbidden(String, i32),
    /// Anything else.
    #[error("{0} cannot be opened: {error}", error = io::Error::from_raw_os_error(*.1))]
    Os(String, i32),
}

impl OpenError {
    /// The meaning of an error of the operating system.
    pub(super) fn from_errno(interface: &str, errno: i32) -> Self {
        let interface = interface.to_owned();
        match errno {
            libc::EAFNOSUPPORT | libc::EPROTONOSUPPORT => Self::NoCan(interface),
            libc::ENODEV | libc::ENXIO => {
                let there = Interface::list(Path::new("/"));
                Self::NoInterface { interface, there: there.into_iter().map(|one| one.name).collect() }
            }
            libc::ENETDOWN => Self::Down(interface),
            libc::EPERM | libc::EACCES => Self::Forbidden(interface, errno),
            _ => Self::Os(interface, errno),
        }
    }
}

/// A CAN interface of this machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Interface {
    /// Its name, such as `can0`.
    pub name: String,
    /// Whether the interface is up.
    pub is_up: bool,
    /// Whether its controller is bus-off.
    pub is_bus_off: bool,
    /// Whether the interface has no hardware, such as `vcan0`. Only a controller of hardware has a bit rate.
    pub is_virtual: bool,
    /// Length of its transmit queue, frames.
    pub transmit_capacity: usize,
}

impl Interface {
    /// All CAN interfaces by name. The kernel's descriptions are below `root/sys/class/net`; `root` is `/`, except in
    /// tests.
    pub fn list(root: &Path) -> Vec<Self> {
        let folders = fs::read_dir(root.join("sys/class/net")).into_iter().flatten().flatten();
        let mut interfaces: Vec<_> =
            folders.filter_map(|entry| Self::read(entry.file_name().to_str()?, &entry.path())).collect();
        interfaces.sort_by(|one, other| one.name.cmp(&other.name));
        interfaces
    }

    /// None for another kind of interface. Flags and carrier decide, because `operstate` changes up to a second later.
    fn read(name: &str, folder: &Path) -> Option<Self> {
        let text = |property: &str| fs::read_to_string(folder.join(property)).ok();
        let number = |property: &str| text(property)?.trim().parse::<u32>().ok();
        let flags = || u32::from_str_radix(text("flags")?.trim().strip_prefix("0x")?, 16).ok();
        (number("type") == Some(CAN_TYPE)).then(|| Self {
            name: name.to_owned(),
            is_up: flags().is_none_or(|flags| flags & UP != 0),
            is_bus_off: number("carrier") == Some(0),
            is_virtual: !folder.join("device").exists(),
            transmit_capacity: number("tx_queue_len").unwrap_or(0) as usize,
        })
    }
}

/// Whether this kernel has CAN, and this process may use CAN.
///
/// # Errors
/// The system's error otherwise.
pub fn is_supported() -> io::Result<()> {
    // A socket on all interfaces exists wherever the kernel has CAN.
    CanSocket::open_iface(0).map(drop)
}

/// The length of the interface's transmit queue, frames. The interface must exist, be a CAN interface, and be up.
pub(super) fn usable_transmit_capacity(interface: &str) -> Result<usize, OpenError> {
    is_supported().map_err(|error| OpenError::from_errno(interface, errno(&error)))?;
    let found = Interface::list(Path::new("/")).into_iter().find(|there| there.name == interface);
    match found {
        None => Err(OpenError::from_errno(interface, libc::ENODEV)),
        Some(down) if !down.is_up => Err(OpenError::from_errno(interface, libc::ENETDOWN)),
        Some(up) => Ok(up.transmit_capacity),
    }
}

/// The number of an error of the operating system.
pub(super) fn errno(error: &io::Error) -> i32 {
    // Only a frame of an unexpected size has no number of the system's.
    error.raw_os_error().unwrap_or(libc::EPROTO)
}

fn existing(there: &[String]) -> String {
    match there {
        [] => "is none: load the driver of your adapter, or 'ip link add vcan0 type vcan'".to_owned(),
        [only] => format!("is {only}"),
        more => format!("are {}", more.join(", ")),
    }
}

/// States of fault confinement, by their number in the kernel.
const STATES: [&str; 6] =
    ["error active", "error warning", "error passive", "bus-off", "stopped", "sleeping"];

// Messages and attributes (linux/rtnetlink.h, linux/if_link.h, linux/can/netlink.h). `socketcan` reads them with its feature
// `netlink`, at the price of a dozen crates.
const GET_LINK: u16 = 18;
const NEW_LINK: u16 = 16;
const REQUEST: u16 = 1;
const LINK_INFO: u16 = 18;
const INFO_DATA: u16 = 2;
const BIT_TIMING: u16 = 1;
const STATE: u16 = 4;
const RESTART_MS: u16 = 6;
const ERROR_COUNTERS: u16 = 8;
/// Bytes of the header of a message, and of the link's description before its attributes.
const HEADER: usize = 16;
const LINK: usize = 16;

/// Settings and state of a CAN controller. A driver may report only some of them; `vcan` reports nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct InterfaceDetails {
    /// Bit rate, bit/s.
    pub bitrate_bps: Option<u32>,
    /// Sample point, ‰ of a bit.
    pub sample_point_permille: Option<u32>,
    /// Time from bus-off to the controller's own restart, ms; 0 for never.
    pub restart_ms: Option<u32>,
    /// State of its fault confinement.
    pub state: Option<&'static str>,
    /// Errors counted while sending, and while receiving.
    pub errors: Option<[u16; 2]>,
}

impl InterfaceDetails {
    /// Asks the kernel. The query needs no rights.
    ///
    /// # Errors
    /// The system's error, for instance for an interface that does not exist.
    pub fn read(interface: &str) -> io::Result<Self> {
        let index = fs::read_to_string(format!("/sys/class/net/{interface}/ifindex"))?;
        let index: u32 = index.trim().parse().map_err(io::Error::other)?;
        let socket = socket(AddressFamily::NETLINK, SocketType::RAW, None)?;
        let mut request = [0; HEADER + LINK];
        request[..4].copy_from_slice(&((HEADER + LINK) as u32).to_ne_bytes());
        request[4..6].copy_from_slice(&GET_LINK.to_ne_bytes());
        request[6..8].copy_from_slice(&REQUEST.to_ne_bytes());
        request[20..24].copy_from_slice(&index.to_ne_bytes());
        sendto(&socket, &request, SendFlags::empty(), &SocketAddrNetlink::new(0, 0))?;
        let mut answer = vec![0; 1 << 15];
        let (length, _) = recv(&socket, &mut answer[..], RecvFlags::empty())?;
        Self::parse(&answer[..length])
            .ok_or_else(|| io::Error::other("the kernel's answer describes no link"))
    }

    /// None for a message that is no description of a link.
    fn parse(message: &[u8]) -> Option<Self> {
        if short(message.get(4..)?)? != NEW_LINK {
            return None;
        }
        let info = find(message.get(HEADER + LINK..)?, LINK_INFO).unwrap_or_default();
        let data = find(info, INFO_DATA).unwrap_or_default();
        let timing = find(data, BIT_TIMING).unwrap_or_default();
        let errors = find(data, ERROR_COUNTERS).and_then(|pair| Some([short(pair)?, short(pair.get(2..)?)?]));
        Some(Self {
            bitrate_bps: long(timing),
            sample_point_permille: timing.get(4..).and_then(long),
            restart_ms: find(data, RESTART_MS).and_then(long),
            state: find(data, STATE).and_then(long).and_then(|state| STATES.get(state as usize).copied()),
            errors,
        })
    }
}

fn short(bytes: &[u8]) -> Option<u16> {
    Some(u16::from_ne_bytes(*bytes.first_chunk()?))
}

fn long(bytes: &[u8]) -> Option<u32> {
    Some(u32::from_ne_bytes(*bytes.first_chunk()?))
}

/// The value of the first attribute of a kind. Attributes begin at multiples of four bytes.
fn find(mut attributes: &[u8], kind: u16) -> Option<&[u8]> {
    loop {
        let (length, found) = (usize::from(short(attributes)?), short(attributes.get(2..)?)?);
        let value = attributes.get(4..length)?;
        if found & 0x3FFF == kind {
            return Some(value);
        }
        attributes = attributes.get(length.next_multiple_of(4)..)?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_refusal_gives_a_remedy() {
        let of = |errno| OpenError::from_errno("can7", errno).to_string();
        let table = [
            (libc::EAFNOSUPPORT, "modprobe can-raw"),
            (libc::ENODEV, "no CAN interface 'can7'"),
            (libc::ENETDOWN, "ip link set can7 up"),
            (libc::EPERM, "no permission"),
            (libc::EIO, "can7 cannot be opened"),
        ];
        for (errno, remedy) in table {
            assert!(of(errno).contains(remedy), "{}", of(errno));
        }
    }

    #[test]
    fn existing_interfaces_are_listed() {
        let there = |names: &[&str]| {
            let there = names.iter().map(|&name| name.to_owned()).collect();
            OpenError::NoInterface { interface: "can7".to_owned(), there }.to_string()
        };
        assert!(there(&[]).contains("there is none"));
        assert!(there(&["can0"]).ends_with("there is can0"));
        assert!(there(&["can0", "can1"]).ends_with("there are can0, can1"));
    }

    fn attribute(kind: u16, value: &[u8]) -> Vec<u8> {
        let mut bytes = [(value.len() as u16 + 4).to_ne_bytes(), kind.to_ne_bytes()].concat();
        bytes.extend(value);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        bytes
    }

    #[test]
    fn the_settings_of_a_controller_are_found_among_other_attributes() {
        let timing: Vec<u8> =
            [500_000u32, 875, 1, 2, 3, 4, 5, 6].iter().flat_map(|n| n.to_ne_bytes()).collect();
        let data = [
            attribute(BIT_TIMING, &timing),
            attribute(3, &[1, 2, 3]),
            attribute(STATE, &3u32.to_ne_bytes()),
            attribute(RESTART_MS, &100u32.to_ne_bytes()),
            attribute(ERROR_COUNTERS, &[7, 0, 9, 0].map(u8::to_le)),
        ]
        .concat();
        let info = [attribute(1, b"can\0"), attribute(INFO_DATA, &data)].concat();
        let mut message = vec![0; HEADER + LINK];
        message[4..6].copy_from_slice(&NEW_LINK.to_ne_bytes());
        message.extend([attribute(3, b"can0\0"), attribute(LINK_INFO | 0x8000, &info)].concat());
        let expected = InterfaceDetails {
            bitrate_bps: Some(500_000),
            sample_point_permille: Some(875),
            restart_ms: Some(100),
            state: Some("bus-off"),
            errors: Some([7, 9]),
        };
        assert_eq!(InterfaceDetails::parse(&message), Some(expected));
        for length in 0..message.len() {
            // A truncated message causes no panic.
            let _ = InterfaceDetails::parse(&message[..length]);
        }
    }

    #[test]
    fn the_kernel_answers_of_an_interface_that_is_no_can_and_refuses_what_does_not_exist() {
        assert_eq!(InterfaceDetails::read("lo").unwrap(), InterfaceDetails::default());
        assert!(InterfaceDetails::read("nocan9").is_err());
    }
}
