//! Runs that the machine disturbed: the reason in words, and what is excused.

use super::*;

#[test]
fn an_invalid_run_says_what_the_machine_withheld_and_what_helps() {
    let reason = |change: Change| {
        let mut run = Run::new();
        run.disturb();
        run.figures.plant_skips.stalled_ns = 1_250_000;
        change(&mut run);
        let Verdict { exit_code: outcome, reason, .. } = Verdict::new(&run.manifest, &run.figures);
        assert_eq!(outcome, Exit::Invalid);
        reason
    };
    let latency = |run: &mut Run, limit_us| {
        run.manifest.cpu_dma_latency =
            Some(DmaLatency { requested: CpuDmaLatency::Auto, limit_us, refusal: None });
    };
    let withheld = "the machine stalled for 4.8 ms while the rig waited, and 3 cycles were missed";
    let doctor = "`masseter doctor` shows the remedies";
    assert_eq!(reason(|_| ()), format!("{withheld}; {doctor}"));
    let mut run = Run::new();
    latency(&mut run, Some(0));
    assert_eq!(remedy(&run.manifest), doctor);
    latency(&mut run, None);
    assert!(remedy(&run.manifest).contains("cpu_dma_latency"));
    let said = reason(|run| {
        run.overruns(1, 0.5);
        run.figures.controller_skips.while_working = 5;
        run.figures.controller_skips.skipped = 8;
        run.figures.plant_skips.stalled_ns = 1_250_000;
    });
    assert_eq!(
        said,
        "the machine stalled for 4.8 ms while the rig waited, and 10 cycles were missed, 7 of them during work, possibly \
         also by a stall; `masseter doctor` shows the remedies"
    );
    let said = reason(|run| {
        run.refuse();
        run.figures.controller_skips.skipped = 9;
    });
    assert_eq!(said, "9 cycles were missed without real time; controller: no priority");
}

#[test]
fn what_a_disturbed_run_failed_is_not_judged() {
    let mut run = Run::new();
    run.disturb();
    run.declare_fault();
    (run.figures.tracking.actual.rms_mm, run.figures.final_state) = (Some(3.0), None);
    let verdict = Verdict::new(&run.manifest, &run.figures);
    assert_eq!(verdict.exit_code, Exit::Invalid);
    let expected = [
        ("sequence", "skip"),
        ("tracking", "skip"),
        ("estimated tracking", "ok"),
        ("missed cycles", "skip"),
        ("dropped messages", "ok"),
        ("bus response", "ok"),
        ("faults", "skip"),
    ];
    assert_eq!(results(&verdict), expected);
}

#[test]
fn without_real_time_only_missed_cycles_are_excused() {
    assert_eq!(Run::with(Run::refuse).exit_code, Exit::Passed);
    let refused_and_off = Run::with(|run| {
        run.refuse();
        run.figures.tracking.actual.rms_mm = Some(0.2);
    });
    assert_eq!(refused_and_off.reason, "failed: tracking");
}

#[test]
fn a_jump_of_the_clock_excuses_failures_and_nothing_else() {
    let jumped = |change: Change| {
        let mut run = Run::new();
        run.manifest.usage.clock_jump_s = 2.0;
        run.manifest.scenario.can.interfaces = vec!["can0".to_owned()];
        change(&mut run);
        Verdict::new(&run.manifest, &run.figures).exit_code
    };
    assert_eq!(jumped(|_| ()), Exit::Passed);
    assert_eq!(jumped(|run| run.figures.tracking.actual.rms_mm = Some(0.2)), Exit::Invalid);
    assert_eq!(jumped(|run| run.manifest.ending = Ending::SafeStop), Exit::SafeStop);
}

#[test]
fn a_busy_core_is_a_remark_on_a_run_that_does_not_pass() {
    let busy = |share: f64, rms_mm: f64| {
        let mut run = Run::new();
        let usage = Usage { observed_s: 2.0, cpu_s: 2.0 * share, ..Usage::default() };
        run.manifest.usage.processes.insert("controller".to_owned(), usage);
        run.figures.tracking.actual.rms_mm = Some(rms_mm);
        Verdict::new(&run.manifest, &run.figures).reason
    };
    assert_eq!(busy(1.0, 0.05), "every check passed");
    assert_eq!(busy(0.9, 0.2), "failed: tracking");
    let said = busy(0.92, 0.2);
    assert!(said.starts_with("failed: tracking; the controller kept its core busy for 92 %"), "{said}");
}
