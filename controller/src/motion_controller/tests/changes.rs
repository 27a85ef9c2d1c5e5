//! Rate and amplitude of the motion change while it plays.

use super::*;

/// The place of a parameter.
fn place(bench: &Bench, name: &str) -> usize {
    bench.controller.declared().place_of(name).unwrap()
}

/// Plays the motion, with a change of both in its middle. Returns the largest distance of the estimated from the
/// desired position.
fn worst_m(rate: f64, amplitude: f64) -> (f64, Bench) {
    let mut bench = Bench::new();
    bench.run_until(ControllerState::Running);
    (0..500).for_each(|_| bench.cycle(Some));
    for (name, value) in [("motion_rate", rate), ("motion_amplitude", amplitude)] {
        let place = place(&bench, name);
        bench.controller.set_parameter(place, value);
    }
    let (mut state, mut worst_m) = (State::default(), 0.0_f64);
    while bench.controller.state() == ControllerState::Running {
        bench.cycle(Some);
        bench.controller.fill_state(&mut state);
        let [desired, estimated] =
            [state.desired_position_m, state.estimated_position_m].map(nalgebra::Vector3::from);
        worst_m = worst_m.max((desired - estimated).norm());
    }
    (worst_m, bench)
}

#[test]
fn what_the_controller_asks_for_is_what_it_desires_two_cycles_later() {
    for (rate, amplitude) in [(0.4, 1.0), (1.0, 0.2), (0.5, 0.0)] {
        let (worst_m, mut bench) = worst_m(rate, amplitude);
        assert!(worst_m < 2e-5, "{rate} {amplitude}: {worst_m}");
        bench.run_until(ControllerState::Finished);
        let is_slower = bench.cycle > 1500 + 1500;
        assert_eq!(is_slower, rate < 1.0, "{rate}: {} cycles", bench.cycle);
    }
}

#[test]
fn a_laws_parameters_keep_their_places_before_the_controllers_own() {
    let mut bench = Bench::new();
    let declared = bench.controller.declared();
    let names: Vec<_> = declared.parameters.iter().map(|parameter| &*parameter.name).collect();
    let expected =
        ["integral_gain_per_s", "trim_limit_m", "trim_limit_rad", "motion_rate", "motion_amplitude"];
    assert_eq!(names, expected);
    let values = declared.parameters.iter().map(|parameter| parameter.value).enumerate();
    values.for_each(|(place, value)| bench.controller.set_parameter(place, value));
    bench.run_until(ControllerState::Finished);
}
