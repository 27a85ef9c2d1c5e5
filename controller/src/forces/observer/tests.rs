//! The observer on a swinging platform.

use masseter_model::geometry::{Mechanism, MechanismConfig, Vec3};
use masseter_scenario::DynamicsConfig;
use nalgebra::UnitQuaternion;

use super::*;

const PERIOD_S: f64 = 1e-3;

fn model(scenario: &Scenario) -> Model {
    Model::new(scenario, Mechanism::new(&MechanismConfig::default()).unwrap())
}

/// A platform that swings, 5 mm and 2° at 1.5 Hz.
fn pose(time_s: f64) -> Pose {
    let phase = std::f64::consts::TAU * 1.5 * time_s;
    Pose::from_parts(
        Vec3::new(0.001 * phase.cos(), 0.0, 0.27 + 0.005 * phase.sin()).into(),
        UnitQuaternion::from_scaled_axis(Vec3::new(0.0, 0.035 * phase.sin(), 0.0)),
    )
}

/// The mean force of the drives in the period before `time_s`, against a wrench on the platform.
fn force_n(model: &Model, time_s: f64, wrench: &Vector6<f64>) -> [f64; AXES] {
    let here_s = time_s - PERIOD_S / 2.0;
    let twist = |at_s: f64| twist_between(&pose(at_s - 1e-4), &pose(at_s + 1e-4), 2e-4);
    let acceleration = (twist(here_s + 1e-4) - twist(here_s - 1e-4)) / 2e-4;
    let motion = model.motion(&pose(here_s), &twist(here_s)).unwrap();
    model.force_n(&motion, &acceleration, wrench).unwrap().into()
}

/// Runs from 0 on; returns the estimate of each cycle.
fn observe(scenario: &Scenario, wrench: impl Fn(f64) -> Vector6<f64>, cycles: u64) -> Vec<Vector6<f64>> {
    let truth = model(&Scenario::default());
    let mut observer = ForceObserver::new(scenario, model(scenario));
    let after = (1..=cycles).map(|cycle| {
        let time_s = cycle as f64 * PERIOD_S;
        observer.take_sample(cycle, &pose(time_s), &force_n(&truth, time_s, &wrench(time_s)));
        observer.residual
    });
    after.collect()
}

#[test]
fn a_constant_wrench_is_found_in_motion_whatever_its_direction() {
    let wrench = Vector6::new(5.0, -8.0, -40.0, 0.3, -0.6, 0.1);
    let found = observe(&Scenario::default(), |_| wrench, 1000);
    let worst = found[100..].iter().map(|found| (found - wrench).abs()).reduce(|a, b| a.sup(&b)).unwrap();
    assert!(worst.fixed_rows::<3>(0).amax() < 0.1 && worst.fixed_rows::<3>(3).amax() < 0.01, "{worst}");
}

#[test]
fn a_step_is_seen_behind_a_low_pass_of_the_observers_time() {
    let step = |time_s: f64| if time_s > 0.5 { Vector6::z() * -40.0 } else { Vector6::zeros() };
    let found = observe(&Scenario::default(), step, 600);
    // After 3 ms of low-pass and half a period of the mean: 1 − 1/e.
    let share = found[502][2] / -40.0;
    assert!((0.45..0.75).contains(&share), "{share}");
    assert!((found[520][2] + 40.0).abs() < 0.5, "{}", found[520][2]);
}

#[test]
fn masses_that_are_wrong_by_a_fifth_shift_the_bite_force_by_a_fifth_of_the_weight() {
    let mut scenario = Scenario::default();
    let right = scenario.dynamics;
    scenario.controller.model = Some(DynamicsConfig {
        platform_mass_kg: 1.2 * right.platform_mass_kg,
        rod_mass_kg: 1.2 * right.rod_mass_kg,
        ..right
    });
    let found = observe(&scenario, |_| Vector6::zeros(), 300);
    let mean_n = found[100..].iter().map(|found| found[2]).sum::<f64>() / 200.0;
    assert!((mean_n - 0.2 * 1.7 * 9.81).abs() < 0.4, "{mean_n}");
}

