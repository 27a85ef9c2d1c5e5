//! Stretches of work that cost deadlines, and whose fault each was: judged by the kernel's counters of the thread that runs
//! the loop, which the supervisor read. Where they cannot decide, [`OverrunAttribution`](crate::OverrunAttribution) weighs
//! the whole run.

use std::fmt::{self, Display, Formatter};

use masseter_recording::{LoopInterval, RunUsage};
use serde::Serialize;

/// What a loop's thread did in a stretch of work that cost deadlines.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum OverrunCause {
    /// It slept, or waited for something: the loop's own fault.
    Slept,
    /// It computed: the loop's own fault.
    Computed,
    /// It was ready without a core, or the hypervisor had taken the core: the machine's fault.
    Machine,
    /// The counters do not decide.
    Unknown,
}

impl OverrunCause {
    /// Whether the loop made the stretch too long.
    pub fn is_own(self) -> bool {
        matches!(self, Self::Slept | Self::Computed)
    }

    /// The order in which overruns are told: first those that are certainly the loop's own.
    pub(crate) fn rank(self) -> u8 {
        match self {
            Self::Slept | Self::Computed => 2,
            Self::Unknown => 1,
            Self::Machine => 0,
        }
    }
}

/// A stretch of work that cost deadlines.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Overrun {
    /// Whose: `controller` or `plant`.
    pub process: &'static str,
    /// The cycle with the work.
    pub cycle: u64,
    /// How long the work took, ns.
    pub lasted_ns: u64,
    /// Deadlines that it cost.
    pub skipped: u64,
    /// Whose fault it was.
    pub cause: OverrunCause,
    /// Growth of the counters around it.
    #[serde(flatten)]
    pub counts: LoopCounts,
}

impl Display for Overrun {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { process, cycle, lasted_ns, cause, counts, .. } = self;
        let what = match cause {
            OverrunCause::Slept => "slept or waited",
            OverrunCause::Computed => "computed",
            OverrunCause::Machine => "had no core",
            OverrunCause::Unknown => "worked, slept or had no core",
        };
        write!(f, "the {process} {what} for {:.1} ms in cycle {cycle} ({counts})", *lasted_ns as f64 / 1e6)
    }
}

/// Growth of the kernel's counters of a loop's thread between the samples before and after a stretch of its work.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct LoopCounts {
    /// From one sample to the other, ns.
    pub looked_over_ns: u64,
    /// CPU time, ns.
    pub cpu_ns: Option<u64>,
    /// Time for which it was ready and had no core, ns.
    pub queued_ns: Option<u64>,
    /// Time that the hypervisor took from its core, ns.
    pub stolen_ns: Option<u64>,
    /// Times it gave up its core to wait.
    pub voluntary_switches: u64,
    /// Times its core was taken from it.
    pub involuntary_switches: u64,
    /// Page faults served from disk.
    pub major_faults: u64,
    /// Whether a signal or a debugger had stopped it.
    pub is_stopped: bool,
}

/// Steal time is counted in whole steps: up to this much may be missing, ns.
const UNCOUNTED_NS: u64 = 10_000_000;

impl LoopCounts {
    /// The sum of intervals in a row. A manifest may have any numbers.
    fn and(self, next: &LoopInterval) -> Self {
        let sum = |so_far: Option<u64>, more: Option<u64>| Some(so_far?.saturating_add(more?));
        let passed_ns = next.to_ns.saturating_sub(next.from_ns);
        Self {
            looked_over_ns: self.looked_over_ns.saturating_add(passed_ns),
            cpu_ns: sum(self.cpu_ns, next.cpu_ns),
            queued_ns: sum(self.queued_ns, next.queued_ns),
            stolen_ns: sum(self.stolen_ns, next.stolen_ns),
            voluntary_switches: self.voluntary_switches.saturating_add(next.voluntary_switches),
            involuntary_switches: self.involuntary_switches.saturating_add(next.involuntary_switches),
            major_faults: self.major_faults.saturating_add(next.major_faults),
            is_stopped: self.is_stopped || next.is_stopped,
        }
    }

