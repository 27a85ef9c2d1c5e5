//! The mechanism's validated dimensions, the positions of its points at any pose, and the inverse kinematics in closed
//! form. The slide is dᵢ = (Aᵢ − Bᵢ⁰)·ûᵢ; lᵢ and θᵢ follow from the part of Aᵢ − Bᵢ perpendicular to ûᵢ. Strokes are
//! not checked here: see [`StrokeLimits`].

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::{Actuators, Joints, LEGS, Legs, Pose, StrokeLimits, Vec3};
use crate::section::Range;

keys! {
    /// One slide in the base plane.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct SlideConfig {
        /// The middle of the slide (hinge Bᵢ at dᵢ = 0), x and y in the base plane.
        pub centre_m: [f64; 2] => Within(-LONGEST_M, LONGEST_M) "not all on a line",
        /// Direction of positive displacement ûᵢ from the base's x axis, counter-clockwise. The leg swings in the vertical
        /// plane perpendicular to it; inward is 90° further on.
        pub azimuth_deg: f64 => "the leg must lean inward",
    }
}

keys! {
    /// The dimensions in a scenario. The default is the paper's mechanism.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct MechanismConfig {
        /// Slides 1, 2, 3.
        pub slides: [SlideConfig; LEGS],
        /// Sides of the platform triangle: A₁A₂, A₂A₃, A₃A₁.
        pub platform_sides_m: [f64; LEGS] => Within(SHORTEST_SIDE_M, LONGEST_M) "a triangle",
        /// Strokes of slides and legs.
        pub strokes: StrokeLimits,
    }
}

impl Default for MechanismConfig {
    fn default() -> Self {
        let radius_m = 0.10 / 3f64.sqrt();
        let slide = |leg_azimuth_deg: f64| {
            let (sin, cos) = leg_azimuth_deg.to_radians().sin_cos();
            SlideConfig { centre_m: [radius_m * cos, radius_m * sin], azimuth_deg: leg_azimuth_deg + 90.0 }
        };
        Self {
            slides: [slide(0.0), slide(120.0), slide(240.0)],
            platform_sides_m: [0.05; LEGS],
            strokes: StrokeLimits { slide_m: [-0.03, 0.03], leg_m: [0.24, 0.30] },
        }
    }
}

/// Longest dimension, m.
const LONGEST_M: f64 = 100.0;
/// Shortest side of a platform, m.
const SHORTEST_SIDE_M: f64 = 1e-3;
/// Least area of the triangle of the slides' centres, m².
const LEAST_BASE_M2: f64 = 1e-6;

/// Dimensions that describe no mechanism, with the key, the value and the remedy.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("mechanism.{0}")]
pub struct GeometryError(String);

/// A leg shorter than this has no direction.
const SHORTEST_LEG_M: f64 = 1e-9;

/// A pose without joint coordinates.
#[doc(alias = "IK")]
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum InverseError {
    /// The pose has a value that is not finite, or a value with an infinite square.
    #[error("the pose has a value that is no finite number, or too large a one")]
    NotFinite,
    /// Platform corner and hinge coincide, so the leg's angle is undefined.
    #[error("leg {leg} has no length ({leg_m:e} m): its angle is undefined")]
    NoLength {
        /// Index of the leg, from 0.
        leg: usize,
        /// Its length.
        leg_m: f64,
    },
}

/// A slide with its directions resolved; base frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Slide {
    centre: Vec3,
    /// ûᵢ: positive displacement.
    along: Vec3,
    /// −r̂ᵢ: horizontal, perpendicular to the slide, towards the middle of the base.
    inward: Vec3,
}

/// A mechanism with checked dimensions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Mechanism {
    slides: [Slide; LEGS],
    corners: [Vec3; LEGS],
    sides_m: [f64; LEGS],
    strokes: StrokeLimits,
}

