//! Options on the kernel's command line, and how each distribution adds them.

use super::{container, distribution};
use crate::machine::SystemRoot;

/// The command that adds kernel `options` and boots again, or an instruction where no command is known.
pub(super) fn add(root: &SystemRoot, options: &str) -> String {
    let by_hand = format!("add `{options}` to the kernel's command line, then boot again");
    if container::is_container(root) {
        // The host may run another distribution.
        return container::on_host(root, by_hand);
    }
    distribution::id(root).and_then(|id| command(root, &id, options)).unwrap_or(by_hand)
}

fn command(root: &SystemRoot, distribution: &str, options: &str) -> Option<String> {
    if let "fedora" | "rhel" | "centos" | "rocky" | "almalinux" = distribution {
        return Some(format!("sudo grubby --update-kernel=ALL --args=\"{options}\" && sudo reboot"));
    }
    // Without this file the machine does not boot by GRUB.
    root.text("etc/default/grub")?;
    let (prepare, file, rebuild) = match distribution {
        // Cloud images have files in this folder that override /etc/default/grub.
        "debian" | "ubuntu" => {
            ("sudo mkdir -p /etc/default/grub.d && ", "/etc/default/grub.d/masseter.cfg", "update-grub")
        }
        "arch" => ("", "/etc/default/grub", "grub-mkconfig -o /boot/grub/grub.cfg"),
        "opensuse-tumbleweed" | "opensuse-leap" => {
            ("", "/etc/default/grub", "grub2-mkconfig -o /boot/grub2/grub.cfg")
        }
        _ => return None,
    };
    // These files are shell scripts, so an appended line overrides the others. This variable comes last on the command
    // line.
    let line = format!("GRUB_CMDLINE_LINUX_DEFAULT=\"$GRUB_CMDLINE_LINUX_DEFAULT {options}\"");
    Some(format!("{prepare}echo '{line}' | sudo tee -a {file} && sudo {rebuild} && sudo reboot"))
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::*;
    use crate::machine::fixture::Fixture;

    fn added(distribution: &str, more: &[(&str, &str)]) -> String {
        let os_release = format!("ID={distribution}\n");
        let files = [&[("etc/os-release", os_release.as_str())], more].concat();
        add(&Fixture::with_files(&files).root(), "isolcpus=2,3")
    }

    #[test]
    fn each_distribution_has_its_own_way() {
        let ways = [
            ("debian", "sudo update-grub"),
            ("ubuntu", "sudo update-grub"),
            ("arch", "sudo grub-mkconfig -o /boot/grub/grub.cfg"),
            ("opensuse-leap", "sudo grub2-mkconfig -o /boot/grub2/grub.cfg"),
            ("rocky", "sudo grubby --update-kernel=ALL --args=\"isolcpus=2,3\""),
        ];
        for (distribution, way) in ways {
            let command = added(distribution, &[("etc/default/grub", "")]);
            assert!(command.contains(&format!("{way} && sudo reboot")), "{command}");
        }
    }

    #[test]
    fn where_no_way_is_known_or_it_is_not_grub_that_boots_it_is_done_by_hand() {
        let by_hand = "add `isolcpus=2,3` to the kernel's command line, then boot again";
        assert_eq!(added("alpine", &[("etc/default/grub", "")]), by_hand);
        assert_eq!(added("debian", &[]), by_hand);
        assert_eq!(added("debian", &[(".dockerenv", "")]), format!("on the host: {by_hand}"));
    }

    /// As GRUB's tools read it.
    #[test]
    fn the_line_holds_whatever_stood_there_before() {
        let command = added("arch", &[("etc/default/grub", "")]);
        let line = command.split('\'').nth(1).unwrap();
        let options_after = |before: &str| {
            let script = format!("{before}\n{line}\nprintf '%s' \"$GRUB_CMDLINE_LINUX_DEFAULT\"");
            let output = Command::new("sh").args(["-c", &script]).output().unwrap();
            String::from_utf8(output.stdout).unwrap()
        };
        for quiet in ["GRUB_CMDLINE_LINUX_DEFAULT='quiet'", "GRUB_CMDLINE_LINUX_DEFAULT=quiet"] {
            assert_eq!(options_after(quiet), "quiet isolcpus=2,3");
        }
        assert_eq!(options_after(""), " isolcpus=2,3");
    }
}