#[test]
fn near_rest_the_uncertainty_has_the_breakaway_friction_of_the_legs_in_either_direction() {
    let scenario = Scenario::default();
    let uncertainty_n = |speed_m_s: f64| {
        let mut observer = ForceObserver::new(&scenario, model(&scenario));
        for cycle in 1..=400 {
            assert_eq!(observer.external().is_some(), cycle > 3, "cycle {cycle}");
            let height_m = 0.268 + speed_m_s * PERIOD_S * (cycle as f64 - 400.0);
            observer.take_sample(cycle, &Pose::translation(0.0, 0.0, height_m), &[0.0; AXES]);
        }
        observer.external().unwrap().uncertainty_n
    };
    // Bounds count 2/√3 times: 1.25 N in either direction and 0.6 times 1.25 N a leg; 30 % of 1.25 N a leg; a tenth of the
    // weight. Two standard deviations of three steps of 0.5 N.
    let expanded_n = |bounds_n: f64| (4.0 / 3.0 * bounds_n.powi(2) + 0.5f64.powi(2)).sqrt();
    let at_rest_n =
        expanded_n((3.0 * 1.25f64.powi(2) + 2.25f64.powi(2) + 1.1f64.powi(2) + 1.7f64.powi(2)).sqrt());
    assert!((uncertainty_n(0.0) - at_rest_n).abs() < 0.2, "{}", uncertainty_n(0.0));
    // No law, but 30 % of 20 N s/m at 50 mm/s, and screws that lose 0.12 of 2.3 N a leg.
    let moving_n = expanded_n((1.1f64.powi(2) + 0.9f64.powi(2) + 1.7f64.powi(2) + 0.8f64.powi(2)).sqrt());
    assert!((uncertainty_n(0.05) - moving_n).abs() < 0.2, "{}", uncertainty_n(0.05));
}

#[test]
fn a_motion_without_contact_calibrates_friction_and_weight() {
    let mut scenario = Scenario::default();
    let right = scenario.dynamics;
    scenario.controller.model = Some(DynamicsConfig {
        platform_mass_kg: 0.9 * right.platform_mass_kg,
        slide_friction_n: 0.7 * right.slide_friction_n,
        viscous_friction_n_s_per_m: 0.7 * right.viscous_friction_n_s_per_m,
        ..right
    });
    // The bite begins after the calibration of two seconds.
    let bite = |time_s: f64| if time_s > 2.1 { Vector6::z() * -20.0 } else { Vector6::zeros() };
    let truth = model(&Scenario::default());
    let mut after = |calibration_s: f64| {
        scenario.force_estimate = Some(ForceEstimateConfig { calibration_s, ..Default::default() });
        let mut observer = ForceObserver::new(&scenario, model(&scenario));
        let (mut square_n2, mut uncertainty_n) = (0.0, 0.0);
        for cycle in 1..=3000 {
            let time_s = cycle as f64 * PERIOD_S;
            observer.take_sample(cycle, &pose(time_s), &force_n(&truth, time_s, &bite(time_s)));
            assert!(observer.external().is_none() || cycle as f64 * PERIOD_S >= calibration_s);
            if let Some(external) = observer.external().filter(|_| cycle > 2200) {
                square_n2 += (external.bite_n() - 20.0).powi(2) / 800.0;
                uncertainty_n += external.uncertainty_n / 800.0;
            }
        }
        [square_n2.sqrt(), uncertainty_n]
    };
    let [[rms_n, uncertainty_n], [calibrated_rms_n, calibrated_uncertainty_n]] = [0.0, 2.0].map(&mut after);
    assert!(calibrated_rms_n < rms_n / 2.0, "{calibrated_rms_n} {rms_n}");
    assert!(calibrated_rms_n < calibrated_uncertainty_n, "{calibrated_rms_n} {calibrated_uncertainty_n}");
    assert!(calibrated_uncertainty_n < 0.6 * uncertainty_n, "{calibrated_uncertainty_n} {uncertainty_n}");
}

#[test]
fn a_gap_in_the_readings_begins_anew_without_a_jump() {
    let scenario = Scenario::default();
    let truth = model(&scenario);
    let mut observer = ForceObserver::new(&scenario, model(&scenario));
    for cycle in (1..=200).chain(205..=400) {
        let time_s = cycle as f64 * PERIOD_S;
        observer.take_sample(cycle, &pose(time_s), &force_n(&truth, time_s, &Vector6::zeros()));
        assert!(observer.residual[2].abs() < 1.0 || cycle < 5, "cycle {cycle}: {}", observer.residual[2]);
    }
}