impl Mechanism {
    /// Checks the dimensions and resolves directions and corners.
    ///
    /// # Examples
    /// ```
    /// use masseter_model::geometry::{Mechanism, MechanismConfig};
    ///
    /// let mechanism = Mechanism::new(&MechanismConfig::default())?;
    /// assert_eq!(mechanism.platform_sides_m(), [0.05; 3]);
    /// let flat = MechanismConfig { platform_sides_m: [0.05, 0.05, 0.1], ..MechanismConfig::default() };
    /// assert!(Mechanism::new(&flat).is_err());
    /// # Ok::<(), masseter_model::geometry::GeometryError>(())
    /// ```
    ///
    /// # Errors
    /// [`GeometryError`] with the key, the value and the remedy.
    pub fn new(config: &MechanismConfig) -> Result<Self, GeometryError> {
        check_sizes(config)?;
        check_strokes(&config.strokes)?;
        Ok(Self {
            slides: resolve_slides(&config.slides)?,
            corners: platform_corners(config.platform_sides_m)?,
            sides_m: config.platform_sides_m,
            strokes: config.strokes,
        })
    }

    /// Strokes of slides and legs.
    pub fn strokes(&self) -> &StrokeLimits {
        &self.strokes
    }

    /// Sides of the platform triangle: A₁A₂, A₂A₃, A₃A₁, metres.
    #[inline]
    pub fn platform_sides_m(&self) -> [f64; LEGS] {
        self.sides_m
    }

    /// Distance of the farthest corner from the platform's origin, metres.
    pub fn platform_arm_m(&self) -> f64 {
        self.corners.iter().map(Vec3::norm).fold(0.0, f64::max)
    }

    /// Corners A₁, A₂, A₃ in the platform frame, metres.
    pub fn platform_corners(&self) -> &[Vec3; LEGS] {
        &self.corners
    }

    /// Hinges Bᵢ in the base frame for slide displacements, metres.
    #[inline]
    pub fn hinge(&self, leg: usize, slide_m: f64) -> Vec3 {
        self.slides[leg].centre + self.slides[leg].along * slide_m
    }

    /// The slide's direction ûᵢ in the base frame.
    #[inline]
    pub fn slide_direction(&self, leg: usize) -> Vec3 {
        self.slides[leg].along
    }

    /// The horizontal direction v̂ᵢ = −r̂ᵢ from which θᵢ is measured, base frame.
    #[inline]
    pub fn inward_direction(&self, leg: usize) -> Vec3 {
        self.slides[leg].inward
    }

    /// Corners A₁, A₂, A₃ in the base frame from actuators and leg angles:
    /// Aᵢ = Bᵢ + lᵢ (−cos θᵢ r̂ᵢ + sin θᵢ ẑ).
    #[inline]
    pub fn corners_from_angles(&self, actuators: &Actuators, theta_rad: &[f64; LEGS]) -> [Vec3; LEGS] {
        std::array::from_fn(|leg| {
            let (sin, cos) = theta_rad[leg].sin_cos();
            let direction = self.slides[leg].inward * cos + Vec3::z() * sin;
            self.hinge(leg, actuators.slide_m[leg]) + direction * actuators.leg_m[leg]
        })
    }

    /// Corners A₁, A₂, A₃ in the base frame at a pose.
    pub fn corners_at(&self, pose: &Pose) -> [Vec3; LEGS] {
        self.corners.map(|corner| pose.rotation * corner + pose.translation.vector)
    }

    /// Joint coordinates that hold the platform at `pose` (platform in the base frame, metres): metres, and angles in
    /// (−π, π].
    ///
    /// ```
    /// use masseter_model::geometry::{Mechanism, MechanismConfig, Pose};
    ///
    /// let mechanism = Mechanism::new(&MechanismConfig::default())?;
    /// let joints = mechanism.inverse(&Pose::translation(0.0, 0.0, 0.268_452_355))?;
    /// assert!((joints.actuators.leg_m[0] - 0.27).abs() < 1e-9);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`InverseError`] for a pose that is not finite, and where a corner lies on its slide's hinge.
    #[doc(alias("inverse kinematics", "IK"))]
    pub fn inverse(&self, pose: &Pose) -> Result<Joints, InverseError> {
        let mut theta_rad = [0.0; LEGS];
        let actuators = self.resolve(&self.corners_at(pose), |leg, [up_m, inward_m], _| {
            theta_rad[leg] = up_m.atan2(inward_m);
        })?;
        Ok(Joints { actuators, theta_rad })
    }

