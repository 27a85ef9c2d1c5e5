//! Memory: transparent huge pages, and room in /dev/shm.

use rustix::fs::statvfs;

use super::container;
use super::finding::Finding;
use crate::machine::SystemRoot;

const SHARED_MEMORY: &str = "/dev/shm";
/// Three times what a rig's topics need.
const ENOUGH_BYTES: u64 = 64 << 20;

/// All findings of this family.
pub(super) fn examine(root: &SystemRoot) -> Vec<Finding> {
    let shared = statvfs(SHARED_MEMORY)
        .map_or(Shared::Absent, |of| Shared::from_blocks(of.f_blocks, of.f_bavail * of.f_frsize));
    vec![huge_pages(root), room(root, shared)]
}

/// Free shared memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shared {
    Absent,
    Free(u64),
    /// Limited by the machine's memory only.
    Unbounded,
}

impl Shared {
    /// A tmpfs without limit reports zero blocks.
    fn from_blocks(blocks: u64, free_bytes: u64) -> Self {
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
        return Finding::warn(CHECK, found, "a cycle waits when it touches a page that the kernel is moving")
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
            Finding::bad(CHECK, found, "a run may have no room for its topics")
                .mended_by(enlarge(format!("sudo mount -o remount,size=1g {SHARED_MEMORY}")))
        }
        Shared::Free(free) => Finding::ok(CHECK, format!("{} MiB free in {SHARED_MEMORY}", free >> 20)),
        Shared::Unbounded => Finding::ok(CHECK, format!("{SHARED_MEMORY} has no limit")),
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
            huge_pages(&Fixture::with_files(&[("sys/kernel/mm/transparent_hugepage/enabled", modes)]).root())
                .level
        };
        assert_eq!(of("[always] madvise never"), Warn);
        assert_eq!(of("always [madvise] never"), Ok);
        assert_eq!(huge_pages(&Fixture::with_files(&[]).root()).level, Ok);
    }

    #[test]
    fn a_container_with_little_shared_memory_is_bad() {
        let container = Fixture::with_files(&[(".dockerenv", "")]);
        let of = |shared| room(&container.root(), shared);
        let levels = [Shared::Absent, Shared::Free(60 << 20), Shared::Free(1 << 30)].map(|it| of(it).level);
        assert_eq!(levels, [Bad, Bad, Ok]);
        assert_eq!(of(Shared::Free(60 << 20)).mend.as_deref(), Some("docker run --shm-size 1g …"));
    }

    #[test]
    fn shared_memory_without_a_bound_is_not_full() {
        assert_eq!(Shared::from_blocks(100, 0), Shared::Free(0));
        let machine = Fixture::with_files(&[]);
        let finding = room(&machine.root(), Shared::from_blocks(0, 0));
        assert_eq!((finding.level, finding.found.as_str()), (Ok, "/dev/shm has no bound"));
    }
}
