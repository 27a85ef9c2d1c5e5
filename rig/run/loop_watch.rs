//! Watches the threads that run the loops, from outside: the judge needs the kernel's figures around a cycle that took too
//! long, and a process that is late is no witness of its own.
//!
//! A loop sleeps before every deadline that it keeps. An interval is kept where the thread slept less often than it had
//! deadlines, with the intervals beside it. A program that only polls is kept throughout.

use std::collections::BTreeMap;

use masseter_machine::SystemRoot;
use masseter_machine::counters::{Counters, loop_thread, stolen_by_core_ns};
use masseter_recording::LoopInterval;
use masseter_runtime::clock::MILLISECOND_NS;

/// From one sample to the next, ns; longer where an interval would have fewer deadlines than [`LEAST_DEADLINES`].
const INTERVAL_NS: u64 = 10 * MILLISECOND_NS;
/// Deadlines of an interval.
const LEAST_DEADLINES: u64 = 5;
/// Samples until the thread of a loop is looked for again: which one it is shows once it has slept often.
const LOOK_EVERY: u64 = 50;
/// Intervals kept of each loop; those in which most deadlines passed stay.
const MOST_KEPT: usize = 250;
/// Fewer deadlines without a sleep show nothing: an interval begins and ends between deadlines.
const LEAST_PASSED: u64 = 2;

/// Samples the counters of all loops.
pub(super) struct LoopWatch {
    root: SystemRoot,
    period_ns: u64,
    /// Whether a hypervisor runs the machine.
    is_virtual: bool,
    next_ns: u64,
    loops: Vec<WatchedLoop>,
}

