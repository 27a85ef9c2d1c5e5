//! What a rig that steps costs: `cargo bench -p masseter-virtual-time`.
//!
//! `step` is the rig alone, with the commands of a controller that stands still; `virtual_cycle` is the rig with its
//! controller, in the motion.

use std::path::PathBuf;

use divan::Bencher;
use masseter_controller::motion_controller::MotionController;
use masseter_plan::RunPlan;
use masseter_recording::Recorded;
use masseter_runtime::messages::codes::DriveRequest;
use masseter_runtime::messages::{Command, LAYOUT_VERSION};
use masseter_scenario::Scenario;
use masseter_virtual_time::{Rig, Run, Sink};

/// Cycles until the drives are booted and enabled, and the motion has begun.
const BEFORE: usize = 2000;
/// Cycles of a sample.
const CYCLES: u32 = 100;

fn main() {
    divan::main();
}

/// Takes the messages and does nothing with them.
#[derive(Clone)]
struct Nowhere;

impl Sink for Nowhere {
    fn take(&mut self, message: &Recorded, _: u64) {
        divan::black_box(message);
    }

    fn has_failed(&self) -> bool {
        false
    }
}

/// The drives stay where they are.
fn stay(rig: &Rig) -> Command {
    let reading = rig.reading();
    Command {
        reading_cycle: reading.cycle,
        target_m: reading.position_m,
        request: DriveRequest::Enable.code(),
        version: LAYOUT_VERSION,
        ..Command::default()
    }
}

fn enabled_rig() -> Rig {
    let mut rig = Rig::new(&Scenario::default(), 1).expect("the default scenario");
    for _ in 0..BEFORE {
        rig.step(&stay(&rig)).expect("a step");
    }
    rig
}

fn running() -> Run<Nowhere> {
    let scenario = Scenario { duration_s: Some(3600.0), ..Scenario::default() };
    let plan = RunPlan::new(scenario).expect("chewing");
    let mut run = Run::new(
        &plan,
        |scenario, mechanism, motion| Box::new(MotionController::new(scenario, mechanism, motion)),
        Nowhere,
    )
    .expect("a run");
    (0..BEFORE).for_each(|_| run.play_cycle().expect("a cycle"));
    run
}

#[divan::bench(sample_size = CYCLES)]
fn step(bencher: Bencher<'_, '_>) {
    let mut rig = enabled_rig();
    let command = stay(&rig);
    bencher.bench_local(|| rig.step(&command).map(|reading| reading.cycle));
}

#[divan::bench(sample_size = CYCLES)]
fn virtual_cycle(bencher: Bencher<'_, '_>) {
    let mut run = running();
    bencher.bench_local(|| run.play_cycle());
}

#[divan::bench]
fn snapshot(bencher: Bencher<'_, '_>) {
    let rig = enabled_rig();
    bencher.bench_local(|| rig.snapshot());
}

#[divan::bench]
fn snapshot_with_controller(bencher: Bencher<'_, '_>) {
    let run = running();
    bencher.bench_local(|| run.snapshot());
}

#[divan::bench]
fn restore(bencher: Bencher<'_, '_>) {
    let mut rig = enabled_rig();
    let branch = rig.snapshot();
    bencher.bench_local(|| rig.restore(&branch));
}

#[divan::bench]
fn reset(bencher: Bencher<'_, '_>) {
    let mut rig = enabled_rig();
    bencher.bench_local(|| rig.reset().map(|reading| reading.cycle));
}

/// A folder for the time of a bench, and a file in it.
fn file() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("bench.snapshot");
    (folder, path)
}

#[divan::bench]
fn write_file(bencher: Bencher<'_, '_>) {
    let (branch, (_folder, path)) = (enabled_rig().snapshot(), file());
    bencher.bench_local(|| branch.write_to(&path));
}

#[divan::bench]
fn read_file(bencher: Bencher<'_, '_>) {
    let (rig, (_folder, path)) = (enabled_rig(), file());
    rig.snapshot().write_to(&path).expect("room for a file");
    bencher.bench_local(|| rig.read_snapshot(&path));
}