    /// The joints of [`inverse`](Self::inverse) with the legs' directions instead of their angles.
    ///
    /// # Errors
    /// Those of [`inverse`](Self::inverse).
    pub fn legs(&self, pose: &Pose) -> Result<Legs, InverseError> {
        let rotation = pose.rotation.to_rotation_matrix();
        let arms_m = self.corners.map(|corner| rotation * corner);
        let corners = arms_m.map(|arm| arm + pose.translation.vector);
        let mut sin_cos = [(0.0, 0.0); LEGS];
        let actuators = self.resolve(&corners, |leg, [up_m, inward_m], leg_m| {
            sin_cos[leg] = (up_m / leg_m, inward_m / leg_m);
        })?;
        Ok(Legs { actuators, sin_cos, arms_m })
    }

    /// Slides and legs of [`inverse`](Self::inverse) without the angles. The angles take half of the time of
    /// [`inverse`](Self::inverse).
    ///
    /// # Errors
    /// Those of [`inverse`](Self::inverse).
    pub fn actuators(&self, pose: &Pose) -> Result<Actuators, InverseError> {
        self.resolve(&self.corners_at(pose), |_, _, _| {})
    }

    /// Slides and legs for the corners in the base frame. `set_leg` gets each leg: its number, its reach upwards and inwards, and
    /// its length, m.
    #[inline]
    fn resolve(
        &self,
        corners: &[Vec3; LEGS],
        mut set_leg: impl FnMut(usize, [f64; 2], f64),
    ) -> Result<Actuators, InverseError> {
        let mut actuators = Actuators { slide_m: [0.0; LEGS], leg_m: [0.0; LEGS] };
        for (leg, corner) in corners.iter().enumerate() {
            let slide = &self.slides[leg];
            let from_centre = corner - slide.centre;
            let horizontal = from_centre.dot(&slide.inward);
            // `hypot` takes five times as long, and no mechanism is so large that a square overflows.
            let leg_m = (horizontal * horizontal + from_centre.z * from_centre.z).sqrt();
            if !(leg_m.is_finite() && from_centre.iter().all(|x| x.is_finite())) {
                return Err(InverseError::NotFinite);
            }
            if leg_m < SHORTEST_LEG_M {
                return Err(InverseError::NoLength { leg, leg_m });
            }
            actuators.slide_m[leg] = from_centre.dot(&slide.along);
            actuators.leg_m[leg] = leg_m;
            set_leg(leg, [from_centre.z, horizontal], leg_m);
        }
        Ok(actuators)
    }
}

/// The pose of the frame fixed by three corners: origin at their centroid, x towards A₁, z along
/// the normal (A₂−A₁)×(A₃−A₁). The corners must span an area.
#[inline]
pub fn frame_of_corners([a1, a2, a3]: &[Vec3; LEGS]) -> Pose {
    let centroid = (a1 + a2 + a3) / 3.0;
    let z = (a2 - a1).cross(&(a3 - a1)).normalize();
    let x = (a1 - centroid).normalize();
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, z.cross(&x), z]));
    Isometry3::from_parts(Translation3::from(centroid), UnitQuaternion::from_rotation_matrix(&rotation))
}

