//! What the object dictionary configures of an axis, in SI units.

use masseter_can::cia402::interpolation_period;
use masseter_shared::clock::MILLISECOND_NS;
use masseter_shared::config::DriveConfig;

use super::dictionary::Objects;
use super::dictionary::names;

/// Object 6065 that switches the supervision of the following error off.
const NO_WINDOW: u32 = u32::MAX;

/// Bounds of a profile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MotionLimits {
    pub(super) velocity_m_s: f64,
    pub(super) acceleration_m_s2: f64,
    pub(super) deceleration_m_s2: f64,
}

/// How an axis is brought to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Stop {
    /// The brake closes at once.
    Brake,
    /// Along a ramp.
    Ramp { deceleration_m_s2: f64 },
}

/// Reaction to the loss of the link (object 6007).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LinkReaction {
    Nothing,
    Fault,
    DisableVoltage,
    QuickStop,
}

/// How homing goes (objects 6098, 6099, 609A, 607C).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct HomingParameters {
    pub(super) method: i8,
    pub(super) search: MotionLimits,
    pub(super) offset_increments: i32,
}

/// The configuration of an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Parameters {
    /// Time from one cyclic target to the next (60C2), s.
    pub(super) period_s: f64,
    /// Velocity limit of every mode (607F, and what the drive can), m/s.
    pub(super) velocity_limit_m_s: f64,
    /// Force limit of every mode (6072, and what the drive can), N.
    pub(super) force_limit_n: f64,
    /// Software position limits as positions of the application: 607D counts from the home position, so that it is
    /// less the home offset (607C); increments.
    pub(super) position_limits: [i32; 2],
    /// Following error window (6065), m; none where it is not supervised.
    pub(super) following_window_m: Option<f64>,
    /// How long the window may be left (6066), ns.
    pub(super) following_timeout_ns: u64,
    /// Position window of profile position (6067), m.
    pub(super) position_window_m: f64,
    /// Profile position (6081, 6083, 6084).
    pub(super) profile: MotionLimits,
    /// Quick stop (605A, 6084, 6085).
    pub(super) quick_stop: Stop,
    /// Whether the drive stays in quick stop active.
    pub(super) holds_quick_stop: bool,
    /// Fault reaction (605E).
    pub(super) fault_stop: Stop,
    /// Link loss (6007).
    pub(super) link: LinkReaction,
    /// Homing.
    pub(super) homing: HomingParameters,
}

impl Parameters {
    /// What the dictionary says, for a drive of those abilities.
    pub(super) fn of(objects: &Objects, drive: &DriveConfig) -> Self {
        let metres = |increments: u32| f64::from(increments) * drive.encoder_resolution_m;
        let velocity_limit_m_s = metres(objects.get(names::MAX_VELOCITY)).min(drive.max_velocity_m_s);
        let profile = MotionLimits {
            velocity_m_s: metres(objects.get(names::PROFILE_VELOCITY)).min(velocity_limit_m_s),
            acceleration_m_s2: metres(objects.get(names::PROFILE_ACCELERATION)),
            deceleration_m_s2: metres(objects.get(names::PROFILE_DECELERATION)),
        };
        let quick_stop_m_s2 = metres(objects.get(names::QUICK_STOP_DECELERATION));
        let stop = |option: i16| match option {
            0 => Stop::Brake,
            1 | 5 => Stop::Ramp { deceleration_m_s2: profile.deceleration_m_s2 },
            _ => Stop::Ramp { deceleration_m_s2: quick_stop_m_s2 },
        };
        let window = Some(objects.get(names::FOLLOWING_WINDOW)).filter(|&window| window != NO_WINDOW);
        let torque_limit_n = f64::from(objects.get(names::MAX_TORQUE)) / 1000.0 * drive.rated_force_n;
        let exponent = i32::from(objects.get(names::PERIOD_INDEX));
        let offset_increments = objects.get(names::HOME_OFFSET);
        let homing_m_s2 = metres(objects.get(names::HOMING_ACCELERATION));
        Self {
            period_s: f64::from(objects.get(names::PERIOD_VALUE)) * 10.0_f64.powi(exponent),
            velocity_limit_m_s,
            force_limit_n: torque_limit_n.min(drive.max_force_n),
            position_limits: [names::LOWEST_POSITION, names::HIGHEST_POSITION]
                .map(|end| objects.get(end).saturating_sub(offset_increments)),
            following_window_m: window.map(metres),
            following_timeout_ns: u64::from(objects.get(names::FOLLOWING_TIMEOUT_MS)) * MILLISECOND_NS,
            position_window_m: metres(objects.get(names::POSITION_WINDOW)),
            profile,
            quick_stop: stop(objects.get(names::QUICK_STOP_OPTION)),
            holds_quick_stop: objects.get(names::QUICK_STOP_OPTION) >= 5,
            fault_stop: stop(objects.get(names::FAULT_OPTION)),
            link: match objects.get(names::LINK_OPTION) {
                0 => LinkReaction::Nothing,
                1 => LinkReaction::Fault,
                2 => LinkReaction::DisableVoltage,
                _ => LinkReaction::QuickStop,
            },
            homing: HomingParameters {
                method: objects.get(names::HOMING_METHOD),
                search: MotionLimits {
                    velocity_m_s: metres(objects.get(names::HOMING_SPEED_ZERO)).min(velocity_limit_m_s),
                    acceleration_m_s2: homing_m_s2,
                    deceleration_m_s2: homing_m_s2,
                },
                offset_increments,
            },
        }
    }
}

