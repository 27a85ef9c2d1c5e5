//! The mechanism: three slides, three telescopic legs and one platform.
//!
//! The two frames are a reconstruction from the paper (Fig. 1 and its two conditions). The *base* has its origin at the
//! centre of the base, x anterior, y left, z up. The *platform* has its origin at the centroid of A₁A₂A₃, x towards A₁,
//! z along the normal (A₂−A₁)×(A₃−A₁). A pose is the platform frame in the base frame.
//!
//! Controller and plant share the geometry, the closed-form inverse kinematics and the Jacobian of this module. Forward
//! kinematics is not here: only the controller has it, so that the plant stays an independent oracle.

use serde::{Deserialize, Serialize};

mod jacobian;
mod mechanism;

pub use jacobian::{Conditioning, Jacobian, Twist};
pub use mechanism::{GeometryError, InverseError, Mechanism, MechanismConfig, SlideConfig, frame_of_corners};

/// Tolerance at the ends of a stroke for rounding; far below the resolution of an encoder, m.
const ROUNDING_M: f64 = 1e-9;

/// Platform frame in the base frame; metres.
#[doc(alias("transform", "rigid transformation"))]
pub type Pose = nalgebra::Isometry3<f64>;
/// A point or direction; metres or unitless.
pub type Vec3 = nalgebra::Vector3<f64>;

/// Legs of the mechanism; each has one slide and one telescopic stroke.
pub const LEGS: usize = 3;
/// Actuated axes, in the order d₁ d₂ d₃ l₁ l₂ l₃ everywhere: messages, nodes, CSV columns.
pub const AXES: usize = 2 * LEGS;
/// The axes' names, in their order.
pub const AXIS_NAMES: [&str; AXES] = ["d1", "d2", "d3", "l1", "l2", "l3"];

/// The inputs of the forward kinematics: slide displacements and leg lengths.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Actuators {
    /// dᵢ: displacement of hinge Bᵢ from the middle of its slide, metres.
    pub slide_m: [f64; LEGS],
    /// lᵢ: distance AᵢBᵢ, metres.
    pub leg_m: [f64; LEGS],
}

impl Actuators {
    /// From the axis order d₁ d₂ d₃ l₁ l₂ l₃, metres.
    pub fn from_axes([d1, d2, d3, l1, l2, l3]: [f64; AXES]) -> Self {
        Self { slide_m: [d1, d2, d3], leg_m: [l1, l2, l3] }
    }

    /// In the axis order d₁ d₂ d₃ l₁ l₂ l₃, metres.
    #[inline]
    pub fn to_axes(self) -> [f64; AXES] {
        let ([d1, d2, d3], [l1, l2, l3]) = (self.slide_m, self.leg_m);
        [d1, d2, d3, l1, l2, l3]
    }

    /// Whether every coordinate is a finite number.
    #[inline]
    pub fn is_finite(&self) -> bool {
        self.to_axes().iter().all(|x| x.is_finite())
    }
}

/// A full joint state: the actuated coordinates and the passive hinge angles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Joints {
    /// Slides and legs.
    pub actuators: Actuators,
    /// θᵢ: angle of leg i against the base, measured from the inward horizontal, radians.
    pub theta_rad: [f64; LEGS],
}

/// Slides and legs at a pose, with the directions of the legs in place of the angles. An angle costs an arc tangent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Legs {
    /// Slides and legs.
    pub actuators: Actuators,
    /// sin θᵢ and cos θᵢ.
    pub sin_cos: [(f64, f64); LEGS],
    /// Corners Aᵢ from the platform's origin, base axes, m.
    pub arms_m: [Vec3; LEGS],
}

keys! {
    /// The strokes of slides and legs, both ends included.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct StrokeLimits {
        /// Lowest and highest displacement of a slide.
        pub slide_m: [f64; 2] => "the first below the second",
        /// Shortest and longest leg.
        pub leg_m: [f64; 2] => "above 0, the first below the second",
    }
}

/// An axis outside its stroke.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "axis {} at {value_m:.6} m is outside its stroke of {lowest_m} to {highest_m} m",
    AXIS_NAMES[*axis]
)]
pub struct LimitViolation {
    /// Axis index in the order d₁ d₂ d₃ l₁ l₂ l₃.
    pub axis: usize,
    /// Actual or requested position of the axis, m.
    pub value_m: f64,
    /// The lower end of the stroke.
    pub lowest_m: f64,
    /// The upper end of the stroke.
    pub highest_m: f64,
}

impl LimitViolation {
    /// The end of the stroke that the axis has passed.
    pub fn limit_m(&self) -> f64 {
        if self.value_m > self.highest_m { self.highest_m } else { self.lowest_m }
    }
}

impl StrokeLimits {
    /// Lowest and highest position of an axis, metres.
    #[inline]
    pub fn of_axis(&self, axis: usize) -> [f64; 2] {
        if axis < LEGS { self.slide_m } else { self.leg_m }
    }

    /// The first axis outside its stroke, if any. A value that is not a number is outside.
    #[inline]
    pub fn check(&self, actuators: &Actuators) -> Result<(), LimitViolation> {
        self.check_within(ROUNDING_M, actuators)
    }

