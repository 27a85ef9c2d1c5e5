//! CAN: whether the kernel speaks it, and which interfaces there are. The virtual bus needs neither.

use std::io;

use rustix::net::{AddressFamily, SocketType, socket};

use super::finding::Finding;
use crate::machine::SystemRoot;

/// ARPHRD_CAN, the hardware type of CAN interfaces.
const HARDWARE_TYPE: i64 = 280;

/// All findings of this family.
pub(super) fn examine(root: &SystemRoot) -> Vec<Finding> {
    let opened = socket(AddressFamily::CAN, SocketType::RAW, None).map(drop).map_err(io::Error::from);
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
    let folder = "sys/class/net";
    let is_can = |name: &String| root.number(&format!("{folder}/{name}/type")) == Some(HARDWARE_TYPE);
    let names: Vec<_> = root.names(folder).into_iter().filter(is_can).collect();
    let down: Vec<_> = names
        .iter()
        .filter(|name| root.text(&format!("{folder}/{name}/operstate")).as_deref() == Some("down"))
        .cloned()
        .collect();
    match (names.is_empty(), down.first()) {
        (true, _) => Finding::ok(CHECK, "none; the virtual bus needs none"),
        (false, None) => Finding::ok(CHECK, names.join(", ")),
        (false, Some(first)) => Finding::warn(
            CHECK,
            format!("{}; down: {}", names.join(", "), down.join(", ")),
            "nothing can be sent on an interface that is down",
        )
        .mended_by(format!("sudo ip link set {first} up type can bitrate 1000000")),
    }
}

#[cfg(test)]
mod tests {
    use super::super::finding::Level::{Ok as Fine, Warn};
    use super::*;
    use crate::machine::fixture::Fixture;

    #[test]
    fn a_kernel_without_can_still_has_the_virtual_bus() {
        assert_eq!(support(&Ok(())).level, Fine);
        assert_eq!(support(&Err(io::Error::from_raw_os_error(97))).level, Warn);
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
        assert!(of("down").mend.unwrap().contains("ip link set can0 up"));
        assert_eq!(interfaces(&Fixture::of(&[]).root()).level, Fine);
    }
}