/// Writes what a drive's abilities and its place in the rig say into its dictionary.
pub(super) fn configure(
    objects: &mut Objects,
    drive: &DriveConfig,
    period_ns: u64,
    position_limits: [i32; 2],
) {
    let increments = |metres: f64| drive.increments(metres) as u32;
    let velocity = increments(drive.max_velocity_m_s).max(1);
    let ramp = increments(drive.quick_stop_deceleration_m_s2).max(1);
    let [lowest, highest] = position_limits;
    let (value, exponent) = interpolation_period(period_ns);
    objects.set(names::FOLLOWING_WINDOW, increments(drive.following_error_m));
    objects.set(names::FOLLOWING_TIMEOUT_MS, drive.following_error_timeout_ms);
    // Ten times the encoder's noise, and no less than ten increments.
    objects.set(names::POSITION_WINDOW, increments(10.0 * drive.encoder_noise_m).max(10));
    objects.set(names::MAX_TORQUE, (drive.max_force_n / drive.rated_force_n * 1000.0).round() as u16);
    objects.set(names::LOWEST_POSITION, lowest);
    objects.set(names::HIGHEST_POSITION, highest);
    objects.set(names::MAX_VELOCITY, velocity);
    // A quarter of what the drive can: profiles are for setting up.
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
    use masseter_shared::config::DrivesConfig;

    use super::*;

    #[test]
    fn what_the_scenario_says_comes_back_in_si() {
        let drive = DrivesConfig::default().leg;
        let mut objects = Objects::new(NodeId::new(1).unwrap());
        configure(&mut objects, &drive, MILLISECOND_NS, [-5, 7]);
        let parameters = Parameters::of(&objects, &drive);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(near(parameters.period_s, 1e-3));
        assert!(near(parameters.velocity_limit_m_s, drive.max_velocity_m_s));
        assert!(near(parameters.force_limit_n, drive.max_force_n));
        assert!(near(parameters.following_window_m.unwrap(), drive.following_error_m));
        assert_eq!(parameters.following_timeout_ns, 20 * MILLISECOND_NS);
        assert_eq!(parameters.position_limits, [-5, 7]);
        let Stop::Ramp { deceleration_m_s2 } = parameters.quick_stop else { panic!("no ramp") };
        assert!(near(deceleration_m_s2, drive.quick_stop_deceleration_m_s2));
        assert_eq!(parameters.link, LinkReaction::QuickStop);
    }
}
