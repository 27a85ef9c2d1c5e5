//! The configuration of an axis in the object dictionary, read in SI units and written at power-on.
//!
//! This module checks nothing: the dictionary accepts only values that the axis can use.

use masseter_can::cia402::interpolation_period;

use crate::MILLISECOND_NS;
use crate::dictionary::Objects;
use crate::names;
use crate::quirks::AxisQuirks;
use crate::ratings::Ratings;
use crate::table::RPM_PER_S;

/// Value of 6065h that switches the supervision of the following error off.
const NO_WINDOW: u32 = u32::MAX;

/// Bounds of a profile.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct MotionLimits {
    pub(super) velocity_m_s: f64,
    pub(super) acceleration_m_s2: f64,
    pub(super) deceleration_m_s2: f64,
}

/// Offsets of the cyclic modes.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Offsets {
    /// Added to the target position (60B0h), increments.
    pub(super) position: i32,
    /// Added to the velocity of the demand (60B1h), m/s.
    pub(super) velocity_m_s: f64,
    /// Added to the force of the velocity loop, or to the target torque (60B2h), N.
    pub(super) force_n: f64,
}

impl Offsets {
    /// The offsets in the dictionary.
    pub(super) fn from_objects(objects: &Objects, drive: &Ratings) -> Self {
        Self {
            position: objects.get(names::POSITION_OFFSET),
            velocity_m_s: f64::from(objects.get(names::VELOCITY_OFFSET)) * drive.encoder_resolution_m,
            force_n: f64::from(objects.get(names::TORQUE_OFFSET)) / 1000.0 * drive.rated_force_n,
        }
    }
}

/// Seconds in a minute.
const MINUTE_S: f64 = 60.0;

/// The drive's unit of acceleration, m/s², by its own objects (60AAh, 608Fh).
fn acceleration_unit_m_s2(objects: &Objects, drive: &Ratings) -> f64 {
    let increments_s2 = match objects.get(names::ACCELERATION_UNIT) {
        RPM_PER_S => f64::from(objects.get(names::INCREMENTS_PER_TURN)) / MINUTE_S,
        _ => 1.0,
    };
    increments_s2 * drive.encoder_resolution_m
}

/// The configuration of an axis.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Parameters {
    /// Time from one cyclic target to the next (60C2h), s.
    pub(super) period_s: f64,
    /// Velocity limit of every mode (607Fh and the drive's own), m/s.
    pub(super) velocity_limit_m_s: f64,
    /// Force limit of every mode (6072h and the drive's own), N.
    pub(super) force_limit_n: f64,
    /// Software position limits as positions of the application, increments. 607D counts from the home position, so the
    /// limits are 607D less the home offset (607Ch).
    pub(super) position_limits: [i32; 2],
    /// Following error window (6065h), m; none without supervision.
    pub(super) following_window_m: Option<f64>,
    /// Following error time out (6066h), ns.
    pub(super) following_timeout_ns: u64,
    /// Position window of profile position (6067h), m.
    pub(super) position_window_m: f64,
    /// Change of the target torque in profile torque (6087h), N/s.
    pub(super) torque_slope_n_s: f64,
    /// Error of the velocity at which profile velocity has reached its target (606Dh), m/s.
    pub(super) velocity_window_m_s: f64,
    /// Velocity up to which the axis stands (606Fh), m/s.
    pub(super) velocity_threshold_m_s: f64,
    /// Profile position and velocity (6081h, 6083h, 6084h).
    pub(super) profile: MotionLimits,
    /// Deceleration of a quick stop (605Ah, 6084h, 6085h), m/s²; `None` if the brake closes at once.
    pub(super) quick_stop_m_s2: Option<f64>,
    /// Whether the drive stays in quick stop active (605Ah from 5 on).
    pub(super) holds_quick_stop: bool,
    /// Deceleration of the fault reaction (605Eh), m/s²; `None` if the brake closes at once.
    pub(super) fault_stop_m_s2: Option<f64>,
    /// Deceleration before "shutdown" and "disable operation" (605Bh, 605Ch), m/s²; `None` if the brake closes at once.
    pub(super) shutdown_m_s2: Option<f64>,
    pub(super) disable_m_s2: Option<f64>,
    /// Deceleration of a halt (605Dh), m/s²; none for that of the mode.
    pub(super) halt_m_s2: Option<f64>,
    /// Abort connection option code (6007h).
    pub(super) abort_connection_option: i16,
    /// Homing method (6098h).
    pub(super) homing_method: i8,
    /// Way to a switch or a stop (6099h:01, 609Ah).
    pub(super) homing_to_switch: MotionLimits,
    /// Every other way of homing (6099h:02, 609Ah).
    pub(super) homing: MotionLimits,
    /// Position at home, which the home offset (607Ch) decides, increments.
    pub(super) home_position: i32,
}

