//! Quantities of a plant that do not go together. Each for itself is checked with the scenario.

use masseter_can::canopen::NodeId;
use masseter_shared::clock::MILLISECOND_NS;
use masseter_shared::config::Scenario;
use masseter_shared::geometry::LEGS;

use crate::error::PlantError;
use crate::expectation::setup;
use crate::master::exchanges;

/// Refuses the first quantity that does not go with the others.
pub(crate) fn check_quantities(scenario: &Scenario) -> Result<(), PlantError> {
    check_counts(scenario)?;
    check_heartbeats(scenario)
}

/// A drive counts increments in 32 bits (objects 6064 and 607A).
fn check_counts(scenario: &Scenario) -> Result<(), PlantError> {
    let Scenario { drives, mechanism, .. } = scenario;
    let [slide_m, leg_m] = [0, LEGS].map(|axis| {
        let [low_m, high_m] = mechanism.strokes.of_axis(axis);
        low_m.abs().max(high_m.abs())
    });
    let too_fine = [
        ("drives.slide.encoder_resolution_m", drives.slide.encoder_resolution_m, slide_m),
        ("drives.leg.encoder_resolution_m", drives.leg.encoder_resolution_m, leg_m),
    ];
    match too_fine.into_iter().find(|(_, increment_m, end_m)| end_m / increment_m > f64::from(i32::MAX)) {
        Some((key, value, _)) => {
            let need = "use more: the end of the stroke does not fit into 32 bits";
            Err(PlantError::Quantity { key, value, need })
        }
        None => Ok(()),
    }
}

/// A heartbeat must be able to arrive before it counts as lost.
fn check_heartbeats(scenario: &Scenario) -> Result<(), PlantError> {
    let timeout_ms = scenario.can.heartbeat_consumer_ms;
    if u64::from(timeout_ms) * MILLISECOND_NS > longest_heartbeat_ns(scenario) {
        return Ok(());
    }
    let need = "use more than can.heartbeat_producer_ms and a cycle (1000 / rate_hz) together";
    Err(PlantError::Quantity { key: "can.heartbeat_consumer_ms", value: f64::from(timeout_ms), need })
}

/// The drives must be able to boot in the time that the controller gives them: every bus carries one SDO request a
/// cycle, and then some readings in a row have to be whole.
pub(crate) fn check_boot_time(scenario: &Scenario) -> Result<(), PlantError> {
    let Scenario { can, controller, rate_hz, .. } = scenario;
    let fullest = can.buses.iter().map(Vec::len).max().unwrap_or(0);
    let of_a_drive = exchanges(NodeId::MASTER, &setup(scenario, 0));
    let cycles = of_a_drive * fullest + controller.steady_readings as usize;
    let least_s = cycles as f64 * scenario.period_s();
    if controller.start_timeout_s > least_s {
        return Ok(());
    }
    Err(PlantError::BootTime { start_timeout_s: controller.start_timeout_s, rate_hz: *rate_hz, least_s })
}

/// The master beats at a SYNC alone: the first one after the interval, which by jitter ends late as often as not.
fn longest_heartbeat_ns(scenario: &Scenario) -> u64 {
    let interval_ns = u64::from(scenario.can.heartbeat_producer_ms) * MILLISECOND_NS;
    (interval_ns / scenario.period_ns() + 1) * scenario.period_ns()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::check;

    #[test]
    fn what_cannot_work_is_refused_with_its_key() {
        let default = Scenario::default;
        let with = |change: fn(&mut Scenario)| {
            let mut scenario = default();
            change(&mut scenario);
            check(&scenario).unwrap_err().to_string()
        };
        let slow = "can.heartbeat_consumer_ms = 90: use more than can.heartbeat_producer_ms and a cycle";
        let too_fine = "drives.leg.encoder_resolution_m = 0.000000000001: use more";
        let cases: [(String, &str); 17] = [
            (with(|s| s.can.heartbeat_consumer_ms = 50), "can.heartbeat_consumer_ms = 50: use more"),
            (with(|s| s.can.heartbeat_consumer_ms = 51), "can.heartbeat_consumer_ms = 51: use more"),
            (with(|s| (s.rate_hz, s.can.heartbeat_consumer_ms) = (10, 90)), slow),
            (with(|s| s.can.node_ids[3] = 1), "node 1 stands twice"),
            (with(|s| s.can.node_ids[3] = 0), "node id"),
            (with(|s| s.can.node_ids[3] = 127), "master"),
            (with(|s| s.can.buses = vec![vec![0, 1, 2], vec![3, 4]]), "axis 5 is named 0 times"),
            (with(|s| s.can.buses = vec![vec![0, 1, 2], vec![3, 4, 5, 0]]), "axis 0 is named 2 times"),
            (with(|s| s.can.buses = vec![vec![0, 1, 2], vec![3, 4, 5, 6]]), "axis 6"),
            (with(|s| s.can.buses.push(Vec::new())), "bus 2 has no drive"),
            (with(|s| s.drives.leg.encoder_resolution_m = 1e-12), too_fine),
            (with(|s| s.dynamics.viscous_friction_n_s_per_m = 20_000.0), "a dynamics.step_ns of at most"),
            (with(|s| s.dynamics.slide_friction_n = 60.0), "a dynamics.step_ns of at most"),
            (with(|s| s.dynamics.slide_friction_n = 1e4), "no dynamics.step_ns resolves it"),
            (with(|s| s.dynamics.slide_friction_n = 1e306), "no dynamics.step_ns resolves it"),
            (with(|s| s.dynamics.initial_leg_m = 0.4), "dynamics.initial_leg_m = 0.4: "),
            (with(|s| s.mechanism.strokes.slide_m = [0.001, 0.03]), "initial_leg_m = 0.29: axis d1 at"),
        ];
        for (error, expected) in cases {
            assert!(error.contains(expected), "{error}");
        }
        assert_eq!(check(&default()), Ok(()));
        let boots_within = |start_timeout_s: f64| {
            let mut scenario = Scenario { rate_hz: 10, ..default() };
            scenario.controller.start_timeout_s = start_timeout_s;
            check(&scenario)
        };
        assert!(boots_within(5.0).unwrap_err().to_string().contains("the drives take 14.2 s to boot"));
        assert_eq!(boots_within(14.3), Ok(()));
    }
}
