//! The cycles that took longest from the plant's deadline to the command on the wire. Each has the hop furthest above
//! its median, and the kernel's counters around it.
//!
//! SYNC on the wire and the waits of the time table lie between the hops, so a delay counts in one hop alone. Where a newer
//! command overtook the cycle's own, the path ends with the first later command that went out: the longest cycles end so.
//! A cycle without a fresh reading has no path.

use masseter_runtime::messages::{Command, Machine, Reading, State};
use serde::Serialize;

use crate::intervals::{Answer, Answers};
use crate::{measured::Durations, series::ByCycle};

/// A cycle's path, joined from messages of both processes.
#[derive(Debug, Clone, Copy)]
struct CyclePath {
    reading: Reading,
    state: State,
    /// Publication of the command.
    published_ns: u64,
    /// Reception by the plant of the command that ended the path.
    received_ns: u64,
    /// When its last process data were on the wire.
    sent_ns: u64,
    /// Time for which the machine stalled meanwhile.
    stalled_ns: u64,
}

impl CyclePath {
    fn total_ns(&self) -> u64 {
        passed_ns(self.reading.due_ns, self.sent_ns)
    }
}

/// The beginning and the end of a hop, ns.
type Ends = fn(&CyclePath) -> [u64; 2];

/// The hops in the order in which a cycle passes through them.
const HOPS: [(&str, Ends); 10] = [
    ("plant wake-up", |path| [path.reading.due_ns, path.reading.woke_ns]),
    ("process data", |path| [path.reading.sampled_ns, path.reading.complete_ns]),
    ("reading publication", |path| [path.reading.complete_ns, path.reading.published_ns]),
    ("controller wake-up", |path| [path.state.due_ns, path.state.woke_ns]),
    // Until it wakes, the controller does not wait for the reading.
    ("reading pick-up", |path| [path.reading.published_ns.max(path.state.woke_ns), path.state.received_ns]),
    ("forward kinematics", |path| [path.state.received_ns, path.state.solved_ns]),
    ("control", |path| [path.state.solved_ns, path.state.commanded_ns]),
    ("command publication", |path| [path.state.commanded_ns, path.published_ns]),
    ("command transport", |path| [path.published_ns, path.received_ns]),
    ("command to wire", |path| [path.received_ns, path.sent_ns]),
];

/// The names of the hops, in the order in which a cycle passes through them.
pub fn hop_names() -> impl Iterator<Item = &'static str> {
    HOPS.into_iter().map(|(name, _)| name)
}

/// A hop of one cycle beside its median.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct HopTime {
    name: &'static str,
    took_ns: u64,
    p50_ns: u64,
}

/// How long the hops typically take.
#[derive(Debug, Clone, Default)]
struct TypicalHops([Durations; HOPS.len()]);

impl TypicalHops {
    fn add(&mut self, path: &CyclePath) {
        for (durations, (_, ends)) in self.0.iter_mut().zip(HOPS) {
            durations.record(took_ns(ends, path), 1);
        }
    }

    /// The hop furthest above its median.
    fn furthest_above_median(&self, path: &CyclePath) -> HopTime {
        let hops = HOPS.into_iter().zip(&self.0).map(|((name, ends), Durations(histogram))| HopTime {
            name,
            took_ns: took_ns(ends, path),
            p50_ns: histogram.value_at_quantile(0.5).min(histogram.max()),
        });
        hops.max_by_key(|hop| hop.took_ns.saturating_sub(hop.p50_ns)).expect("there are hops")
    }
}

fn took_ns(ends: Ends, path: &CyclePath) -> u64 {
    let [from_ns, to_ns] = ends(path);
    passed_ns(from_ns, to_ns)
}

/// 0 where the two are in the wrong order, as in a damaged recording.
fn passed_ns(from_ns: u64, to_ns: u64) -> u64 {
    to_ns.saturating_sub(from_ns)
}

