//! What the processes of a run used, from samples of the kernel's counters: CPU time, context switches, page faults,
//! and the time that a hypervisor stole.
//!
//! Counted from the first sample on, when the processes are in their steady state.

use masseter_machine::counters::{Sample, Sampler};
use masseter_machine::{SystemRoot, counters::Counters};
use masseter_recording::{RunUsage, Usage};
use masseter_runtime::clock::{self, SECOND_NS};

const INTERVAL_NS: u64 = SECOND_NS / 2;

/// A step of the wall clock by more than this within an interval is a jump; clock discipline moves it by less, ns.
const JUMP_NS: i64 = 1_000_000;

/// Follows the counters of a run's processes.
#[derive(Debug)]
pub(super) struct UsageMeter {
    sampler: Sampler,
    processes: Vec<ProcessUsage>,
    /// First and last steal time.
    stolen_ns: Option<[u64; 2]>,
    wall_clock: WallClock,
}

/// First and last counters of a process, with their times.
#[derive(Debug)]
struct ProcessUsage {
    name: &'static str,
    span: Option<[(u64, Counters); 2]>,
}

/// Follows the wall clock.
#[derive(Debug, Default)]
struct WallClock {
    /// Wall clock less monotonic clock, ns.
    offset_ns: Option<i64>,
    largest_jump_ns: i64,
}

impl WallClock {
    fn add(&mut self, offset_ns: i64) {
        let jump_ns = self.offset_ns.replace(offset_ns).map_or(0, |before_ns| offset_ns - before_ns);
        if jump_ns.abs() > JUMP_NS.max(self.largest_jump_ns.abs()) {
            self.largest_jump_ns = jump_ns;
        }
    }
}

impl ProcessUsage {
    fn add(&mut self, time_ns: u64, counters: Counters) {
        let now = (time_ns, counters);
        let [first, last] = self.span.unwrap_or([now; 2]);
        // The threads of a process that is about to end no longer count: CPU time falls, and the last sample stays.
        self.span = Some([first, if counters.cpu_ns < last.1.cpu_ns { last } else { now }]);
    }

    /// None from a single sample.
    fn usage(&self) -> Option<Usage> {
        let [(first_ns, first), (last_ns, last)] = self.span?;
        let cpu_ns = last.cpu_ns? - first.cpu_ns?;
        (first_ns < last_ns).then(|| Usage {
            observed_s: (last_ns - first_ns) as f64 / 1e9,
            cpu_s: cpu_ns as f64 / 1e9,
            voluntary_switches: last.voluntary_switches - first.voluntary_switches,
            involuntary_switches: last.involuntary_switches - first.involuntary_switches,
            minor_faults: last.minor_faults - first.minor_faults,
            major_faults: last.major_faults - first.major_faults,
        })
    }
}