impl Parameters {
    /// The dictionary's parameters, bounded by the abilities of the drive.
    pub(super) fn from_objects(objects: &Objects, drive: &Ratings, quirks: &AxisQuirks) -> Self {
        let unit_m_s2 = acceleration_unit_m_s2(objects, drive);
        let acceleration_m_s2 = |word: u32| f64::from(word) * unit_m_s2;
        let metres = |increments: u32| f64::from(increments) * drive.encoder_resolution_m;
        let velocity_limit_m_s = metres(objects.get(names::MAX_VELOCITY)).min(drive.max_velocity_m_s);
        let profile = MotionLimits {
            velocity_m_s: metres(objects.get(names::PROFILE_VELOCITY)).min(velocity_limit_m_s),
            acceleration_m_s2: acceleration_m_s2(objects.get(names::PROFILE_ACCELERATION)),
            deceleration_m_s2: acceleration_m_s2(objects.get(names::PROFILE_DECELERATION)),
        };
        let quick_stop_m_s2 = acceleration_m_s2(objects.get(names::QUICK_STOP_DECELERATION));
        let stop = |option: i16| match option {
            0 => None,
            1 | 5 => Some(profile.deceleration_m_s2),
            _ => Some(quick_stop_m_s2),
        };
        let window = Some(objects.get(names::FOLLOWING_WINDOW)).filter(|&window| window != NO_WINDOW);
        let torque_limit_n = f64::from(objects.get(names::MAX_TORQUE)) / 1000.0 * drive.rated_force_n;
        let exponent = i32::from(objects.get(names::PERIOD_INDEX));
        let option_of = |option| Some(profile.deceleration_m_s2).filter(|_| objects.get(option) == 1);
        // Zero is the home offset (607Ch) beyond home, so that home has the position minus the offset (CiA 402).
        let home_offset = objects.get(names::HOME_OFFSET);
        let home_position =
            if quirks.is_offset_inverted { home_offset } else { 0_i32.saturating_sub(home_offset) };
        // Software position limits count from home.
        let limits_shift = if quirks.are_limits_from_zero { 0 } else { home_position };
        let homing_m_s2 = acceleration_m_s2(objects.get(names::HOMING_ACCELERATION));
        let homing = |speed| MotionLimits {
            velocity_m_s: metres(objects.get(speed)).min(velocity_limit_m_s),
            acceleration_m_s2: homing_m_s2,
            deceleration_m_s2: homing_m_s2,
        };
        Self {
            period_s: f64::from(objects.get(names::PERIOD_VALUE)) * 10.0_f64.powi(exponent),
            velocity_limit_m_s,
            force_limit_n: torque_limit_n.min(drive.max_force_n),
            position_limits: [names::MIN_POSITION_LIMIT, names::MAX_POSITION_LIMIT]
                .map(|end| objects.get(end).saturating_add(limits_shift)),
            following_window_m: window.map(metres),
            following_timeout_ns: u64::from(objects.get(names::FOLLOWING_TIMEOUT_MS)) * MILLISECOND_NS,
            position_window_m: metres(objects.get(names::POSITION_WINDOW)),
            torque_slope_n_s: f64::from(objects.get(names::TORQUE_SLOPE)) / 1000.0 * drive.rated_force_n,
            velocity_window_m_s: metres(objects.get(names::VELOCITY_WINDOW).into()),
            velocity_threshold_m_s: metres(objects.get(names::VELOCITY_THRESHOLD).into()),
            profile,
            quick_stop_m_s2: stop(objects.get(names::QUICK_STOP_OPTION)),
            holds_quick_stop: objects.get(names::QUICK_STOP_OPTION) >= 5,
            fault_stop_m_s2: stop(objects.get(names::FAULT_OPTION)),
            shutdown_m_s2: option_of(names::SHUTDOWN_OPTION),
            disable_m_s2: option_of(names::DISABLE_OPERATION_OPTION),
            halt_m_s2: Some(quick_stop_m_s2).filter(|_| objects.get(names::HALT_OPTION) == 2),
            abort_connection_option: objects.get(names::ABORT_CONNECTION_OPTION),
            homing_method: objects.get(names::HOMING_METHOD),
            homing_to_switch: homing(names::HOMING_SPEED_SWITCH),
            homing: homing(names::HOMING_SPEED_ZERO),
            home_position,
        }
    }
}

