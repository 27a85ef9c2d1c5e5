//! Proof, by interval arithmetic, that inputs have at most one true solution.
//!
//! [`Proof::examine`] takes a box of inputs and encloses every solution in it that meets the
//! conditions. If the slopes of the three equations over that enclosure form a regular
//! matrix, then no input in the box has two: with solutions h ≠ h′, the slopes S between them would
//! give S (h − h′) = 0. Otherwise the box stays undecided, and the caller examines its
//! [halves](InputBox::halves).
//!
//! Halving and pruning enclose the reaches h of all its solutions:
//! - A part of h-space is removed when a side cannot close in it, or a condition cannot hold.
//! - Krawczyk's operator −Y E(m) + (1 − Y S)(h − m) shrinks a part. It contains every solution, because the
//!   slopes S contain every difference.
//!
//! The proof does not show that a solution exists. The dimensions of the mechanism count as exact numbers.

use masseter_model::geometry::{AXES, Actuators, LEGS, Mechanism, Vec3};
use nalgebra::Matrix3;

use crate::enclosure::Enclosure;

/// Most parts of h-space examined for one box of inputs; the limit bounds the time only.
const MOST_PARTS: usize = 20_000;
/// Parts narrower than this share of the inputs' own width are not halved again.
const FINE_ENOUGH: f64 = 0.5;
/// Nor are parts narrower than this, metres: the slopes decide on the remaining parts.
const FINEST_M: f64 = 5e-4;
/// A shrinking step that leaves more than this share of the width is not repeated.
const WORTH_REPEATING: f64 = 0.8;

/// A box of inputs: an interval for each axis d₁ d₂ d₃ l₁ l₂ l₃, metres; lᵢ must be positive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InputBox {
    pub(crate) axes: [Enclosure; AXES],
}

impl InputBox {
    /// The same interval for all slides, and one for all legs, metres.
    pub fn uniform(slide_m: [f64; 2], leg_m: [f64; 2]) -> Self {
        let interval = |[low, high]: [f64; 2]| Enclosure::new(low, high);
        Self { axes: std::array::from_fn(|axis| interval(if axis < LEGS { slide_m } else { leg_m })) }
    }

    /// All inputs that differ from one by at most this in each axis.
    pub(crate) fn around(input: &Actuators, by_m: f64) -> Self {
        Self { axes: input.to_axes().map(|axis_m| Enclosure::new(axis_m - by_m, axis_m + by_m)) }
    }

    /// The smallest box that contains both.
    pub(crate) fn hull(&self, other: &Self) -> Self {
        Self { axes: std::array::from_fn(|axis| self.axes[axis].hull(other.axes[axis])) }
    }

    /// The length of the widest axis, metres.
    pub(crate) fn width_m(&self) -> f64 {
        self.axes.iter().map(|axis| axis.width()).fold(0.0, f64::max)
    }

    /// The two halves along the widest axis.
    pub(crate) fn halves(&self) -> [Self; 2] {
        halves_of_widest(self.axes).map(|axes| Self { axes })
    }
}

/// The two halves of a box along its widest side.
fn halves_of_widest<const N: usize>(sides: [Enclosure; N]) -> [[Enclosure; N]; 2] {
    let widest = (0..N).fold(0, |a, b| if sides[b].width() > sides[a].width() { b } else { a });
    sides[widest].halves().map(|half| {
        let mut part = sides;
        part[widest] = half;
        part
    })
}

/// The leg at the far end of the side that starts at this one.
fn next(leg: usize) -> usize {
    (leg + 1) % LEGS
}

/// Reaches hᵢ = lᵢ cos θᵢ, metres.
pub(crate) type Reaches = [Enclosure; LEGS];

/// The verdict on a box of inputs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Finding {
    /// No input in the box has a solution of this kind.
    NoSolution,
    /// No input in the box has more than one solution of this kind.
    AtMostOne,
    /// Neither is proven. The reaches of all solutions of this kind lie in this box.
    Undecided(Reaches),
}