impl LoopWatch {
    /// For processes, by name and id, that begin their work at `start_ns`. The id 0 means no process.
    pub(super) fn new(
        root: SystemRoot,
        is_virtual: bool,
        period_ns: u64,
        start_ns: u64,
        processes: &[(&'static str, u32)],
    ) -> Self {
        let watched = |&(name, process)| WatchedLoop { name, process, ..WatchedLoop::default() };
        let loops = processes.iter().map(watched).collect();
        Self { root, period_ns, is_virtual, next_ns: start_ns, loops }
    }

    /// Samples if it is time to.
    pub(super) fn update(&mut self, now_ns: u64) {
        if now_ns < self.next_ns {
            return;
        }
        self.next_ns = now_ns + INTERVAL_NS.max(LEAST_DEADLINES * self.period_ns);
        let stolen_ns = stolen_by_core_ns(&self.root);
        for watched in &mut self.loops {
            watched.sample(&self.root, self.period_ns, now_ns, &stolen_ns);
        }
    }

    /// The kept intervals, by process. A hypervisor that has stolen nothing since boot does not report it.
    pub(super) fn into_intervals(self) -> BTreeMap<String, Vec<LoopInterval>> {
        let is_reported =
            !self.is_virtual || stolen_by_core_ns(&self.root).values().any(|stolen_ns| *stolen_ns > 0);
        let kept = self.loops.into_iter().map(|watched| {
            let mut intervals = watched.kept.into_intervals();
            for interval in intervals.iter_mut().filter(|_| !is_reported) {
                interval.stolen_ns = None;
            }
            (watched.name.to_owned(), intervals)
        });
        kept.filter(|(_, intervals)| !intervals.is_empty()).collect()
    }
}

/// The loop of a process.
#[derive(Default)]
struct WatchedLoop {
    name: &'static str,
    process: u32,
    thread: Option<u32>,
    samples: u64,
    last: Option<Sample>,
    kept: KeptIntervals,
}

impl WatchedLoop {
    fn sample(&mut self, root: &SystemRoot, period_ns: u64, time_ns: u64, stolen_ns: &BTreeMap<usize, u64>) {
        if self.process == 0 {
            return;
        }
        if self.samples.is_multiple_of(LOOK_EVERY) {
            let thread = loop_thread(root, self.process);
            if std::mem::replace(&mut self.thread, thread) != thread {
                self.last = None;
            }
        }
        self.samples += 1;
        let counters = self.thread.and_then(|thread| Counters::of_thread(root, self.process, thread));
        let now = counters.map(|counters| Sample { time_ns, counters, stolen_ns: stolen_ns.clone() });
        if let (Some(last), Some(now)) = (&self.last, &now) {
            self.kept.add(last.until(now), period_ns);
        }
        self.last = now;
    }
}

/// The counters of a loop's thread, and the steal time of each core.
struct Sample {
    time_ns: u64,
    counters: Counters,
    stolen_ns: BTreeMap<usize, u64>,
}

impl Sample {
    fn until(&self, now: &Self) -> LoopInterval {
        let (before, after) = (&self.counters, &now.counters);
        let growth = |before: Option<u64>, after: Option<u64>| Some(after?.saturating_sub(before?));
        let stolen_ns = |core: usize| {
            let stolen_at = |sample: &Self| sample.stolen_ns.get(&core).copied();
            growth(stolen_at(self), stolen_at(now))
        };
        LoopInterval {
            from_ns: self.time_ns,
            to_ns: now.time_ns,
            cpu_ns: growth(before.cpu_ns, after.cpu_ns),
            queued_ns: growth(before.queued_ns, after.queued_ns),
            // Of the two cores, where the thread moved from one to the other.
            stolen_ns: stolen_ns(before.core).max(stolen_ns(after.core)),
            voluntary_switches: after.voluntary_switches.saturating_sub(before.voluntary_switches),
            involuntary_switches: after.involuntary_switches.saturating_sub(before.involuntary_switches),
            major_faults: after.major_faults.saturating_sub(before.major_faults),
            is_stopped: after.is_stopped,
        }
    }
}

/// The intervals of a loop that stand out, and those beside them.
#[derive(Default)]
struct KeptIntervals {
    before: Option<LoopInterval>,
    open: Stretch,
    stretches: Vec<Stretch>,
}

/// Intervals in a row.
#[derive(Default)]
struct Stretch {
    /// Deadlines before which the thread did not sleep.
    passed: u64,
    intervals: Vec<LoopInterval>,
}

impl KeptIntervals {
    fn add(&mut self, interval: LoopInterval, period_ns: u64) {
        let deadlines = (interval.to_ns - interval.from_ns) / period_ns;
        let passed = deadlines.saturating_sub(interval.voluntary_switches);
        let before = self.before.replace(interval);
        let stands_out = passed >= LEAST_PASSED;
        if stands_out && self.open.intervals.is_empty() {
            // What began in its last moments shows in the next alone.
            self.open.intervals.extend(before);
        }
        if stands_out || !self.open.intervals.is_empty() {
            self.open.passed += passed;
            self.open.intervals.push(interval);
        }
        // The kernel may count what ended in the interval before only in this one.
        if !stands_out || self.open.intervals.len() >= MOST_KEPT {
            self.close();
        }
    }

    fn close(&mut self) {
        if self.open.intervals.is_empty() {
            return;
        }
        self.stretches.push(std::mem::take(&mut self.open));
        let kept =
            |stretches: &[Stretch]| stretches.iter().map(|stretch| stretch.intervals.len()).sum::<usize>();
        while self.stretches.len() > 1 && kept(&self.stretches) > MOST_KEPT {
            let least = (0..self.stretches.len()).min_by_key(|place| self.stretches[*place].passed);
            self.stretches.remove(least.expect("there are some"));
        }
    }

    fn into_intervals(mut self) -> Vec<LoopInterval> {
        self.close();
        let mut all: Vec<_> = self.stretches.into_iter().flat_map(|stretch| stretch.intervals).collect();
        // One between two stretches is in both.
        all.dedup();
        all
    }
}

#[cfg(test)]
mod tests {
    use masseter_machine::fixture::Fixture;

    use super::*;

    const PERIOD_NS: u64 = MILLISECOND_NS;

    /// One that begins this many intervals after the start.
    fn interval(place: u64, voluntary_switches: u64) -> LoopInterval {
        let from_ns = place * INTERVAL_NS;
        LoopInterval { from_ns, to_ns: from_ns + INTERVAL_NS, voluntary_switches, ..LoopInterval::default() }
    }

    fn kept(sleeps: &[u64]) -> Vec<u64> {
        let mut kept = KeptIntervals::default();
        (0..).zip(sleeps).for_each(|(place, sleeps)| kept.add(interval(place, *sleeps), PERIOD_NS));
        kept.into_intervals().iter().map(|interval| interval.from_ns / INTERVAL_NS).collect()
    }

    #[test]
    fn an_interval_with_too_few_sleeps_is_kept_with_those_beside_it() {
        assert_eq!(kept(&[10, 10, 9, 30, 10]), [0; 0], "every deadline may have been kept");
        assert_eq!(kept(&[10, 10, 1, 0, 10, 10, 10]), [1, 2, 3, 4]);
        assert_eq!(kept(&[0, 10, 0, 10]), [0, 1, 2, 3], "one between two is kept once");
    }

    #[test]
    fn of_too_many_stretches_the_longest_stay() {
        let sleeps: Vec<u64> =
            (0..1000).map(|place| if place == 500 { 0 } else { 8 * (place % 3) }).collect();
        let kept = kept(&sleeps);
        assert!(kept.len() <= MOST_KEPT && kept.contains(&500), "{kept:?}");
    }

    #[test]
    fn the_counters_of_an_interval_are_growths_and_steal_is_that_of_its_core() {
        let files = |time: u64, stolen: u64| {
            let stat = format!("7 (a) S {}1 80 1", "0 ".repeat(35));
            let status = format!("voluntary_ctxt_switches:\t{time}\nnonvoluntary_ctxt_switches:\t1\n");
            let cores = format!("cpu0 0 0 0 0 0 0 0 9\ncpu1 0 0 0 0 0 0 0 {stolen}\n");
            [
                ("proc/7/task/7/stat", stat),
                ("proc/7/task/7/status", status),
                ("proc/7/task/7/schedstat", format!("{} 5 1", 100 * time)),
                ("proc/stat", cores),
            ]
        };
        let fixture = |time, stolen| {
            let files = files(time, stolen);
            Fixture::with_files(&files.each_ref().map(|(path, text)| (*path, text.as_str())))
        };
        let (first, second) = (fixture(1, 10), fixture(2, 13));
        let mut watch = LoopWatch::new(first.root(), true, PERIOD_NS, 0, &[("plant", 7), ("controller", 0)]);
        watch.update(0);
        watch.root = second.root();
        watch.update(INTERVAL_NS - 1);
        watch.update(INTERVAL_NS);
        let expected = LoopInterval {
            from_ns: 0,
            to_ns: INTERVAL_NS,
            cpu_ns: Some(100),
            queued_ns: Some(0),
            stolen_ns: Some(30_000_000),
            voluntary_switches: 1,
            ..LoopInterval::default()
        };
        assert_eq!(watch.into_intervals(), BTreeMap::from([("plant".to_owned(), vec![expected])]));
    }
}
