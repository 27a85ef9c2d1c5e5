//! Quantities of a plant that no physics or bus can have.

use masseter_shared::config::{DriveConfig, Scenario};

use crate::build::{MS_NS, master_id};
use crate::error::PlantError;
use crate::expectation::setup;
use crate::master::exchanges;

/// Integration steps that resolve the stiffest parts and cost a bearable time, ns.
const STEPS_NS: std::ops::RangeInclusive<u64> = 10_000..=250_000;

/// Refuses the first quantity out of its range.
pub(crate) fn check_quantities(scenario: &Scenario) -> Result<(), PlantError> {
    check_ranges(scenario)?;
    check_times(scenario)
}

fn check_ranges(scenario: &Scenario) -> Result<(), PlantError> {
    let dynamics = &scenario.dynamics;
    let can = &scenario.can;
    let above_zero = [
        ("dynamics.step_ns", dynamics.step_ns as f64),
        ("dynamics.carriage_mass_kg", dynamics.carriage_mass_kg),
        ("dynamics.rod_mass_kg", dynamics.rod_mass_kg),
        ("dynamics.platform_mass_kg", dynamics.platform_mass_kg),
        ("dynamics.initial_leg_m", dynamics.initial_leg_m),
        ("can.heartbeat_producer_ms", f64::from(can.heartbeat_producer_ms)),
        ("can.heartbeat_consumer_ms", f64::from(can.heartbeat_consumer_ms)),
        ("can.boot_timeout_ms", f64::from(can.boot_timeout_ms)),
        ("can.command_timeout_cycles", f64::from(can.command_timeout_cycles)),
    ];
    let not_below = [
        ("dynamics.leg_inertia_kg_m2", dynamics.leg_inertia_kg_m2),
        ("dynamics.slide_friction_n", dynamics.slide_friction_n),
        ("dynamics.viscous_friction_n_s_per_m", dynamics.viscous_friction_n_s_per_m),
        ("dynamics.gravity_m_s2", dynamics.gravity_m_s2),
    ];
    for (key, value) in
        above_zero.into_iter().chain(drive_quantities(&scenario.drives.slide, &scenario.drives.leg))
    {
        if !(value.is_finite() && value > 0.0) {
            return Err(PlantError::Quantity { key, value, need: "use a finite number above 0" });
        }
    }
    for (key, value) in not_below
        .into_iter()
        .chain(dynamics.platform_inertia_kg_m2.map(|i| ("dynamics.platform_inertia_kg_m2", i)))
    {
        if !(value.is_finite() && value >= 0.0) {
            return Err(PlantError::Quantity { key, value, need: "use a finite number not below 0" });
        }
    }
    Ok(())
}

/// A heartbeat must be able to arrive before it counts as lost, and the stiffest parts of the rig, brakes
/// and velocity loops, must be resolved by the integration.
fn check_times(scenario: &Scenario) -> Result<(), PlantError> {
    let Scenario { can, dynamics, .. } = scenario;
    let quantity = |key, value, need| Err(PlantError::Quantity { key, value, need });
    if u64::from(can.heartbeat_consumer_ms) * MS_NS <= longest_heartbeat_ns(scenario) {
        let value = f64::from(can.heartbeat_consumer_ms);
        let need = "use more than can.heartbeat_producer_ms and a cycle (1000 / rate_hz) together";
        return quantity("can.heartbeat_consumer_ms", value, need);
    }
    if !STEPS_NS.contains(&dynamics.step_ns) {
        return quantity("dynamics.step_ns", dynamics.step_ns as f64, "use 10000 to 250000 ns");
    }
    Ok(())
}

/// The drives must be able to boot in the time that the controller gives them: every bus carries one SDO request a
/// cycle, and then some readings in a row have to be whole.
pub(crate) fn check_boot_time(scenario: &Scenario) -> Result<(), PlantError> {
    let Scenario { can, controller, rate_hz, .. } = scenario;
    let fullest = can.buses.iter().map(Vec::len).max().unwrap_or(0);
    let of_a_drive = exchanges(master_id(), &setup(scenario, master_id(), 0));
    let cycles = of_a_drive * fullest + controller.steady_readings as usize;
    let least_s = cycles as f64 * scenario.period_s();
    if controller.start_timeout_s > least_s {
        return Ok(());
    }
    Err(PlantError::BootTime { start_timeout_s: controller.start_timeout_s, rate_hz: *rate_hz, least_s })
}

/// The master beats at a SYNC alone: the first one after the interval, which by jitter ends late as often as not.
fn longest_heartbeat_ns(scenario: &Scenario) -> u64 {
    let interval_ns = u64::from(scenario.can.heartbeat_producer_ms) * MS_NS;
    (interval_ns / scenario.period_ns() + 1) * scenario.period_ns()
}

fn drive_quantities(slide: &DriveConfig, leg: &DriveConfig) -> impl Iterator<Item = (&'static str, f64)> {
    [("drives.slide", *slide), ("drives.leg", *leg)].into_iter().flat_map(|(key, drive)| {
        [
            drive.rated_force_n,
            drive.max_force_n,
            drive.max_velocity_m_s,
            drive.quick_stop_deceleration_m_s2,
            drive.following_error_m,
            drive.position_gain_per_s,
            drive.velocity_gain_n_s_per_m,
            drive.velocity_integral_time_s,
            drive.encoder_resolution_m,
            // The noise may be zero; that it is a number is all it needs.
            1.0 + drive.encoder_noise_m.abs(),
        ]
        .map(|value| (key, value))
    })
}
