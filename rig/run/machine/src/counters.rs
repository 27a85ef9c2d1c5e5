//! The kernel's counters of processes and of the machine, read from outside, and periodic samples of them.
//!
//! The supervisor derives the manifest's usage figures from the samples, the recorder the topic `machine`. Reading costs
//! the processes nothing. This module computes no differences.

use std::{cmp::Reverse, collections::BTreeMap};

use crate::SystemRoot;

/// `/proc/stat` counts in hundredths of a second (USER_HZ) on every platform of the rig.
const TICK_NS: u64 = 10_000_000;

fn status_counter(status: &str, name: &str) -> Option<u64> {
    status.lines().find_map(|line| line.strip_prefix(name))?.trim().parse().ok()
}

/// A field by its number from 3 on. The name in field 2 may hold blanks; field 3 follows its closing bracket.
fn stat_field(stat: &str, number: usize) -> Option<&str> {
    stat.rsplit_once(')')?.1.split_whitespace().nth(number - 3)
}

/// The kernel's counters of a process, or of one of its threads.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counters {
    /// CPU time, ns; for a process, that of all its threads that run. `None` if the kernel has no statistics of its scheduler.
    pub cpu_ns: Option<u64>,
    /// Time for which the thread was ready and had no core, ns; none as above. It grows when the thread gets a core.
    pub queued_ns: Option<u64>,
    /// Context switches that the thread, of a process the main one, asked for by waiting.
    pub voluntary_switches: u64,
    /// Those that it did not ask for.
    pub involuntary_switches: u64,
    /// Page faults, of a process those of all threads, that were served from memory.
    pub minor_faults: u64,
    /// Those served from disk.
    pub major_faults: u64,
    /// The core on which the thread ran last.
    pub core: usize,
    /// Whether a signal or a debugger has stopped it.
    pub is_stopped: bool,
    /// Whether its scheduling is real-time.
    pub is_real_time: bool,
}

impl Counters {
    /// The counters of a process; none if it has ended.
    pub fn of_process(root: &SystemRoot, id: u32) -> Option<Self> {
        Some(Self { cpu_ns: Some(root.cpu_time_ns(id)), ..Self::read(root, &format!("proc/{id}"))? })
    }

    /// The counters of a thread of a process; none if it has ended.
    pub fn of_thread(root: &SystemRoot, process: u32, thread: u32) -> Option<Self> {
        Self::read(root, &format!("proc/{process}/task/{thread}"))
    }

    fn read(root: &SystemRoot, folder: &str) -> Option<Self> {
        let text = |file: &str| root.text(&format!("{folder}/{file}"));
        let (status, stat) = (text("status")?, text("stat")?);
        let schedule = text("schedstat").unwrap_or_default();
        let mut times_ns = schedule.split_whitespace().map_while(|time_ns| time_ns.parse().ok());
        let policy: u32 = stat_field(&stat, 41)?.parse().ok()?;
        Some(Self {
            cpu_ns: times_ns.next(),
            queued_ns: times_ns.next(),
            voluntary_switches: status_counter(&status, "voluntary_ctxt_switches:")?,
            involuntary_switches: status_counter(&status, "nonvoluntary_ctxt_switches:")?,
            minor_faults: stat_field(&stat, 10)?.parse().ok()?,
            major_faults: stat_field(&stat, 12)?.parse().ok()?,
            core: stat_field(&stat, 39)?.parse().ok()?,
            is_stopped: matches!(stat_field(&stat, 3)?, "T" | "t"),
            is_real_time: REAL_TIME_POLICIES.contains(&policy),
        })
    }
}

/// SCHED_FIFO, SCHED_RR and SCHED_DEADLINE.
const REAL_TIME_POLICIES: [u32; 3] = [1, 2, 6];

/// The thread of a process that runs its loop, which may be any thread of a program of the user: that with real-time
/// scheduling, and among several that which has slept most often. A loop sleeps before every deadline.
pub fn loop_thread(root: &SystemRoot, process: u32) -> Option<u32> {
    let threads = root.names(&format!("proc/{process}/task"));
    let rank = |thread: &u32| {
        let counters = Counters::of_thread(root, process, *thread)?;
        Some((counters.is_real_time, counters.voluntary_switches, Reverse(*thread)))
    };
    threads.into_iter().filter_map(|thread| thread.parse().ok()).max_by_key(rank)
}

/// Steal time of each core since boot, by the core's number, ns.
pub fn stolen_by_core_ns(root: &SystemRoot) -> BTreeMap<usize, u64> {
    let core_and_stolen = |line: &str| -> Option<(usize, u64)> {
        let (core, ticks) = line.strip_prefix("cpu")?.split_once(' ')?;
        let stolen: u64 = ticks.split_whitespace().nth(7)?.parse().ok()?;
        Some((core.parse().ok()?, stolen * TICK_NS))
    };
    root.text("proc/stat").unwrap_or_default().lines().filter_map(core_and_stolen).collect()
}

