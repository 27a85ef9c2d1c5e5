//! What the kernel counts of a process and of the machine, from outside.

use super::SystemRoot;

/// `/proc/stat` counts in hundredths of a second (USER_HZ) on every platform of the rig.
const TICK_NS: u64 = 10_000_000;

/// The kernel's counters of a process at an instant.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ProcessCounters {
    pub(crate) at_ns: u64,
    /// CPU time of all its threads.
    pub(crate) cpu_ns: u64,
    /// Times its main thread gave up its core, and had it taken.
    pub(crate) voluntary_switches: u64,
    pub(crate) involuntary_switches: u64,
    /// Page faults of all its threads, served from memory and from disk.
    pub(crate) minor_faults: u64,
    pub(crate) major_faults: u64,
}

impl ProcessCounters {
    /// Of a process; none when it is gone.
    pub(crate) fn of(root: &SystemRoot, id: u32, at_ns: u64) -> Option<Self> {
        let status = root.text(&format!("proc/{id}/status"))?;
        let counter = |name: &str| -> Option<u64> {
            status.lines().find_map(|line| line.strip_prefix(name))?.trim().parse().ok()
        };
        // The name in field 2 may hold blanks; field 3 follows its closing bracket.
        let stat = root.text(&format!("proc/{id}/stat"))?;
        let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
        let field = |number: usize| -> Option<u64> { fields.get(number - 3)?.parse().ok() };
        Some(Self {
            at_ns,
            cpu_ns: root.cpu_time_ns(id),
            voluntary_switches: counter("voluntary_ctxt_switches:")?,
            involuntary_switches: counter("nonvoluntary_ctxt_switches:")?,
            minor_faults: field(10)?,
            major_faults: field(12)?,
        })
    }
}

/// Steal time of all cores since boot, ns.
pub(crate) fn stolen_ns(root: &SystemRoot) -> Option<u64> {
    let [.., stolen] = root.core_ticks()?;
    Some(stolen * TICK_NS)
}
