//! The check of an interface, with the remedy for every refusal.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

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
        "{interface}: this kernel has no CAN (no AF_CAN); load its modules with `modprobe can-raw`, or use \
         `--can virtual`"
    )]
    NoCan {
        /// The interface asked for.
        interface: String,
    },
    /// No CAN interface of that name.
    #[error("no CAN interface `{interface}`; there {}", existing(.there))]
    NoInterface {
        /// The interface asked for.
        interface: String,
        /// Those there are.
        there: Vec<String>,
    },
    /// The interface is down.
    #[error("{interface} is down; `ip link set {interface} up type can bitrate …` brings it up")]
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
            libc::ENODEV | libc::ENXIO => Self::NoInterface { interface, there: can_interfaces() },
            libc::ENETDOWN => Self::Down { interface },
            libc::EPERM | libc::EACCES => Self::Forbidden { interface, errno },
            _ => Self::Os { interface, errno },
        }
    }
}

/// The length of the interface's transmit queue, frames. Refuses an interface that does not exist, is not a CAN
/// interface, or is down.
pub(super) fn check(interface: &str) -> Result<usize, OpenError> {
    // A socket on all interfaces exists wherever the kernel has CAN.
    CanSocket::open_iface(0).map_err(|error| OpenError::from_errno(interface, errno(&error)))?;
    if !can_interfaces().iter().any(|there| there == interface) {
        return Err(OpenError::from_errno(interface, libc::ENODEV));
    }
    let folder = Path::new(INTERFACES).join(interface);
    if flags(&folder).is_some_and(|flags| flags & UP == 0) {
        return Err(OpenError::Down { interface: interface.to_owned() });
    }
    Ok(number(&folder.join("tx_queue_len")).unwrap_or(0) as usize)
}

/// Where the kernel lists its network interfaces.
const INTERFACES: &str = "/sys/class/net";

/// The names of the existing CAN interfaces.
fn can_interfaces() -> Vec<String> {
    let folders = fs::read_dir(INTERFACES).into_iter().flatten().flatten();
    let is_can = |folder: &PathBuf| number(&folder.join("type")) == Some(CAN_TYPE);
    let can = folders.map(|entry| entry.path()).filter(is_can);
    let mut names: Vec<_> = can.filter_map(|folder| Some(folder.file_name()?.to_str()?.to_owned())).collect();
    names.sort();
    names
}

fn flags(interface: &Path) -> Option<u32> {
    let text = fs::read_to_string(interface.join("flags")).ok()?;
    u32::from_str_radix(text.trim().strip_prefix("0x")?, 16).ok()
}

fn number(file: &Path) -> Option<u32> {
    fs::read_to_string(file).ok()?.trim().parse().ok()
}

fn existing(there: &[String]) -> String {
    match there {
        [] => "is none: load the driver of your adapter, or `ip link add vcan0 type vcan`".to_owned(),
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
            (libc::ENODEV, "no CAN interface `can7`"),
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
