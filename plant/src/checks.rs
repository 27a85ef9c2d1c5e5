//! Checks of quantities against each other. The scenario checks each quantity alone.

use masseter_shared::clock::MILLISECOND_NS;
use masseter_shared::config::Scenario;
use masseter_shared::geometry::LEGS;

use crate::error::PlantError;

/// Refuses the first quantity that contradicts others.
pub(crate) fn check_quantities(scenario: &Scenario) -> Result<(), PlantError> {
    check_counts(scenario)?;
    check_heartbeats(scenario)
}

/// A drive counts increments in 32 bits (objects 6064h and 607Ah).
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
            Err(PlantError::Scenario(format!("{key} = {value}: {need}")))
        }
        None => Ok(()),
    }
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

/// The master sends its heartbeat with the first SYNC after the interval, whose end jitter may delay by a cycle.
fn longest_heartbeat_ns(scenario: &Scenario) -> u64 {
    let interval_ns = u64::from(scenario.can.heartbeat_producer_ms) * MILLISECOND_NS;
    (interval_ns / scenario.period_ns() + 1) * scenario.period_ns()
}
