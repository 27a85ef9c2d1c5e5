//! The joint between a drive and its axis: rigid, or loose with a play for the drive's side.

use super::friction::{CONTACT, Element};

/// The drive's share of the axis' mass: of a slide, the carriage.
const DRIVE_SHARE: f64 = 0.75;
/// Friction of the drive's side, N per m/s.
const DRIVE_DAMPING_N_S_PER_M: f64 = 20.0;

/// The joint.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(super) enum Coupling {
    /// Rigid: the distance of the drive's side beyond the joint, m.
    Rigid { beyond_m: f64 },
    /// Loose: the drive's side moves by itself.
    Loose(DriveSide),
}

/// The drive's side of a loose joint.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(super) struct DriveSide {
    /// Half of the play, m; infinite where nothing connects the sides.
    half_m: f64,
    /// Distance of the middle of the play beyond the joint, m.
    beyond_m: f64,
    mass_kg: f64,
    position_m: f64,
    speed_m_s: f64,
    acceleration_m_s2: f64,
    /// The step that is being solved.
    step: Step,
}

/// The drive's acceleration in a step is `free_m_s2` plus `per_speed` times the joint's speed at the end of the step.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
struct Step {
    free_m_s2: f64,
    per_speed_per_s: f64,
}

impl Coupling {
    /// Position of the drive's side for a position of the joint, m.
    pub(super) fn drive_m(&self, joint_m: f64) -> f64 {
        match self {
            Self::Rigid { beyond_m } => joint_m + beyond_m,
            Self::Loose(side) => side.position_m,
        }
    }

    /// Makes the joint loose, with that play.
    pub(super) fn loosen(&mut self, play_m: f64, axis_mass_kg: f64, joint_m: f64, joint_m_s: f64) {
        let half_m = play_m / 2.0;
        let (position_m, speed_m_s, beyond_m) = match *self {
            // The play is even to both sides of where the joint is.
            Self::Rigid { beyond_m } => (joint_m + beyond_m, joint_m_s, beyond_m),
            Self::Loose(DriveSide { position_m, speed_m_s, beyond_m, .. }) => {
                // A drive's side outside of the new play does not jump into it.
                let ahead_m = position_m - joint_m - beyond_m;
                (position_m, speed_m_s, beyond_m + (ahead_m - ahead_m.clamp(-half_m, half_m)))
            }
        };
        *self = Self::Loose(DriveSide {
            half_m,
            beyond_m,
            mass_kg: DRIVE_SHARE * axis_mass_kg,
            position_m,
            speed_m_s,
            acceleration_m_s2: 0.0,
            step: Step::default(),
        });
    }

    /// Makes the joint rigid in its present place.
    pub(super) fn tighten(&mut self, joint_m: f64) {
        *self = Self::Rigid { beyond_m: self.drive_m(joint_m) - joint_m };
    }

    /// The mass that the joint does not carry, kg.
    pub(super) fn parted_kg(&self) -> f64 {
        match self {
            Self::Rigid { .. } => 0.0,
            Self::Loose(side) => side.mass_kg,
        }
    }

    /// The force on the joint in a step with a force of the drive. The position of the joint is that of the middle of
    /// the step.
    pub(super) fn push(&mut self, force_n: f64, joint_m: f64, joint_m_s: f64, step_s: f64) -> Element {
        match self {
            Self::Rigid { .. } => Element { force_n, damping_n_s_per_m: 0.0 },
            Self::Loose(side) => side.push(force_n, joint_m, joint_m_s, step_s),
        }
    }

    /// Solves the drive's side for the known speed of the joint at the end of the step.
    pub(super) fn solve_drive_side(&mut self, joint_m_s: f64) {
        if let Self::Loose(side) = self {
            side.acceleration_m_s2 = side.step.free_m_s2 + side.step.per_speed_per_s * joint_m_s;
        }
    }

    /// Moves the drive's side.
    pub(super) fn advance(&mut self, dt_s: f64) {
        if let Self::Loose(side) = self {
            side.position_m += (side.speed_m_s + 0.5 * side.acceleration_m_s2 * dt_s) * dt_s;
            side.speed_m_s += side.acceleration_m_s2 * dt_s;
        }
    }
}