/// Writes the abilities and the position limits of a drive into its dictionary.
pub(crate) fn configure(objects: &mut Objects, drive: &Ratings, period_ns: u64, position_limits: [i32; 2]) {
    let increments = |metres: f64| drive.increments(metres) as u32;
    let velocity = increments(drive.max_velocity_m_s).max(1);
    let unit_m_s2 = acceleration_unit_m_s2(objects, drive);
    let ramp = ((drive.quick_stop_deceleration_m_s2 / unit_m_s2).round() as u32).max(1);
    let [lowest, highest] = position_limits;
    let (value, exponent) = interpolation_period(period_ns);
    objects.set(names::FOLLOWING_WINDOW, increments(drive.following_error_m));
    objects.set(names::FOLLOWING_TIMEOUT_MS, drive.following_error_timeout_ms);
    // Ten times the encoder's noise, and no less than ten increments.
    objects.set(names::POSITION_WINDOW, increments(10.0 * drive.encoder_noise_m).max(10));
    objects.set(names::MAX_TORQUE, (drive.max_force_n / drive.rated_force_n * 1000.0).round() as u16);
    objects.set(names::MIN_POSITION_LIMIT, lowest);
    objects.set(names::MAX_POSITION_LIMIT, highest);
    objects.set(names::MAX_VELOCITY, velocity);
    let small = (velocity / 50).clamp(1, u16::MAX.into()) as u16;
    objects.set(names::VELOCITY_WINDOW, small);
    objects.set(names::VELOCITY_THRESHOLD, small);
    // A quarter of the drive's abilities: profiles are for setting up.
    objects.set(names::PROFILE_VELOCITY, (velocity / 4).max(1));
    objects.set(names::PROFILE_ACCELERATION, (ramp / 4).max(1));
    objects.set(names::PROFILE_DECELERATION, (ramp / 4).max(1));
    objects.set(names::QUICK_STOP_DECELERATION, ramp);
    objects.set(names::HOMING_SPEED_SWITCH, (velocity / 20).max(1));
    objects.set(names::HOMING_SPEED_ZERO, (velocity / 100).max(1));
    objects.set(names::HOMING_ACCELERATION, (ramp / 4).max(1));
    objects.set(names::PERIOD_VALUE, value);
    objects.set(names::PERIOD_INDEX, exponent);
}

#[cfg(test)]
mod tests {
    use masseter_can::canopen::NodeId;

    use super::*;

    fn near(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-9 * b.abs()
    }

