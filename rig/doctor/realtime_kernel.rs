//! How each distribution installs its PREEMPT_RT kernel.

use super::{container, distribution};
use crate::machine::SystemRoot;

/// The command that installs it; none if no package is known.
pub(super) fn installation(root: &SystemRoot) -> Option<String> {
    if container::is_container(root) {
        // The host may run another distribution.
        return Some("on the host: install its distribution's kernel with PREEMPT_RT".to_owned());
    }
    command(&distribution::id(root)?, std::env::consts::ARCH)
}

fn command(distribution: &str, architecture: &str) -> Option<String> {
    let install = match (distribution, architecture) {
        ("debian", "x86_64") => "apt install linux-image-rt-amd64",
        ("debian", "aarch64") => "apt install linux-image-rt-arm64",
        ("debian", "arm") => "apt install linux-image-rt-armmp",
        ("ubuntu", "x86_64" | "aarch64") => "pro enable realtime-kernel",
        ("centos" | "rocky" | "almalinux", "x86_64") => "dnf --enablerepo=rt install kernel-rt",
        ("arch", "x86_64") => "pacman -S linux-rt",
        ("opensuse-tumbleweed" | "opensuse-leap", "x86_64") => "zypper install kernel-rt",
        _ => return None,
    };
    Some(format!("sudo {install} && sudo reboot"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::fixture::Fixture;

    #[test]
    fn a_containers_distribution_says_nothing_of_its_kernel() {
        let debian = ("etc/os-release", "ID=debian\n");
        let command = installation(&Fixture::with_files(&[debian, (".dockerenv", "")]).root()).unwrap();
        assert!(command.starts_with("on the host: ") && !command.contains("apt"), "{command}");
    }

    #[test]
    fn the_package_depends_on_distribution_and_architecture() {
        let cases = [
            ("debian", "x86_64", Some("linux-image-rt-amd64")),
            ("debian", "aarch64", Some("linux-image-rt-arm64")),
            ("ubuntu", "x86_64", Some("pro enable realtime-kernel")),
            ("rocky", "x86_64", Some("install kernel-rt")),
            ("debian", "riscv64", None),
            ("alpine", "x86_64", None),
        ];
        for (distribution, architecture, said) in cases {
            let command = command(distribution, architecture);
            assert_eq!(command.is_some(), said.is_some(), "{distribution} {architecture}");
            assert!(command.unwrap_or_default().contains(said.unwrap_or_default()), "{distribution}");
        }
    }
}