fn check_sizes(config: &MechanismConfig) -> Result<(), GeometryError> {
    let strokes = &config.strokes;
    let require = |name: &str, range: Range, value_m: f64| {
        let refusal = || GeometryError(format!("{name}: {value_m:e} m; use {range} m"));
        if range.contains(value_m) { Ok(()) } else { Err(refusal()) }
    };
    config
        .slides
        .iter()
        .try_for_each(|slide| slide.check_ranges(|_, range, m| require("slides.centre_m", range, m)))?;
    let mut ends_m = strokes.slide_m.into_iter().chain(strokes.leg_m);
    ends_m.try_for_each(|end_m| require("strokes", Range::Within(-LONGEST_M, LONGEST_M), end_m))?;
    config.check_ranges(require)
}

fn check_strokes(strokes: &StrokeLimits) -> Result<(), GeometryError> {
    let refuse = |name, [lowest_m, highest_m]: [f64; 2], need| {
        Err(GeometryError(format!("strokes.{name}: {lowest_m} to {highest_m} m is no stroke; {need}")))
    };
    if strokes.slide_m[0] >= strokes.slide_m[1] {
        return refuse("slide_m", strokes.slide_m, "the first must be below the second");
    }
    if strokes.leg_m[0] >= strokes.leg_m[1] || strokes.leg_m[0] <= 0.0 {
        return refuse("leg_m", strokes.leg_m, "the first must be above 0 and below the second");
    }
    Ok(())
}

fn resolve_slides(configs: &[SlideConfig; LEGS]) -> Result<[Slide; LEGS], GeometryError> {
    let refuse = |problem: String| Err(GeometryError(format!("slides{problem}")));
    for (leg, SlideConfig { azimuth_deg, .. }) in configs.iter().enumerate() {
        if !azimuth_deg.is_finite() {
            return refuse(format!("[{leg}]: the azimuth is {azimuth_deg}; give a finite number"));
        }
    }
    let slides = configs.map(|config| {
        let (sin, cos) = config.azimuth_deg.to_radians().sin_cos();
        Slide {
            centre: Vec3::new(config.centre_m[0], config.centre_m[1], 0.0),
            along: Vec3::new(cos, sin, 0.0),
            inward: Vec3::new(-sin, cos, 0.0),
        }
    });
    let [b1, b2, b3] = slides.map(|slide| slide.centre);
    let area_m2 = (b2 - b1).cross(&(b3 - b1)).z / 2.0;
    if area_m2.abs() <= LEAST_BASE_M2 {
        let area = format!("(area {:e} m²)", area_m2.abs());
        return refuse(format!(": the three centres lie on one line {area}; spread them around the base"));
    }
    // The platform's corners are numbered counter-clockwise; with clockwise slides the platform would be upside down.
    if area_m2 < 0.0 {
        let remedy = "number the slides counter-clockwise seen from above";
        return refuse(format!(": the three centres go round clockwise; {remedy}"));
    }
    let middle = (b1 + b2 + b3) / 3.0;
    for (leg, slide) in slides.iter().enumerate() {
        if slide.inward.dot(&(middle - slide.centre)) <= 0.0 {
            let azimuth_deg = configs[leg].azimuth_deg;
            return refuse(format!("[{leg}]: with azimuth {azimuth_deg}° the leg leans outward; add 180°"));
        }
    }
    Ok(slides)
}

/// Corners in the platform frame, counter-clockwise seen from +z.
fn platform_corners(sides_m: [f64; LEGS]) -> Result<[Vec3; LEGS], GeometryError> {
    let [a12, a23, a31] = sides_m;
    let x3 = (a12 * a12 + a31 * a31 - a23 * a23) / (2.0 * a12);
    let height_squared = a31 * a31 - x3 * x3;
    if height_squared <= 1e-6 * a31 * a31 {
        let need = "each side must be shorter than the other two together";
        return Err(GeometryError(format!("platform_sides_m: {sides_m:?} close to no triangle; {need}")));
    }
    let flat = [Vec3::zeros(), Vec3::new(a12, 0.0, 0.0), Vec3::new(x3, height_squared.sqrt(), 0.0)];
    let to_platform = frame_of_corners(&flat).inverse();
    Ok(flat.map(|corner| to_platform.rotation * corner + to_platform.translation.vector))
}

#[cfg(test)]
mod tests;
