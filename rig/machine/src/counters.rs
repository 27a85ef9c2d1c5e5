//! The kernel's counters of a process and of the machine, read from outside.

use super::SystemRoot;

/// `/proc/stat` counts in hundredths of a second (USER_HZ) on every platform of the rig.
const TICK_NS: u64 = 10_000_000;

/// The kernel's counters of a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ProcessCounters {
    /// CPU time of all threads that run.
    pub cpu_ns: u64,
    /// Context switches that the main thread asked for by waiting.
    pub voluntary_switches: u64,
    /// Those that the main thread did not ask for.
    pub involuntary_switches: u64,
    /// Page faults of all threads that were served from memory.
    pub minor_faults: u64,
    /// Those served from disk.
    pub major_faults: u64,
}

impl ProcessCounters {
    /// The counters of a process; none if it has ended.
    pub fn read(root: &SystemRoot, id: u32) -> Option<Self> {
        let status = root.text(&format!("proc/{id}/status"))?;
        let counter = |name: &str| -> Option<u64> {
            status.lines().find_map(|line| line.strip_prefix(name))?.trim().parse().ok()
        };
        // The name in field 2 may hold blanks; field 3 follows its closing bracket.
        let stat = root.text(&format!("proc/{id}/stat"))?;
        let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
        let field = |number: usize| -> Option<u64> { fields.get(number - 3)?.parse().ok() };
        Some(Self {
            cpu_ns: root.cpu_time_ns(id),
            voluntary_switches: counter("voluntary_ctxt_switches:")?,
            involuntary_switches: counter("nonvoluntary_ctxt_switches:")?,
            minor_faults: field(10)?,
            major_faults: field(12)?,
        })
    }
}

/// Steal time of all cores since boot, ns.
pub fn stolen_ns(root: &SystemRoot) -> Option<u64> {
    let [.., stolen] = root.core_ticks()?;
    Some(stolen * TICK_NS)
}
