//! Contact between the jaws: teeth that meet their antagonists, and food between them.
//!
//! Forces follow from the pose and the twist at the beginning of a step, and are held over the step. So a step must be
//! shorter than the fastest oscillation of the mechanism on its contacts allows.

pub(crate) mod food;
mod teeth;

#[cfg(test)]
mod tests;

use arrayvec::ArrayVec;
use masseter_model::dynamics::DynamicsConfig;
use masseter_model::geometry::{Pose, Twist, Vec3};
use masseter_runtime::messages::Contact;
use masseter_scenario::{MOST_PAIRS, TeethConfig, ToothConfig};
use nalgebra::{Matrix6, Vector6};

use crate::error::ContactError;
use food::{Food, FoodBreak};
use teeth::{Enamel, Pair};

/// The contact between the jaws.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct Occlusion {
    /// By the numbers of their teeth; empty if the jaws never touch.
    pairs: ArrayVec<Pair, MOST_PAIRS>,
    /// The contact of each pair; empty if the teeth never meet.
    enamel: ArrayVec<Enamel, MOST_PAIRS>,
    pub(crate) food: Option<Food>,
    /// Force on each lower tooth, base axes, N.
    forces_n: [Vec3; MOST_PAIRS],
    /// Sum of these forces since the last message, N.
    sums_n: [Vec3; MOST_PAIRS],
    steps: u32,
    /// The break of a piece of food since the last look.
    pub(crate) broke: Option<FoodBreak>,
    /// Largest stiffness of contact and all foods of the scenario against the platform's twist in the closed mouth.
    stiffness: Matrix6<f64>,
}

impl Occlusion {
    /// Teeth for a mouth that is closed in that pose of the platform, each with the stiffest contact that it may have (N/m).
    /// Without enamel they meet food alone.
    pub(crate) fn new(teeth: &[(ToothConfig, f64)], enamel: Option<&TeethConfig>, closed: &Pose) -> Self {
        let teeth = &teeth[..teeth.len().min(MOST_PAIRS)];
        let pairs: ArrayVec<_, MOST_PAIRS> =
            teeth.iter().map(|(tooth, _)| Pair::new(tooth, closed)).collect();
        let enamel = enamel.into_iter().flat_map(|teeth| pairs.iter().map(|_| Enamel::new(teeth))).collect();
        let mut stiffness = Matrix6::zeros();
        for (pair, (_, stiffest_n_per_m)) in pairs.iter().zip(teeth) {
            let jacobian = pair.jacobian(closed);
            stiffness += jacobian.transpose() * jacobian * *stiffest_n_per_m;
        }
        let zero = [Vec3::zeros(); MOST_PAIRS];
        Self { pairs, enamel, food: None, forces_n: zero, sums_n: zero, steps: 0, broke: None, stiffness }
    }

    /// Refuses a step (ns) longer than a radian of the fastest oscillation of a platform with this mass matrix on its
    /// contacts. With the damping of its own end, a step is stable up to 1.15 radians.
    pub(crate) fn check_step(&self, mass: &Matrix6<f64>, step_ns: u64) -> Result<(), ContactError> {
        let Some(cholesky) = mass.cholesky().filter(|_| !self.pairs.is_empty()) else { return Ok(()) };
        let half = cholesky.l().solve_lower_triangular(&self.stiffness).unwrap_or_default();
        let squares = cholesky.l().solve_lower_triangular(&half.transpose()).unwrap_or_default();
        // The search for eigenvalues never ends with NaN or infinity.
        let is_finite = squares.iter().all(|square| square.is_finite());
        let fastest = if is_finite { squares.symmetric_eigenvalues().max() } else { f64::INFINITY };
        let longest_ns = (1e9 / fastest.sqrt()) as u64;
        match longest_ns {
            _ if step_ns <= longest_ns => Ok(()),
            _ if longest_ns < *DynamicsConfig::STEPS_NS.start() => Err(ContactError::Stiff { longest_ns }),
            _ => Err(ContactError::Step { step_ns, longest_ns }),
        }
    }

    /// The wrench of a step on the platform: force (N), then moment (N m) about the platform's origin, in base axes.
    pub(crate) fn push(&mut self, pose: &Pose, twist: &Twist, step_s: f64) -> Vector6<f64> {
        let mut wrench = Vector6::zeros();
        if self.enamel.is_empty() && self.food.is_none() {
            return wrench;
        }
        let touches: ArrayVec<_, MOST_PAIRS> =
            self.pairs.iter().map(|pair| pair.touch(pose, twist, step_s)).collect();
        self.forces_n = [Vec3::zeros(); MOST_PAIRS];
        for ((enamel, touch), force_n) in self.enamel.iter_mut().zip(&touches).zip(&mut self.forces_n) {
            *force_n = enamel.force_n(touch);
        }
        if let Some(food) = &mut self.food {
            self.broke = food.bite(&touches, &mut self.forces_n).or(self.broke);
        }
        self.steps += 1;
        for ((touch, force_n), sum_n) in touches.iter().zip(&self.forces_n).zip(&mut self.sums_n) {
            *sum_n += force_n;
            let moment = touch.arm.cross(force_n);
            wrench += Vector6::new(force_n.x, force_n.y, force_n.z, moment.x, moment.y, moment.z);
        }
        wrench
    }

    /// Another food, or none.
    pub(crate) fn set_food(&mut self, food: Option<Food>) {
        self.food = food;
        self.forces_n = [Vec3::zeros(); MOST_PAIRS];
    }

    /// The vertical force on the lower jaw, downwards, N.
    pub(crate) fn bite_force_n(&self) -> f64 {
        // A sum of nothing is −0.
        0.0 - self.forces_n.iter().map(|force_n| force_n.z).sum::<f64>()
    }

    /// The mean forces since the last call; without a step since, those of the last step.
    pub(crate) fn take_mean(&mut self) -> Contact {
        let mut message = Contact::default();
        for (place, pair) in self.pairs.iter().enumerate() {
            let mean_n = if self.steps == 0 {
                self.forces_n[place]
            } else {
                self.sums_n[place] / f64::from(self.steps)
            };
            message.tooth[place] = pair.number.into();
            message.force_n[3 * place..][..3].copy_from_slice(mean_n.as_slice());
            message.place_m[3 * place..][..3].copy_from_slice(pair.lower_m.as_slice());
        }
        (self.sums_n, self.steps) = ([Vec3::zeros(); MOST_PAIRS], 0);
        message
    }
}