    #[test]
    fn what_the_settings_say_comes_back_in_si() {
        let drive = Ratings::default();
        let mut objects = Objects::new(NodeId::new(1).unwrap());
        configure(&mut objects, &drive, MILLISECOND_NS, [-5, 7]);
        let parameters = Parameters::from_objects(&objects, &drive, &AxisQuirks::default());
        assert!(near(parameters.period_s, 1e-3));
        assert!(near(parameters.velocity_limit_m_s, drive.max_velocity_m_s));
        assert!(near(parameters.force_limit_n, drive.max_force_n));
        assert!(near(parameters.following_window_m.unwrap(), drive.following_error_m));
        assert_eq!(parameters.following_timeout_ns, 20 * MILLISECOND_NS);
        assert_eq!(parameters.position_limits, [-5, 7]);
        assert!(near(parameters.quick_stop_m_s2.unwrap(), drive.quick_stop_deceleration_m_s2));
        assert_eq!(parameters.abort_connection_option, 3, "quick stop");
    }

    /// A drive whose dictionary differs from its abilities in every limit.
    fn objects() -> (Objects, Ratings) {
        let drive = Ratings { encoder_resolution_m: 2e-6, ..Ratings::default() };
        let mut objects = Objects::new(NodeId::new(1).unwrap());
        configure(&mut objects, &drive, MILLISECOND_NS, [-5, 7]);
        objects.set(names::MAX_VELOCITY, 150_000);
        objects.set(names::PROFILE_VELOCITY, 20_000);
        objects.set(names::PROFILE_ACCELERATION, 3_000_000);
        objects.set(names::PROFILE_DECELERATION, 4_000_000);
        objects.set(names::QUICK_STOP_DECELERATION, 6_000_000);
        objects.set(names::MAX_TORQUE, 1500);
        objects.set(names::FOLLOWING_WINDOW, 700);
        objects.set(names::FOLLOWING_TIMEOUT_MS, 30);
        objects.set(names::POSITION_WINDOW, 40);
        objects.set(names::HOME_OFFSET, 100);
        objects.set(names::HOMING_METHOD, 34);
        objects.set(names::HOMING_SPEED_ZERO, 5000);
        objects.set(names::HOMING_ACCELERATION, 1_000_000);
        objects.set(names::PERIOD_VALUE, 25);
        objects.set(names::PERIOD_INDEX, -4);
        (objects, drive)
    }

    #[test]
    fn every_parameter_is_read_in_si() {
        let (objects, drive) = objects();
        let parameters = Parameters::from_objects(&objects, &drive, &AxisQuirks::default());
        assert!(near(parameters.period_s, 2.5e-3));
        assert!(near(parameters.velocity_limit_m_s, 0.3));
        assert!(near(parameters.force_limit_n, 750.0));
        assert_eq!(parameters.position_limits, [-105, -93]);
        assert!(near(parameters.following_window_m.unwrap(), 1.4e-3));
        assert_eq!(parameters.following_timeout_ns, 30 * MILLISECOND_NS);
        assert!(near(parameters.position_window_m, 80e-6));
        let limits =
            |limits: MotionLimits| [limits.velocity_m_s, limits.acceleration_m_s2, limits.deceleration_m_s2];
        let found = [limits(parameters.profile), limits(parameters.homing)];
        let expected = [[0.04, 6.0, 8.0], [0.01, 2.0, 2.0]];
        assert!(
            found.iter().flatten().zip(expected.iter().flatten()).all(|(a, b)| near(*a, *b)),
            "{found:?}"
        );
        assert_eq!((parameters.homing_method, parameters.home_position), (34, -100));
    }

