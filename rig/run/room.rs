//! Room for a run: memory, file size, disk and shared memory, checked before anything is armed.

use std::fs::{self, OpenOptions};
use std::{io, path::Path};

use anyhow::{Context, anyhow, ensure};
use rustix::fs::{FallocateFlags, fallocate, statvfs};
use rustix::process::{Resource, getrlimit};

const SHARED_MEMORY: &str = "/dev/shm";
/// What the topics of a rig take in shared memory: 27 MB measured, and some for observers.
const SHARED_BYTES: u64 = 36_000_000;
/// What a cycle leaves on the disk: 1.7 kB measured, half of them in the recording.
const CYCLE_BYTES: f64 = 2000.0;
/// What a run leaves on the disk besides: page, figures, scenario.
const REPORT_BYTES: f64 = 4e6;
/// Start and end of a run, around the motion, s.
const AROUND_MOTION_S: f64 = 5.0;
/// The least address space and data of a process: twice what the default run takes.
const LEAST_MEMORY: [(Resource, &str, &str, u64); 2] =
    [(Resource::As, "address space", "v", 200_000_000), (Resource::Data, "data", "d", 120_000_000)];

/// The least number of open files of a process: the recorder of a run with eight live clients has 74.
const LEAST_FILES: u64 = 128;

/// Refuses a limit under which a process would die of its next file.
pub(super) fn check_open_files() -> anyhow::Result<()> {
    let files = getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX);
    ensure!(
        files >= LEAST_FILES,
        "a process may open {files} files, and a run needs {LEAST_FILES}: raise the limit ('ulimit -n 1024')"
    );
    Ok(())
}

/// Refuses limits under which a process would die of its next allocation.
pub(super) fn check_memory_limits() -> anyhow::Result<()> {
    for (resource, name, option, least) in LEAST_MEMORY {
        let limit = getrlimit(resource).current.unwrap_or(u64::MAX);
        ensure!(
            limit >= least,
            "a process may have {} of {name}, and a run needs {}: raise the limit ('ulimit -{option} unlimited')",
            megabytes(limit),
            megabytes(least)
        );
    }
    Ok(())
}

/// Refuses a run whose files have no room in the folder of this absolute path, which need not exist yet.
pub(super) fn check_disk(path: &Path, plan: &masseter_plan::RunPlan) -> anyhow::Result<()> {
    let run_s = plan.trajectory.duration_s() + AROUND_MOTION_S;
    let needed = (run_s * f64::from(plan.scenario.rate_hz) * CYCLE_BYTES + REPORT_BYTES) as u64;
    let largest = getrlimit(Resource::Fsize).current.unwrap_or(u64::MAX);
    ensure!(
        largest >= needed,
        "a file may have {}, and the recording may need {}: raise the limit ('ulimit -f unlimited'), or shorten the \
         run (--duration)",
        megabytes(largest),
        megabytes(needed)
    );
    let existing = path.ancestors().find(|folder| folder.is_dir()).unwrap_or(path);
    let free = free_bytes(existing)?;
    ensure!(
        free >= needed,
        "{} has {} free, and the run may need {}: free some, choose another disk (--out), or shorten the run \
         (--duration)",
        existing.display(),
        megabytes(free),
        megabytes(needed)
    );
    Ok(())
}

/// Refuses a rig whose topics have no room in shared memory: the kernel ends a process that touches a page for which
/// there is none.
pub(super) fn check_shared_memory() -> anyhow::Result<()> {
    require_writable(SHARED_MEMORY.as_ref())?;
    let free = free_bytes(SHARED_MEMORY.as_ref())?;
    ensure!(
        free >= SHARED_BYTES,
        "{SHARED_MEMORY} has {} free, and a rig needs {}: {}",
        megabytes(free),
        megabytes(SHARED_BYTES),
        more_shared_memory()
    );
    Ok(())
}

fn require_writable(folder: &Path) -> anyhow::Result<()> {
    let unwritable = || {
        let folder = folder.display();
        format!(
            "{folder} takes no files, and a rig needs it for its messages; --clock virtual needs no shared memory"
        )
    };
    tempfile::tempfile_in(folder).map(drop).with_context(unwritable)
}

