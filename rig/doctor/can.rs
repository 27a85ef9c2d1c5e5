//! CAN: whether the kernel speaks it, and which interfaces there are. The virtual bus needs neither.

use std::io;
use std::num::NonZeroU32;

use rustix::net::{AddressFamily, Protocol, SocketType, socket};

use super::finding::Finding;
use crate::machine::SystemRoot;

/// ARPHRD_CAN, the hardware type of CAN interfaces.
const HARDWARE_TYPE: i64 = 280;
/// `CAN_RAW`: the kernel has no default among the protocols of `AF_CAN`.
const RAW: Option<Protocol> = match NonZeroU32::new(1) {
    Some(number) => Some(Protocol::from_raw(number)),
    None => None,
};

/// A folder an interface.
const INTERFACES: &str = "sys/class/net";

/// All findings of this family.
pub(super) fn examine(root: &SystemRoot) -> Vec<Finding> {
    let opened = socket(AddressFamily::CAN, SocketType::RAW, RAW).map(drop).map_err(io::Error::from);
    let is_supported = opened.is_ok();
    let support = support(&opened);
    if is_supported { vec![support, interfaces(root)] } else { vec![support] }
}

fn support(opened: &io::Result<()>) -> Finding {
    const CHECK: &str = "SocketCAN";
    match opened {
        Ok(()) => Finding::ok(CHECK, "supported by the kernel"),
        Err(error) => Finding::warn(
            CHECK,
            format!("not supported ({error})"),
            "only the virtual bus can be used, no CAN interface",
        )
        .mended_by("sudo modprobe can-raw"),
    }
}

fn interfaces(root: &SystemRoot) -> Finding {
    const CHECK: &str = "CAN interfaces";
    let is_can = |name: &String| root.number(&of_interface(name, "type")) == Some(HARDWARE_TYPE);
    let names: Vec<_> = root.names(INTERFACES).into_iter().filter(is_can).collect();
    let is_down = |name: &&String| root.text(&of_interface(name, "operstate")).as_deref() == Some("down");
    let down: Vec<_> = names.iter().filter(is_down).cloned().collect();
    if names.is_empty() {
        return Finding::ok(CHECK, "none; the virtual bus needs none");
    }
    if down.is_empty() {
        return Finding::ok(CHECK, names.join(", "));
    }
    let mends: Vec<_> = down.iter().map(|name| bring_up(root, name)).collect();
    Finding::warn(
        CHECK,
        format!("{}; down: {}", names.join(", "), down.join(", ")),
        "nothing can be sent on an interface that is down",
    )
    .mended_by(mends.join(" && "))
}

fn of_interface(name: &str, property: &str) -> String {
    format!("{INTERFACES}/{name}/{property}")
}

/// Only an interface with a controller behind it has a bit rate.
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
        assert_eq!(support(&Ok(())).level, Fine);
        assert_eq!(support(&Err(io::Error::from_raw_os_error(97))).level, Warn);
    }

    #[test]
    fn a_kernel_with_can_knows_the_protocol_asked_for() {
        let refused = socket(AddressFamily::CAN, SocketType::RAW, RAW).err();
        assert!([None, Some(Errno::AFNOSUPPORT), Some(Errno::PERM)].contains(&refused), "{refused:?}");
    }

    #[test]
    fn interfaces_are_told_by_their_hardware_type() {
        let of = |state| {
            interfaces(
                &Fixture::of(&[
                    ("sys/class/net/eth0/type", "1"),
                    ("sys/class/net/eth0/operstate", "down"),
                    ("sys/class/net/can0/type", "280"),
                    ("sys/class/net/can0/operstate", state),
                ])
                .root(),
            )
        };
        assert_eq!((of("up").level, of("up").found.as_str()), (Fine, "can0"));
        assert_eq!(of("down").level, Warn);
        assert_eq!(interfaces(&Fixture::of(&[]).root()).level, Fine);
    }

    #[test]
    fn a_bit_rate_is_set_where_a_controller_has_one() {
        let down = Fixture::of(&[
            ("sys/class/net/can0/type", "280"),
            ("sys/class/net/can0/operstate", "down"),
            ("sys/class/net/can0/device/vendor", "0x10e8"),
            ("sys/class/net/vcan0/type", "280"),
            ("sys/class/net/vcan0/operstate", "down"),
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
