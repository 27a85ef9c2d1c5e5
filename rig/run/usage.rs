//! What the processes of a run used, as the kernel counts it: CPU time, context switches, page faults;
//! and what a hypervisor stole meanwhile.
//!
//! Looked at from outside, twice a second, so that it costs the processes nothing. Counted from the first
//! look on, when they are in their steady state.

use masseter_recording::{RunUsage, Usage};
use masseter_shared::clock::{self, SECOND_NS};

use crate::machine::SystemRoot;
use crate::machine::counters::{ProcessCounters, stolen_ns};

/// From one look to the next, ns.
const EVERY_NS: u64 = SECOND_NS / 2;

/// A clock that is disciplined, not set, moves by less than this from one look to the next, ns.
const DISCIPLINED_NS: i64 = 1_000_000;

/// Follows the processes.
#[derive(Debug)]
pub(super) struct Meter {
    root: SystemRoot,
    next_ns: u64,
    processes: Vec<Metered>,
    stolen_from_to_ns: Option<[u64; 2]>,
    wall: Wall,
}

/// Follows the wall clock.
#[derive(Debug, Default)]
struct Wall {
    ahead_ns: Option<i64>,
    jump_ns: i64,
}

impl Wall {
    fn look(&mut self, ahead_ns: i64) {
        let jump_ns = self.ahead_ns.replace(ahead_ns).map_or(0, |before_ns| ahead_ns - before_ns);
        if jump_ns.abs() > DISCIPLINED_NS.max(self.jump_ns.abs()) {
            self.jump_ns = jump_ns;
        }
    }
}

#[derive(Debug)]
struct Metered {
    name: &'static str,
    id: u32,
    from_to: Option<[ProcessCounters; 2]>,
}

impl Metered {
    /// The threads of a process that is about to end take their time along with them: it keeps what was seen last.
    fn see(&mut self, sample: ProcessCounters) {
        let [from, to] = self.from_to.unwrap_or([sample; 2]);
        self.from_to = Some([from, if sample.cpu_ns < to.cpu_ns { to } else { sample }]);
    }
}

