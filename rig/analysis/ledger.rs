//! The cycles that took longest from the plant's deadline to the command on the wire, each with the hop
//! to blame: the one furthest above its own median.

use masseter_shared::messages::{Command, Machine, Reading, State};
use serde::Serialize;

use super::join::ByCycle;
use super::measured::IntervalFigures;

/// Cycles told of.
const WORST: usize = 10;
/// The hops of a cycle, by the names of their intervals.
const HOPS: [&str; 8] = [
    "plant wake-up",
    "process data",
    "reading transport",
    "controller wake-up",
    "forward kinematics",
    "control",
    "command transport",
    "command to wire",
];

/// One of the worst cycles.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WorstCycle {
    /// Cycle of the controller.
    pub cycle: u64,
    /// The plant's deadline for the reading it used, ns of the run's clock.
    pub due_ns: u64,
    /// From there until the last process data of its command were on the wire, ns.
    pub total_ns: u64,
    /// The hop to blame.
    pub hop: &'static str,
    /// How long that hop took, ns.
    pub hop_ns: u64,
    /// How long it takes in half of all cycles, ns.
    pub hop_p50_ns: u64,
    /// Time that the machine withheld from both processes since the cycle before, ns.
    pub stalled_ns: u64,
    /// What the kernel counted around it; none where nobody looked.
    #[serde(flatten)]
    pub around: Around,
}

/// What the kernel counted between the looks before and after a cycle.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Around {
    /// From one look to the other, ns.
    pub looked_over_ns: Option<u64>,
    /// Time that the hypervisor took from all cores meanwhile, as far as it tells, ns.
    pub stolen_ns: Option<u64>,
    /// Times that one of the loops had its core taken from it.
    pub involuntary_switches: Option<u64>,
    /// Page faults of both processes.
    pub page_faults: Option<u64>,
}

impl Around {
    fn between(before: &Machine, after: &Machine) -> Self {
        let more = |of: fn(&Machine) -> u64| Some(of(after).saturating_sub(of(before)));
        Self {
            looked_over_ns: more(|machine| machine.time_ns),
            stolen_ns: more(|machine| machine.stolen_ns),
            involuntary_switches: more(|machine| machine.involuntary_switches.iter().sum()),
            page_faults: more(|machine| machine.page_faults.iter().sum()),
        }
    }
}

/// What is known of a reading's way.
#[allow(clippy::struct_field_names, reason = "the unit")]
#[derive(Debug, Clone, Copy)]
struct Up {
    due_ns: u64,
    wake_up_ns: u64,
    process_data_ns: u64,
    published_ns: u64,
    stalled_ns: u64,
}

/// What is known of a controller's cycle so far.
#[derive(Debug, Clone, Copy, Default)]
struct Parts {
    state: Option<(u64, [u64; 5], u64)>,
    published_ns: Option<u64>,
    answer: Option<(u64, u64)>,
}

#[derive(Debug, Clone, Copy)]
struct Entry {
    cycle: u64,
    due_ns: u64,
    total_ns: u64,
    hops_ns: [u64; HOPS.len()],
    stalled_ns: u64,
}

/// Follows every cycle and keeps the worst.
#[derive(Debug, Default)]
pub(super) struct Ledger {
    ups: ByCycle<Up>,
    parts: ByCycle<Parts>,
    worst: Vec<Entry>,
    looks: Vec<Machine>,
    plant_stalled_ns: u64,
    controller_stalled_ns: u64,
    last_answered: u64,
}

impl Ledger {
    pub(super) fn reading(&mut self, reading: &Reading) {
        if reading.complete_ns > 0 {
            let up = Up {
                due_ns: reading.due_ns,
                wake_up_ns: reading.woke_ns.saturating_sub(reading.due_ns),
                process_data_ns: reading.complete_ns.saturating_sub(reading.sampled_ns),
                published_ns: reading.published_ns,
                stalled_ns: reading.stalled_ns.saturating_sub(self.plant_stalled_ns),
            };
            self.ups.insert(reading.cycle, up);
        }
        self.plant_stalled_ns = reading.stalled_ns;
        if reading.answers_cycle > self.last_answered && reading.command_sent_ns > 0 {
            self.last_answered = reading.answers_cycle;
            let answer = (reading.command_received_ns, reading.command_sent_ns);
            self.add(reading.answers_cycle, |parts| parts.answer = Some(answer));
        }
    }