impl DriveSide {
    /// The speed v′ of the drive's side is a linear function of the joint's speed q̇′.
    ///
    /// The drive's side obeys m (v′ − v)/h = F − b v′ − c. The force of the contact is c = k g + d (v′ − q̇′), with the
    /// closing g of the gap.
    fn push(&mut self, drive_n: f64, joint_m: f64, joint_m_s: f64, step_s: f64) -> Element {
        let middle_m = self.position_m + 0.5 * step_s * self.speed_m_s;
        let (closed_m, damping) = self.contact(middle_m - joint_m - self.beyond_m, joint_m_s, step_s);
        let spring_n = CONTACT.stiffness_n_per_m * closed_m;
        let moved = self.mass_kg + step_s * (damping + DRIVE_DAMPING_N_S_PER_M);
        let free_m_s = (self.mass_kg * self.speed_m_s + step_s * (drive_n - spring_n)) / moved;
        let per_speed = step_s * damping / moved;
        self.step =
            Step { free_m_s2: (free_m_s - self.speed_m_s) / step_s, per_speed_per_s: per_speed / step_s };
        let damping_n_s_per_m = damping * (1.0 - per_speed);
        let force_n = spring_n + damping * free_m_s - damping_n_s_per_m * joint_m_s;
        Element { force_n, damping_n_s_per_m }
    }

    /// The closing of the play, and the contact's damping in the step. The closing is positive for a drive that pushes
    /// upwards. Both are zero for sides that do not touch before the end of the step.
    fn contact(&self, ahead_m: f64, joint_m_s: f64, step_s: f64) -> (f64, f64) {
        let next_m = ahead_m + step_s * (self.speed_m_s - joint_m_s);
        if next_m.abs() <= self.half_m {
            return (0.0, 0.0);
        }
        let damping = CONTACT.damping_n_s_per_m + CONTACT.stiffness_n_per_m * step_s;
        (ahead_m - self.half_m.copysign(next_m), damping)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 1.25e-4;

    /// A joint of half a kilogram under a load, and a drive with a constant force: positions of joint and drive after.
    fn after(seconds: f64, play_m: f64, drive_n: f64, load_n: f64) -> (f64, f64) {
        let mut coupling = Coupling::Rigid { beyond_m: 0.0 };
        coupling.loosen(play_m, 0.4, 0.0, 0.0);
        let (mut joint_m, mut joint_m_s) = (0.0, 0.0);
        for _ in 0..(seconds / STEP_S) as usize {
            joint_m += 0.5 * STEP_S * joint_m_s;
            let Element { force_n, damping_n_s_per_m } = coupling.push(drive_n, joint_m, joint_m_s, STEP_S);
            joint_m_s += STEP_S * (force_n + load_n) / (0.5 + STEP_S * damping_n_s_per_m);
            coupling.solve_drive_side(joint_m_s);
            joint_m += 0.5 * STEP_S * joint_m_s;
            coupling.advance(STEP_S);
        }
        (joint_m, coupling.drive_m(joint_m))
    }

    #[test]
    fn opposite_forces_close_the_play_at_its_end_and_pass_through() {
        let (joint_m, drive_m) = after(0.5, 0.002, 100.0, -100.0);
        assert!((drive_m - joint_m - 0.001).abs() < 2e-5, "{joint_m} {drive_m}");
    }

    #[test]
    fn with_its_end_closed_both_sides_accelerate_as_one_mass() {
        let (joint_m, drive_m) = after(0.05, 0.0, 80.0, 0.0);
        // 80 N on 0.8 kg for 50 ms, against 20 N per m/s.
        assert!((joint_m - 0.0858).abs() < 1e-3, "{joint_m}");
        assert!((drive_m - joint_m).abs() < 1e-4);
    }

    #[test]
    fn a_broken_joint_passes_no_force_and_stays_beside_when_it_is_rigid_again() {
        let (joint_m, drive_m) = after(0.05, f64::INFINITY, 10.0, 0.0);
        assert!(joint_m == 0.0 && drive_m > 0.01);
        let mut coupling = Coupling::Rigid { beyond_m: 0.0 };
        coupling.loosen(f64::INFINITY, 0.4, 0.3, 0.1);
        coupling.advance(0.01);
        coupling.tighten(0.3);
        assert!((coupling.drive_m(0.3) - 0.301).abs() < 1e-12);
        assert_eq!(coupling.push(7.0, 0.3, 0.0, STEP_S), Element { force_n: 7.0, damping_n_s_per_m: 0.0 });
    }
}
