//! A cycle of the controller, alone and with the forces: `cargo bench -p masseter-controller --bench cycle`.
//!
//! The drives are at their targets, in the middle of a chewing cycle.

use divan::Bencher;
use masseter_controller::motion_controller::MotionController;
use masseter_controller::trajectory::Trajectory;
use masseter_model::geometry::{AXES, Actuators, LEGS, Mechanism};
use masseter_runtime::control::{Controller, Tick};
use masseter_runtime::messages::codes::{ControllerState, DriveRequest, DriveState};
use masseter_runtime::messages::{Command, Reading};
use masseter_scenario::{ControllerConfig, ForceControlConfig, ForceEstimateConfig, Scenario};

/// Cycles before the measurement: half a second of the motion.
const BEFORE: u64 = 500;
/// Cycles of a sample.
const CYCLES: u32 = 100;

fn main() {
    divan::main();
}

/// Controller and drives.
struct Bench {
    controller: MotionController,
    reading: Reading,
    command: Command,
}

impl Bench {
    fn running(scenario: &Scenario) -> Self {
        let mechanism = Mechanism::new(&scenario.mechanism).expect("the default mechanism");
        let motion =
            Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism, Some(3600.0)).expect("chewing");
        let controller = MotionController::new(scenario, mechanism, motion);
        let start = Actuators { slide_m: [0.0; LEGS], leg_m: [0.29; LEGS] };
        let reading = Reading { position_m: start.to_axes(), ..Reading::default() };
        let mut bench = Self { controller, reading, command: Command::default() };
        while bench.controller.state() != ControllerState::Running {
            bench.cycle();
        }
        (0..BEFORE).for_each(|_| bench.cycle());
        bench
    }

    fn cycle(&mut self) {
        if self.command.request == DriveRequest::Enable.code() {
            self.reading.position_m = self.command.target_m;
        }
        self.reading.cycle += 1;
        let cycle = self.reading.cycle;
        self.reading.answers_cycle = cycle - 1;
        self.reading.drive_state = [DriveState::OperationEnabled.code(); AXES];
        self.reading.fresh_axes = (1 << AXES) - 1;
        self.controller.observe(Some(&self.reading));
        self.controller.decide(Tick { cycle, now_ns: cycle * 1_000_000 });
        self.controller.fill_command(&mut self.command);
    }
}

#[divan::bench(sample_size = CYCLES)]
fn positions(bencher: Bencher<'_, '_>) {
    measure(bencher, &Scenario::default());
}

#[divan::bench(sample_size = CYCLES)]
fn feed_forward(bencher: Bencher<'_, '_>) {
    let controller = ControllerConfig { feed_forward_torque: true, ..ControllerConfig::default() };
    measure(bencher, &Scenario { controller, ..Scenario::default() });
}

#[divan::bench(sample_size = CYCLES)]
fn force_estimate(bencher: Bencher<'_, '_>) {
    let force_estimate = Some(ForceEstimateConfig::default());
    measure(bencher, &Scenario { force_estimate, ..Scenario::default() });
}

#[divan::bench(sample_size = CYCLES)]
fn force_control(bencher: Bencher<'_, '_>) {
    let force_control = Some(ForceControlConfig::default());
    measure(bencher, &Scenario { force_control, ..Scenario::default() });
}

fn measure(bencher: Bencher<'_, '_>, scenario: &Scenario) {
    let mut bench = Bench::running(scenario);
    bencher.bench_local(|| bench.cycle());
}
