//! CAN: kernel support and interfaces. Simulated buses need neither.

use std::io;
use std::num::NonZeroU32;

use rustix::net::{AddressFamily, Protocol, SocketType, socket};

use super::container;
use super::finding::Finding;
use crate::machine::SystemRoot;

/// ARPHRD_CAN, the hardware type of CAN interfaces.
const HARDWARE_TYPE: i64 = 280;
/// `CAN_RAW`: the kernel has no default among the protocols of `AF_CAN`.
const RAW: Option<Protocol> = match NonZeroU32::new(1) {
    Some(number) => Some(Protocol::from_raw(number)),
    None => None,
};

/// Flag of an interface that is up.
const IFF_UP: u32 = 1;
/// Holds one folder per interface.
const INTERFACES: &str = "sys/class/net";

/// All findings of this family.
pub(super) fn examine(root: &SystemRoot) -> Vec<Finding> {
    let opened = socket(AddressFamily::CAN, SocketType::RAW, RAW).map(drop).map_err(io::Error::from);
    let is_supported = opened.is_ok();
    let support = support(root, &opened);
    if is_supported { vec![support, interfaces(root)] } else { vec![support] }
}

fn support(root: &SystemRoot, opened: &io::Result<()>) -> Finding {
    const CHECK: &str = "SocketCAN";
    match opened {
        Ok(()) => Finding::ok(CHECK, "supported by the kernel"),
        Err(error) => {
            Finding::warn(CHECK, format!("not supported ({error})"), "runs can only use simulated buses")
                .mended_by(container::on_host(root, "sudo modprobe can-raw"))
        }
    }
}

/// Why an interface cannot send.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Obstacle {
    Down,
    /// Up, but its controller is in the bus-off state.
    BusOff,
}

impl Obstacle {
    /// From flags and carrier: `operstate` changes up to a second later.
    fn read(root: &SystemRoot, name: &str) -> Option<Self> {
        let flags = root.text(&of_interface(name, "flags"))?;
        let flags = u32::from_str_radix(flags.trim_start_matches("0x"), 16).ok()?;
        if flags & IFF_UP == 0 {
            return Some(Self::Down);
        }
        (root.number(&of_interface(name, "carrier")) == Some(0)).then_some(Self::BusOff)
    }

    fn text(self) -> &'static str {
        match self {
            Self::Down => "down",
            Self::BusOff => "bus-off",
        }
    }

    fn mend(self, root: &SystemRoot, name: &str) -> String {
        match self {
            Self::Down => bring_up(root, name),
            // The kernel refuses `type can restart` if the interface restarts by itself.
            Self::BusOff => format!("sudo ip link set {name} down && sudo ip link set {name} up"),
        }
    }
}

fn interfaces(root: &SystemRoot) -> Finding {
    const CHECK: &str = "CAN interfaces";
    let is_can = |name: &String| root.number(&of_interface(name, "type")) == Some(HARDWARE_TYPE);
    let names: Vec<_> = root.names(INTERFACES).into_iter().filter(is_can).collect();
    if names.is_empty() {
        return Finding::ok(CHECK, "none; simulated buses need none");
    }
    let obstructed: Vec<_> =
        names.iter().filter_map(|name| Some((name, Obstacle::read(root, name)?))).collect();
    if obstructed.is_empty() {
        return Finding::ok(CHECK, names.join(", "));
    }
    let states: Vec<_> =
        obstructed.iter().map(|(name, obstacle)| format!("{name} {}", obstacle.text())).collect();
    let mends: Vec<_> = obstructed.iter().map(|(name, obstacle)| obstacle.mend(root, name)).collect();
    Finding::warn(
        CHECK,
        format!("{}; {}", names.join(", "), states.join(", ")),
        "such an interface cannot send",
    )
    .mended_by(mends.join(" && "))
}

fn of_interface(name: &str, property: &str) -> String {
    format!("{INTERFACES}/{name}/{property}")
}

/// Only an interface of a hardware controller has a bit rate.
fn bring_up(root: &SystemRoot, name: &str) -> String {
    let is_virtual = root.names(&of_interface(name, "device")).is_empty();
    let controller = if is_virtual { "" } else { " type can bitrate 1000000 restart-ms 100" };
    format!("sudo ip link set {name} up txqueuelen 100{controller}")
}

#[cfg(test)]
mod tests {
    use rustix::io::Errno;

    use super::super::finding::Level::{Ok as Fine, Warn};
    use super::*;
    use crate::machine::fixture::Fixture;

    #[test]
    fn a_kernel_without_can_still_has_the_virtual_bus() {
        let machine = Fixture::with_files(&[]);
        assert_eq!(support(&machine.root(), &Ok(())).level, Fine);
        assert_eq!(support(&machine.root(), &Err(io::Error::from_raw_os_error(97))).level, Warn);
    }

    #[test]
    fn a_kernel_with_can_knows_the_protocol_asked_for() {
        let refused = socket(AddressFamily::CAN, SocketType::RAW, RAW).err();
        assert!([None, Some(Errno::AFNOSUPPORT), Some(Errno::PERM)].contains(&refused), "{refused:?}");
    }

    #[test]
    fn interfaces_are_told_by_their_hardware_type_flags_and_carrier() {
        let of = |flags, carrier| {
            let fixture = Fixture::with_files(&[
                ("sys/class/net/eth0/type", "1"),
                ("sys/class/net/eth0/flags", "0x1002"),
                ("sys/class/net/can0/type", "280"),
                ("sys/class/net/can0/flags", flags),
                // As soon after a change.
                ("sys/class/net/can0/operstate", "down"),
                ("sys/class/net/can0/carrier", carrier),
            ]);
            let finding = interfaces(&fixture.root());
            (finding.level, finding.found, finding.mend)
        };
        assert_eq!(of("0x400c1", "1"), (Fine, "can0".to_owned(), None));
        let (level, found, _) = of("0x400c0", "");
        assert_eq!((level, found.as_str()), (Warn, "can0; can0 down"));
        let (level, found, mend) = of("0x400c1", "0");
        assert_eq!((level, found.as_str()), (Warn, "can0; can0 off the bus"));
        assert_eq!(mend.as_deref(), Some("sudo ip link set can0 down && sudo ip link set can0 up"));
        assert_eq!(interfaces(&Fixture::with_files(&[]).root()).level, Fine);
    }

    #[test]
    fn a_bit_rate_is_set_where_a_controller_has_one() {
        let down = Fixture::with_files(&[
            ("sys/class/net/can0/type", "280"),
            ("sys/class/net/can0/flags", "0x400c0"),
            ("sys/class/net/can0/device/vendor", "0x10e8"),
            ("sys/class/net/vcan0/type", "280"),
            ("sys/class/net/vcan0/flags", "0x80"),
        ]);
        assert_eq!(
            interfaces(&down.root()).mend.as_deref(),
            Some(
                "sudo ip link set can0 up txqueuelen 100 type can bitrate 1000000 restart-ms 100 && \
                 sudo ip link set vcan0 up txqueuelen 100"
            )
        );
    }
}
