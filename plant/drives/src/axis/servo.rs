//! The servo loops of a drive: P position loop with velocity feed-forward, PI velocity loop, force limit. Also force
//! control within a range of velocities, and the holding brake.
//!
//! The loops depend on neither CANopen nor time: the caller gives the command of every step. They supervise nothing.

use super::demand::ServoCommand;
use super::motion::{Motion, clamp};
use crate::ratings::Ratings;

/// Time constant of the filter on the measured velocity, s.
const VELOCITY_FILTER_S: f64 = 5e-4;
/// Largest distance of an axis' velocity from the demanded one, as a share of the drive's velocity.
const RUNAWAY_SHARE: f64 = 0.25;
/// Time at that velocity for the way that is no overshoot after late SYNCs.
const RUNAWAY_S: f64 = 3e-3;
/// Largest way of a measured position in a step, in ways at the drive's velocity.
const MOST_WAYS: f64 = 10.0;
/// Counts that an encoder's noise may make in a step, for axes so slow that noise is faster.
const MOST_NOISE: f64 = 8.0;
/// Stiffness of the closed brake, N/m, and its damping, N per m/s.
pub(super) const BRAKE_STIFFNESS_N_M: f64 = 2e5;
pub(super) const BRAKE_DAMPING_N_S_M: f64 = 400.0;

/// Limits of a step, and the addend to its loops.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ServoLimits {
    /// Largest force, N.
    pub(super) force_n: f64,
    /// Largest velocity in position control, m/s.
    pub(super) velocity_m_s: f64,
    /// Lowest and highest velocity in velocity and force control, m/s.
    pub(super) free_velocity_m_s: [f64; 2],
    /// Force that position control gives beside its loops, N.
    pub(super) feed_n: f64,
}

/// The loops' memory.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Servo {
    config: Ratings,
    step_s: f64,
    /// The last measured position with the filtered velocity.
    pub(super) motion: Motion,
    /// The same of the shaft itself, which the brake holds. The two differ by the encoder's error.
    pub(super) shaft: Motion,
    integral_n: f64,
    brake_at_m: Option<f64>,
    /// Whether the last step limited force or velocity.
    pub(super) is_limited: bool,
}

impl Servo {
    /// At rest at a measured position, brake closed.
    pub(super) fn new(config: Ratings, step_s: f64, position_m: f64) -> Self {
        Self {
            config,
            step_s,
            motion: Motion::at_rest(position_m),
            shaft: Motion::at_rest(position_m),
            integral_n: 0.0,
            brake_at_m: Some(position_m),
            is_limited: false,
        }
    }

    /// Releases the brake, which later closes at the shaft's new place.
    pub(super) fn release_brake(&mut self) {
        (self.brake_at_m, self.integral_n) = (None, 0.0);
    }

    /// Lets the brake slip, if it is closed.
    pub(super) fn slip(&mut self, way_m: f64) {
        self.brake_at_m = self.brake_at_m.map(|at_m| at_m + way_m);
    }

    /// One step of the loops with the encoder `error_m` beside the shaft: the force for the next `step_s`, N.
    pub(super) fn step(
        &mut self,
        measured_m: f64,
        error_m: f64,
        command: ServoCommand,
        limits: &ServoLimits,
    ) -> f64 {
        self.motion = self.moved(self.motion, measured_m);
        self.shaft = self.moved(self.shaft, measured_m - error_m);
        match command {
            ServoCommand::Brake => self.brake(),
            ServoCommand::Follow(desired) => self.follow(desired, limits),
            ServoCommand::Speed { velocity_m_s } => self.keep_speed(velocity_m_s, limits),
            ServoCommand::Force { force_n } => self.push(force_n, limits),
        }
    }

    /// Largest distance of an axis' velocity from the demanded one, m/s.
    pub(super) fn runaway_m_s(&self) -> f64 {
        let count_m_s = self.config.encoder_resolution_m / self.step_s;
        (RUNAWAY_SHARE * self.config.max_velocity_m_s).max(MOST_NOISE * count_m_s)
    }

    /// Largest way of an axis in operation ahead of its demand at such a velocity, m.
    pub(super) fn runaway_m(&self) -> f64 {
        RUNAWAY_S * self.runaway_m_s()
    }

