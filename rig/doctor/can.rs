//! CAN: kernel support and interfaces. Simulated buses need neither.

use std::io;

use masseter_can::{Interface, is_supported};

use super::container::on_host;
use super::finding::Finding;
use masseter_machine::SystemRoot;

/// All findings of this family.
pub(super) fn examine(root: &SystemRoot) -> Vec<Finding> {
    match is_supported() {
        Ok(()) => vec![Finding::ok(SUPPORT, "supported by the kernel"), interfaces(root)],
        Err(error) => vec![unsupported(root, &error)],
    }
}

const SUPPORT: &str = "SocketCAN";

fn unsupported(root: &SystemRoot, error: &io::Error) -> Finding {
    Finding::warn(SUPPORT, format!("not supported ({error})"), "runs can only use simulated buses")
        .with_remedy(on_host(root, "sudo modprobe can-raw"))
}

fn interfaces(root: &SystemRoot) -> Finding {
    const CHECK: &str = "CAN interfaces";
    let interfaces = Interface::list(root.path());
    let names = interfaces.iter().map(|interface| interface.name.as_str()).collect::<Vec<_>>().join(", ");
    if names.is_empty() {
        return Finding::ok(CHECK, "none; simulated buses need none");
    }
    let (states, remedies): (Vec<_>, Vec<_>) = interfaces.iter().filter_map(obstacle).unzip();
    if states.is_empty() {
        return Finding::ok(CHECK, names);
    }
    let found = format!("{names}; {}", states.join(", "));
    Finding::warn(CHECK, found, "such an interface cannot send").with_remedy(remedies.join(" && "))
}

/// Why an interface cannot send, and the command that remedies it.
fn obstacle(Interface { name, is_up, is_bus_off, is_virtual, .. }: &Interface) -> Option<(String, String)> {
    if !is_up {
        let controller = if *is_virtual { "" } else { " type can bitrate 1000000 restart-ms 100" };
        let bring_up = format!("sudo ip link set {name} up txqueuelen 100{controller}");
        return Some((format!("{name} down"), bring_up));
    }
    // The kernel refuses `type can restart` if the interface restarts by itself.
    let restart = format!("sudo ip link set {name} down && sudo ip link set {name} up");
    is_bus_off.then(|| (format!("{name} bus-off"), restart))
}

#[cfg(test)]
mod tests {
    use rustix::io::Errno;

    use super::super::finding::Level::{Ok as Fine, Warn};
    use super::*;
    use masseter_machine::fixture::Fixture;

    #[test]
    fn a_kernel_without_can_is_a_warning_only() {
        let machine = Fixture::with_files(&[]);
        assert_eq!(unsupported(&machine.root(), &Errno::AFNOSUPPORT.into()).level, Warn);
    }

    #[test]
    fn a_kernel_with_can_knows_the_protocol_asked_for() {
        let refused = is_supported().err().map(|error| Errno::from_io_error(&error).unwrap());
        assert!([None, Some(Errno::AFNOSUPPORT), Some(Errno::PERM)].contains(&refused), "{refused:?}");
    }

    #[test]
    fn interfaces_are_judged_by_hardware_type_flags_and_carrier() {
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
            (finding.level, finding.found, finding.remedy)
        };
        assert_eq!(of("0x400c1", "1"), (Fine, "can0".to_owned(), None));
        let (level, found, _) = of("0x400c0", "");
        assert_eq!((level, found.as_str()), (Warn, "can0; can0 down"));
        let (level, found, remedy) = of("0x400c1", "0");
        assert_eq!((level, found.as_str()), (Warn, "can0; can0 bus-off"));
        assert_eq!(remedy.as_deref(), Some("sudo ip link set can0 down && sudo ip link set can0 up"));
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
            interfaces(&down.root()).remedy.as_deref(),
            Some(
                "sudo ip link set can0 up txqueuelen 100 type can bitrate 1000000 restart-ms 100 && \
                 sudo ip link set vcan0 up txqueuelen 100"
            )
        );
    }
}
