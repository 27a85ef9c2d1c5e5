//! The master's own following-error monitor on the whole plant. A disturbed machine passes; a wrong drive does not.

use super::*;

/// A cycle of a disturbed machine.
#[derive(Debug, Clone, Copy, Default)]
struct Disturbance {
    /// Delay of SYNC, ns.
    late_ns: u64,
    skipped: u64,
    /// Whether no command comes.
    is_silent: bool,
}

/// The fastest step of the default motion, m.
const STEP_M: f64 = 0.116e-3;

/// Moves the legs at that speed and disturbs cycles meanwhile; the faults.
fn faults(disturbances: &[Disturbance]) -> Vec<Cause> {
    let mut bench = Bench::new(&Scenario::default());
    bench.enable();
    let start = bench.reading.position_m;
    let (mut steps, mut speed, mut number, mut free_ns) = (0.0, 0.0, bench.cycle, 0);
    for cycle in 0..160_usize {
        let disturbance = cycle.checked_sub(60).and_then(|place| disturbances.get(place)).copied();
        let Disturbance { late_ns, skipped, is_silent } = disturbance.unwrap_or_default();
        number += 1 + skipped;
        let due_ns = EPOCH_NS + (number - 1) * PERIOD_NS;
        let woke_ns = free_ns.max(due_ns + late_ns);
        free_ns = woke_ns + 550_000;
        bench.plant.begin_cycle(Wake { woke_ns, ..Wake::on_time(number, due_ns) }).unwrap();
        bench.plant.collect(woke_ns + 525_000).unwrap();
        if !is_silent {
            speed = f64::min(speed + 0.05, 1.0);
            steps += speed;
        }
        let target_m = std::array::from_fn(|axis| start[axis] - if axis < 3 { 0.0 } else { steps * STEP_M });
        let request = DriveRequest::Enable.code();
        let command =
            Command { cycle: number, target_m, request, version: LAYOUT_VERSION, ..Command::default() };
        bench.plant.apply(woke_ns + 545_000, Some(&command).filter(|_| !is_silent)).unwrap();
        bench.plant.drain_events(&mut |event| bench.events.push(event));
    }
    bench.causes(EventKind::Fault)
}

/// The test covers the fastest moment of the default motion with its limit: late SYNCs (some so late that SYNC
/// overtakes the targets), skipped cycles and missing commands.
#[test]
fn a_disturbed_machine_makes_no_following_error() {
    let none = Disturbance::default();
    let late = |late_ns| Disturbance { late_ns, ..none };
    let mut cases = vec![vec![none]];
    for late_ns in [100_000, 300_000, 450_000, 600_000, 900_000, 990_000] {
        let [late, none] = [late_ns, 0].map(late);
        cases.extend([vec![late], vec![late; 2], vec![late; 20], [late, none].repeat(10)]);
        cases.extend([1, 2, 3, 5, 10, 20, 100].map(|skipped| vec![Disturbance { skipped, ..late }; 3]));
    }
    cases.extend([1, 2, 3, 5, 10, 20].map(|silent| vec![Disturbance { is_silent: true, ..none }; silent]));
    for case in cases {
        assert_eq!(faults(&case), [], "{case:?}");
    }
}
