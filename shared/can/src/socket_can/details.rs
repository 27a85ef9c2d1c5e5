//! What the kernel says of the CAN controller behind an interface (rtnetlink).
//!
//! `socketcan` reads the same with its feature `netlink`, at the price of a dozen crates.

use std::fs;
use std::io;

use rustix::net::netlink::SocketAddrNetlink;
use rustix::net::{AddressFamily, RecvFlags, SendFlags, SocketType, recv, sendto, socket};

/// States of fault confinement, by their number in the kernel.
const STATES: [&str; 6] =
    ["error active", "error warning", "error passive", "bus-off", "stopped", "sleeping"];

// Messages and attributes (linux/rtnetlink.h, linux/if_link.h, linux/can/netlink.h).
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

/// Settings and state of a CAN controller. What the driver does not report is left out; `vcan` reports nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct InterfaceDetails {
    /// Bit rate, bit/s.
    pub bitrate_bps: Option<u32>,
    /// Sample point, ‰ of a bit.
    pub sample_point_permille: Option<u32>,
    /// How long after bus-off the controller restarts by itself, ms; 0 for never.
    pub restart_ms: Option<u32>,
    /// State of its fault confinement.
    pub state: Option<&'static str>,
    /// Errors counted while sending, and while receiving.
    pub errors: Option<[u16; 2]>,
}

impl InterfaceDetails {
    /// Asks the kernel. That needs no rights.
    ///
    /// # Errors
    /// The system's error, such as for an interface that does not exist.
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

    /// None for another message than the description of a link.
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
            // A message that is cut short has no other values.
            let _ = InterfaceDetails::parse(&message[..length]);
        }
    }

    #[test]
    fn the_kernel_answers_of_an_interface_that_is_no_can_and_refuses_what_does_not_exist() {
        assert_eq!(InterfaceDetails::read("lo").unwrap(), InterfaceDetails::default());
        assert!(InterfaceDetails::read("nocan9").is_err());
    }
}
