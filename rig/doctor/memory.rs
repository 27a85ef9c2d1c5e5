//! Memory: transparent huge pages, and room in /dev/shm.

use rustix::fs::statvfs;

use super::container::{on_host, start_with};
use super::finding::Finding;
use masseter_machine::SystemRoot;

const SHARED_MEMORY: &str = "/dev/shm";
/// Three times what a rig's topics need.
const ENOUGH_BYTES: u64 = 64 << 20;

/// All findings of this family.
pub(super) fn examine(root: &SystemRoot) -> Vec<Finding> {
    let shared = statvfs(SHARED_MEMORY).map(|of| (of.f_blocks, of.f_bavail * of.f_frsize));
    vec![huge_pages(root), room(root, shared.ok())]
}

fn huge_pages(root: &SystemRoot) -> Finding {
    const CHECK: &str = "huge pages";
    const MODES: &str = "sys/kernel/mm/transparent_hugepage/enabled";
    let modes = root.text(MODES).unwrap_or_else(|| "none".to_owned());
    if !modes.contains("[always]") {
        return Finding::ok(CHECK, format!("transparent: {modes}"));
    }
    let cost = "a cycle waits when it touches a page that the kernel is moving";
    Finding::warn(CHECK, format!("transparent: {modes}"), cost)
        .with_remedy(on_host(root, format!("echo madvise | sudo tee /{MODES}")))
}

/// Judges blocks and free bytes of the file system of shared memory; none if there is none.
fn room(root: &SystemRoot, shared: Option<(u64, u64)>) -> Finding {
    const CHECK: &str = "shared memory";
    let enlarge =
        |mount: &str| start_with(root, "--shm-size 1g", format!("sudo mount {mount} {SHARED_MEMORY}"));
    match shared {
        None => Finding::bad(CHECK, format!("no {SHARED_MEMORY}"), "the processes cannot exchange messages")
            .with_remedy(enlarge("-t tmpfs tmpfs")),
        // A tmpfs without limit.
        Some((0, _)) => Finding::ok(CHECK, format!("{SHARED_MEMORY} has no limit")),
        Some((_, free)) => {
            let found = format!("{} MiB free in {SHARED_MEMORY}", free >> 20);
            if free >= ENOUGH_BYTES {
                return Finding::ok(CHECK, found);
            }
            Finding::bad(CHECK, found, "a run may have no room for its topics")
                .with_remedy(enlarge("-o remount,size=1g"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::finding::Level::{Bad, Ok, Warn};
    use super::*;
    use masseter_machine::fixture::Fixture;

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
        let levels = [None, Some((100, 60 << 20)), Some((100, 1 << 30))].map(|shared| of(shared).level);
        assert_eq!(levels, [Bad, Bad, Ok]);
        assert_eq!(of(Some((100, 60 << 20))).remedy.as_deref(), Some("docker run --shm-size 1g …"));
    }

    #[test]
    fn shared_memory_without_a_bound_is_not_full() {
        let machine = Fixture::with_files(&[]);
        assert_eq!(room(&machine.root(), Some((100, 0))).level, Bad);
        let finding = room(&machine.root(), Some((0, 0)));
        assert_eq!((finding.level, finding.found.as_str()), (Ok, "/dev/shm has no limit"));
    }
}