    /// `is_fresh`: the state's reading is used for the first time.
    pub(super) fn state(&mut self, state: &State, is_fresh: bool) {
        let stalled_ns = state.stalled_ns.saturating_sub(self.controller_stalled_ns);
        self.controller_stalled_ns = state.stalled_ns;
        if is_fresh {
            let times = [state.due_ns, state.woke_ns, state.received_ns, state.solved_ns, state.commanded_ns];
            self.add(state.cycle, |parts| parts.state = Some((state.reading_cycle, times, stalled_ns)));
        }
    }

    pub(super) fn command(&mut self, command: &Command) {
        self.add(command.cycle, |parts| parts.published_ns = Some(command.published_ns));
    }

    pub(super) fn machine(&mut self, machine: &Machine) {
        self.looks.push(*machine);
    }

    /// What was counted between the last look before a cycle and the first behind it.
    fn around(&self, entry: &Entry) -> Around {
        let after = self.looks.partition_point(|look| look.time_ns < entry.due_ns + entry.total_ns);
        let before = self.looks.partition_point(|look| look.time_ns <= entry.due_ns);
        match (before.checked_sub(1), self.looks.get(after)) {
            (Some(before), Some(after)) => Around::between(&self.looks[before], after),
            _ => Around::default(),
        }
    }

    /// Adds a part; the last one makes the entry.
    fn add(&mut self, cycle: u64, put: impl FnOnce(&mut Parts)) {
        let mut parts = self.parts.take(cycle).unwrap_or_default();
        put(&mut parts);
        match self.entry(cycle, &parts) {
            Some(entry) => self.keep(entry),
            None => self.parts.insert(cycle, parts),
        }
    }

    fn entry(&self, cycle: u64, parts: &Parts) -> Option<Entry> {
        let (reading_cycle, [due_ns, woke_ns, received_ns, solved_ns, commanded_ns], stalled_ns) =
            parts.state?;
        let (command_received_ns, sent_ns) = parts.answer?;
        let published_ns = parts.published_ns?;
        let up = self.ups.get(reading_cycle)?;
        Some(Entry {
            cycle,
            due_ns: up.due_ns,
            total_ns: sent_ns.saturating_sub(up.due_ns),
            hops_ns: [
                up.wake_up_ns,
                up.process_data_ns,
                received_ns.saturating_sub(up.published_ns),
                woke_ns.saturating_sub(due_ns),
                solved_ns.saturating_sub(received_ns),
                commanded_ns.saturating_sub(solved_ns),
                command_received_ns.saturating_sub(published_ns),
                sent_ns.saturating_sub(command_received_ns),
            ],
            stalled_ns: stalled_ns + up.stalled_ns,
        })
    }

    fn keep(&mut self, entry: Entry) {
        let place = self.worst.partition_point(|worse| worse.total_ns >= entry.total_ns);
        if place < WORST {
            self.worst.insert(place, entry);
            self.worst.truncate(WORST);
        }
    }

    /// The worst cycles, longest first. `intervals` know how long each hop usually takes.
    pub(super) fn finish(self, intervals: &[IntervalFigures]) -> Vec<WorstCycle> {
        let usual_ns = HOPS.map(|name| {
            intervals.iter().find(|interval| interval.name == name).map_or(0, |interval| interval.p50_ns)
        });
        self.worst.iter().map(|entry| blame(entry, &usual_ns, self.around(entry))).collect()
    }
}