/// Gives every page of the domain's shared memory its place, once all processes have opened their ports.
pub(super) fn reserve_shared_memory(domain: &masseter_runtime::transport::Domain) -> anyhow::Result<()> {
    for path in domain.own_shared_memory()? {
        let file = OpenOptions::new().read(true).write(true).open(&path);
        let allocated = file.and_then(|file| allocate(&file, file.metadata()?.len()));
        // As text: full shared memory is no full disk.
        allocated.map_err(|error| {
            anyhow!("no room in shared memory for {} ({error}): {}", path.display(), more_shared_memory())
        })?;
    }
    Ok(())
}

/// What to do for a rig and as much again.
fn more_shared_memory() -> String {
    let mebibytes = (2 * SHARED_BYTES).div_ceil(1 << 20);
    format!(
        "remove leftovers ('masseter clean'), or enlarge it ('mount -o remount,size={mebibytes}m {SHARED_MEMORY}'; in a \
         container '--shm-size={mebibytes}m')"
    )
}

/// Room on the disk for the manifest and the summary at the end of a run. Its files have no names, so nothing of them
/// outlives a kill.
pub(super) struct Reserve {
    pub manifest: fs::File,
    pub summary: fs::File,
}

impl Reserve {
    pub(super) fn allocate_in(folder: &Path) -> io::Result<Self> {
        let reserve = |bytes| {
            let file = tempfile::tempfile_in(folder)?;
            allocate(&file, bytes)?;
            Ok::<_, io::Error>(file)
        };
        Ok(Self { manifest: reserve(512 << 10)?, summary: reserve(1 << 20)? })
    }
}

/// Some file systems cannot allocate ahead.
fn allocate(file: &fs::File, bytes: u64) -> io::Result<()> {
    match fallocate(file, FallocateFlags::empty(), 0, bytes.max(1)) {
        Err(rustix::io::Errno::OPNOTSUPP) => Ok(()),
        allocated => Ok(allocated?),
    }
}

/// What an ordinary user may still write; a file system that does not count its blocks has no limit.
fn free_bytes(folder: &Path) -> anyhow::Result<u64> {
    let found =
        statvfs(folder).with_context(|| format!("cannot see how much room {} has", folder.display()))?;
    Ok(if found.f_blocks == 0 { u64::MAX } else { found.f_bavail.saturating_mul(found.f_frsize) })
}

fn megabytes(bytes: u64) -> String {
    format!("{:.1} MB", bytes as f64 / 1e6)
}

#[cfg(test)]
mod tests {
    use masseter_runtime::transport::ScratchDomain;
    use masseter_terminal::{Exit, OrFailure};

    use super::*;

    #[test]
    fn shared_memory_without_room_is_no_full_disk_and_no_death() {
        let domain = ScratchDomain::claim("test-no-room").unwrap();
        let path = Path::new(SHARED_MEMORY).join(domain.prefix().unwrap() + "large");
        fs::File::create_new(&path).unwrap().set_len(1 << 50).unwrap();
        let failure = reserve_shared_memory(&domain).usage().unwrap_err();
        assert_eq!(failure.exit, Exit::Usage);
        assert!(failure.error.to_string().contains("--shm-size=69m"), "{}", failure.error);
    }

    #[test]
    fn shared_memory_that_takes_no_files_is_named() {
        require_writable(SHARED_MEMORY.as_ref()).unwrap();
        let refusal = require_writable("/proc".as_ref()).unwrap_err().to_string();
        assert!(
            refusal.starts_with("/proc takes no files") && refusal.contains("--clock virtual"),
            "{refusal}"
        );
    }

    #[test]
    fn a_file_of_others_is_not_reserved() {
        let domain = ScratchDomain::claim("test-not-reserved").unwrap();
        let path = Path::new(SHARED_MEMORY).join(domain.prefix().unwrap() + "x");
        std::os::unix::fs::symlink("/dev/null", path).unwrap();
        reserve_shared_memory(&domain).unwrap();
    }
}
