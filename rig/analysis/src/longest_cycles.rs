//! The cycles that took longest from the plant's deadline to the command on the wire, each with the hop furthest above
//! its median.
//!
//! Where a newer command overtook the cycle's own, the path ends with the first later command that went out: the
//! longest cycles end so. A cycle without a fresh reading has no path.

use masseter_runtime::messages::{Command, Machine, Reading, State};
use serde::Serialize;

use super::answer::{Answer, Answers};
use super::by_cycle::ByCycle;
use super::hops::{CyclePath, TypicalHops, passed_ns};
use super::kernel_counts::KernelCounts;

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
    pub(super) fn reading(&mut self, reading: &Reading) {
        let late_ns = reading.woke_ns.saturating_sub(reading.due_ns);
        let stalled_ns = self.plant_stalls.when_due_ns(reading.stalled_ns, late_ns);
        if reading.complete_ns > 0 {
            self.readings.insert(reading.cycle, (*reading, stalled_ns));
        }
        let Some(Answer { cycle, received_ns, sent_ns: Some(sent_ns) }) = self.answers.take(reading) else {
            return;
        };
        // The command also ends the wait for those that it overtook.
        let first = self.last_sent.replace(cycle).map_or(cycle, |last| last + 1);
        for ended in first.max(cycle.saturating_sub(OVERTAKEN))..=cycle {
            self.add(ended, |parts| parts.sent_ns = Some(([received_ns, sent_ns], stalled_ns)));
        }
    }

    /// `is_fresh`: the state's reading is used for the first time.
    pub(super) fn state(&mut self, state: &State, is_fresh: bool) {
        let late_ns = state.woke_ns.saturating_sub(state.due_ns);
        let stalled_ns = self.controller_stalls.when_due_ns(state.stalled_ns, late_ns);
        if let Some(last_cycle) = self.last_cycle.replace(state.cycle) {
            self.add(last_cycle, |parts| parts.stalled_when_next_due_ns = Some(stalled_ns));
        }
        if is_fresh {
            self.add(state.cycle, |parts| parts.state = Some((*state, stalled_ns)));
        }
    }

    pub(super) fn command(&mut self, command: &Command) {
        self.add(command.cycle, |parts| parts.published_ns = Some(command.published_ns));
    }

    pub(super) fn machine(&mut self, machine: &Machine) {
        self.kernel.push(*machine);
    }

    /// Adds a part; the last one completes the path.
    fn add(&mut self, cycle: u64, put: impl FnOnce(&mut Parts)) {
        let mut parts = self.parts.take(cycle).unwrap_or_default();
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
        self.typical.take(path);
        let place = self.longest.partition_point(|worse| worse.total_ns() >= path.total_ns());
        if place < WORST {
            self.longest.insert(place, *path);
            self.longest.truncate(WORST);
        }
    }

    /// The worst cycles, longest first.
    pub(super) fn finish(self) -> Vec<WorstCycle> {
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
mod tests {
    use super::super::hops::hop_names;
    use super::*;

    type HopTimes = [u64; 10];

    const PERIOD_NS: u64 = 1_000_000;
    const SYNC_NS: u64 = 48_000;
    const CONTROLLER_AT_NS: u64 = 540_000;
    /// The reading is there 90 µs before the controller wakes.
    const TYPICAL_NS: HopTimes = [0, 360_000, 42_000, 0, 1_000, 2_000, 500, 500, 2_000, 280_000];

    /// Cycles as the time table has them.
    #[derive(Default)]
    struct Rig {
        longest: LongestCycles,
        /// Command's cycle, reception and end.
        answer: [u64; 3],
        plant_stalled_ns: u64,
        controller_stalled_ns: u64,
    }

    impl Rig {
        /// The messages of a cycle with these hop times.
        fn cycle(&mut self, cycle: u64, hops_ns: HopTimes) {
            let [wake_up, data, publication, late, pick_up, solving, control, publishing, transport, to_wire] =
                hops_ns;
            let due_ns = cycle * PERIOD_NS;
            let sampled_ns = due_ns + wake_up + SYNC_NS;
            let complete_ns = sampled_ns + data;
            let reading = Reading {
                cycle,
                due_ns,
                woke_ns: due_ns + wake_up,
                sampled_ns,
                complete_ns,
                published_ns: complete_ns + publication,
                stalled_ns: self.plant_stalled_ns,
                ..Default::default()
            };
            // Readings are drained first: the answer may be there before the state that explains it.
            let [answers_cycle, command_received_ns, command_sent_ns] = self.answer;
            self.longest.reading(&Reading { answers_cycle, command_received_ns, command_sent_ns, ..reading });

            let woke_ns = due_ns + CONTROLLER_AT_NS + late;
            let received_ns = reading.published_ns.max(woke_ns) + pick_up;
            let commanded_ns = received_ns + solving + control;
            let published_ns = commanded_ns + publishing;
            self.longest.command(&Command { cycle, published_ns, ..Default::default() });
            let state = State {
                cycle,
                reading_cycle: cycle,
                due_ns: due_ns + CONTROLLER_AT_NS,
                woke_ns,
                received_ns,
                solved_ns: received_ns + solving,
                commanded_ns,
                stalled_ns: self.controller_stalled_ns,
                ..Default::default()
            };
            self.longest.state(&state, true);
            let plant_has_it_ns = published_ns + transport;
            self.answer = [cycle, plant_has_it_ns, plant_has_it_ns + to_wire];
        }
    }

    #[test]
    fn of_the_worst_cycles_the_hop_that_took_unusually_long_is_to_blame_and_no_other() {
        let mut rig = Rig::default();
        for cycle in 1..100 {
            let mut hops_ns = TYPICAL_NS;
            // Every ninth cycle, one hop after the other; the later ones a little longer.
            if cycle % 9 == 0 && cycle / 9 <= TYPICAL_NS.len() as u64 {
                hops_ns[cycle as usize / 9 - 1] += 200_000 + cycle * 1000;
            }
            rig.cycle(cycle, hops_ns);
        }
        let worst = rig.longest.finish();
        assert_eq!(worst.len(), WORST);
        assert!(worst.windows(2).all(|pair| pair[0].total_ns >= pair[1].total_ns));
        for told in worst {
            let hop = told.cycle as usize / 9 - 1;
            let expected = (hop_names().nth(hop).unwrap(), TYPICAL_NS[hop] + 200_000 + told.cycle * 1000);
            assert_eq!((told.hop, told.hop_ns), expected, "cycle {}", told.cycle);
            assert!(told.hop_p50_ns.abs_diff(TYPICAL_NS[hop]) <= TYPICAL_NS[hop] / 500, "{told:?}");
        }
    }

    #[test]
    fn time_lost_before_the_next_wake_up_is_attributed_to_the_long_cycle() {
        let mut rig = Rig::default();
        for cycle in 1..20 {
            let mut hops_ns = TYPICAL_NS;
            match cycle {
                5 => hops_ns[8] += 300_000,
                // Counters are read in the next wake-up.
                6 => rig.plant_stalled_ns += 300_000,
                10 => hops_ns[4] += 200_000,
                11 => rig.controller_stalled_ns += 200_000,
                // A late wake-up is known at once.
                15 => {
                    hops_ns[0] += 250_000;
                    rig.plant_stalled_ns += 250_000;
                }
                _ => {}
            }
            rig.cycle(cycle, hops_ns);
        }
        let told: Vec<_> =
            rig.longest.finish().iter().map(|worst| (worst.cycle, worst.stalled_ns)).take(4).collect();
        assert_eq!(told, [(5, 300_000), (10, 200_000), (15, 250_000), (1, 0)]);
    }

    #[test]
    fn a_command_that_was_overtaken_ends_with_the_first_later_one_on_the_wire() {
        let mut rig = Rig::default();
        (1..7).for_each(|cycle| rig.cycle(cycle, TYPICAL_NS));
        // The plant stands still behind reading 7, and takes the newest of three commands then.
        rig.cycle(7, TYPICAL_NS);
        for cycle in [8, 9] {
            rig.longest.command(&Command { cycle, published_ns: cycle * PERIOD_NS, ..Default::default() });
            rig.longest.state(&State { cycle, reading_cycle: 7, ..Default::default() }, false);
        }
        let [command_received_ns, command_sent_ns] = [10_300_000, 10_500_000];
        let reading = Reading { cycle: 10, command_received_ns, command_sent_ns, ..Default::default() };
        rig.longest.reading(&Reading { answers_cycle: 9, ..reading });
        let worst = rig.longest.finish();
        assert_eq!((worst[0].cycle, worst[0].total_ns, worst[0].hop), (7, 3_500_000, "command transport"));
        assert_eq!(worst.len(), 7);
    }

    #[test]
    fn a_cycle_that_used_a_late_reading_is_among_the_longest() {
        let mut longest = LongestCycles::default();
        let late = Reading { cycle: 7, due_ns: 7_000_000, complete_ns: 7_900_000, ..Default::default() };
        longest.reading(&late);
        longest.state(&State { cycle: 8, reading_cycle: 7, ..Default::default() }, true);
        longest.command(&Command { cycle: 8, ..Default::default() });
        let (answers_cycle, command_sent_ns) = (8, 8_900_000);
        longest.reading(&Reading { cycle: 9, answers_cycle, command_sent_ns, ..Default::default() });
        longest.state(&State { cycle: 9, reading_cycle: 7, ..Default::default() }, false);
        let worst = longest.finish();
        assert_eq!((worst[0].cycle, worst[0].due_ns, worst[0].total_ns), (8, 7_000_000, 1_900_000));
    }

    #[test]
    fn a_stall_counts_before_a_deadline_but_for_what_made_the_wake_up_late() {
        let mut stalls = Stalls::default();
        // What was counted in a wake-up, how late that was, and what was counted at its deadline.
        for (counted_ns, late_ns, when_due_ns) in
            [(0, 20, 0), (300, 0, 300), (1000, 700, 300), (1000, 20, 1000), (1500, 400, 1100)]
        {
            assert_eq!(stalls.when_due_ns(counted_ns, late_ns), when_due_ns, "{counted_ns} ns");
        }
    }
}
