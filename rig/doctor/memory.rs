//! Memory: transparent huge pages, and room in /dev/shm.

use rustix::fs::statvfs;

use super::container;
use super::finding::Finding;
use crate::machine::SystemRoot;

const SHARED_MEMORY: &str = "/dev/shm";
/// A rig's topics take about a third of this.
const ENOUGH_BYTES: u64 = 64 << 20;

/// All findings of this family.
pub(super) fn examine(root: &SystemRoot) -> Vec<Finding> {
    let shared = statvfs(SHARED_MEMORY)
        .map_or(Shared::Absent, |of| Shared::of_blocks(of.f_blocks, of.f_bavail * of.f_frsize));
    vec![huge_pages(root), room(root, shared)]
}

/// Room in shared memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shared {
    Absent,
    Free(u64),
    /// As much as the machine has.
    Unbounded,
}

impl Shared {
    /// A file system in memory that was given no bound says that it has no blocks at all.
    fn of_blocks(blocks: u64, free_bytes: u64) -> Self {
        if blocks == 0 { Self::Unbounded } else { Self::Free(free_bytes) }
    }
}

fn huge_pages(root: &SystemRoot) -> Finding {
    const CHECK: &str = "huge pages";
    let reserved = root.number("proc/sys/vm/nr_hugepages").unwrap_or(0);
    let Some(modes) = root.text("sys/kernel/mm/transparent_hugepage/enabled") else {
        return Finding::ok(CHECK, format!("{reserved} reserved, no transparent ones"));
    };
    let found = format!("{reserved} reserved, transparent: {modes}");
    if modes.contains("[always]") {
        return Finding::warn(
            CHECK,
            found,
            "the kernel moves pages about, and a cycle that touches one waits",
        )
        .mended_by(container::on_host(
            root,
            "echo madvise | sudo tee /sys/kernel/mm/transparent_hugepage/enabled",
        ));
    }
    Finding::ok(CHECK, found)
}

fn room(root: &SystemRoot, shared: Shared) -> Finding {
    const CHECK: &str = "shared memory";
    let enlarge = |mount: String| container::start_with(root, "--shm-size 1g", mount);
    match shared {
        Shared::Absent => {
            Finding::bad(CHECK, format!("no {SHARED_MEMORY}"), "the processes cannot exchange messages")
                .mended_by(enlarge(format!("sudo mount -t tmpfs tmpfs {SHARED_MEMORY}")))
        }
        Shared::Free(free) if free < ENOUGH_BYTES => {
            let found = format!("{} MiB free in {SHARED_MEMORY}", free >> 20);
            Finding::bad(CHECK, found, "a run may not find room for its topics")
                .mended_by(enlarge(format!("sudo mount -o remount,size=1g {SHARED_MEMORY}")))
        }
        Shared::Free(free) => Finding::ok(CHECK, format!("{} MiB free in {SHARED_MEMORY}", free >> 20)),
        Shared::Unbounded => Finding::ok(CHECK, format!("{SHARED_MEMORY} has no bound")),
    }
}

#[cfg(test)]
mod tests {
    use super::super::finding::Level::{Bad, Ok, Warn};
    use super::*;
    use crate::machine::fixture::Fixture;

    #[test]
    fn huge_pages_made_behind_the_back_are_warned_of() {
        let of = |modes| {
            huge_pages(&Fixture::of(&[("sys/kernel/mm/transparent_hugepage/enabled", modes)]).root()).level
        };
        assert_eq!(of("[always] madvise never"), Warn);
        assert_eq!(of("always [madvise] never"), Ok);
        assert_eq!(huge_pages(&Fixture::of(&[]).root()).level, Ok);
    }

    #[test]
    fn a_container_with_little_shared_memory_is_bad() {
        let container = Fixture::of(&[(".dockerenv", "")]);
        let of = |shared| room(&container.root(), shared);
        let levels = [Shared::Absent, Shared::Free(60 << 20), Shared::Free(1 << 30)].map(|it| of(it).level);
        assert_eq!(levels, [Bad, Bad, Ok]);
        assert_eq!(of(Shared::Free(60 << 20)).mend.as_deref(), Some("docker run --shm-size 1g …"));
    }

    #[test]
    fn shared_memory_without_a_bound_is_not_full() {
        assert_eq!(Shared::of_blocks(100, 0), Shared::Free(0));
        let machine = Fixture::of(&[]);
        let finding = room(&machine.root(), Shared::of_blocks(0, 0));
        assert_eq!((finding.level, finding.found.as_str()), (Ok, "/dev/shm has no bound"));
    }
}