/// Growth of the kernel's counters between the samples before and after a cycle.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct KernelCounts {
    /// From one sample to the other, ns.
    pub looked_over_ns: Option<u64>,
    /// Time that the hypervisor took from all cores meanwhile, as far as it reports that, ns.
    pub stolen_ns: Option<u64>,
    /// Times that one of the loops lost its core.
    pub involuntary_switches: Option<u64>,
    /// Page faults of both processes.
    pub page_faults: Option<u64>,
}

impl KernelCounts {
    /// Growth between the last of all samples before a stretch of time and the first behind it.
    fn around(samples: &[Machine], from_ns: u64, to_ns: u64) -> Self {
        let before = samples.partition_point(|sample| sample.time_ns <= from_ns);
        let after = samples.partition_point(|sample| sample.time_ns < to_ns);
        match (before.checked_sub(1), samples.get(after)) {
            (Some(before), Some(after)) => Self::between(&samples[before], after),
            _ => Self::default(),
        }
    }

    fn between(before: &Machine, after: &Machine) -> Self {
        let growth = |counter: fn(&Machine) -> u64| Some(counter(after).saturating_sub(counter(before)));
        Self {
            looked_over_ns: growth(|machine| machine.time_ns),
            stolen_ns: growth(|machine| machine.stolen_ns),
            involuntary_switches: growth(|machine| machine.involuntary_switches.iter().sum()),
            page_faults: growth(|machine| machine.page_faults.iter().sum()),
        }
    }
}

/// Cycles kept.
const WORST: usize = 10;
/// Commands overtaken at once that are followed: more than a rig that still moves can have.
const OVERTAKEN: u64 = 1 << 12;

/// One of the worst cycles.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WorstCycle {
    /// Cycle of the controller.
    pub cycle: u64,
    /// The plant's deadline for the reading it used, ns of the run's clock.
    pub due_ns: u64,
    /// From there until the last process data of its command were on the wire, or of the first later one if it was
    /// overtaken, ns.
    pub total_ns: u64,
    /// The hop furthest above its median.
    pub hop: &'static str,
    /// How long that hop took, ns.
    pub hop_ns: u64,
    /// How long it takes in half of all cycles, ns.
    pub hop_p50_ns: u64,
    /// Time for which the machine stalled while waiting: of the plant between that deadline and the one after the
    /// command, and of the controller between its deadline and the next, ns.
    pub stalled_ns: u64,
    /// The kernel's counters around it; none without samples.
    #[serde(flatten)]
    pub around: KernelCounts,
}

/// A message, and its process's counter of stalls at the deadline of its cycle.
type Counted<M> = (M, u64);

/// The parts of a controller's cycle that were found so far.
#[derive(Debug, Clone, Copy, Default)]
struct Parts {
    state: Option<Counted<State>>,
    published_ns: Option<u64>,
    /// Reception of a command and its end on the wire, with the counter at the deadline of the reading that reports them.
    sent_ns: Option<Counted<[u64; 2]>>,
    /// The controller's counter at its next deadline.
    stalled_when_next_due_ns: Option<u64>,
}

/// Follows every cycle and keeps the longest.
#[derive(Debug, Clone, Default)]
pub(super) struct LongestCycles {
    readings: ByCycle<Counted<Reading>>,
    parts: ByCycle<Parts>,
    typical: TypicalHops,
    longest: Vec<CyclePath>,
    kernel: Vec<Machine>,
    plant_stalls: Stalls,
    controller_stalls: Stalls,
    last_cycle: Option<u64>,
    answers: Answers,
    last_sent: Option<u64>,
}

impl LongestCycles {
    pub(super) fn apply_reading(&mut self, reading: &Reading) {
        let late_ns = reading.woke_ns.saturating_sub(reading.due_ns);
        let stalled_ns = self.plant_stalls.when_due_ns(reading.stalled_ns, late_ns);
        if reading.complete_ns > 0 {
            self.readings.insert(reading.cycle, (*reading, stalled_ns));
        }
        let Some(Answer { cycle, received_ns, sent_ns: Some(sent_ns) }) = self.answers.new_answer(reading)
        else {
            return;
        };
        // The command also ends the wait for those that it overtook.
        let first = self.last_sent.replace(cycle).map_or(cycle, |last| last + 1);
        for ended in first.max(cycle.saturating_sub(OVERTAKEN))..=cycle {
            self.add(ended, |parts| parts.sent_ns = Some(([received_ns, sent_ns], stalled_ns)));
        }
    }

