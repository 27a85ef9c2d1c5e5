//! The solvers and the controller's cycle allocate nothing, on every path. Alone in its file: the allocator is that of
//! the whole process.
#![allow(unsafe_code)] // A global allocator is an unsafe trait; this one only counts and passes on.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;

use masseter_controller::kinematics::{ForwardTracker, Method, Options, Solutions, solve};
use masseter_controller::motion_controller::MotionController;
use masseter_controller::trajectory::Trajectory;
use masseter_model::geometry::{AXES, Actuators, LEGS, Mechanism, MechanismConfig};
use masseter_runtime::control::{Controller, Tick};
use masseter_runtime::messages::codes::{ControllerState, DriveRequest, DriveState};
use masseter_runtime::messages::{Command, Reading, State};
use masseter_scenario::{
    ControllerConfig, ForceControlConfig, ForceEstimateConfig, ForceFusion, LoadCellConfig, Scenario,
};

struct Counting;

thread_local! {
    /// Counts of this thread: the other threads belong to the test harness.
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

#[global_allocator]
static COUNTING: Counting = Counting;

// SAFETY: every call goes to the system's allocator unchanged, so its guarantees hold.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller's promises about `layout` go to the system's allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: `pointer` came from `alloc` above, that is, from `System`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

fn allocations_of(work: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.get();
    work();
    ALLOCATIONS.get() - before
}

/// Drives at their targets, from the wait for readings until the motion plays.
#[test]
fn no_cycle_of_the_controller_allocates() {
    check_cycles(&Scenario { duration_s: Some(0.5), ..Scenario::default() });
}

/// The drives push with the forces of a bite, so that force control has its turn.
#[test]
fn no_cycle_with_feed_forward_and_force_control_allocates() {
    let controller = ControllerConfig { feed_forward_torque: true, ..ControllerConfig::default() };
    // Nothing presses on the jaw: the forces below would be a bite beyond any other limit.
    let force_control = Some(ForceControlConfig { overload: 1e3, ..ForceControlConfig::default() });
    check_cycles(&Scenario { duration_s: Some(0.5), controller, force_control, ..Scenario::default() });
}

#[test]
fn no_cycle_with_a_load_cell_in_the_estimate_allocates() {
    let fused =
        ForceEstimateConfig { calibration_s: 0.1, fusion: ForceFusion::LoadCell, ..Default::default() };
    let (force_estimate, load_cell) = (Some(fused), Some(LoadCellConfig::default()));
    check_cycles(&Scenario { duration_s: Some(0.5), force_estimate, load_cell, ..Scenario::default() });
}

fn check_cycles(scenario: &Scenario) {
    let mechanism = Mechanism::new(&scenario.mechanism).unwrap();
    let trajectory =
        Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism, scenario.duration_s).unwrap();
    let start = Actuators { slide_m: [0.0; LEGS], leg_m: [0.29; LEGS] }.to_axes();
    let mut controller = MotionController::new(scenario, mechanism, trajectory);
    let (mut reading, mut command, mut state) = (Reading::default(), Command::default(), State::default());
    let mut signals = vec![0.0; controller.declared().signals.len()];
    let cycling = allocations_of(|| {
        for cycle in 1..=3000 {
            controller.warm_up();
            let is_driven = command.request == DriveRequest::Enable.code();
            reading = Reading {
                cycle,
                answers_cycle: cycle - 1,
                force_n: [0.0, 0.0, 0.0, 20.0, 20.0, 20.0],
                load_cell_n: if cycle.is_multiple_of(2) { 0.1 } else { -0.1 },
                position_m: if is_driven { command.target_m } else { start },
                drive_state: [DriveState::OperationEnabled.code(); AXES],
                fresh_axes: (1 << AXES) - 1,
                ..reading
            };
            controller.observe(Some(&reading));
            controller.decide(Tick { cycle, now_ns: cycle * 1_000_000 });
            controller.fill_command(&mut command);
            controller.fill_state(&mut state);
            controller.fill_signals(&mut signals);
        }
    });
    assert_eq!(cycling, 0);
    assert_eq!(controller.state(), ControllerState::Disabling, "these drives never switch off");
}

#[test]
fn no_path_of_the_forward_kinematics_allocates() {
    let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
    let mut tracker = ForwardTracker::new(mechanism.clone());
    let neutral = Actuators { slide_m: [0.0; LEGS], leg_m: [0.27; LEGS] };
    let nearby = Actuators { leg_m: [0.2701, 0.27, 0.2699], ..neutral };
    let unassemblable = Actuators { leg_m: [0.30, 0.30, 0.20], ..neutral };
    let options = Options::default();
    let solving = allocations_of(|| {
        for input in [neutral, nearby, neutral] {
            assert!(black_box(tracker.update(&input)).is_ok());
        }
        let mut guessing = ForwardTracker::with_guess(mechanism.clone(), [0.3, 2.9, 1.0]);
        assert!(black_box(guessing.update(&nearby)).is_ok());
        assert!(black_box(tracker.update(&unassemblable)).is_err());
        assert_eq!(Solutions::new(&mechanism, &neutral).map(|all| all.count()), Ok(16));
        assert!(black_box(solve(Method::Published, &mechanism, &nearby, &[1.4; LEGS], &options)).is_ok());
        assert!(black_box(solve(Method::Newton, &mechanism, &nearby, &[1.4; LEGS], &options)).is_ok());
    });
    assert_eq!(solving, 0);
    assert!(allocations_of(|| drop(black_box(vec![1u8]))) > 0, "the counter counts");
}
