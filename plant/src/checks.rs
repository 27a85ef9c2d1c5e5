//! Checks of quantities that drives and bus need to fit each other.

use masseter_model::geometry::LEGS;
use masseter_runtime::clock::MILLISECOND_NS;
use masseter_scenario::Scenario;

use crate::error::PlantError;

/// Refuses the first quantity that contradicts others.
pub(crate) fn check_quantities(scenario: &Scenario) -> Result<(), PlantError> {
    check_counts(scenario)?;
    check_heartbeats(scenario)?;
    check_process_data(scenario)
}

/// A drive counts increments in 32 bits (objects 6064h and 607Ah).
fn check_counts(scenario: &Scenario) -> Result<(), PlantError> {
    let Scenario { drives, mechanism, .. } = scenario;
    for (key, axis) in [("drives.slide", 0), ("drives.leg", LEGS)] {
        let increment_m = drives.of_axis(axis).encoder_resolution_m;
        let [low_m, high_m] = mechanism.strokes.of_axis(axis);
        if low_m.abs().max(high_m.abs()) / increment_m > f64::from(i32::MAX) {
            let need = "use more: the end of the stroke does not fit into 32 bits";
            return Err(PlantError::Scenario(format!("{key}.encoder_resolution_m = {increment_m}: {need}")));
        }
    }
    Ok(())
}

/// The time-out of a heartbeat must be longer than its longest interval.
fn check_heartbeats(scenario: &Scenario) -> Result<(), PlantError> {
    let timeout_ms = scenario.can.heartbeat_consumer_ms;
    if u64::from(timeout_ms) * MILLISECOND_NS > longest_heartbeat_ns(scenario) {
        return Ok(());
    }
    let need = "use more than can.heartbeat_producer_ms and a cycle (1000 / rate_hz) together";
    Err(PlantError::Scenario(format!("can.heartbeat_consumer_ms = {timeout_ms}: {need}")))
}

/// The time-out of process data must be longer than two cycles, between which jitter may leave that much.
fn check_process_data(scenario: &Scenario) -> Result<(), PlantError> {
    match scenario.can.rpdo_timeout_ms {
        Some(timeout_ms @ 1..) if u64::from(timeout_ms) * MILLISECOND_NS <= 2 * scenario.period_ns() => {
            let need = "use 0 for none, or more than two cycles (2000 / rate_hz)";
            Err(PlantError::Scenario(format!("can.rpdo_timeout_ms = {timeout_ms}: {need}")))
        }
        _ => Ok(()),
    }
}

/// The master sends its heartbeat with the first SYNC after the interval, whose end jitter may delay by a cycle.
fn longest_heartbeat_ns(scenario: &Scenario) -> u64 {
    let interval_ns = u64::from(scenario.can.heartbeat_producer_ms) * MILLISECOND_NS;
    (interval_ns / scenario.period_ns() + 1) * scenario.period_ns()
}