    /// What a stretch of work of this length was. `cpu_share`: CPU time of the loop in the rest of the time.
    ///
    /// A wait for the disk, a stop by a signal, and CPU time on a hypervisor that does not report what it steals may have either
    /// cause. So may a stretch of which steal time too short to be counted leaves less than a period.
    pub(crate) fn cause(&self, lasted_ns: u64, period_ns: u64, cpu_share: f64) -> OverrunCause {
        let (Some(cpu_ns), Some(queued_ns)) = (self.cpu_ns, self.queued_ns) else {
            return OverrunCause::Unknown;
        };
        let machine_ns = queued_ns.saturating_add(self.stolen_ns.unwrap_or(0));
        if machine_ns >= lasted_ns.div_ceil(2) {
            return OverrunCause::Machine;
        }
        if lasted_ns < machine_ns + UNCOUNTED_NS + period_ns || self.major_faults > 0 || self.is_stopped {
            return OverrunCause::Unknown;
        }
        let beside_ns = cpu_share * self.looked_over_ns.saturating_sub(lasted_ns) as f64;
        if cpu_ns as f64 - beside_ns >= lasted_ns as f64 / 2.0 {
            return if self.stolen_ns.is_some() { OverrunCause::Computed } else { OverrunCause::Unknown };
        }
        // A thread that neither ran, nor waited, nor was ready is no thread of the loop.
        if self.voluntary_switches > 0 { OverrunCause::Slept } else { OverrunCause::Unknown }
    }
}

impl Display for LoopCounts {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let ms = |ns: Option<u64>| {
            ns.map_or_else(|| "unknown".to_owned(), |ns| format!("{:.1} ms", ns as f64 / 1e6))
        };
        write!(
            f,
            "of {:.1} ms: CPU time {}, ready without a core {}, stolen {}; it waited {} times and lost its core {} times",
            self.looked_over_ns as f64 / 1e6,
            ms(self.cpu_ns),
            ms(self.queued_ns),
            ms(self.stolen_ns),
            self.voluntary_switches,
            self.involuntary_switches
        )?;
        if self.major_faults > 0 {
            write!(f, "; {} pages came from disk", self.major_faults)?;
        }
        if self.is_stopped { f.write_str("; a signal had stopped it") } else { Ok(()) }
    }
}

/// The samples of a loop's thread in which deadlines passed without a sleep.
#[derive(Debug, Clone, Default)]
pub(crate) struct LoopSamples {
    pub(crate) process: &'static str,
    /// CPU time of the loop in the rest of the time, as a share.
    pub(crate) cpu_share: f64,
    intervals: Vec<LoopInterval>,
}

/// The kernel may count what ended less than this before a sample only in the next one, ns.
const COUNTED_AFTER_NS: u64 = 5_000_000;

impl LoopSamples {
    /// Those of a process.
    pub(crate) fn of(usage: &RunUsage, process: &'static str) -> Self {
        Self {
            process,
            intervals: usage.loops.get(process).cloned().unwrap_or_default(),
            cpu_share: usage.processes.get(process).map_or(0.0, masseter_recording::Usage::share),
        }
    }

    /// What happened in a stretch of work within this time; `None` if samples are missing.
    pub(crate) fn around(&self, from_ns: u64, to_ns: u64) -> Option<LoopCounts> {
        let first = self.intervals.partition_point(|interval| interval.to_ns <= from_ns);
        let around = self.intervals[first..].iter();
        let around = around.take_while(|interval| interval.from_ns < to_ns.saturating_add(COUNTED_AFTER_NS));
        let none =
            LoopCounts { cpu_ns: Some(0), queued_ns: Some(0), stolen_ns: Some(0), ..LoopCounts::default() };
        let (mut counts, mut covered_ns) = (none, from_ns);
        for interval in around {
            if interval.from_ns > covered_ns {
                break;
            }
            counts = counts.and(interval);
            covered_ns = interval.to_ns;
        }
        (covered_ns >= to_ns).then_some(counts)
    }
}

#[cfg(test)]
mod tests;
