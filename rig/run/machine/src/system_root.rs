//! Files of `/proc` and `/sys`, below a root that tests can replace.

use std::path::{Path, PathBuf};
use std::{fs, ops::RangeInclusive};

/// The folder below which `proc` and `sys` lie.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SystemRoot(PathBuf);

impl SystemRoot {
    /// The running machine.
    pub fn of_this_machine() -> Self {
        Self(PathBuf::from("/"))
    }

    /// A copy of `/proc` and `/sys`, or a part of one, below `path`.
    pub fn at(path: &Path) -> Self {
        Self(path.to_owned())
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// A file's text without surrounding white space; none if the file cannot be read.
    pub fn text(&self, path: &str) -> Option<String> {
        Some(fs::read_to_string(self.0.join(path)).ok()?.trim().to_owned())
    }

    /// A file that holds one number.
    pub fn number(&self, path: &str) -> Option<i64> {
        self.text(path)?.parse().ok()
    }

    /// The names in a folder, sorted; empty if the folder does not exist.
    pub fn names(&self, folder: &str) -> Vec<String> {
        let entries = fs::read_dir(self.0.join(folder)).into_iter().flatten().flatten();
        let mut names: Vec<_> = entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
        names.sort();
        names
    }

    /// Ticks of all cores together since boot: user, nice, system, idle, iowait, irq, softirq and steal. User time
    /// includes that of guests.
    pub fn core_ticks(&self) -> Option<[u64; 8]> {
        let stat = self.text("proc/stat")?;
        let counts = stat.lines().find_map(|line| line.strip_prefix("cpu "))?;
        let ticks: Vec<u64> =
            counts.split_whitespace().map_while(|ticks| ticks.parse().ok()).take(8).collect();
        ticks.try_into().ok()
    }

    /// CPU time of all threads of a process, ns. Threads that have ended do not count.
    pub fn cpu_time_ns(&self, process: u32) -> u64 {
        let tasks = format!("proc/{process}/task");
        let of_thread = |task: String| -> Option<u64> {
            self.text(&format!("{tasks}/{task}/schedstat"))?.split_whitespace().next()?.parse().ok()
        };
        self.names(&tasks).into_iter().filter_map(of_thread).sum()
    }

    /// The cores that are online; none if the kernel does not list them.
    pub fn online_cores(&self) -> Vec<usize> {
        self.cores("sys/devices/system/cpu/online")
    }

    /// A file with a list of cores as the kernel writes it: `0,4-6`.
    pub fn cores(&self, path: &str) -> Vec<usize> {
        let range = |part: &str| -> Option<RangeInclusive<usize>> {
            let (from, to) = part.split_once('-').unwrap_or((part, part));
            Some(from.parse().ok()?..=to.parse().ok()?)
        };
        self.text(path).unwrap_or_default().split(',').filter_map(range).flatten().collect()
    }
}

/// A made-up machine for tests.
#[cfg(any(test, feature = "fixture"))]
pub mod fixture {
    use super::{Path, SystemRoot, fs};

    /// A root that holds exactly these files.
    #[derive(Debug)]
    pub struct Fixture {
        folder: tempfile::TempDir,
    }

    impl Fixture {
        /// A machine with exactly these files.
        ///
        /// # Panics
        /// Where a file cannot be written.
        pub fn with_files(files: &[(&str, &str)]) -> Self {
            let folder = tempfile::tempdir().unwrap();
            for (path, text) in files {
                let path = folder.path().join(path);
                fs::create_dir_all(path.parent().unwrap_or(Path::new(""))).unwrap();
                fs::write(path, text).unwrap();
            }
            Self { folder }
        }

        /// Its root.
        pub fn root(&self) -> SystemRoot {
            SystemRoot::at(self.folder.path())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::fixture::Fixture;

    #[test]
    fn cores_that_are_offline_do_not_count() {
        let online =
            |list| Fixture::with_files(&[("sys/devices/system/cpu/online", list)]).root().online_cores();
        assert_eq!(online("0-3,6\n"), [0, 1, 2, 3, 6]);
        assert_eq!(online("0\n"), [0]);
        let offline = Fixture::with_files(&[("sys/devices/system/cpu/cpu4/online", "0")]);
        assert_eq!(offline.root().online_cores(), [0; 0]);
    }
}
