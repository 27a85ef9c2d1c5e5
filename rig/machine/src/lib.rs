//! The machine: facts from `/proc` and `/sys`, and `/dev/cpu_dma_latency`.
//!
//! Files are read below a root that tests can replace. `masseter doctor` judges the facts; this crate does not.

pub mod counters;
pub mod dma_latency;
mod hypervisor;
pub mod sampler;
mod system_root;

use std::fs;

use masseter_recording::MachineInfo;
use masseter_runtime::realtime::scheduling::allowed_cores;

pub use hypervisor::is_virtual;
pub use system_root::SystemRoot;
#[cfg(any(test, feature = "fixture"))]
pub use system_root::fixture;

/// This machine, for the manifest.
pub fn describe() -> MachineInfo {
    let uname = rustix::system::uname();
    let [name, release, version] =
        [uname.sysname(), uname.release(), uname.version()].map(std::ffi::CStr::to_string_lossy);
    let cpuinfo = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpuinfo.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    MachineInfo {
        cpu: model.map_or_else(|| std::env::consts::ARCH.to_owned(), |(_, name)| name.to_owned()),
        cores: allowed_cores().len(),
        kernel: format!("{name} {release} {version}"),
        is_virtual: is_virtual(&SystemRoot::of_this_machine()),
    }
}