    /// Whether a measured position is farther from the last one than any axis comes in a step.
    pub(super) fn is_jump(&self, measured_m: f64) -> bool {
        let way_m = (measured_m - self.motion.position_m).abs();
        let axis_m = MOST_WAYS * self.config.max_velocity_m_s * self.step_s;
        way_m > axis_m.max(MOST_NOISE * self.config.encoder_resolution_m)
    }

    /// A motion after a step to a position, with its velocity filtered.
    fn moved(&self, before: Motion, position_m: f64) -> Motion {
        let raw_m_s = (position_m - before.position_m) / self.step_s;
        let share = (raw_m_s - before.velocity_m_s) * self.step_s / (self.step_s + VELOCITY_FILTER_S);
        Motion { position_m, velocity_m_s: before.velocity_m_s + share }
    }

    fn brake(&mut self) -> f64 {
        let Motion { position_m, velocity_m_s } = self.shaft;
        let at_m = *self.brake_at_m.get_or_insert(position_m);
        self.is_limited = false;
        // When the loops take over they begin with the load that the brake carried.
        self.integral_n = BRAKE_STIFFNESS_N_M * (at_m - position_m);
        self.integral_n - BRAKE_DAMPING_N_S_M * velocity_m_s
    }

    fn follow(&mut self, desired: Motion, limits: &ServoLimits) -> f64 {
        let (config, actual) = (&self.config, self.motion);
        self.brake_at_m = None;
        let unlimited_m_s =
            desired.velocity_m_s + config.position_gain_per_s * (desired.position_m - actual.position_m);
        let (speed_m_s, is_velocity_limited) =
            clamp(unlimited_m_s, [-limits.velocity_m_s, limits.velocity_m_s]);
        self.regulate(speed_m_s, is_velocity_limited, limits)
    }

    /// Velocity control. The integral goes on at the limit of the velocity, so that a load moves nothing there.
    fn keep_speed(&mut self, asked_m_s: f64, limits: &ServoLimits) -> f64 {
        self.brake_at_m = None;
        let (speed_m_s, is_velocity_limited) = clamp(asked_m_s, limits.free_velocity_m_s);
        let force_n = self.regulate(speed_m_s, false, limits);
        self.is_limited |= is_velocity_limited;
        force_n
    }

    /// The velocity loop.
    fn regulate(&mut self, speed_m_s: f64, is_velocity_limited: bool, limits: &ServoLimits) -> f64 {
        let (config, actual) = (&self.config, self.motion);
        let proportional_n = config.velocity_gain_n_s_per_m * (speed_m_s - actual.velocity_m_s);
        let (force_n, is_force_limited) =
            clamp(proportional_n + self.integral_n + limits.feed_n, [-limits.force_n, limits.force_n]);
        self.is_limited = is_velocity_limited || is_force_limited;
        if !self.is_limited {
            self.integral_n += proportional_n * self.step_s / config.velocity_integral_time_s;
        }
        force_n
    }

    /// Force control. Where the velocity would leave its range, the velocity loop takes over without its integral.
    fn push(&mut self, asked_n: f64, limits: &ServoLimits) -> f64 {
        self.brake_at_m = None;
        let velocity_m_s = self.motion.velocity_m_s;
        let range_n =
            limits.free_velocity_m_s.map(|end| self.config.velocity_gain_n_s_per_m * (end - velocity_m_s));
        let (allowed_n, is_velocity_limited) = clamp(asked_n, range_n);
        let (force_n, is_force_limited) = clamp(allowed_n, [-limits.force_n, limits.force_n]);
        self.is_limited = is_velocity_limited || is_force_limited;
        // When the position loop takes over it begins with this force.
        self.integral_n = force_n;
        force_n
    }
}

#[cfg(test)]
mod servo_tests {

    use super::*;

    const STEP_S: f64 = 1.25e-4;
    const LIMITS: ServoLimits =
        ServoLimits { force_n: 1000.0, velocity_m_s: 0.4, free_velocity_m_s: [-0.4, 0.4], feed_n: 0.0 };

