//! The CAN interfaces of this machine, and the check of one, with the remedy for every refusal.

use std::fs;
use std::io;
use std::path::Path;

use socketcan::{CanSocket, Socket};

use super::errno::errno;

/// Hardware type of CAN interfaces (`ARPHRD_CAN`).
const CAN_TYPE: u32 = 280;
/// Flag of an interface that is up (`IFF_UP`).
const UP: u32 = 1;

/// Why an interface cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum OpenError {
    /// The kernel has no CAN.
    #[error(
        "{interface}: this kernel has no CAN (no AF_CAN); load its modules with 'modprobe can-raw', or use \
         --can virtual"
    )]
    NoCan {
        /// The interface asked for.
        interface: String,
    },
    /// No CAN interface of that name.
    #[error("no CAN interface '{interface}'; there {}", existing(.there))]
    NoInterface {
        /// The interface asked for.
        interface: String,
        /// Those there are.
        there: Vec<String>,
    },
    /// The interface is down.
    #[error("{interface} is down; 'ip link set {interface} up type can bitrate …' brings it up")]
    Down {
        /// The interface.
        interface: String,
    },
    /// The kernel forbids it.
    #[error(
        "{interface}: no permission for raw CAN sockets ({}); run where the network namespace of the \
         interface is yours, or as root",
        io::Error::from_raw_os_error(*.errno)
    )]
    Forbidden {
        /// The interface.
        interface: String,
        /// Error number of the operating system.
        errno: i32,
    },
    /// Anything else.
    #[error("{interface} cannot be opened: {}", io::Error::from_raw_os_error(*.errno))]
    Os {
        /// The interface.
        interface: String,
        /// Error number of the operating system.
        errno: i32,
    },
}

impl OpenError {
    /// The meaning of an error of the operating system.
    pub(super) fn from_errno(interface: &str, errno: i32) -> Self {
        let interface = interface.to_owned();
        match errno {
            libc::EAFNOSUPPORT | libc::EPROTONOSUPPORT => Self::NoCan { interface },
            libc::ENODEV | libc::ENXIO => {
                let there = Interface::list(Path::new("/"));
                Self::NoInterface { interface, there: there.into_iter().map(|one| one.name).collect() }
            }
            libc::ENETDOWN => Self::Down { interface },
            libc::EPERM | libc::EACCES => Self::Forbidden { interface, errno },
            _ => Self::Os { interface, errno },
        }
    }
}

/// A CAN interface of this machine, up or not.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Interface {
    /// Its name, such as `can0`.
    pub name: String,
    /// Whether it is up.
    pub is_up: bool,
    /// Whether its controller is bus-off.
    pub is_bus_off: bool,
    /// Whether no hardware belongs to it, as for `vcan0`: only a controller of hardware has a bit rate.
    pub is_virtual: bool,
    /// Length of its transmit queue, frames.
    pub transmit_capacity: usize,
}

impl Interface {
    /// All CAN interfaces by name. The kernel describes them below `root/sys/class/net`; `root` is `/` but for tests.
    pub fn list(root: &Path) -> Vec<Self> {
        let folders = fs::read_dir(root.join("sys/class/net")).into_iter().flatten().flatten();
        let mut interfaces: Vec<_> =
            folders.filter_map(|entry| Self::read(entry.file_name().to_str()?, &entry.path())).collect();
        interfaces.sort_by(|one, other| one.name.cmp(&other.name));
        interfaces
    }

    /// None if it is no CAN interface. From flags and carrier: `operstate` changes up to a second later.
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

/// Whether this kernel has CAN, and lets this process use it.
///
/// # Errors
/// The system's error if not.
pub fn is_supported() -> io::Result<()> {
    // A socket on all interfaces exists wherever the kernel has CAN.
    CanSocket::open_iface(0).map(drop)
}

/// The length of the interface's transmit queue, frames. Refuses an interface that does not exist, is not a CAN
/// interface, or is down.
pub(super) fn check(interface: &str) -> Result<usize, OpenError> {
    is_supported().map_err(|error| OpenError::from_errno(interface, errno(&error)))?;
    let found = Interface::list(Path::new("/")).into_iter().find(|there| there.name == interface);
    match found {
        None => Err(OpenError::from_errno(interface, libc::ENODEV)),
        Some(down) if !down.is_up => Err(OpenError::from_errno(interface, libc::ENETDOWN)),
        Some(up) => Ok(up.transmit_capacity),
    }
}

fn existing(there: &[String]) -> String {
    match there {
        [] => "is none: load the driver of your adapter, or 'ip link add vcan0 type vcan'".to_owned(),
        [only] => format!("is {only}"),
        more => format!("are {}", more.join(", ")),
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
}
