//! Enclosures of all positions of the platform's corners for a box of inputs and of reaches.
//!
//! A leg's *reach* is the horizontal part of the leg, h = l cos θ. Its height is z = l sin θ. Above the
//! base z = √(l² − h²), so Aᵢ = Bᵢ + hᵢ v̂ᵢ + zᵢ ẑ contains no sine and no cosine. Side k from leg i = k to
//! leg j = k + 1 closes where ½(|Aᵢ − Aⱼ|² − L²) = 0.
//!
//! Hypotheses for two solutions of one input:
//! - They share d and l. Therefore z − z′ = σ (h − h′) with σ = −(h + h′)/(z + z′).
//! - C and W are the means of their horizontal and vertical differences Aᵢ − Aⱼ.
//!
//! Result: the difference of the side's equation is *exactly* nᵢ (hᵢ − hᵢ′) + fⱼ (hⱼ − hⱼ′), with
//! n = C·v̂ᵢ + W σᵢ and f = −(C·v̂ⱼ + W σⱼ).
//!
//! The means C and W, and −σ as a quotient of means, lie in every box that contains both solutions. So
//! [`Slopes`] encloses the derivatives and also the slopes between any two solutions. The mechanism's
//! dimensions count as exact.

use masseter_model::geometry::{LEGS, Mechanism, Vec3};

use super::super::legs::next;
use super::{Enclosure, InputBox};

/// Corners for every input in a box and every reach in a box.
#[allow(clippy::struct_field_names)] // Units are part of a name.
#[derive(Debug, Clone, Copy)]
pub(super) struct Platforms {
    /// hᵢ, metres.
    reach_m: [Enclosure; LEGS],
    /// zᵢ, metres.
    height_m: [Enclosure; LEGS],
    leg_m: [Enclosure; LEGS],
    /// Aᵢ − Aⱼ of side k, horizontal.
    across_m: [[Enclosure; 2]; LEGS],
    /// Aᵢ − Aⱼ of side k, vertical.
    rise_m: [Enclosure; LEGS],
}

/// Enclosures of n and f of each side, metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slopes {
    pub near_m: [Enclosure; LEGS],
    pub far_m: [Enclosure; LEGS],
}

/// With a horizontal vector.
fn dot(a: [Enclosure; 2], b: &Vec3) -> Enclosure {
    a[0] * b.x + a[1] * b.y
}

impl Platforms {
    /// None when a leg is shorter than its reach for every input: no such platform exists.
    pub(super) fn new(mechanism: &Mechanism, inputs: &InputBox, reach_m: &[Enclosure; LEGS]) -> Option<Self> {
        let mut height_m = *reach_m;
        for leg in 0..LEGS {
            height_m[leg] = (inputs.leg_m[leg].square() - reach_m[leg].square()).square_root()?;
        }
        let corner = |leg: usize| {
            let (along, inward) = (mechanism.slide_direction(leg), mechanism.inward_direction(leg));
            let centre_m = mechanism.hinge(leg, 0.0);
            [0, 1].map(|axis| {
                inputs.slide_m[leg] * along[axis]
                    + reach_m[leg] * inward[axis]
                    + Enclosure::point(centre_m[axis])
            })
        };
        let corners: [_; LEGS] = std::array::from_fn(corner);
        let across_m =
            std::array::from_fn(|side| [0, 1].map(|axis| corners[side][axis] - corners[next(side)][axis]));
        let rise_m = std::array::from_fn(|side| height_m[side] - height_m[next(side)]);
        Some(Self { reach_m: *reach_m, height_m, leg_m: inputs.leg_m, across_m, rise_m })
    }

    /// ½(|Aᵢ − Aⱼ|² − L²) of each side, m².
    pub(super) fn excess_m2(&self, mechanism: &Mechanism) -> [Enclosure; LEGS] {
        let sides_m = mechanism.platform_sides_m();
        std::array::from_fn(|side| {
            let [x, y] = self.across_m[side];
            let square = x.square() + y.square() + self.rise_m[side].square();
            (square - Enclosure::point(sides_m[side]).square()) * 0.5
        })
    }

    /// None when a leg may be horizontal: there z is not a smooth function of h.
    pub(super) fn slopes(&self, mechanism: &Mechanism) -> Option<Slopes> {
        let mut lean = self.reach_m;
        for (lean, height_m) in lean.iter_mut().zip(self.height_m) {
            *lean = -(*lean * height_m.reciprocal()?);
        }
        let slope = |side: usize, leg: usize| {
            dot(self.across_m[side], &mechanism.inward_direction(leg)) + self.rise_m[side] * lean[leg]
        };
        Some(Slopes {
            near_m: std::array::from_fn(|side| slope(side, side)),
            far_m: std::array::from_fn(|side| -slope(side, next(side))),
        })
    }