    /// The actuators with every axis clamped to its stroke. An axis outside its stroke before may come back, but go no
    /// further.
    ///
    /// # Errors
    /// [`LimitViolation`] for an axis that is not a number, or outside by more than `excess_m`.
    #[doc(alias = "saturate")]
    #[inline]
    pub fn clamp(
        &self,
        actuators: &Actuators,
        before: &Actuators,
        excess_m: f64,
    ) -> Result<Actuators, LimitViolation> {
        self.check_within(excess_m, actuators)?;
        let (desired_m, before_m) = (actuators.to_axes(), before.to_axes());
        Ok(Actuators::from_axes(std::array::from_fn(|axis| {
            let [lowest_m, highest_m] = self.of_axis(axis);
            desired_m[axis].clamp(lowest_m.min(before_m[axis]), highest_m.max(before_m[axis]))
        })))
    }

    #[inline]
    fn check_within(&self, excess_m: f64, actuators: &Actuators) -> Result<(), LimitViolation> {
        for (axis, value_m) in actuators.to_axes().into_iter().enumerate() {
            let [lowest_m, highest_m] = self.of_axis(axis);
            if !(lowest_m - excess_m..=highest_m + excess_m).contains(&value_m) {
                return Err(LimitViolation { axis, value_m, lowest_m, highest_m });
            }
        }
        Ok(())
    }
}

/// The difference between two poses.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Deviation {
    /// Distance of the platform's origin, m.
    pub origin_m: f64,
    /// Distance of the incisal point, m.
    pub incisal_m: f64,
    /// Angle of the rotation between them, rad.
    pub angle_rad: f64,
}

impl Deviation {
    /// The difference between the poses `a` and `b`, with the incisal point at `incisal_m` in the platform frame.
    pub fn between(a: &Pose, b: &Pose, incisal_m: [f64; 3]) -> Self {
        let incisal = Vec3::from(incisal_m);
        let apart_m = a.translation.vector - b.translation.vector;
        Self {
            origin_m: apart_m.norm(),
            incisal_m: (apart_m + a.rotation * incisal - b.rotation * incisal).norm(),
            angle_rad: a.rotation.angle_to(&b.rotation),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STROKES: StrokeLimits = StrokeLimits { slide_m: [-0.03, 0.03], leg_m: [0.24, 0.30] };

    /// Inverse of forward kinematics at the end of a stroke gives a value up to a few units of the last place beyond
    /// it.
    #[test]
    fn rounding_at_the_end_of_a_stroke_is_tolerated() {
        let legs = |leg_m: f64| Actuators { slide_m: [0.0; LEGS], leg_m: [leg_m; LEGS] };
        for leg_m in [0.30_f64.next_up(), 0.24_f64.next_down(), 0.30 + 0.9e-9] {
            assert_eq!(STROKES.check(&legs(leg_m)), Ok(()), "{leg_m}");
        }
        for leg_m in [0.30 + 1.1e-9, 0.24 - 1.1e-9] {
            assert!(STROKES.check(&legs(leg_m)).is_err(), "{leg_m}");
        }
    }

    #[test]
    fn an_axis_is_clamped_to_its_stroke_unless_it_is_too_far_outside() {
        let asked = |d1_m: f64, l3_m: f64| Actuators { slide_m: [d1_m, 0.0, 0.0], leg_m: [0.27, 0.27, l3_m] };
        let clamps = [
            (asked(0.01, 0.25), asked(0.01, 0.25)),
            (asked(-0.0305, 0.27), asked(-0.03, 0.27)),
            (asked(0.0, 0.3009), asked(0.0, 0.30)),
        ];
        let before = asked(0.0, 0.27);
        for (actuators, held) in clamps {
            assert_eq!(STROKES.clamp(&actuators, &before, 1e-3), Ok(held));
        }
        for (actuators, axis) in [(asked(0.0302, 0.238), 5), (asked(f64::NAN, 0.27), 0)] {
            assert_eq!(STROKES.clamp(&actuators, &before, 1e-3).unwrap_err().axis, axis);
        }
        assert!(STROKES.check(&asked(0.03, 0.24)).is_ok());
        assert!(STROKES.check(&asked(0.03, 0.239_999)).is_err());
    }

    #[test]
    fn an_axis_outside_its_stroke_may_come_back_but_go_no_further() {
        let asked = |l1_m: f64| Actuators { slide_m: [0.0; LEGS], leg_m: [l1_m, 0.27, 0.27] };
        let moves = [(0.2395, 0.2396, 0.2396), (0.2395, 0.2394, 0.2395), (0.241, 0.2394, 0.24)];
        for (from_m, to_m, held_m) in moves {
            assert_eq!(STROKES.clamp(&asked(to_m), &asked(from_m), 1e-3), Ok(asked(held_m)));
        }
    }

    #[test]
    fn a_turn_about_the_origin_moves_the_incisal_point_alone() {
        let turned = Pose::new(Vec3::zeros(), Vec3::new(0.0, 0.0, 0.01));
        let found = Deviation::between(&Pose::identity(), &turned, [0.03, 0.0, 0.5]);
        assert!((found.incisal_m - 0.06 * 0.005f64.sin()).abs() < 1e-15, "{found:?}");
        assert!((found.angle_rad - 0.01).abs() < 1e-15 && found.origin_m == 0.0, "{found:?}");
        let shifted = Pose::translation(0.0, 3e-3, -4e-3);
        let found = Deviation::between(&shifted, &Pose::identity(), [0.03, 0.0, 0.5]);
        assert!((found.origin_m - 5e-3).abs() < 1e-15 && (found.incisal_m - 5e-3).abs() < 1e-15, "{found:?}");
    }
}