impl Meter {
    /// For processes that begin their work at `start_ns`.
    pub(super) fn new(
        root: SystemRoot,
        start_ns: u64,
        processes: impl IntoIterator<Item = (&'static str, u32)>,
    ) -> Self {
        let processes = processes.into_iter().map(|(name, id)| Metered { name, id, from_to: None }).collect();
        let (stolen_from_to_ns, wall) = (None, Wall::default());
        Self { root, next_ns: start_ns + EVERY_NS, processes, stolen_from_to_ns, wall }
    }

    /// Looks at the processes if it is time to; one that has ended keeps what was seen last.
    pub(super) fn look(&mut self, now_ns: u64) {
        if now_ns < self.next_ns {
            return;
        }
        self.next_ns = now_ns + EVERY_NS;
        for process in &mut self.processes {
            if let Some(sample) = ProcessCounters::of(&self.root, process.id, now_ns) {
                process.see(sample);
            }
        }
        if let Some(ahead_ns) = clock::wall_ahead_ns() {
            self.wall.look(ahead_ns);
        }
        if let Some(stolen_ns) = stolen_ns(&self.root) {
            let from_ns = self.stolen_from_to_ns.map_or(stolen_ns, |[from_ns, _]| from_ns);
            self.stolen_from_to_ns = Some([from_ns, stolen_ns]);
        }
    }

    pub(super) fn finish(self) -> RunUsage {
        let processes = self.processes.iter();
        RunUsage {
            processes: processes
                .filter_map(|process| {
                    // A single look tells nothing.
                    let [from, to] = process.from_to.filter(|[from, to]| from.at_ns < to.at_ns)?;
                    Some((process.name.to_owned(), usage_between(&from, &to)))
                })
                .collect(),
            stolen_s: self
                .stolen_from_to_ns
                .map_or(0.0, |[from_ns, to_ns]| to_ns.saturating_sub(from_ns) as f64 / 1e9),
            clock_jump_s: self.wall.jump_ns as f64 / 1e9,
        }
    }
}

fn usage_between(from: &ProcessCounters, to: &ProcessCounters) -> Usage {
    Usage {
        observed_s: (to.at_ns - from.at_ns) as f64 / 1e9,
        cpu_s: (to.cpu_ns - from.cpu_ns) as f64 / 1e9,
        voluntary_switches: to.voluntary_switches - from.voluntary_switches,
        involuntary_switches: to.involuntary_switches - from.involuntary_switches,
        minor_faults: to.minor_faults - from.minor_faults,
        major_faults: to.major_faults - from.major_faults,
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::machine::fixture::Fixture;

    fn files(switches: u64, faults: u64, cpu_ns: u64, stolen: u64) -> Vec<(&'static str, String)> {
        vec![
            (
                "proc/7/status",
                format!(
                    "Name:\tmasseter\nvoluntary_ctxt_switches:\t{switches}\nnonvoluntary_ctxt_switches:\t2\n"
                ),
            ),
            ("proc/7/stat", format!("7 (a (b) c) S 1 7 7 0 -1 4194304 {faults} 0 0 0 11 5 0 0 20 0")),
            ("proc/7/task/7/schedstat", format!("{} 500 9\n", cpu_ns / 4 * 3)),
            ("proc/7/task/9/schedstat", format!("{} 0 1\n", cpu_ns / 4)),
            ("proc/stat", format!("cpu  1 2 3 4 5 6 7 {stolen} 0 0\ncpu0 1 2 3 4 5 6 7 8 0 0\n")),
        ]
    }

    fn root(files: &[(&'static str, String)]) -> Fixture {
        let files: Vec<_> = files.iter().map(|(path, text)| (*path, text.as_str())).collect();
        Fixture::of(&files)
    }

    #[test]
    fn a_clock_that_is_set_jumps_and_a_disciplined_one_does_not() {
        let jump = |looks: &[i64]| {
            let mut wall = Wall::default();
            for &ahead_ns in looks {
                wall.look(ahead_ns);
            }
            wall.jump_ns
        };
        assert_eq!(jump(&[5_000_000_000, 5_000_250_000, 5_000_500_000]), 0);
        assert_eq!(jump(&[5_000_000_000, 4_000_000_000, 4_000_000_000, 4_100_000_000]), -1_000_000_000);
    }

    #[test]
    fn a_single_look_tells_nothing() {
        let only = root(&files(10, 100, 1_000_000_000, 250));
        let mut meter = Meter::new(only.root(), 0, [("plant", 7)]);
        meter.look(EVERY_NS);
        assert_eq!(meter.finish().processes, BTreeMap::new());
    }

    #[test]
    fn a_process_that_loses_threads_keeps_what_was_seen_last() {
        let early = root(&files(10, 100, 1_000_000_000, 250));
        let mut meter = Meter::new(early.root(), 0, [("logger", 7)]);
        meter.look(EVERY_NS);
        let late = root(&files(20, 100, 1_300_000_000, 250));
        meter.root = late.root();
        meter.look(2 * EVERY_NS);
        let dying = root(&files(30, 100, 400_000_000, 250));
        meter.root = dying.root();
        meter.look(3 * EVERY_NS);
        let logger = &meter.finish().processes["logger"];
        assert!((logger.cpu_s - 0.3).abs() < 1e-9, "{}", logger.cpu_s);
        assert_eq!(logger.voluntary_switches, 10);
    }

    #[test]
    fn usage_is_what_was_added_between_the_first_and_the_last_look() {
        let early = root(&files(10, 100, 1_000_000_000, 250));
        let mut meter = Meter::new(early.root(), 0, [("plant", 7), ("gone", 8)]);
        meter.look(EVERY_NS - 1);
        meter.look(EVERY_NS);
        let late = root(&files(1010, 103, 1_300_000_000, 280));
        meter.root = late.root();
        meter.look(2 * EVERY_NS);
        let usage = meter.finish();
        let plant = Usage {
            observed_s: 0.5,
            cpu_s: 0.3,
            voluntary_switches: 1000,
            involuntary_switches: 0,
            minor_faults: 3,
            major_faults: 0,
        };
        assert_eq!(usage.processes, BTreeMap::from([("plant".to_owned(), plant)]));
        assert!((usage.stolen_s - 0.3).abs() < 1e-9, "{}", usage.stolen_s);
    }
}
