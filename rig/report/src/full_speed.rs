//! What a dry run says of the same motion at full speed.
//!
//! Velocity and acceleration are those of the plan. The following error is scaled as a drive's that lags by a time.
//! The force of the slow motion is that of weight and friction; how much the motion adds depends on masses that a run at
//! this speed does not show. So the table has the mass that the rest of the force accelerates.

use std::fmt::Write;

use masseter_analysis::{AxisFigures, Figures};
use masseter_model::geometry::AXIS_NAMES;
use masseter_recording::Manifest;

use crate::text::{microseconds, or_dash};

/// The table; nothing of a run that is no dry one.
pub(crate) fn write(text: &mut String, manifest: &Manifest, figures: &Figures) -> std::fmt::Result {
    let scenario = &manifest.scenario;
    let (dry, Some(planned)) = (scenario.dry, manifest.full_speed) else { return Ok(()) };
    let limits = scenario.limits.within(&scenario.drives);
    writeln!(
        text,
        "\nat full speed, predicted from this run at {:.0} % (limit in brackets):\n{:<4} {:>15} {:>15} {:>17} {:>17} {:>11} {:>19}",
        dry.speed * 100.0,
        "axis",
        "velocity, m/s",
        "acc., m/s²",
        "following, µm",
        "force slow, N",
        "mass, kg",
        "TPDO1 here, µs"
    )?;
    for (axis, name) in AXIS_NAMES.into_iter().enumerate() {
        let AxisFigures { following_error_m, force_n } = figures.axes[axis];
        let (velocity_m_s, acceleration_m_s2) = (planned.velocity_m_s[axis], planned.acceleration_m_s2[axis]);
        let most_n = scenario.drives.of_axis(axis).max_force_n;
        let with_limit = |value: String, limit: String| format!("{value} ({limit})");
        writeln!(
            text,
            "{name:<4} {:>15} {:>15} {:>17} {:>17} {:>11} {:>19}",
            with_limit(format!("{velocity_m_s:.3}"), format!("{:.3}", limits.velocity_m_s(axis))),
            with_limit(format!("{acceleration_m_s2:.2}"), format!("{:.1}", limits.acceleration_m_s2(axis))),
            with_limit(
                format!("{:.1}", following_error_m / dry.speed * 1e6),
                format!("{:.1}", scenario.can.following_limit_m * 1e6)
            ),
            with_limit(format!("{force_n:.1}"), format!("{most_n:.0}")),
            format!("{:.1}", (most_n - force_n).max(0.0) / acceleration_m_s2),
            process_data(figures, scenario.can.node_ids[axis]),
        )?;
    }
    writeln!(
        text,
        "  following: if it grows with the velocity; mass: what the rest of the force accelerates, compare it with what the \
         axis moves"
    )
}

/// Longest response of a drive's process data, and its bound by the plan of the bus. Neither depends on the speed.
fn process_data(figures: &Figures, node: u8) -> String {
    let name = format!("TPDO1 {node}");
    let response = figures.bus_response.messages.iter().find(|response| response.message == name);
    let of = |ns: Option<u64>| or_dash(ns, microseconds);
    response.map_or_else(
        || "–".to_owned(),
        |response| format!("{} ({})", of(response.max_ns), of(response.bound_ns)),
    )
}