/// Which solutions of which mechanism must be unique: those above the base that meet the paper's two conditions, with the
/// platform's plane oriented.
#[derive(Debug)]
pub(crate) struct Proof<'a> {
    pub mechanism: &'a Mechanism,
    /// Of these, only those whose [determinant](masseter_controller::kinematics::Solution::determinant) is at least this.
    pub margin: Option<f64>,
}

/// All reaches of legs of these lengths: the start of the search.
pub(crate) fn any_reaches(inputs: &InputBox) -> Reaches {
    std::array::from_fn(|leg| Enclosure::new(-inputs.axes[LEGS + leg].high, inputs.axes[LEGS + leg].high))
}

impl Proof<'_> {
    /// Examines a box of inputs; `within` must contain the reaches of all its solutions.
    pub(crate) fn examine(&self, inputs: &InputBox, within: &Reaches) -> Finding {
        let Some(parts) = self.parts(inputs, within) else { return Finding::Undecided(*within) };
        let hull = |a: Reaches, b: &Reaches| std::array::from_fn(|leg| a[leg].hull(b[leg]));
        match parts.split_first() {
            None => Finding::NoSolution,
            Some((first, others)) => {
                let all = others.iter().fold(*first, hull);
                if self.is_regular(inputs, &all) { Finding::AtMostOne } else { Finding::Undecided(all) }
            }
        }
    }

    /// Parts of h-space that together contain all solutions; none when there are too many parts.
    fn parts(&self, inputs: &InputBox, within: &Reaches) -> Option<Vec<Reaches>> {
        let finest_m = FINEST_M.max(FINE_ENOUGH * inputs.width_m());
        let (mut open, mut kept) = (vec![*within], Vec::new());
        let mut looked_at = 0;
        while let Some(part) = open.pop() {
            looked_at += 1;
            if looked_at > MOST_PARTS {
                return None;
            }
            let Some(part) = self.shrunk(inputs, part) else { continue };
            if part.iter().all(|side| side.width() <= finest_m) {
                kept.push(part);
            } else {
                open.extend(halves_of_widest(part));
            }
        }
        Some(kept)
    }

    /// The portion of a part that may contain solutions; none when no portion does.
    fn shrunk(&self, inputs: &InputBox, part: Reaches) -> Option<Reaches> {
        let mut part = part;
        loop {
            let platforms = Platforms::new(self.mechanism, inputs, &part)?;
            if !self.may_count(&platforms) {
                return None;
            }
            let smaller = self.contracted(inputs, &platforms, &part)?;
            // Also false for a leg without width, which no step makes narrower.
            let shrinks = |leg: usize| smaller[leg].width() < WORTH_REPEATING * part[leg].width();
            let repeats = (0..LEGS).all(shrinks);
            part = smaller;
            if !repeats {
                return Some(part);
            }
        }
    }

    /// Whether a platform in this enclosure may be a solution of this kind.
    fn may_count(&self, platforms: &Platforms) -> bool {
        let closes = platforms.excess_m2(self.mechanism).iter().all(|excess| excess.contains(0.0));
        closes && platforms.may_stand_as_assembled(self.mechanism) && self.may_be_conditioned(platforms)
    }

    fn may_be_conditioned(&self, platforms: &Platforms) -> bool {
        let Some(margin) = self.margin else { return true };
        let slopes = platforms.slopes(self.mechanism);
        let determinant = slopes.and_then(|slopes| platforms.determinant(self.mechanism, &slopes));
        determinant.is_none_or(|determinant| determinant.high >= margin)
    }

    /// Krawczyk's operator: the unchanged part when the operator does not apply, none when no solution is left.
    fn contracted(&self, inputs: &InputBox, platforms: &Platforms, part: &Reaches) -> Option<Reaches> {
        let middle = part.map(|reach_m| Enclosure::point(reach_m.middle()));
        let at_middle = Platforms::new(self.mechanism, inputs, &middle);
        let preconditioned = platforms.slopes(self.mechanism).and_then(|slopes| Preconditioned::new(&slopes));
        let (Some(at_middle), Some(preconditioned)) = (at_middle, preconditioned) else { return Some(*part) };
        let excess_m2 = at_middle.excess_m2(self.mechanism);
        let mut smaller = *part;
        for leg in 0..LEGS {
            let mut reach_m = middle[leg];
            for column in 0..LEGS {
                reach_m = reach_m - excess_m2[column] * preconditioned.inverse[(leg, column)];
                reach_m = reach_m + preconditioned.defect[leg][column] * (part[column] - middle[column]);
            }
            smaller[leg] = reach_m.intersection(part[leg])?;
        }
        Some(smaller)
    }

    /// Whether all matrices within the slopes are regular.
    fn is_regular(&self, inputs: &InputBox, all: &Reaches) -> bool {
        let slopes = Platforms::new(self.mechanism, inputs, all)
            .and_then(|platforms| platforms.slopes(self.mechanism));
        slopes.and_then(|slopes| Preconditioned::new(&slopes)).is_some_and(|matrix| matrix.is_regular())
    }
}

