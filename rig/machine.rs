//! What the kernel tells of the machine in `/proc` and `/sys`, read below a root that tests can choose.

use std::fs;
use std::path::{Path, PathBuf};

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

    /// A file's text without surrounding white space; none when it is not there or not readable.
    pub fn text(&self, path: &str) -> Option<String> {
        Some(fs::read_to_string(self.0.join(path)).ok()?.trim().to_owned())
    }

    /// A file that holds one number.
    pub fn number(&self, path: &str) -> Option<i64> {
        self.text(path)?.parse().ok()
    }

    /// The names in a folder, sorted; none of them when it is not there.
    pub fn names(&self, folder: &str) -> Vec<String> {
        let entries = fs::read_dir(self.0.join(folder)).into_iter().flatten().flatten();
        let mut names: Vec<_> = entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
        names.sort();
        names
    }

    /// Names of the folders of the machine's cores, `cpu0`, `cpu1`, …
    pub fn core_folders(&self) -> Vec<String> {
        let is_core = |name: &str| name.strip_prefix("cpu").is_some_and(|rest| rest.parse::<usize>().is_ok());
        let mut folders = self.names("sys/devices/system/cpu");
        folders.retain(|name| is_core(name));
        folders
    }

    /// Whether a hypervisor runs this machine, as the processor says (x86) or the device tree (Arm).
    pub fn is_virtual(&self) -> bool {
        let cpuinfo = self.text("proc/cpuinfo").unwrap_or_default();
        let mut flags = cpuinfo.lines().filter(|line| line.starts_with("flags"));
        flags.any(|line| line.split_whitespace().any(|flag| flag == "hypervisor"))
            || self.text("sys/hypervisor/type").is_some()
            || self.text("proc/device-tree/hypervisor/compatible").is_some()
    }
}

#[cfg(test)]
pub(crate) mod fixture {
    use super::{Path, SystemRoot, fs};

    /// A root that holds exactly these files.
    pub(crate) struct Fixture {
        folder: tempfile::TempDir,
    }

    impl Fixture {
        pub(crate) fn of(files: &[(&str, &str)]) -> Self {
            let folder = tempfile::tempdir().unwrap();
            for (path, text) in files {
                let path = folder.path().join(path);
                fs::create_dir_all(path.parent().unwrap_or(Path::new(""))).unwrap();
                fs::write(path, text).unwrap();
            }
            Self { folder }
        }

        pub(crate) fn root(&self) -> SystemRoot {
            SystemRoot::at(self.folder.path())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::fixture::Fixture;

    #[test]
    fn a_virtual_machine_is_known_by_its_processor_or_its_firmware() {
        let cases = [
            (("proc/cpuinfo", "flags\t\t: fpu vme hypervisor lahf_lm\n"), true),
            (("proc/cpuinfo", "flags\t\t: fpu vme lahf_lm\nmodel name : hypervisor\n"), false),
            (("sys/hypervisor/type", "xen\n"), true),
            (("proc/device-tree/hypervisor/compatible", "linux,kvm"), true),
        ];
        for (file, expected) in cases {
            assert_eq!(Fixture::of(&[file]).root().is_virtual(), expected, "{file:?}");
        }
    }

    #[test]
    fn folders_of_cores_are_told_from_their_neighbours() {
        let files =
            ["cpu1", "cpu0", "cpufreq", "cpuidle"].map(|name| format!("sys/devices/system/cpu/{name}/x"));
        let files: Vec<_> = files.iter().map(|path| (path.as_str(), "")).collect();
        assert_eq!(Fixture::of(&files).root().core_folders(), ["cpu0", "cpu1"]);
    }
}
