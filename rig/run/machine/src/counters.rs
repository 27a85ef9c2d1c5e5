//! The kernel's counters of processes and of the machine, read from outside, and periodic samples of them.
//!
//! The supervisor derives the manifest's usage figures from the samples, the recorder the topic `machine`. Reading costs
//! the processes nothing. This module computes no differences.

use crate::SystemRoot;

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

/// Reads the counters at most once per interval.
#[derive(Debug)]
pub struct Sampler {
    root: SystemRoot,
    processes: Vec<u32>,
    interval_ns: u64,
    next_ns: u64,
}

/// The kernel's counters at an instant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sample {
    /// Now, ns of the monotonic clock.
    pub time_ns: u64,
    /// Steal time of all cores since boot, if the kernel counts it.
    pub stolen_ns: Option<u64>,
    /// In the order given to the sampler; none for a process that has ended.
    pub processes: Vec<Option<ProcessCounters>>,
}

impl Sampler {
    /// Samples these processes, by their ids, every `interval_ns` from `first_ns` on.
    pub fn new(root: SystemRoot, processes: Vec<u32>, interval_ns: u64, first_ns: u64) -> Self {
        Self { root, processes, interval_ns, next_ns: first_ns }
    }

    /// A sample if one is due.
    pub fn sample(&mut self, now_ns: u64) -> Option<Sample> {
        if now_ns < self.next_ns {
            return None;
        }
        self.next_ns = now_ns + self.interval_ns;
        let counters = |id: &u32| ProcessCounters::read(&self.root, *id);
        Some(Sample {
            time_ns: now_ns,
            stolen_ns: stolen_ns(&self.root),
            processes: self.processes.iter().map(counters).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::Fixture;

    #[test]
    fn a_sample_is_due_once_per_interval_and_holds_every_counter_of_each_process() {
        let fixture = Fixture::with_files(&[
            (
                "proc/7/status",
                "Name:\tmasseter\nvoluntary_ctxt_switches:\t9\nnonvoluntary_ctxt_switches:\t3\n",
            ),
            ("proc/7/stat", "7 (a (b) c) S 1 7 7 0 -1 4194304 100 0 1 0 11 5 0 0 20 0"),
            ("proc/7/task/7/schedstat", "750000000 500 9\n"),
            ("proc/7/task/9/schedstat", "250000000 0 1\n"),
            ("proc/stat", "cpu  1 2 3 4 5 6 7 25 0 0\ncpu0 1 2 3 4 5 6 7 8 0 0\n"),
        ]);
        let mut sampler = Sampler::new(fixture.root(), vec![7, 8], 500, 1000);
        assert_eq!(sampler.sample(999), None);
        let counters = ProcessCounters {
            cpu_ns: 1_000_000_000,
            voluntary_switches: 9,
            involuntary_switches: 3,
            minor_faults: 100,
            major_faults: 1,
        };
        let sample =
            Sample { time_ns: 1000, stolen_ns: Some(250_000_000), processes: vec![Some(counters), None] };
        assert_eq!(sampler.sample(1000), Some(sample));
        assert_eq!(sampler.sample(1499), None);
        assert_eq!(sampler.sample(1500).unwrap().time_ns, 1500);
    }
}
