//! The CAN interfaces of this machine, and the remedy for every refusal to open one. This module changes no interface.

use std::{fs, io, path::Path};

use socketcan::{CanSocket, Socket};

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
    /// The kernel's driver of its hardware.
    pub driver: Option<String>,
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
        (number("type") == Some(libc::ARPHRD_CAN.into())).then(|| Self {
            name: name.to_owned(),
            is_up: flags().is_none_or(|flags| flags & libc::IFF_UP as u32 != 0),
            is_bus_off: number("carrier") == Some(0),
            is_virtual: !folder.join("device").exists(),
            driver: driver(folder),
            transmit_capacity: number("tx_queue_len").unwrap_or(0) as usize,
        })
    }
}

/// The kernel's driver of the hardware of an interface, which is described in this folder.
pub(super) fn driver(folder: &Path) -> Option<String> {
    Some(fs::read_link(folder.join("device/driver")).ok()?.file_name()?.to_str()?.to_owned())
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

/// What an error of the system on an interface in use in words, and what to do.
pub fn explain_errno(interface: &str, errno: i32) -> String {
    let remedy = match errno {
        libc::ENODEV | libc::ENXIO => {
            format!("{interface} is gone: plug its adapter in, bring {interface} up again, then start anew")
        }
        // An unplugged adapter is taken down first.
        libc::ENETDOWN => format!(
            "{interface} was taken down or unplugged: plug its adapter in, then 'ip link set {interface} up' brings it up again"
        ),
        libc::ENOBUFS => format!(
            "{interface} does not get rid of its frames: its adapter hangs, the bus is overloaded, or no node acknowledges; check \
             power, wiring and bit rate of the drives, then 'ip link set {interface} down' and 'ip link set {interface} up'"
        ),
        _ => format!("look for {interface} in the kernel's log (dmesg)"),
    };
    format!("{}; {remedy}", io::Error::from_raw_os_error(errno))
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
    fn an_error_on_an_interface_in_use_has_its_text_its_interface_and_a_remedy() {
        let table = [
            (libc::ENXIO, "No such device or address (os error 6); can1 is gone: plug its adapter in"),
            (libc::ENODEV, "No such device (os error 19); can1 is gone"),
            (libc::ENETDOWN, "Network is down (os error 100); can1 was taken down or unplugged"),
            (libc::ENOBUFS, "No buffer space available (os error 105); can1 does not get rid of its frames"),
            (libc::EIO, "(os error 5); look for can1 in the kernel's log"),
        ];
        for (errno, words) in table {
            assert!(explain_errno("can1", errno).contains(words), "{}", explain_errno("can1", errno));
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
