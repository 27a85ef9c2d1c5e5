use super::*;

const MS: u64 = 1_000_000;
const PERIOD_NS: u64 = MS;

/// Around a stretch of 100 ms: milliseconds of CPU time, without a core, and stolen.
fn counts(cpu_ms: u64, queued_ms: u64, stolen_ms: u64) -> LoopCounts {
    LoopCounts {
        looked_over_ns: 120 * MS,
        cpu_ns: Some(cpu_ms * MS),
        queued_ns: Some(queued_ms * MS),
        stolen_ns: Some(stolen_ms * MS),
        voluntary_switches: 20,
        ..LoopCounts::default()
    }
}

#[test]
fn the_counters_name_who_made_a_stretch_too_long() {
    use OverrunCause::{Computed, Machine, Slept, Unknown};
    let cases = [
        ("a sleep", counts(6, 0, 0), Slept),
        ("a sleep beside a short preemption", counts(6, 20, 10), Slept),
        ("a spin", counts(105, 0, 0), Computed),
        ("a spin that lost its core for a while", counts(70, 30, 0), Computed),
        ("a sleep, then a longer spin", counts(65, 0, 0), Computed),
        ("a read of the disk", LoopCounts { major_faults: 3, ..counts(6, 0, 0) }, Unknown),
        ("a wait for a file, as for anything else", counts(7, 1, 0), Slept),
        ("a preemption", counts(6, 98, 0), Machine),
        ("a preemption beside its own work", counts(50, 50, 0), Machine),
        ("steal", counts(6, 0, 100), Machine),
        ("steal that counts as CPU time", counts(105, 0, 100), Machine),
        ("steal and preemption", counts(6, 30, 30), Machine),
        ("CPU time without a report of steal", LoopCounts { stolen_ns: None, ..counts(105, 0, 0) }, Unknown),
        ("a sleep without a report of steal", LoopCounts { stolen_ns: None, ..counts(6, 0, 0) }, Slept),
        ("no schedstat", LoopCounts { cpu_ns: None, queued_ns: None, ..counts(0, 0, 0) }, Unknown),
        ("a signal", LoopCounts { is_stopped: true, ..counts(6, 0, 0) }, Unknown),
        ("another thread", LoopCounts { voluntary_switches: 0, ..counts(6, 0, 0) }, Unknown),
    ];
    for (name, counts, expected) in cases {
        assert_eq!(counts.cause(100 * MS, PERIOD_NS, 0.25), expected, "{name}: {counts}");
    }
}

/// The kernel counts steal time in steps of 10 ms, so that as much may be missing.
#[test]
fn a_stretch_that_uncounted_steal_may_explain_has_no_certain_cause() {
    let cause = |lasted_ns, queued_ns| {
        let counts = LoopCounts { looked_over_ns: 30 * MS, queued_ns: Some(queued_ns), ..counts(3, 0, 0) };
        counts.cause(lasted_ns, PERIOD_NS, 0.25)
    };
    assert_eq!(cause(11 * MS, 0), OverrunCause::Slept);
    assert_eq!(cause(11 * MS - 1, 0), OverrunCause::Unknown);
    assert_eq!(cause(11 * MS, MS), OverrunCause::Unknown);
    assert_eq!(cause(2 * MS, MS), OverrunCause::Machine);
}

fn samples(froms_ms: &[u64]) -> LoopSamples {
    let interval = |from_ms: &u64| LoopInterval {
        from_ns: from_ms * MS,
        to_ns: (from_ms + 10) * MS,
        cpu_ns: Some(MS),
        queued_ns: Some(2 * MS),
        stolen_ns: None,
        voluntary_switches: 3,
        ..LoopInterval::default()
    };
    let intervals = froms_ms.iter().map(interval).collect();
    LoopSamples { process: "controller", cpu_share: 0.2, intervals }
}

#[test]
fn samples_around_a_stretch_add_up_and_none_may_be_missing() {
    let samples = samples(&[100, 110, 120, 130, 300]);
    let around = |from_ms: u64, to_ms: u64| samples.around(from_ms * MS, to_ms * MS);
    let found = around(102, 114).unwrap();
    assert_eq!((found.looked_over_ns, found.cpu_ns, found.queued_ns), (20 * MS, Some(2 * MS), Some(4 * MS)));
    assert_eq!((found.stolen_ns, found.voluntary_switches), (None, 6));
    assert_eq!(around(102, 117).unwrap().looked_over_ns, 30 * MS, "its end may be counted late");
    assert_eq!(around(99, 114), None, "before the first");
    assert_eq!(around(125, 145), None, "behind the last in a row");
    assert_eq!(around(125, 305), None, "with a gap");
    assert_eq!(around(200, 210), None, "where nothing was kept");
    assert!(around(302, 309).is_some());
}

#[test]
fn an_overrun_is_told_with_its_figures() {
    let overrun = Overrun {
        process: "controller",
        cycle: 700,
        lasted_ns: 100 * MS,
        skipped: 99,
        cause: OverrunCause::Slept,
        counts: counts(6, 0, 0),
    };
    assert_eq!(
        overrun.to_string(),
        "the controller slept or waited for 100.0 ms in cycle 700 (of 120.0 ms: CPU time 6.0 ms, ready without a core \
         0.0 ms, stolen 0.0 ms; it waited 20 times and lost its core 0 times)"
    );
}
