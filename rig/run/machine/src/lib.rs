//! The machine: facts from `/proc` and `/sys`, and `/dev/cpu_dma_latency`.
//!
//! Files are read below a root that tests can replace. `masseter doctor` judges the facts; this crate does not.

pub mod counters;
pub mod dma_latency;
mod system_root;

use masseter_recording::MachineInfo;
use masseter_runtime::realtime::scheduling::allowed_cores;

pub use system_root::SystemRoot;
#[cfg(any(test, feature = "fixture"))]
pub use system_root::fixture;

/// The firmware's description of this machine, where there is one.
const DEVICE_TREE: &str = "proc/device-tree";
/// Compatible strings of device trees of virtual machines.
const NO_BOARD: [&str; 2] = ["linux,dummy-virt", "qemu,pseries"];
/// Files with the firmware's names of product and vendor.
const NAMES: [&str; 3] = ["sys_vendor", "product_name", "chassis_vendor"];
/// Prefixes of such names on virtual machines.
const GUESTS: [&str; 15] = [
    "QEMU",
    "KVM",
    "OpenStack",
    "KubeVirt",
    "Amazon EC2",
    "Google Compute Engine",
    "Virtual Machine",
    "VMware",
    "innotek GmbH",
    "VirtualBox",
    "Xen",
    "Bochs",
    "Parallels",
    "BHYVE",
    "Apple Virtualization",
];

/// This machine, for the manifest.
pub fn describe() -> MachineInfo {
    let uname = rustix::system::uname();
    let [name, release, version] =
        [uname.sysname(), uname.release(), uname.version()].map(std::ffi::CStr::to_string_lossy);
    let cpuinfo = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpuinfo.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    MachineInfo {
        cpu: model.map_or_else(|| std::env::consts::ARCH.to_owned(), |(_, name)| name.to_owned()),
        cores: allowed_cores().len(),
        kernel: format!("{name} {release} {version}"),
        is_virtual: is_virtual(&SystemRoot::of_this_machine()),
    }
}

/// Whether a hypervisor runs this machine: by a processor flag on x86, elsewhere by the firmware's description.
pub fn is_virtual(root: &SystemRoot) -> bool {
    if root.text("sys/hypervisor/type").is_some() {
        return true;
    }
    let cpuinfo = root.text("proc/cpuinfo").unwrap_or_default();
    match cpuinfo.lines().find_map(|line| line.strip_prefix("flags")) {
        Some(flags) => flags.split_whitespace().any(|flag| flag == "hypervisor"),
        None => device_tree_is_virtual(root) || is_named_virtual(root),
    }
}

fn device_tree_is_virtual(root: &SystemRoot) -> bool {
    let compatible = root.text(&format!("{DEVICE_TREE}/compatible")).unwrap_or_default();
    root.text(&format!("{DEVICE_TREE}/hypervisor/compatible")).is_some()
        || root.names(DEVICE_TREE).iter().any(|node| node.starts_with("fw-cfg@"))
        || compatible.split('\0').any(|board| NO_BOARD.contains(&board))
}

/// By product and vendor. Clouds also name their bare machines so; those are called `m7g.metal` and the like.
fn is_named_virtual(root: &SystemRoot) -> bool {
    let name = |name: &str| root.text(&format!("sys/class/dmi/id/{name}")).unwrap_or_default();
    let is_guest = |name: String| GUESTS.iter().any(|guest| name.starts_with(guest));
    !name("product_name").contains(".metal") && NAMES.into_iter().map(name).any(is_guest)
}

#[cfg(test)]
mod tests {
    use super::fixture::Fixture;
    use super::*;

    const X86: (&str, &str) = ("proc/cpuinfo", "flags\t\t: fpu vme lahf_lm\nmodel name : hypervisor\n");
    const X86_GUEST: (&str, &str) = ("proc/cpuinfo", "flags\t\t: fpu vme hypervisor lahf_lm\n");
    const ARM: (&str, &str) = ("proc/cpuinfo", "Features\t: fp asimd\n");
    const VENDOR: &str = "sys/class/dmi/id/sys_vendor";
    const PRODUCT: &str = "sys/class/dmi/id/product_name";

    #[test]
    fn a_virtual_machine_is_known_by_its_processor_or_its_firmware() {
        let cases: [(&[(&str, &str)], bool); 16] = [
            (&[X86_GUEST], true),
            (&[X86], false),
            (&[("sys/hypervisor/type", "xen\n")], true),
            (&[X86, (VENDOR, "Amazon EC2\n"), (PRODUCT, "m5.metal\n")], false),
            (&[ARM], false),
            (&[ARM, ("proc/device-tree/hypervisor/compatible", "linux,kvm")], true),
            (&[ARM, ("proc/device-tree/fw-cfg@9020000/reg", "")], true),
            (&[ARM, ("proc/device-tree/compatible", "linux,dummy-virt\0")], true),
            (&[ARM, ("proc/device-tree/compatible", "raspberrypi,4-model-b\0brcm,bcm2711\0")], false),
            (&[ARM, (VENDOR, "QEMU\n"), (PRODUCT, "KVM Virtual Machine\n")], true),
            (
                &[
                    ARM,
                    (VENDOR, "Hetzner"),
                    (PRODUCT, "vServer"),
                    ("sys/class/dmi/id/chassis_vendor", "QEMU"),
                ],
                true,
            ),
            (&[ARM, (VENDOR, "Amazon EC2\n"), (PRODUCT, "m7g.large\n")], true),
            (&[ARM, (VENDOR, "Amazon EC2\n"), (PRODUCT, "m7g.metal\n")], false),
            (&[ARM, (VENDOR, "Google\n"), (PRODUCT, "Google Compute Engine\n")], true),
            (&[ARM, (VENDOR, "Microsoft Corporation\n"), (PRODUCT, "Virtual Machine\n")], true),
            (&[ARM, (VENDOR, "Microsoft Corporation\n"), (PRODUCT, "Surface Pro X\n")], false),
        ];
        for (files, expected) in cases {
            assert_eq!(is_virtual(&Fixture::with_files(files).root()), expected, "{files:?}");
        }
    }
}