    /// `is_fresh`: the state's reading is used for the first time.
    pub(super) fn apply_state(&mut self, state: &State, is_fresh: bool) {
        let late_ns = state.woke_ns.saturating_sub(state.due_ns);
        let stalled_ns = self.controller_stalls.when_due_ns(state.stalled_ns, late_ns);
        if let Some(last_cycle) = self.last_cycle.replace(state.cycle) {
            self.add(last_cycle, |parts| parts.stalled_when_next_due_ns = Some(stalled_ns));
        }
        if is_fresh {
            self.add(state.cycle, |parts| parts.state = Some((*state, stalled_ns)));
        }
    }

    pub(super) fn apply_command(&mut self, command: &Command) {
        self.add(command.cycle, |parts| parts.published_ns = Some(command.published_ns));
    }

    pub(super) fn apply_machine(&mut self, machine: &Machine) {
        self.kernel.push(*machine);
    }

    /// Adds a part; the last one completes the path.
    fn add(&mut self, cycle: u64, put: impl FnOnce(&mut Parts)) {
        let mut parts = self.parts.remove(cycle).unwrap_or_default();
        put(&mut parts);
        match self.path(&parts) {
            Some(path) => self.keep(&path),
            None => self.parts.insert(cycle, parts),
        }
    }

    /// None while a part is missing.
    fn path(&self, parts: &Parts) -> Option<CyclePath> {
        let (state, controller_stalled_ns) = parts.state?;
        let (reading, plant_stalled_ns) = self.readings.get(state.reading_cycle).copied()?;
        let ([received_ns, sent_ns], plant_stalled_next_ns) = parts.sent_ns?;
        let plant_ns = passed_ns(plant_stalled_ns, plant_stalled_next_ns);
        let controller_ns = passed_ns(controller_stalled_ns, parts.stalled_when_next_due_ns?);
        let (published_ns, stalled_ns) = (parts.published_ns?, plant_ns.saturating_add(controller_ns));
        Some(CyclePath { reading, state, published_ns, received_ns, sent_ns, stalled_ns })
    }

    fn keep(&mut self, path: &CyclePath) {
        self.typical.add(path);
        let place = self.longest.partition_point(|worse| worse.total_ns() >= path.total_ns());
        if place < WORST {
            self.longest.insert(place, *path);
            self.longest.truncate(WORST);
        }
    }

    /// The worst cycles, longest first.
    pub(super) fn into_figures(self) -> Vec<WorstCycle> {
        let worst_cycle = |path: &CyclePath| {
            let hop = self.typical.furthest_above_median(path);
            let (due_ns, total_ns) = (path.reading.due_ns, path.total_ns());
            WorstCycle {
                cycle: path.state.cycle,
                due_ns,
                total_ns,
                hop: hop.name,
                hop_ns: hop.took_ns,
                hop_p50_ns: hop.p50_ns,
                stalled_ns: path.stalled_ns,
                around: KernelCounts::around(&self.kernel, due_ns, due_ns.saturating_add(total_ns)),
            }
        };
        self.longest.iter().map(worst_cycle).collect()
    }
}

/// Computes a process's counter of stalls at a deadline from the counter in its message, which is that at the wake-up.
#[derive(Debug, Clone, Default)]
struct Stalls {
    counted_ns: u64,
}

impl Stalls {
    /// A wake-up that was late was so because of the last stall before it: as much of the growth belongs to the cycle
    /// that begins, the rest to the one before.
    fn when_due_ns(&mut self, counted_ns: u64, late_ns: u64) -> u64 {
        let growth_ns = counted_ns.saturating_sub(std::mem::replace(&mut self.counted_ns, counted_ns));
        counted_ns - growth_ns.min(late_ns)
    }
}

#[cfg(test)]
mod tests;