    /// The test covers all limits of the dictionary.
    #[test]
    fn no_parameter_exceeds_the_abilities_of_the_drive() {
        let (mut objects, drive) = objects();
        for velocity in [names::MAX_VELOCITY, names::PROFILE_VELOCITY, names::HOMING_SPEED_ZERO] {
            objects.set(velocity, 10_000_000);
        }
        objects.set(names::MAX_TORQUE, u16::MAX);
        let parameters = Parameters::from_objects(&objects, &drive, &AxisQuirks::default());
        let velocities =
            [parameters.velocity_limit_m_s, parameters.profile.velocity_m_s, parameters.homing.velocity_m_s];
        assert!(velocities.iter().all(|velocity_m_s| near(*velocity_m_s, 0.4)), "{velocities:?}");
        assert!(near(parameters.force_limit_n, 1000.0));
    }

    #[test]
    fn stops_brake_or_slow_down_as_their_options_say() {
        let (mut objects, drive) = objects();
        let table = [
            (0, None, false),
            (1, Some(8.0), false),
            (2, Some(12.0), false),
            (5, Some(8.0), true),
            (6, Some(12.0), true),
        ];
        for (option, ramp_m_s2, holds) in table {
            objects.set(names::QUICK_STOP_OPTION, option);
            objects.set(names::FAULT_OPTION, 2);
            let parameters = Parameters::from_objects(&objects, &drive, &AxisQuirks::default());
            assert_eq!(
                (parameters.quick_stop_m_s2, parameters.holds_quick_stop),
                (ramp_m_s2, holds),
                "{option}"
            );
            assert_eq!(parameters.fault_stop_m_s2, Some(12.0));
            objects.set(names::FAULT_OPTION, option);
            assert_eq!(
                Parameters::from_objects(&objects, &drive, &AxisQuirks::default()).fault_stop_m_s2,
                ramp_m_s2,
                "{option}"
            );
        }
        objects.set(names::FOLLOWING_WINDOW, u32::MAX);
        assert_eq!(
            Parameters::from_objects(&objects, &drive, &AxisQuirks::default()).following_window_m,
            None
        );
    }

    #[test]
    fn a_new_drive_has_its_abilities_in_its_dictionary() {
        let read = |drive: &Ratings| {
            let mut objects = Objects::new(NodeId::new(1).unwrap());
            configure(&mut objects, drive, 2 * MILLISECOND_NS, [-5, 7]);
            let window = objects.get(names::POSITION_WINDOW);
            assert_eq!(
                (objects.get(names::MIN_POSITION_LIMIT), objects.get(names::MAX_POSITION_LIMIT)),
                (-5, 7)
            );
            assert_eq!((objects.get(names::FOLLOWING_TIMEOUT_MS), objects.get(names::PERIOD_VALUE)), (20, 2));
            let numbers = [
                names::FOLLOWING_WINDOW,
                names::MAX_VELOCITY,
                names::PROFILE_VELOCITY,
                names::PROFILE_ACCELERATION,
                names::PROFILE_DECELERATION,
                names::QUICK_STOP_DECELERATION,
                names::HOMING_SPEED_SWITCH,
                names::HOMING_SPEED_ZERO,
                names::HOMING_ACCELERATION,
            ];
            (numbers.map(|number| objects.get(number)), objects.get(names::MAX_TORQUE), window)
        };
        let drive = Ratings { max_force_n: 600.0, encoder_noise_m: 5e-6, ..Ratings::default() };
        let (numbers, torque, window) = read(&drive);
        let ramp = 10_000_000;
        let expected = [2000, 400_000, 100_000, ramp / 4, ramp / 4, ramp, 20_000, 4000, ramp / 4];
        assert_eq!((numbers, torque, window), (expected, 1200, 50));
        // A drive slower than an increment a second can still be moved.
        let slow = Ratings {
            max_velocity_m_s: 1e-9,
            quick_stop_deceleration_m_s2: 1e-9,
            encoder_noise_m: 0.0,
            ..drive
        };
        let (numbers, _, window) = read(&slow);
        assert_eq!((numbers, window), ([2000, 1, 1, 1, 1, 1, 1, 1, 1], 10));
    }
}
