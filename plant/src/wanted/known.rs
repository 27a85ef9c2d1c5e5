//! The objects that the rig needs in every drive, with the values that follow from the scenario.

use masseter_can::canopen::ObjectAddress;
use masseter_can::cia402::interpolation_period;
use masseter_model::geometry::LEGS;
use masseter_runtime::clock::{MILLISECOND_NS, SECOND_NS};
use masseter_scenario::{DriveProfile, MASTER_NODE, ObjectKey, Scenario};

use crate::error::PlantError;

/// Abort connection option code (6007h): quick stop.
const QUICK_STOP_AT_ABORT: i64 = 3;
/// Quick stop (605Ah) and fault reaction (605Eh) option codes: quick-stop ramp, then off.
const RAMP_THEN_OFF: i64 = 2;

/// Index, sub-index, value, bytes, and the key that decides the value.
type KnownObject = (u16, u8, i64, usize, &'static str);

/// The known objects of the drive of an axis, in the order in which they are written.
pub(super) fn known_objects(scenario: &Scenario, axis: usize) -> Result<[KnownObject; 14], PlantError> {
    let (can, drive, scale) = (&scenario.can, scenario.drives.of_axis(axis), scenario.scale(axis));
    let profile = scenario.profile(axis);
    let consumed = i64::from(MASTER_NODE.get()) << 16 | i64::from(can.heartbeat_consumer_ms);
    let quick_stop = i64::from(scale.acceleration(drive.quick_stop_deceleration_m_s2));
    let window = i64::from(scale.window(drive.following_error_m));
    let [lowest, highest] = software_limits(scenario, axis);
    let force_share = drive.max_force_n / drive.rated_force_n * scenario.dry.force_now();
    let force_limit = (force_share * 1000.0).round().clamp(1.0, f64::from(u16::MAX)) as i64;
    let (period, exponent) = period(scenario, profile)?;
    let key = |slide, leg| if axis < LEGS { slide } else { leg };
    let quick_stop_key =
        key("drives.slide.quick_stop_deceleration_m_s2", "drives.leg.quick_stop_deceleration_m_s2");
    let window_key = key("drives.slide.following_error_m", "drives.leg.following_error_m");
    let timeout_key = key("drives.slide.following_error_timeout_ms", "drives.leg.following_error_timeout_ms");
    Ok([
        (0x1400, 5, rpdo_timeout_ms(scenario).into(), 2, "can.rpdo_timeout_ms"),
        (0x1017, 0, can.heartbeat_producer_ms.into(), 2, "can.heartbeat_producer_ms"),
        (0x1016, 1, consumed, 4, "can.heartbeat_consumer_ms"),
        (0x6007, 0, QUICK_STOP_AT_ABORT, 2, "drive_profile.objects"),
        (0x605A, 0, RAMP_THEN_OFF, 2, "drive_profile.objects"),
        (0x605E, 0, RAMP_THEN_OFF, 2, "drive_profile.objects"),
        (0x6085, 0, quick_stop, 4, quick_stop_key),
        (0x6065, 0, window, 4, window_key),
        (0x6066, 0, drive.following_error_timeout_ms.into(), 2, timeout_key),
        // A dry run before may have lowered the limit.
        (0x6072, 0, force_limit, 2, key("drives.slide.max_force_n", "drives.leg.max_force_n")),
        // The upper limit comes first: the boot opens the lower one before.
        (0x607D, 2, highest.into(), 4, "mechanism.strokes"),
        (0x607D, 1, lowest.into(), 4, "mechanism.strokes"),
        (0x60C2, 1, period, 1, "rate_hz"),
        (0x60C2, 2, exponent, 1, "rate_hz"),
    ])
}

/// The ends of the stroke as the drive counts them in 607Dh, ascending.
fn software_limits(scenario: &Scenario, axis: usize) -> [i32; 2] {
    let (scale, offset_m) = (scenario.scale(axis), scenario.profile(axis).homing.limit_offset_m());
    let mut ends = scenario.mechanism.strokes.of_axis(axis).map(|end_m| scale.increments(end_m - offset_m));
    ends.sort_unstable();
    ends
}

/// 60C2h for a cycle: with the profile's exponent where that has one.
fn period(scenario: &Scenario, profile: &DriveProfile) -> Result<(i64, i64), PlantError> {
    let fixed = profile.object(ObjectKey(ObjectAddress::new(0x60C2, 2))).value;
    let Some(exponent) = fixed else {
        let (value, exponent) = interpolation_period(scenario.period_ns());
        return Ok((value.into(), exponent.into()));
    };
    let unit_ns =
        u32::try_from(exponent + 9).ok().and_then(|digits| 10u64.checked_pow(digits)).unwrap_or(SECOND_NS);
    if !scenario.period_ns().is_multiple_of(unit_ns) {
        let reason =
            format!("the drive counts its cycle in 10^{exponent} s (drive_profile '{}')", profile.kind);
        return Err(PlantError::Scenario(format!("rate_hz = {}: {reason}", scenario.rate_hz)));
    }
    Ok(((scenario.period_ns() / unit_ns) as i64, exponent))
}

/// The event timer of a drive's RPDO: a stall of the machine that neither heartbeat nor commands make a fault trips no
/// drive.
fn rpdo_timeout_ms(scenario: &Scenario) -> u16 {
    let can = &scenario.can;
    let commands_ms = u64::from(can.command_timeout_cycles) * scenario.period_ns() / MILLISECOND_NS;
    let longest_ms = u16::try_from(commands_ms).unwrap_or(u16::MAX).max(can.heartbeat_consumer_ms);
    can.rpdo_timeout_ms.unwrap_or(longest_ms)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn process_data_may_be_silent_as_long_as_commands_or_the_heartbeat() {
        let timeout_ms = |rate_hz, configured| {
            let mut scenario = Scenario { rate_hz, ..Scenario::default() };
            scenario.can.rpdo_timeout_ms = configured;
            rpdo_timeout_ms(&scenario)
        };
        assert_eq!(timeout_ms(100, None), 200, "20 cycles");
        assert_eq!(timeout_ms(1000, None), Scenario::default().can.heartbeat_consumer_ms);
        assert_eq!(timeout_ms(1000, Some(0)), 0);
    }
}