/// The slopes' matrix S, multiplied by an approximate inverse Y of its middle.
struct Preconditioned {
    inverse: Matrix3<f64>,
    /// 1 − Y S.
    defect: [[Enclosure; LEGS]; LEGS],
}

impl Preconditioned {
    fn new(slopes: &Slopes) -> Option<Self> {
        let mut middle = Matrix3::zeros();
        for side in 0..LEGS {
            middle[(side, side)] = slopes.near_m[side].middle();
            middle[(side, next(side))] = slopes.far_m[side].middle();
        }
        let inverse = middle.try_inverse().filter(|inverse| inverse.iter().all(|x| x.is_finite()))?;
        // Column i of S has the near slope of side i and the far slope of the side before.
        let defect = std::array::from_fn(|row| {
            std::array::from_fn(|leg| {
                let before = (leg + LEGS - 1) % LEGS;
                let entry =
                    slopes.near_m[leg] * inverse[(row, leg)] + slopes.far_m[before] * inverse[(row, before)];
                Enclosure::point(f64::from(u8::from(row == leg))) - entry
            })
        });
        Some(Self { inverse, defect })
    }

    /// ‖1 − Y S‖ < 1 for every S leaves none of them singular.
    fn is_regular(&self) -> bool {
        self.defect.iter().all(|row| {
            let sum = row.iter().map(|entry| Enclosure::point(entry.magnitude()));
            sum.reduce(|a, b| a + b).is_some_and(|sum| sum.high < 1.0)
        })
    }
}

/// Enclosures of all positions of the platform's corners for every input in a box and every reach in a box.
///
/// A leg's *reach* is the horizontal part of the leg, h = l cos θ. Its height is z = l sin θ. Above the
/// base z = √(l² − h²), so Aᵢ = Bᵢ + hᵢ v̂ᵢ + zᵢ ẑ contains no sine and no cosine. Side k from leg i = k to
/// leg j = k + 1 closes where ½(|Aᵢ − Aⱼ|² − L²) = 0.
///
/// Hypotheses for two solutions of one input:
/// - They share d and l. Therefore z − z′ = σ (h − h′) with σ = −(h + h′)/(z + z′).
/// - C and W are the means of their horizontal and vertical differences Aᵢ − Aⱼ.
///
/// Result: the difference of the side's equation is *exactly* nᵢ (hᵢ − hᵢ′) + fⱼ (hⱼ − hⱼ′), with
/// n = C·v̂ᵢ + W σᵢ and f = −(C·v̂ⱼ + W σⱼ).
///
/// The means C and W, and −σ as a quotient of means, lie in every box that contains both solutions. So
/// [`Slopes`] encloses the derivatives and also the slopes between any two solutions. The mechanism's
/// dimensions count as exact.
#[allow(clippy::struct_field_names)] // Units are part of a name.
#[derive(Debug, Clone, Copy)]
struct Platforms {
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
struct Slopes {
    near_m: [Enclosure; LEGS],
    far_m: [Enclosure; LEGS],
}

/// With a horizontal vector.
fn dot(a: [Enclosure; 2], b: &Vec3) -> Enclosure {
    a[0] * b.x + a[1] * b.y
}

impl Platforms {
    /// None when a leg is shorter than its reach for every input: no such platform exists.
    fn new(mechanism: &Mechanism, inputs: &InputBox, reach_m: &[Enclosure; LEGS]) -> Option<Self> {
        let mut height_m = *reach_m;
        for leg in 0..LEGS {
            height_m[leg] = (inputs.axes[LEGS + leg].square() - reach_m[leg].square()).square_root()?;
        }
        let corner = |leg: usize| {
            let (along, inward) = (mechanism.slide_direction(leg), mechanism.inward_direction(leg));
            let centre_m = mechanism.hinge(leg, 0.0);
            [0, 1].map(|axis| {
                inputs.axes[leg] * along[axis]
                    + reach_m[leg] * inward[axis]
                    + Enclosure::point(centre_m[axis])
            })
        };
        let corners: [_; LEGS] = std::array::from_fn(corner);
        let across_m =
            std::array::from_fn(|side| [0, 1].map(|axis| corners[side][axis] - corners[next(side)][axis]));
        let rise_m = std::array::from_fn(|side| height_m[side] - height_m[next(side)]);
        Some(Self {
            reach_m: *reach_m,
            height_m,
            leg_m: std::array::from_fn(|leg| inputs.axes[LEGS + leg]),
            across_m,
            rise_m,
        })
    }

