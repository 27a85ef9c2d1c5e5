//! Quantities of a plant that no physics or bus can have.

use masseter_shared::can::canopen::NodeId;
use masseter_shared::clock::MILLISECOND_NS;
use masseter_shared::config::Scenario;
use masseter_shared::geometry::LEGS;

use crate::error::PlantError;
use crate::expectation::setup;
use crate::master::exchanges;

/// Integration steps that resolve the stiffest parts and cost a bearable time, ns.
pub(crate) const STEPS_NS: std::ops::RangeInclusive<u64> = 10_000..=250_000;
/// More is no encoder's, m.
const NOISIEST_M: f64 = 1e-3;

/// Refuses the first quantity out of its range.
pub(crate) fn check_quantities(scenario: &Scenario) -> Result<(), PlantError> {
    check_ranges(scenario)?;
    check_counts(scenario)?;
    check_times(scenario)
}

/// Each quantity of both kinds of drives, with its key.
macro_rules! of_both {
    ($drives:expr, $($field:ident),+) => {
        [$(
            (concat!("drives.slide.", stringify!($field)), $drives.slide.$field),
            (concat!("drives.leg.", stringify!($field)), $drives.leg.$field),
        )+]
    };
}

fn check_ranges(scenario: &Scenario) -> Result<(), PlantError> {
    let Scenario { can, dynamics, drives, .. } = scenario;
    let above_zero = [
        ("dynamics.carriage_mass_kg", dynamics.carriage_mass_kg),
        ("dynamics.rod_mass_kg", dynamics.rod_mass_kg),
        ("dynamics.platform_mass_kg", dynamics.platform_mass_kg),
        ("dynamics.initial_leg_m", dynamics.initial_leg_m),
        ("can.heartbeat_consumer_ms", f64::from(can.heartbeat_consumer_ms)),
        ("can.boot_timeout_ms", f64::from(can.boot_timeout_ms)),
        ("can.command_timeout_cycles", f64::from(can.command_timeout_cycles)),
    ];
    let of_drives = of_both!(
        drives,
        rated_force_n,
        max_force_n,
        max_velocity_m_s,
        quick_stop_deceleration_m_s2,
        following_error_m,
        position_gain_per_s,
        velocity_gain_n_s_per_m,
        velocity_integral_time_s,
        encoder_resolution_m
    );
    let not_below = [
        ("dynamics.leg_inertia_kg_m2", dynamics.leg_inertia_kg_m2),
        ("dynamics.slide_friction_n", dynamics.slide_friction_n),
        ("dynamics.viscous_friction_n_s_per_m", dynamics.viscous_friction_n_s_per_m),
        ("dynamics.gravity_m_s2", dynamics.gravity_m_s2),
    ];
    let inertia = dynamics.platform_inertia_kg_m2.map(|inertia| ("dynamics.platform_inertia_kg_m2", inertia));
    require(above_zero.into_iter().chain(of_drives), |value| value > 0.0, "use a finite number above 0")?;
    require(not_below.into_iter().chain(inertia), |value| value >= 0.0, "use a finite number not below 0")?;
    let noise = of_both!(drives, encoder_noise_m);
    require(noise, |value| (0.0..=NOISIEST_M).contains(&value), "use 0 to 0.001 m")
}

/// Refuses the first of `values` that is not finite, or not as it should be.
fn require(
    values: impl IntoIterator<Item = (&'static str, f64)>,
    is_good: impl Fn(f64) -> bool,
    need: &'static str,
) -> Result<(), PlantError> {
    match values.into_iter().find(|(_, value)| !(value.is_finite() && is_good(*value))) {
        Some((key, value)) => Err(PlantError::Quantity { key, value, need }),
        None => Ok(()),
    }
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

/// A heartbeat must be able to arrive before it counts as lost, and the stiffest parts of the rig, brakes
/// and velocity loops, must be resolved by the integration.
fn check_times(scenario: &Scenario) -> Result<(), PlantError> {
    let Scenario { can, dynamics, .. } = scenario;
    let quantity = |key, value, need| Err(PlantError::Quantity { key, value, need });
    if u64::from(can.heartbeat_consumer_ms) * MILLISECOND_NS <= longest_heartbeat_ns(scenario) {
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
