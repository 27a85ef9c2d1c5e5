//! Containers: the options of their start decide what they may do, and their kernel is the host's.

use masseter_machine::SystemRoot;

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
    use super::*;
    use masseter_machine::fixture::Fixture;

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