    /// ½(|Aᵢ − Aⱼ|² − L²) of each side, m².
    fn excess_m2(&self, mechanism: &Mechanism) -> [Enclosure; LEGS] {
        let sides_m = mechanism.platform_sides_m();
        std::array::from_fn(|side| {
            let [x, y] = self.across_m[side];
            let square = x.square() + y.square() + self.rise_m[side].square();
            (square - Enclosure::point(sides_m[side]).square()) * 0.5
        })
    }

    /// None when a leg may be horizontal: there z is not a smooth function of h.
    fn slopes(&self, mechanism: &Mechanism) -> Option<Slopes> {
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
    fn may_stand_as_assembled(&self, mechanism: &Mechanism) -> bool {
        let [[x12, y12], [x23, y23], [x31, y31]] = self.across_m;
        let [z12, _, z31] = self.rise_m;
        // (A₂ − A₁) × (A₃ − A₁), where A₂ − A₁ is minus side 12 and A₃ − A₁ is side 31.
        let normal = [z12 * y31 - y12 * z31, x12 * z31 - z12 * x31];
        let normal_up = y12 * x31 - x12 * y31;
        let below = |leg: usize| {
            let along_leg = self.reach_m[leg] * dot(normal, &mechanism.inward_direction(leg));
            (along_leg + self.height_m[leg] * normal_up).high > 0.0
        };
        (0..LEGS).all(below) && dot([x23, y23], &mechanism.slide_direction(0)).high > 0.0
    }

    /// The [determinant](masseter_controller::kinematics::Solution::determinant) of every platform in this enclosure.
    fn determinant(&self, mechanism: &Mechanism, slopes: &Slopes) -> Option<Enclosure> {
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
    use masseter_controller::kinematics::Solutions;
    use masseter_model::geometry::{MechanismConfig, SlideConfig};
    use proptest::prelude::*;

    use super::*;

    fn published_mechanism() -> Mechanism {
        Mechanism::new(&MechanismConfig::default()).expect("the default is a mechanism")
    }

    /// Mechanisms like the paper's with every dimension off: no equal sides, no even azimuths.
    fn mechanisms() -> impl Strategy<Value = Mechanism> {
        let slide = |azimuth: f64| {
            (0.05..0.065f64, -8.0..8.0f64, -6.0..6.0f64).prop_map(move |(radius, shift, skew)| {
                let (sin, cos) = (azimuth + shift).to_radians().sin_cos();
                let azimuth_deg = azimuth + shift + 90.0 + skew;
                SlideConfig { centre_m: [radius * cos, radius * sin], azimuth_deg }
            })
        };
        let sides = [0.045..0.056f64, 0.045..0.056f64, 0.045..0.056f64];
        (slide(0.0), slide(120.0), slide(240.0), sides).prop_map(|(s1, s2, s3, platform_sides_m)| {
            let config = MechanismConfig { slides: [s1, s2, s3], platform_sides_m, ..Default::default() };
            Mechanism::new(&config).expect("the ranges hold mechanisms only")
        })
    }

    /// An input with two solutions that meet every condition, the determinants being 0.045 and more.
    const AMBIGUOUS: Actuators = Actuators {
        slide_m: [0.010_137_353_810_067_46, 0.015_926_592_372_227_42, 0.020_840_656_757_742_57],
        leg_m: [0.246_449_456_124_783_5, 0.287_523_749_262_044_8, 0.270_252_791_539_176_8],
    };

    fn examine(margin: Option<f64>, actuators: &Actuators, radius_m: f64) -> Finding {
        let inputs = InputBox::around(actuators, radius_m);
        Proof { mechanism: &published_mechanism(), margin }.examine(&inputs, &any_reaches(&inputs))
    }

    #[test]
    fn inputs_near_the_neutral_one_have_at_most_one() {
        let neutral = Actuators { slide_m: [0.0; LEGS], leg_m: [0.27; LEGS] };
        assert_eq!(examine(None, &neutral, 1e-3), Finding::AtMostOne);
        let tilted = Actuators { slide_m: [0.005, -0.004, 0.003], leg_m: [0.26, 0.27, 0.275] };
        assert_eq!(examine(None, &tilted, 1e-3), Finding::AtMostOne);
    }

    #[test]
    fn nothing_is_proven_where_two_true_solutions_are_known() {
        let known = Solutions::new(&published_mechanism(), &AMBIGUOUS).unwrap();
        assert_eq!(known.true_ones().count(), 2);
        for margin in [None, Some(0.0), Some(0.04)] {
            for radius_m in [1e-9, 1e-6, 1e-4] {
                let Finding::Undecided(within) = examine(margin, &AMBIGUOUS, radius_m) else {
                    panic!("{margin:?} within {radius_m} m")
                };
                assert!(within[0].width() < 0.1, "the search gave up: {margin:?}, {radius_m} m");
                for one in known.true_ones() {
                    for (leg, reach_m) in within.iter().enumerate() {
                        assert!(reach_m.contains(AMBIGUOUS.leg_m[leg] * one.theta_rad[leg].cos()));
                    }
                }
            }
        }
    }

    /// The search of a single point, and of a segment, ends.
    #[test]
    fn reaches_without_width_are_examined_as_any_other() {
        let known = Solutions::new(&published_mechanism(), &AMBIGUOUS).unwrap();
        let one = known.true_ones().next().unwrap();
        let reach_m: [f64; LEGS] = std::array::from_fn(|leg| AMBIGUOUS.leg_m[leg] * one.theta_rad[leg].cos());
        let inputs = InputBox::around(&AMBIGUOUS, 1e-6);
        let mechanism = published_mechanism();
        let proof = Proof { mechanism: &mechanism, margin: None };
        let point = reach_m.map(Enclosure::point);
        assert_eq!(proof.examine(&inputs, &point), Finding::AtMostOne);
        let segment = [Enclosure::new(reach_m[0] - 1e-3, reach_m[0] + 1e-3), point[1], point[2]];
        assert_eq!(proof.examine(&inputs, &segment), Finding::AtMostOne);
    }

    #[test]
    fn a_determinant_between_the_two_settles_the_same_input() {
        let known = Solutions::new(&published_mechanism(), &AMBIGUOUS).unwrap();
        let between = known.true_ones().map(|one| one.determinant).sum::<f64>() / 2.0;
        assert_eq!(examine(Some(between), &AMBIGUOUS, 1e-7), Finding::AtMostOne);
    }

    #[test]
    fn what_cannot_be_assembled_has_no_solution() {
        let apart = Actuators { slide_m: [0.0; LEGS], leg_m: [0.30, 0.30, 0.20] };
        assert_eq!(examine(None, &apart, 1e-3), Finding::NoSolution);
    }

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
            let inputs = InputBox::around(&actuators, margin_m);
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
                        prop_assert!(change.low < 1e-13 && change.high > -1e-13);
                    }
                }
            }
        }
    }
}
