//! What a scenario expects of its drives: what the master verifies and configures over the bus.

use masseter_can::canopen::NodeId;
use masseter_can::cia402::interpolation_period;
use masseter_shared::config::Scenario;

use crate::master::Setup;

/// What the drive of an axis must be, and is configured with.
pub(crate) fn setup(scenario: &Scenario, axis: usize) -> Setup {
    let (can, drive) = (&scenario.can, scenario.drives.of_axis(axis));
    let stroke_m = scenario.mechanism.strokes.of_axis(axis);
    Setup {
        identity: can.identity,
        heartbeat_ms: can.heartbeat_producer_ms,
        watched: (NodeId::MASTER, can.heartbeat_consumer_ms),
        period: interpolation_period(scenario.period_ns()),
        following_error: drive.increments(drive.following_error_m) as u32,
        following_error_ms: drive.following_error_timeout_ms,
        quick_stop_deceleration: drive.increments(drive.quick_stop_deceleration_m_s2) as u32,
        position_limits: stroke_m.map(|end_m| drive.increments(end_m) as i32),
    }
}
