//! What a run shares with others: memory, CAN interfaces, and the machine with other rigs of this user.

use std::io;

use masseter_can::{Interface, bring_up_command};
use masseter_machine::SystemRoot;
use masseter_runtime::transport::{Domain, DomainError};
use masseter_scenario::wording::counted;

use super::finding::{Finding, on_host, start_with};

pub(super) const SHARED_MEMORY: &str = "/dev/shm";
/// Three times what a rig's topics need.
const ENOUGH_BYTES: u64 = 64 << 20;

/// The finding about transparent huge pages.
pub(super) fn huge_pages(root: &SystemRoot) -> Finding {
    const MODES: &str = "sys/kernel/mm/transparent_hugepage/enabled";
    let modes = root.text(MODES).unwrap_or_else(|| "none".to_owned());
    if !modes.contains("[always]") {
        return Finding::ok(format!("transparent: {modes}"));
    }
    let cost = "a cycle waits when it touches a page that the kernel is moving";
    Finding::warn(format!("transparent: {modes}"), cost)
        .with_remedy(on_host(root, format!("echo madvise | sudo tee /{MODES}")))
}

/// Judges blocks and free bytes of the file system of shared memory; `None` without one.
pub(super) fn room(root: &SystemRoot, shared: Option<(u64, u64)>) -> Finding {
    let enlarge =
        |mount: &str| start_with(root, "--shm-size 1g", format!("sudo mount {mount} {SHARED_MEMORY}"));
    let free = shared.map_or(0, |(_, free)| free);
    let found = format!("{} MiB free in {SHARED_MEMORY}", free >> 20);
    match shared {
        None => Finding::bad(format!("no {SHARED_MEMORY}"), "the processes cannot exchange messages")
            .with_remedy(enlarge("-t tmpfs tmpfs")),
        // A tmpfs without limit.
        Some((0, _)) => Finding::ok(format!("{SHARED_MEMORY} has no limit")),
        Some((_, ENOUGH_BYTES..)) => Finding::ok(found),
        Some(_) => Finding::bad(found, "a run may have no room for its topics")
            .with_remedy(enlarge("-o remount,size=1g")),
    }
}

pub(super) fn unsupported(root: &SystemRoot, error: &io::Error) -> Finding {
    Finding::warn(format!("not supported ({error})"), "runs can only use simulated buses")
        .with_remedy(on_host(root, "sudo modprobe can-raw"))
}

pub(super) fn interfaces(root: &SystemRoot) -> Finding {
    let interfaces = Interface::list(root.path());
    let names = interfaces.iter().map(|interface| interface.name.as_str()).collect::<Vec<_>>().join(", ");
    if names.is_empty() {
        return Finding::ok("none; simulated buses need none");
    }
    let (states, remedies): (Vec<_>, Vec<_>) = interfaces.iter().filter_map(obstacle).unzip();
    if states.is_empty() {
        return Finding::ok(names);
    }
    let found = format!("{names}; {}", states.join(", "));
    Finding::warn(found, "such an interface cannot send").with_remedy(remedies.join(" && "))
}

/// Why an interface cannot send, and the command that remedies it.
fn obstacle(
    Interface { name, is_up, is_bus_off, is_virtual, driver, .. }: &Interface,
) -> Option<(String, String)> {
    if !is_up {
        let bitrate_bps = (!is_virtual).then_some(1_000_000);
        let bring_up = format!("sudo {}", bring_up_command(name, driver.as_deref(), bitrate_bps));
        return Some((format!("{name} down"), bring_up));
    }
    // The kernel refuses `type can restart` if the interface restarts by itself.
    let restart = format!("sudo ip link set {name} down && sudo ip link set {name} up");
    is_bus_off.then(|| (format!("{name} bus-off"), restart))
}

/// Running and killed ones.
pub(super) fn count_rigs() -> Result<[usize; 2], DomainError> {
    let alive = Domain::all()?.iter().map(Domain::is_alive).collect::<Result<Vec<_>, _>>()?;
    Ok([true, false].map(|wanted| alive.iter().filter(|&&is_alive| is_alive == wanted).count()))
}

/// The finding about other rigs: running ones, and files of killed ones in shared memory.
pub(super) fn other_rigs(count: &Result<[usize; 2], DomainError>) -> Finding {
    match count {
        Ok([0, 0]) => Finding::ok("none running, no files of killed ones"),
        Ok([alive, 0]) => {
            Finding::warn(format!("{alive} running"), "rigs on the same cores delay each other")
                .with_remedy("masseter run --cores N,N")
        }
        Ok([alive, dead]) => {
            let found = format!("{alive} running, files of {}", counted(*dead as u64, "killed one"));
            Finding::warn(found, "these files occupy shared memory").with_remedy("masseter clean")
        }
        Err(error) => Finding::warn(error.to_string(), "files of killed runs cannot be removed"),
    }
}

#[cfg(test)]
mod tests {
    use masseter_can::is_supported;
    use masseter_machine::fixture::Fixture;
    use rustix::io::Errno;

    use super::super::finding::Level::{Bad, Ok as Fine, Warn};
    use super::*;

    #[test]
    fn huge_pages_made_behind_the_back_are_warned_of() {
        let of = |modes| {
            huge_pages(&Fixture::with_files(&[("sys/kernel/mm/transparent_hugepage/enabled", modes)]).root())
                .level
        };
        assert_eq!(of("[always] madvise never"), Warn);
        assert_eq!(of("always [madvise] never"), Fine);
        assert_eq!(huge_pages(&Fixture::with_files(&[]).root()).level, Fine);
    }

    #[test]
    fn a_container_with_little_shared_memory_is_bad() {
        let container = Fixture::with_files(&[(".dockerenv", "")]);
        let of = |shared| room(&container.root(), shared);
        let levels = [None, Some((100, 60 << 20)), Some((100, 1 << 30))].map(|shared| of(shared).level);
        assert_eq!(levels, [Bad, Bad, Fine]);
        assert_eq!(of(Some((100, 60 << 20))).remedy.as_deref(), Some("docker run --shm-size 1g …"));
    }

    #[test]
    fn shared_memory_without_a_bound_is_not_full() {
        let machine = Fixture::with_files(&[]);
        assert_eq!(room(&machine.root(), Some((100, 0))).level, Bad);
        let finding = room(&machine.root(), Some((0, 0)));
        assert_eq!((finding.level, finding.found.as_str()), (Fine, "/dev/shm has no limit"));
    }

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
                "sudo ip link set can0 up txqueuelen 50 type can bitrate 1000000 restart-ms 100 && \
                 sudo ip link set vcan0 up txqueuelen 50"
            )
        );
    }

    #[test]
    fn dead_rigs_are_swept_and_living_ones_avoided() {
        let remedy = |alive, dead| other_rigs(&Ok([alive, dead])).remedy;
        assert_eq!(remedy(0, 0), None);
        assert!(remedy(1, 0).unwrap().contains("--cores"));
        assert_eq!(remedy(1, 2).as_deref(), Some("masseter clean"));
    }
}