    /// A mass with a constant load.
    fn simulate(command: impl Fn(f64) -> ServoCommand, mass_kg: f64, load_n: f64, seconds: f64) -> Motion {
        let mut servo = Servo::new(Ratings::default(), STEP_S, 0.27);
        let (mut position_m, mut velocity_m_s, mut time_s) = (0.27, 0.0, 0.0);
        while time_s < seconds {
            let force_n = servo.step(position_m, 0.0, command(time_s), &LIMITS);
            velocity_m_s += (force_n - load_n) / mass_kg * STEP_S;
            position_m += velocity_m_s * STEP_S;
            time_s += STEP_S;
        }
        Motion { position_m, velocity_m_s }
    }

    #[test]
    fn it_holds_a_position_against_a_load() {
        let hold = |_| ServoCommand::Follow(Motion::at_rest(0.27));
        let Motion { position_m, .. } = simulate(hold, 0.6, 20.0, 1.0);
        assert!((position_m - 0.27).abs() < 1e-6, "{position_m}");
    }

    #[test]
    fn it_follows_a_ramp_without_lasting_error() {
        let ramp = |t: f64| {
            ServoCommand::Follow(Motion { position_m: 0.27 + 0.1 * (t + STEP_S), velocity_m_s: 0.1 })
        };
        let Motion { position_m, velocity_m_s } = simulate(ramp, 0.6, 20.0, 0.3);
        assert!((position_m - 0.30).abs() < 5e-5, "{position_m}");
        assert!((velocity_m_s - 0.1).abs() < 1e-3, "{velocity_m_s}");
    }

    #[test]
    fn the_brake_holds_a_load_nearly_where_it_closed() {
        let Motion { position_m, velocity_m_s } = simulate(|_| ServoCommand::Brake, 0.6, 20.0, 1.0);
        assert!((position_m - 0.27).abs() < 2e-4, "{position_m}");
        assert!(velocity_m_s.abs() < 1e-6);
    }

    /// The force on an axis at rest far from its target, and whether it was limited.
    fn pull(limits: &ServoLimits) -> (f64, bool) {
        let mut servo = Servo::new(Ratings::default(), STEP_S, 0.27);
        let force_n = servo.step(0.27, 0.0, ServoCommand::Follow(Motion::at_rest(5.0)), limits);
        (force_n, servo.is_limited)
    }

    #[test]
    fn the_velocity_asked_for_stays_within_its_limit() {
        let (force_n, is_limited) = pull(&ServoLimits { force_n: f64::INFINITY, ..LIMITS });
        assert!((force_n - 240.0).abs() < 1e-9 && is_limited, "0.4 m/s times the velocity gain: {force_n} N");
    }

    #[test]
    fn the_force_stays_within_its_limit() {
        assert_eq!(pull(&ServoLimits { force_n: 100.0, ..LIMITS }), (100.0, true));
    }

    #[test]
    fn a_force_is_given_as_it_is_asked_for() {
        let mut servo = Servo::new(Ratings::default(), STEP_S, 0.27);
        let force_n = servo.step(0.27, 0.0, ServoCommand::Force { force_n: -33.0 }, &LIMITS);
        assert!((force_n + 33.0).abs() < 1e-12 && !servo.is_limited);
        let force_n = servo.step(0.27, 0.0, ServoCommand::Force { force_n: 5000.0 }, &LIMITS);
        assert!((force_n - 240.0).abs() < 1e-9 && servo.is_limited, "0.4 m/s times the velocity gain");
    }

    #[test]
    fn under_a_force_the_axis_keeps_to_its_velocity() {
        let Motion { position_m, velocity_m_s } =
            simulate(|_| ServoCommand::Force { force_n: 100.0 }, 0.6, 20.0, 0.5);
        assert!((0.2..0.4).contains(&velocity_m_s), "{velocity_m_s} at {position_m}");
    }
}

#[cfg(test)]
mod limit_tests {
    use super::*;

    #[test]
    fn noise_of_a_slow_axis_is_neither_a_jump_nor_a_runaway() {
        let ratings = Ratings { max_velocity_m_s: 1e-3, ..Ratings::default() };
        let mut servo = Servo::new(ratings, 1.25e-4, 0.27);
        for count in [3.0, -3.0, 3.0] {
            assert!(!servo.is_jump(0.27 + count * 1e-6));
            servo.motion = servo.moved(servo.motion, 0.27 + count * 1e-6);
            assert!(servo.motion.velocity_m_s.abs() < servo.runaway_m_s());
        }
        assert!(servo.is_jump(0.27 + 2e-5));
    }
}
