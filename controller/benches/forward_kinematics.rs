//! The forward solvers side by side, in one run: `cargo bench -p masseter-controller --bench forward_kinematics`. The
//! bench `instructions` gives figures that do not depend on the load of the machine.

mod workloads;

use divan::Bencher;
use workloads::{CYCLES, WORKS, Work};

fn main() {
    divan::main();
}

#[divan::bench(args = WORKS, sample_size = CYCLES)]
fn forward_kinematics(bencher: Bencher<'_, '_>, work: &Work) {
    bencher.bench_local((work.start)());
}