/// Steal time of all cores since boot, ns.
fn stolen_ns(root: &SystemRoot) -> Option<u64> {
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
    pub processes: Vec<Option<Counters>>,
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
        let counters = |id: &u32| Counters::of_process(&self.root, *id);
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
            ("proc/7/schedstat", "750000000 500 9\n"),
            ("proc/7/stat", &format!("7 (a (b) c) S 1 7 7 0 -1 4194304 100 0 1 {}1 80 0 0", "0 ".repeat(26))),
            ("proc/7/task/7/schedstat", "750000000 500 9\n"),
            ("proc/7/task/9/schedstat", "250000000 0 1\n"),
            ("proc/stat", "cpu  1 2 3 4 5 6 7 25 0 0\ncpu0 1 2 3 4 5 6 7 8 0 0\n"),
        ]);
        let mut sampler = Sampler::new(fixture.root(), vec![7, 8], 500, 1000);
        assert_eq!(sampler.sample(999), None);
        let counters = Counters {
            cpu_ns: Some(1_000_000_000),
            queued_ns: Some(500),
            voluntary_switches: 9,
            involuntary_switches: 3,
            minor_faults: 100,
            major_faults: 1,
            core: 1,
            ..Counters::default()
        };
        let sample =
            Sample { time_ns: 1000, stolen_ns: Some(250_000_000), processes: vec![Some(counters), None] };
        assert_eq!(sampler.sample(1000), Some(sample));
        assert_eq!(sampler.sample(1499), None);
        assert_eq!(sampler.sample(1500).unwrap().time_ns, 1500);
    }

    /// The files of thread `number` of process 7.
    fn thread(number: u32, state: &str, sleeps: u64, policy: u32, schedstat: bool) -> Vec<(String, String)> {
        let task = format!("proc/7/task/{number}");
        let status = format!("voluntary_ctxt_switches:\t{sleeps}\nnonvoluntary_ctxt_switches:\t3\n");
        let before_core = "0 ".repeat(26);
        let stat = format!("{number} (a (b) c) {state} 1 7 7 0 -1 0 5 0 2 {before_core}1 80 {policy} 0");
        let mut files = vec![(format!("{task}/status"), status), (format!("{task}/stat"), stat)];
        files.extend(schedstat.then(|| (format!("{task}/schedstat"), "750 500 9\n".to_owned())));
        files
    }

    fn root_of(threads: &[Vec<(String, String)>]) -> Fixture {
        let files: Vec<_> =
            threads.iter().flatten().map(|(path, text)| (path.as_str(), text.as_str())).collect();
        Fixture::with_files(&files)
    }

    #[test]
    fn the_counters_of_a_thread_are_its_own_and_a_kernel_may_lack_schedstat() {
        let fixture = root_of(&[thread(7, "R", 9, 1, true), thread(8, "T", 4, 0, false)]);
        let main = Counters {
            cpu_ns: Some(750),
            queued_ns: Some(500),
            voluntary_switches: 9,
            involuntary_switches: 3,
            minor_faults: 5,
            major_faults: 2,
            core: 1,
            is_stopped: false,
            is_real_time: true,
        };
        assert_eq!(Counters::of_thread(&fixture.root(), 7, 7), Some(main));
        let other = Counters {
            cpu_ns: None,
            queued_ns: None,
            voluntary_switches: 4,
            is_stopped: true,
            is_real_time: false,
            ..main
        };
        assert_eq!(Counters::of_thread(&fixture.root(), 7, 8), Some(other));
        assert_eq!(Counters::of_thread(&fixture.root(), 7, 9), None);
    }

    #[test]
    fn the_thread_of_a_loop_has_real_time_scheduling_or_sleeps_most_often() {
        let found = |threads: &[Vec<(String, String)>]| loop_thread(&root_of(threads).root(), 7);
        let [main, worker] = [thread(7, "S", 5, 0, true), thread(8, "S", 900, 0, true)];
        assert_eq!(found(&[main.clone(), worker.clone()]), Some(8));
        assert_eq!(found(&[thread(7, "S", 5, 1, true), worker]), Some(7));
        assert_eq!(found(&[main, thread(8, "S", 5, 0, true)]), Some(7), "the first of equals");
        assert_eq!(found(&[]), None);
    }

    #[test]
    fn steal_time_is_that_of_each_core() {
        let stat = "cpu  1 2 3 4 5 6 7 25 0 0\ncpu0 1 2 3 4 5 6 7 8 0 0\ncpu2 1 2 3 4 5 6 7 17 0 0\nctxt 7\n";
        let fixture = Fixture::with_files(&[("proc/stat", stat)]);
        assert_eq!(stolen_by_core_ns(&fixture.root()), BTreeMap::from([(0, 80_000_000), (2, 170_000_000)]));
    }
}