impl UsageMeter {
    /// For processes, by name and id, that begin their work at `start_ns`.
    pub(super) fn new(start_ns: u64, processes: &[(&'static str, u32)]) -> Self {
        let ids = processes.iter().map(|(_, id)| *id).collect();
        let root = SystemRoot::of_this_machine();
        Self {
            sampler: Sampler::new(root, ids, INTERVAL_NS, start_ns + INTERVAL_NS),
            processes: processes.iter().map(|&(name, _)| ProcessUsage { name, span: None }).collect(),
            stolen_ns: None,
            wall_clock: WallClock::default(),
        }
    }

    /// Samples if it is time to.
    pub(super) fn update(&mut self, now_ns: u64) {
        let Some(sample) = self.sampler.sample(now_ns) else { return };
        self.add(&sample);
        if let Some(offset_ns) = clock::wall_ahead_ns() {
            self.wall_clock.add(offset_ns);
        }
    }

    fn add(&mut self, sample: &Sample) {
        for (process, counters) in self.processes.iter_mut().zip(&sample.processes) {
            if let Some(counters) = *counters {
                process.add(sample.time_ns, counters);
            }
        }
        if let Some(stolen_ns) = sample.stolen_ns {
            let first_ns = self.stolen_ns.map_or(stolen_ns, |[first_ns, _]| first_ns);
            self.stolen_ns = Some([first_ns, stolen_ns]);
        }
    }

    pub(super) fn into_usage(self) -> RunUsage {
        let named = |process: &ProcessUsage| Some((process.name.to_owned(), process.usage()?));
        let stolen_ns = self.stolen_ns.map_or(0, |[first_ns, last_ns]| last_ns.saturating_sub(first_ns));
        RunUsage {
            processes: self.processes.iter().filter_map(named).collect(),
            stolen_s: stolen_ns as f64 / 1e9,
            clock_jump_s: self.wall_clock.largest_jump_ns as f64 / 1e9,
            ..RunUsage::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    fn counters(switches: u64, faults: u64, cpu_ns: u64) -> Counters {
        Counters {
            cpu_ns: Some(cpu_ns),
            voluntary_switches: switches,
            involuntary_switches: 2,
            minor_faults: faults,
            ..Counters::default()
        }
    }

    fn usage_of(processes: &[(&'static str, u32)], samples: &[(u64, &[Option<Counters>])]) -> RunUsage {
        let mut meter = UsageMeter::new(0, processes);
        for (time_ns, counters) in samples {
            let processes = counters.to_vec();
            meter.add(&Sample { time_ns: *time_ns, stolen_ns: Some(time_ns / 10), processes });
        }
        meter.into_usage()
    }

    #[test]
    fn a_clock_that_is_set_jumps_and_a_disciplined_one_does_not() {
        let jump = |offsets_ns: &[i64]| {
            let mut wall_clock = WallClock::default();
            for offset_ns in offsets_ns {
                wall_clock.add(*offset_ns);
            }
            wall_clock.largest_jump_ns
        };
        assert_eq!(jump(&[5_000_000_000, 5_000_250_000, 5_000_500_000]), 0);
        assert_eq!(jump(&[5_000_000_000, 4_000_000_000, 4_000_000_000, 4_100_000_000]), -1_000_000_000);
    }

    #[test]
    fn a_single_sample_gives_no_usage() {
        let usage = usage_of(&[("plant", 7)], &[(0, &[Some(counters(10, 100, 0))])]);
        assert_eq!(usage.processes, BTreeMap::new());
    }

    #[test]
    fn a_process_that_loses_threads_keeps_its_last_whole_sample() {
        let samples =
            [counters(10, 100, 1_000_000_000), counters(20, 100, 1_300_000_000), counters(30, 100, 1)]
                .map(|counters| [Some(counters)]);
        let [first, last, dying] = &samples;
        let usage = usage_of(&[("recorder", 7)], &[(1, first), (2, last), (3, dying)]);
        let recorder = &usage.processes["recorder"];
        assert!((recorder.cpu_s - 0.3).abs() < 1e-9, "{}", recorder.cpu_s);
        assert_eq!(recorder.voluntary_switches, 10);
    }

    #[test]
    fn usage_is_the_difference_between_the_first_and_the_last_sample() {
        let first = [Some(counters(10, 100, 1_000_000_000)), None];
        let last = [Some(counters(1010, 103, 1_300_000_000)), None];
        let usage =
            usage_of(&[("plant", 7), ("gone", 8)], &[(SECOND_NS, &first), (SECOND_NS + INTERVAL_NS, &last)]);
        let plant = Usage {
            observed_s: 0.5,
            cpu_s: 0.3,
            voluntary_switches: 1000,
            involuntary_switches: 0,
            minor_faults: 3,
            major_faults: 0,
        };
        assert_eq!(usage.processes, BTreeMap::from([("plant".to_owned(), plant)]));
        assert!((usage.stolen_s - 0.05).abs() < 1e-9, "{}", usage.stolen_s);
    }
}
