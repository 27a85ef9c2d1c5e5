//! When injected faults act: since switch-on, since the motion began, and since each other.

use masseter_scenario::{
    AxisFault, BusFault, CommandFault, DriveFault, EncoderFault, FaultConfig, FaultKindConfig as Kind,
};

use crate::core::tests::*;

fn named(name: &str, fault: FaultConfig) -> FaultConfig {
    FaultConfig { name: Some(name.to_owned()), ..fault }
}

fn on_l1(kind: impl Into<Kind>) -> FaultConfig {
    FaultConfig { axis: Some("l1".to_owned()), ..FaultConfig::new(kind) }
}

fn bench_with(faults: Vec<FaultConfig>) -> Bench {
    let scenario = Scenario { faults, ..Scenario::default() };
    scenario.validate().unwrap();
    Bench::new(&scenario)
}

/// Enables the drives, begins the motion and holds for so many cycles; returns when the motion began, ns.
fn run(bench: &mut Bench, cycles: u64) -> u64 {
    bench.enable();
    bench.controller_state = ControllerState::Running;
    let held_m = bench.reading.position_m;
    bench.cycle(Some(&|_| (held_m, DriveRequest::Enable)));
    let began_ns = bench.reading.sampled_ns;
    (1..cycles).for_each(|_| bench.cycle(Some(&|_| (held_m, DriveRequest::Enable))));
    began_ns
}

fn times_ns(bench: &Bench, cause: Cause) -> Vec<(f64, u64)> {
    let told = bench.events.iter().filter(|event| event.cause == cause.code());
    told.map(|event| (event.value, event.time_ns)).collect()
}

#[test]
fn a_fault_of_a_bus_acts_in_the_time_of_the_motion() {
    let lose = FaultConfig {
        bus: Some(1),
        node: Some(4),
        id: Some(0x204),
        at_s: Some(0.05),
        for_s: Some(0.003),
        ..FaultConfig::new(BusFault::Lose)
    };
    let mut bench = bench_with(vec![lose]);
    let began_ns = run(&mut bench, 100);
    let [(1.0, struck_ns)] = times_ns(&bench, Cause::FaultInjected)[..] else { panic!() };
    assert!((50_000_000..51_500_000).contains(&(struck_ns - began_ns)), "{}", struck_ns - began_ns);
    let ended = bench.events.iter().find(|event| event.cause == Cause::FaultEnded.code()).unwrap();
    assert_eq!((ended.source, ended.limit), (Source::Wire.code(), 3.0), "three process data were lost");
}

#[test]
fn faults_follow_each_other_over_every_layer() {
    let after = |name: &str, at_s: f64, fault: FaultConfig| FaultConfig {
        after: Some(name.to_owned()),
        at_s: Some(at_s),
        ..fault
    };
    let lose =
        FaultConfig { bus: Some(1), node: Some(4), count: Some(1), ..FaultConfig::new(BusFault::Lose) };
    let size = Some("1 um".parse().unwrap());
    let mut bench = bench_with(vec![
        named("third", after("fault.second", 0.02, FaultConfig { size, ..on_l1(EncoderFault::Offset) })),
        named("first", FaultConfig { at_s: Some(0.03), ..on_l1(EncoderFault::Stuck) }),
        named("second", after("fault.first", 0.01, lose)),
        named("fourth", after("fault.third", 0.005, FaultConfig::new(CommandFault::Foreign))),
    ]);
    let began_ns = run(&mut bench, 100);
    let struck = times_ns(&bench, Cause::FaultInjected);
    let order: Vec<_> = struck.iter().map(|(number, _)| *number).collect();
    assert_eq!(order, [2.0, 3.0, 1.0, 4.0]);
    let after_ms = |index: usize, from_ns: u64| (struck[index].1 - from_ns) as f64 * 1e-6;
    assert!((30.0..30.2).contains(&after_ms(0, began_ns)), "{struck:?}");
    assert!((10.0..11.1).contains(&after_ms(1, struck[0].1)), "the next frame to that node: {struck:?}");
    assert!((20.0..20.2).contains(&after_ms(2, struck[1].1)), "{struck:?}");
    assert!((5.0..6.6).contains(&after_ms(3, struck[2].1)), "the next command: {struck:?}");
}

#[test]
fn a_fault_of_a_state_that_never_comes_never_acts() {
    let mut bench = bench_with(vec![
        FaultConfig { at_s: Some(0.0), ..on_l1(DriveFault::Fault) },
        FaultConfig { at_s: Some(0.5), ..on_l1(AxisFault::Jam) },
    ]);
    bench.enable();
    (0..100).for_each(|_| bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::Enable))));
    assert!(times_ns(&bench, Cause::FaultInjected).is_empty());
    run(&mut bench, 100);
    let struck = times_ns(&bench, Cause::FaultInjected);
    assert_eq!(struck.iter().map(|(number, _)| *number).collect::<Vec<_>>(), [1.0]);
}