fn blame(entry: &Entry, usual_ns: &[u64; HOPS.len()], around: Around) -> WorstCycle {
    let excess_ns = |hop: &usize| entry.hops_ns[*hop].saturating_sub(usual_ns[*hop]);
    let hop = (0..HOPS.len()).max_by_key(excess_ns).expect("there are hops");
    WorstCycle {
        cycle: entry.cycle,
        due_ns: entry.due_ns,
        total_ns: entry.total_ns,
        hop: HOPS[hop],
        hop_ns: entry.hops_ns[hop],
        hop_p50_ns: usual_ns[hop],
        stalled_ns: entry.stalled_ns,
        around,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 1_000_000;

    /// A cycle in which each hop takes as long as it is told, and the messages that tell of it.
    fn cycle(ledger: &mut Ledger, cycle: u64, hops_ns: [u64; 8]) {
        let [wake_up, data, transport, late, solving, control, command_transport, to_wire] = hops_ns;
        let due_ns = cycle * PERIOD_NS;
        let complete_ns = due_ns + wake_up + data;
        let received_ns = complete_ns + transport;
        let commanded_ns = received_ns + solving + control;
        ledger.reading(&Reading {
            cycle,
            due_ns,
            woke_ns: due_ns + wake_up,
            sampled_ns: due_ns + wake_up,
            complete_ns,
            published_ns: complete_ns,
            ..Default::default()
        });
        ledger.command(&Command { cycle, published_ns: commanded_ns, ..Default::default() });
        // The answer may be drained before the state that explains it.
        ledger.reading(&Reading {
            cycle: cycle + 1,
            answers_cycle: cycle,
            command_received_ns: commanded_ns + command_transport,
            command_sent_ns: commanded_ns + command_transport + to_wire,
            ..Default::default()
        });
        let state = State {
            cycle,
            reading_cycle: cycle,
            due_ns: received_ns,
            woke_ns: received_ns + late,
            received_ns,
            solved_ns: received_ns + solving,
            commanded_ns,
            ..Default::default()
        };
        ledger.state(&state, true);
    }

    #[test]
    fn the_worst_cycles_are_told_with_the_hop_that_took_unusually_long() {
        let mut ledger = Ledger::default();
        let usual = [1, 400_000, 2_000, 1, 1_000, 500, 2_000, 300_000];
        for number in 1..100 {
            let mut hops_ns = usual;
            match number {
                40 => hops_ns[4] += 90_000,
                70 => hops_ns[6] += 50_000,
                _ => {}
            }
            cycle(&mut ledger, number, hops_ns);
        }
        // Looks every 50 cycles: around the worst 3 ms were stolen, and its loop lost its core twice.
        for (look, stolen_ns, switches) in [(0, 0, 1), (50, 3_000_000, 3), (100, 3_000_000, 3)] {
            let (time_ns, involuntary_switches) = (look * PERIOD_NS, [switches, 0]);
            ledger.machine(&Machine { time_ns, stolen_ns, involuntary_switches, ..Default::default() });
        }
        let usual = |name: &&'static str| IntervalFigures {
            name,
            n: 99,
            p50_ns: usual[HOPS.iter().position(|hop| hop == name).unwrap()],
            p50_noise_ns: None,
            p99_ns: 0,
            p99_noise_ns: None,
            p999_ns: None,
            max_ns: 0,
            max_at_ns: 0,
            curve: Vec::new(),
        };
        let worst = ledger.finish(&HOPS.iter().map(usual).collect::<Vec<_>>());
        assert_eq!(worst.len(), WORST);
        assert_eq!((worst[0].cycle, worst[0].hop, worst[0].hop_ns), (40, "forward kinematics", 91_000));
        assert_eq!((worst[1].cycle, worst[1].hop, worst[1].hop_ns), (70, "command transport", 52_000));
        let around = |stolen_ns, switches| Around {
            looked_over_ns: Some(50 * PERIOD_NS),
            stolen_ns: Some(stolen_ns),
            involuntary_switches: Some(switches),
            page_faults: Some(0),
        };
        assert_eq!((worst[0].around, worst[1].around), (around(3_000_000, 2), around(0, 0)));
        assert!(worst.windows(2).all(|pair| pair[0].total_ns >= pair[1].total_ns));
    }

    #[test]
    fn a_cycle_that_used_a_late_reading_is_among_the_longest() {
        let mut ledger = Ledger::default();
        let late = Reading { cycle: 7, due_ns: 7_000_000, complete_ns: 7_900_000, ..Default::default() };
        ledger.reading(&late);
        ledger.state(&State { cycle: 8, reading_cycle: 7, ..Default::default() }, true);
        ledger.command(&Command { cycle: 8, ..Default::default() });
        let (answers_cycle, command_sent_ns) = (8, 8_900_000);
        ledger.reading(&Reading { cycle: 9, answers_cycle, command_sent_ns, ..Default::default() });
        let worst = ledger.finish(&[]);
        assert_eq!((worst[0].cycle, worst[0].due_ns, worst[0].total_ns), (8, 7_000_000, 1_900_000));
    }
}
