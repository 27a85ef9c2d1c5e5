//! Containers: what their engine grants them is chosen when they are started, and their kernel is the host's.

use crate::machine::SystemRoot;

/// The start of the container with `options` if this is one, else the command that helps on the machine itself.
pub(super) fn start_with(root: &SystemRoot, options: &str, otherwise: impl Into<String>) -> String {
    match engine(root) {
        Some(engine) => format!("{engine} run {options} …"),
        None => otherwise.into(),
    }
}

/// The command that changes the kernel or what it runs on.
pub(super) fn on_host(root: &SystemRoot, command: impl Into<String>) -> String {
    let command = command.into();
    if is_container(root) { format!("on the host: {command}") } else { command }
}

/// Whether the system's files are other than those of the machine itself.
pub(super) fn is_container(root: &SystemRoot) -> bool {
    engine(root).is_some()
}

/// The command of the engine that runs this container, if it is one.
fn engine(root: &SystemRoot) -> Option<&'static str> {
    let marks = [("run/.containerenv", "podman"), (".dockerenv", "docker")];
    marks.into_iter().find(|(mark, _)| root.text(mark).is_some()).map(|(_, engine)| engine)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::fixture::Fixture;

    #[test]
    fn a_container_is_started_anew_by_its_engine() {
        let mend = |files: &[(&str, &str)]| start_with(&Fixture::of(files).root(), "--shm-size 1g", "mount");
        assert_eq!(mend(&[]), "mount");
        assert_eq!(mend(&[(".dockerenv", "")]), "docker run --shm-size 1g …");
        assert_eq!(mend(&[("run/.containerenv", "engine=podman")]), "podman run --shm-size 1g …");
    }

    #[test]
    fn the_kernel_is_changed_on_the_host() {
        let mend = |files: &[(&str, &str)]| on_host(&Fixture::of(files).root(), "modprobe");
        assert_eq!(mend(&[]), "modprobe");
        assert_eq!(mend(&[(".dockerenv", "")]), "on the host: modprobe");
    }
}
