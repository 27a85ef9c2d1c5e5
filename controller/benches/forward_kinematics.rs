//! The forward solvers side by side, in one run: `cargo bench -p masseter-controller --bench
//! forward_kinematics`. For figures that no other load on the machine can change see `instructions`.

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
