//! The finding of a check, and the commands that its remedy needs in a container: the options of its start decide
//! what it may do, and its kernel is the host's.

use masseter_machine::SystemRoot;
use serde::Serialize;

/// How a finding affects real-time runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Level {
    /// No effect.
    Ok,
    /// Runs work with longer latencies or fewer features.
    Warn,
    /// Runs cannot be trusted to meet their deadlines.
    Bad,
}

/// An entry of the doctor's report.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(super) struct Finding {
    /// The name of the check.
    pub check: &'static str,
    /// Its level.
    pub level: Level,
    /// The state of the machine.
    pub found: String,
    /// The effect on runs; none at level `ok`.
    pub cost: Option<String>,
    /// The command that improves it; none at level `ok`, or where no command helps.
    pub remedy: Option<String>,
}

impl Finding {
    /// A finding without effect.
    pub(super) fn ok(found: impl Into<String>) -> Self {
        Self { check: "", level: Level::Ok, found: found.into(), cost: None, remedy: None }
    }

    /// A finding that degrades runs.
    pub(super) fn warn(found: impl Into<String>, cost: impl Into<String>) -> Self {
        Self { level: Level::Warn, cost: Some(cost.into()), ..Self::ok(found) }
    }

    /// A finding that rules real time out.
    pub(super) fn bad(found: impl Into<String>, cost: impl Into<String>) -> Self {
        Self { level: Level::Bad, ..Self::warn(found, cost) }
    }

    /// Adds the command that improves it.
    #[must_use]
    pub(super) fn with_remedy(self, command: impl Into<String>) -> Self {
        Self { remedy: Some(command.into()), ..self }
    }

    /// Names its check.
    #[must_use]
    pub(super) fn named(self, check: &'static str) -> Self {
        Self { check, ..self }
    }
}

/// The command that starts a container with `options`, or `otherwise` outside of containers.
pub(super) fn start_with(root: &SystemRoot, options: &str, otherwise: impl Into<String>) -> String {
    engine(root).map_or_else(|| otherwise.into(), |engine| format!("{engine} run {options} …"))
}

/// A command on the kernel or the hardware, which a container's user must run on the host.
pub(super) fn on_host(root: &SystemRoot, command: impl Into<String>) -> String {
    let command = command.into();
    if engine(root).is_some() { format!("on the host: {command}") } else { command }
}

/// The command of the container's engine; none outside of containers.
fn engine(root: &SystemRoot) -> Option<&'static str> {
    let marks = [("run/.containerenv", "podman"), (".dockerenv", "docker")];
    marks.into_iter().find(|(mark, _)| root.text(mark).is_some()).map(|(_, engine)| engine)
}

#[cfg(test)]
mod tests {
    use masseter_machine::fixture::Fixture;

    use super::*;

    #[test]
    fn a_container_is_started_anew_by_its_engine() {
        let remedy =
            |files: &[(&str, &str)]| start_with(&Fixture::with_files(files).root(), "--shm-size 1g", "mount");
        assert_eq!(remedy(&[]), "mount");
        assert_eq!(remedy(&[(".dockerenv", "")]), "docker run --shm-size 1g …");
        assert_eq!(remedy(&[("run/.containerenv", "engine=podman")]), "podman run --shm-size 1g …");
    }

    #[test]
    fn the_kernel_is_changed_on_the_host() {
        let remedy = |files: &[(&str, &str)]| on_host(&Fixture::with_files(files).root(), "modprobe");
        assert_eq!(remedy(&[]), "modprobe");
        assert_eq!(remedy(&[(".dockerenv", "")]), "on the host: modprobe");
    }
}
