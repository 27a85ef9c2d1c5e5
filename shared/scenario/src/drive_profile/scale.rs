//! From metres to a drive's numbers and back.

use super::DriveProfile;
use super::units::{AccelerationUnit, VelocityUnit};
use crate::DriveConfig;

/// The scales of one axis. Positions have the axis' sign; velocities and accelerations of profiles and limits have none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisScale {
    /// d or l for an increment of 6064h, m: negative on an axis that counts the other way.
    pub increment_m: f64,
    /// A unit of velocity, m/s.
    pub velocity_m_s: f64,
    /// A unit of acceleration, m/s².
    pub acceleration_m_s2: f64,
    /// Force for 1 ‰ of the torque objects, N: negative like `increment_m`.
    pub permille_n: f64,
}

impl AxisScale {
    pub(crate) fn new(drive: &DriveConfig, profile: &DriveProfile, axis: usize) -> Self {
        let (length_m, sign) =
            (drive.encoder_resolution_m, if profile.is_reversed(axis) { -1.0 } else { 1.0 });
        // A profile that counts turns has a lead: it is refused otherwise.
        let rpm_m_s = profile.units.travel_per_turn_m().unwrap_or(length_m) / 60.0;
        Self {
            increment_m: sign * length_m,
            velocity_m_s: match profile.units.velocity {
                VelocityUnit::IncrementsS => length_m,
                VelocityUnit::TenthIncrementsS => length_m / 10.0,
                VelocityUnit::Rpm => rpm_m_s,
            },
            acceleration_m_s2: match profile.units.acceleration {
                AccelerationUnit::IncrementsS2 => length_m,
                AccelerationUnit::RpmPerS => rpm_m_s,
            },
            permille_n: sign * drive.rated_force_n / 1000.0,
        }
    }

    /// The increments nearest to d or l; out of their range the nearest of all.
    #[inline]
    pub fn increments(&self, position_m: f64) -> i32 {
        (position_m / self.increment_m).round() as i32
    }

    /// d or l at a number of increments, m.
    #[inline]
    pub fn metres(&self, increments: i32) -> f64 {
        f64::from(increments) * self.increment_m
    }

    /// A force in the direction of d or l, in ‰ of the rated force.
    #[inline]
    pub fn permille(&self, force_n: f64) -> i16 {
        (force_n / self.permille_n).round() as i16
    }

    /// A length without a sign, such as a window, in increments.
    #[inline]
    pub fn window(&self, length_m: f64) -> u32 {
        (length_m / self.increment_m.abs()).round() as u32
    }

    /// A velocity without a sign, in the drive's unit: at least 1.
    pub fn velocity(&self, velocity_m_s: f64) -> u32 {
        ((velocity_m_s / self.velocity_m_s).round() as u32).max(1)
    }

    /// An acceleration without a sign, in the drive's unit: at least 1.
    pub fn acceleration(&self, acceleration_m_s2: f64) -> u32 {
        ((acceleration_m_s2 / self.acceleration_m_s2).round() as u32).max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Scenario, UnitsConfig};

    fn scale(units: UnitsConfig, reversed: &[&str]) -> AxisScale {
        let reversed = reversed.iter().map(|&name| name.to_owned()).collect();
        let profile = DriveProfile { reversed, units, ..DriveProfile::default() };
        Scenario { drive_profile: vec![profile], ..Scenario::default() }.scale(3)
    }

    /// 5 mm a turn, 2 µm an increment would be 2500 increments a turn; the default leg has 1 µm.
    #[test]
    fn an_acceleration_counts_in_the_unit_of_the_drive() {
        let units = UnitsConfig {
            acceleration: AccelerationUnit::RpmPerS,
            velocity: VelocityUnit::Rpm,
            gear_ratio: 2.0,
            lead_m: Some(0.006),
        };
        let turns = scale(units, &[]);
        // 3 mm a motor turn: 10 m/s² are 3333.3 turns/s², 200 000 rpm/s.
        assert_eq!((turns.acceleration(10.0), turns.velocity(0.03)), (200_000, 600));
        let increments = scale(UnitsConfig::default(), &[]);
        assert_eq!((increments.acceleration(10.0), increments.velocity(0.03)), (10_000_000, 30_000));
        let tenths = UnitsConfig { velocity: VelocityUnit::TenthIncrementsS, ..UnitsConfig::default() };
        assert_eq!(scale(tenths, &[]).velocity(0.03), 300_000);
    }

    #[test]
    fn a_reversed_axis_has_the_other_sign_and_the_same_windows() {
        let (ahead, back) = (scale(UnitsConfig::default(), &[]), scale(UnitsConfig::default(), &["l1"]));
        assert_eq!((ahead.increments(0.1), back.increments(0.1)), (100_000, -100_000));
        let is_near = |a: f64, b: f64| (a - b).abs() < 1e-15;
        assert!(is_near(ahead.metres(5), 5e-6) && is_near(back.metres(-5), 5e-6));
        assert_eq!((ahead.window(0.002), back.window(0.002)), (2000, 2000));
        assert!(is_near(ahead.permille_n, -back.permille_n));
        let force_n = 40.0 * ahead.permille_n;
        assert_eq!((ahead.permille(force_n), back.permille(force_n)), (40, -40));
    }
}