    /// Whether a platform in this enclosure may fulfil the paper's conditions 1 and 2, oriented; heights are
    /// not negative.
    pub(super) fn may_stand_as_assembled(&self, mechanism: &Mechanism) -> bool {
        let [[x12, y12], [x23, y23], [x31, y31]] = self.across_m;
        let [z12, _, z31] = self.rise_m;
        // (A₂ − A₁) × (A₃ − A₁), where A₂ − A₁ is minus side 12 and A₃ − A₁ is side 31.
        let normal = [z12 * y31 - y12 * z31, x12 * z31 - z12 * x31];
        let normal_up = y12 * x31 - x12 * y31;
        let below = |leg: usize| {
            let along_leg = self.reach_m[leg] * dot(normal, &mechanism.inward_direction(leg));
            (along_leg + self.height_m[leg] * normal_up).high() > 0.0
        };
        (0..LEGS).all(below) && dot([x23, y23], &mechanism.slide_direction(0)).high() > 0.0
    }

    /// The [determinant](crate::kinematics::Solution::determinant) of every platform in this enclosure.
    pub(super) fn determinant(&self, mechanism: &Mechanism, slopes: &Slopes) -> Option<Enclosure> {
        let [n1, n2, n3] = slopes.near_m;
        let [f1, f2, f3] = slopes.far_m;
        let mut determinant = -(n1 * n2 * n3 + f1 * f2 * f3);
        for (leg, side_m) in mechanism.platform_sides_m().into_iter().enumerate() {
            let side = Enclosure::point(side_m);
            determinant = determinant * self.height_m[leg] * (self.leg_m[leg] * side).reciprocal()?;
        }
        Some(determinant)
    }
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::Actuators;
    use proptest::prelude::*;

    use super::*;
    use crate::kinematics::Solutions;
    use crate::kinematics::tests::mechanisms;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        /// Every solution lies in the enclosure of a box around it, and the slopes between two solutions give the
        /// difference of their equations.
        #[test]
        fn enclosures_hold_what_the_solver_finds(
            mechanism in mechanisms(), slide_m in prop::array::uniform3(-0.03..0.03f64),
            leg_m in prop::array::uniform3(0.24..0.3f64), margin_m in 1e-9..1e-3f64,
        ) {
            let actuators = Actuators { slide_m, leg_m };
            let around = |value: f64| Enclosure::new(value - margin_m, value + margin_m);
            let inputs = InputBox { slide_m: slide_m.map(around), leg_m: leg_m.map(around) };
            let solutions = Solutions::new(&mechanism, &actuators).unwrap();
            let above = || solutions.iter().filter(|one| one.theta_rad.iter().all(|theta| *theta > 0.1));
            let reach = |theta_rad: [f64; LEGS]| -> [f64; LEGS] {
                std::array::from_fn(|leg| leg_m[leg] * theta_rad[leg].cos())
            };
            for one in above() {
                let h = reach(one.theta_rad);
                let platforms = Platforms::new(&mechanism, &inputs, &h.map(around)).unwrap();
                prop_assert!(platforms.excess_m2(&mechanism).iter().all(|excess| excess.contains(0.0)));
                let slopes = platforms.slopes(&mechanism).unwrap();
                let determinant = platforms.determinant(&mechanism, &slopes).unwrap();
                prop_assert!(determinant.contains(one.determinant));
                let assembly = one.assembly;
                let stands = assembly.hinges_below_platform == [true; LEGS] && assembly.corners_in_order;
                prop_assert!(!stands || platforms.may_stand_as_assembled(&mechanism));
                for other in above() {
                    let h_other = reach(other.theta_rad);
                    let both = std::array::from_fn(|leg| around(h[leg]).hull(around(h_other[leg])));
                    let platforms = Platforms::new(&mechanism, &inputs, &both).unwrap();
                    let slopes = platforms.slopes(&mechanism).unwrap();
                    for side in 0..LEGS {
                        let step = |leg: usize| Enclosure::point(h[leg]) - Enclosure::point(h_other[leg]);
                        let change = slopes.near_m[side] * step(side) + slopes.far_m[side] * step(next(side));
                        prop_assert!(change.low() < 1e-13 && change.high() > -1e-13);
                    }
                }
            }
        }
    }
}
