//! The six actuated coordinates, the three passive hinge angles, and the strokes that bound them.

use serde::{Deserialize, Serialize};

use super::Vec3;

/// Legs of the mechanism; each has one slide and one telescopic stroke.
pub const LEGS: usize = 3;
/// Actuated axes, in the order d₁ d₂ d₃ l₁ l₂ l₃ everywhere: messages, nodes, CSV columns.
pub const AXES: usize = 2 * LEGS;
/// The axes' names, in their order.
pub const AXIS_NAMES: [&str; AXES] = ["d1", "d2", "d3", "l1", "l2", "l3"];

/// The inputs of the forward kinematics: slide displacements and leg lengths.
#[derive(Debug, Clone, Copy, PartialEq)]
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

/// Tolerance at the ends of a stroke for rounding; far below the resolution of an encoder, m.
const ROUNDING_M: f64 = 1e-9;

/// A full joint state: the actuated coordinates and the passive hinge angles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Joints {
    /// Slides and legs.
    pub actuators: Actuators,
    /// θᵢ: angle of leg i against the base, measured from the inward horizontal, radians.
    pub theta_rad: [f64; LEGS],
}

/// Slides and legs at a pose, with the directions of the legs in place of the angles, which cost an arc tangent each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Legs {
    /// Slides and legs.
    pub actuators: Actuators,
    /// sin θᵢ and cos θᵢ.
    pub sin_cos: [(f64, f64); LEGS],
    /// Corners Aᵢ from the platform's origin, base axes, m.
    pub arms_m: [Vec3; LEGS],
}

/// The strokes of slides and legs, both ends included.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StrokeLimits {
    /// Slide displacement, lowest and highest, metres.
    pub slide_m: [f64; 2],
    /// Leg length, lowest and highest, metres.
    pub leg_m: [f64; 2],
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
    /// The end of the stroke that was passed.
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

    /// The first axis outside its stroke, if any; a value that is not a number is outside.
    #[inline]
    pub fn check(&self, actuators: &Actuators) -> Result<(), LimitViolation> {
        self.check_within(ROUNDING_M, actuators)
    }

    /// The actuators with every axis clamped to its stroke. An axis that was outside before may come back, but go no
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

#[cfg(test)]
mod tests {
    use super::*;

    const STROKES: StrokeLimits = StrokeLimits { slide_m: [-0.03, 0.03], leg_m: [0.24, 0.30] };

    /// Inverse of forward kinematics at the end of a stroke ends up to a few units of the last place beyond it.
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
}
