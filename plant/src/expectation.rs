//! What a scenario expects of its drives: what the master verifies and configures over the bus.

use masseter_shared::can::canopen::NodeId;
use masseter_shared::can::cia402::interpolation_period;
use masseter_shared::config::Scenario;

use crate::build::drive_of;
use crate::master::Setup;

/// What the drive of an axis must be, and is configured with.
pub(crate) fn setup(scenario: &Scenario, master: NodeId, axis: usize) -> Setup {
    let (can, drive) = (&scenario.can, drive_of(scenario, axis));
    let increments = |metres: f64| (metres / drive.encoder_resolution_m).round();
    let stroke_m = scenario.mechanism.strokes.of_axis(axis);
    Setup {
        identity: can.identity,
        heartbeat_ms: can.heartbeat_producer_ms,
        watched: (master, can.heartbeat_consumer_ms),
        period: interpolation_period(scenario.period_ns()),
        following_error: increments(drive.following_error_m) as u32,
        following_error_ms: drive.following_error_timeout_ms,
        quick_stop_deceleration: increments(drive.quick_stop_deceleration_m_s2) as u32,
        position_limits: stroke_m.map(|end_m| increments(end_m) as i32),
    }
}
