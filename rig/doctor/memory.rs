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
    let free = statvfs(SHARED_MEMORY).ok().map(|of| of.f_bavail * of.f_frsize);
    vec![huge_pages(root), room(root, free)]
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

fn room(root: &SystemRoot, free_bytes: Option<u64>) -> Finding {
    const CHECK: &str = "shared memory";
    let enlarge = |mount: String| container::start_with(root, "--shm-size 1g", mount);
    match free_bytes {
        None => Finding::bad(CHECK, format!("no {SHARED_MEMORY}"), "the processes cannot exchange messages")
            .mended_by(enlarge(format!("sudo mount -t tmpfs tmpfs {SHARED_MEMORY}"))),
        Some(free) if free < ENOUGH_BYTES => {
            let found = format!("{} MiB free in {SHARED_MEMORY}", free >> 20);
            Finding::bad(CHECK, found, "a run may not find room for its topics")
                .mended_by(enlarge(format!("sudo mount -o remount,size=1g {SHARED_MEMORY}")))
        }
        Some(free) => Finding::ok(CHECK, format!("{} MiB free in {SHARED_MEMORY}", free >> 20)),
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
        let of = |free| room(&container.root(), free);
        assert_eq!([None, Some(60 << 20), Some(1 << 30)].map(|free| of(free).level), [Bad, Bad, Ok]);
        assert_eq!(of(Some(60 << 20)).mend.as_deref(), Some("docker run --shm-size 1g …"));
    }
}
