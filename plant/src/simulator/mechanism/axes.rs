//! The axes between drives and platform: friction, end stops, play, and what faults make of them.
//!
//! Each part states its force in a step as an [`Element`]; their sums enter the equations of motion. The masses of the
//! axes are not part of this module, but for the drives' sides of loose joints.

use masseter_model::dynamics::AxesConfig;
use masseter_model::geometry::{AXES, LEGS, Mechanism};
use nalgebra::Vector6;

use super::friction::{Braking, CONTACT, Element, Spring};

/// The axes d₁ d₂ d₃ l₁ l₂ l₃.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct Axes {
    pub(crate) each: [Axis; AXES],
}

/// What faults make of an axis.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct AxisFaults {
    /// Whether its guide has seized.
    pub(crate) is_jammed: bool,
    /// The factor on its friction.
    pub(crate) friction: f64,
    /// The play of its joint in place of what it is built with, m; infinite where the rod is broken.
    pub(crate) play_m: Option<f64>,
    /// Between the hard stops in its way, m.
    pub(crate) free_m: [f64; 2],
}

impl AxisFaults {
    /// An axis without faults.
    pub(crate) const NONE: Self =
        Self { is_jammed: false, friction: 1.0, play_m: None, free_m: [f64::NEG_INFINITY, f64::INFINITY] };
}

/// One axis.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct Axis {
    pub(crate) faults: AxisFaults,
    /// Which hard stops of faults it touched since their last change: the lower one, the upper one.
    pub(crate) touched: [bool; 2],
    mass_kg: f64,
    play_m: f64,
    /// Behind the ends of the stroke.
    ends: Stops,
    seizure: Option<Seizure>,
    coupling: Coupling,
    is_at_end: bool,
    hit_m_s: Option<f64>,
}

/// The motion of an axis at the beginning of a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct AxisMotion {
    pub(super) position_m: f64,
    pub(super) speed_m_s: f64,
}

/// The forces of the axes in a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct AxesForces {
    /// On the moving bodies while the speeds stay, those of the drives included, N.
    pub(super) force_n: Vector6<f64>,
    /// Mass of the drives' sides, which the axes do not move, kg.
    pub(super) parted_kg: Vector6<f64>,
    /// What the change of the axes' speeds acts against like a mass, kg.
    pub(super) resisting_kg: Vector6<f64>,
}

impl Axes {
    /// The axes of a mechanism at rest in these positions (m), with their masses.
    pub(super) fn new(
        config: &AxesConfig,
        mechanism: &Mechanism,
        positions_m: [f64; AXES],
        masses_kg: &Vector6<f64>,
    ) -> Self {
        let steel = Spring {
            stiffness_n_per_m: config.stop_stiffness_n_per_m,
            damping_n_s_per_m: config.stop_damping_n_s_per_m,
        };
        let axis = |axis: usize| {
            let [low_m, high_m] = mechanism.strokes().of_axis(axis);
            let ends_m = [low_m - config.stop_beyond_m, high_m + config.stop_beyond_m];
            Axis {
                faults: AxisFaults::NONE,
                touched: [false; 2],
                mass_kg: masses_kg[axis],
                play_m: if axis < LEGS { config.slide_play_m } else { config.leg_play_m },
                ends: Stops::between(ends_m, steel),
                seizure: None,
                coupling: Coupling::Rigid { beyond_m: 0.0 },
                is_at_end: false,
                hit_m_s: None,
            }
        };
        let mut axes = Self { each: std::array::from_fn(axis) };
        for (axis, position_m) in axes.each.iter_mut().zip(positions_m) {
            axis.loosen_as_built(AxisMotion { position_m, speed_m_s: 0.0 });
        }
        axes
    }

    /// The next axis that has run into an end of its own, with its speed, m/s.
    pub(crate) fn take_stop_hit(&mut self) -> Option<(usize, f64)> {
        self.each.iter_mut().enumerate().find_map(|(axis, faults)| Some((axis, faults.hit_m_s.take()?)))
    }

    /// Where the encoders see the axes: at the drives' side of each joint, m.
    pub(super) fn drive_positions_m(&self, joints_m: [f64; AXES]) -> [f64; AXES] {
        std::array::from_fn(|axis| self.each[axis].coupling.drive_m(joints_m[axis]))
    }

    /// The axes' forces in a step, with those of the drives (N).
    pub(super) fn act(
        &mut self,
        drives_n: &[f64; AXES],
        positions_m: [f64; AXES],
        speeds_m_s: &Vector6<f64>,
        braking: &Braking,
        step_s: f64,
    ) -> AxesForces {
        let mut forces = AxesForces {
            force_n: Vector6::zeros(),
            parted_kg: Vector6::zeros(),
            resisting_kg: Vector6::zeros(),
        };
        let coulomb_n = braking.coulomb_n();
        for (number, axis) in self.each.iter_mut().enumerate() {
            let motion = AxisMotion { position_m: positions_m[number], speed_m_s: speeds_m_s[number] };
            let mut element = axis.act(drives_n[number], motion, step_s);
            element +=
                braking.on_axis(number, coulomb_n[number], motion.speed_m_s, axis.faults.friction, step_s);
            forces.force_n[number] = element.force_n;
            forces.parted_kg[number] = axis.coupling.parted_kg();
            forces.resisting_kg[number] = element.damping_n_s_per_m * step_s;
        }
        forces
    }

    /// Solves the drives' sides for a step at whose end the axes have these speeds, m/s.
    pub(super) fn solve_drive_sides(&mut self, speeds_m_s: &Vector6<f64>) {
        for (axis, speed_m_s) in self.each.iter_mut().zip(speeds_m_s) {
            axis.coupling.solve_drive_side(*speed_m_s);
        }
    }

    /// Moves the drives' sides.
    pub(super) fn advance(&mut self, dt_s: f64) {
        self.each.iter_mut().for_each(|axis| axis.coupling.advance(dt_s));
    }
}

impl Axis {
    /// From now on faults make this of it.
    pub(super) fn set_faults(&mut self, faults: AxisFaults, motion: AxisMotion) {
        let AxisMotion { position_m, speed_m_s } = motion;
        let before = std::mem::replace(&mut self.faults, faults);
        self.touched = [false; 2];
        self.seizure = faults.is_jammed.then(|| self.seizure.unwrap_or(Seizure::at(position_m)));
        match faults.play_m {
            _ if faults.play_m == before.play_m => {}
            Some(play_m) => self.coupling.loosen(play_m, self.mass_kg, position_m, speed_m_s),
            None => {
                self.coupling.tighten(position_m);
                self.loosen_as_built(motion);
            }
        }
    }

    /// Gives the joint the play that it has without faults.
    fn loosen_as_built(&mut self, AxisMotion { position_m, speed_m_s }: AxisMotion) {
        if self.play_m > 0.0 {
            self.coupling.loosen(self.play_m, self.mass_kg, position_m, speed_m_s);
        }
    }

    /// The force on the axis in a step, without friction.
    fn act(
        &mut self,
        drive_n: f64,
        AxisMotion { position_m, speed_m_s }: AxisMotion,
        step_s: f64,
    ) -> Element {
        let mut element = self.coupling.push(drive_n, position_m, speed_m_s, step_s);
        if let Some(seizure) = &mut self.seizure {
            element += seizure.hold(position_m, speed_m_s, step_s);
        }
        if let Some(contact) = Stops::steel(self.faults.free_m).touch(position_m, speed_m_s, step_s) {
            self.touched[usize::from(contact.force_n < 0.0)] = true;
            element += contact;
        }
        let contact = self.ends.touch(position_m, speed_m_s, step_s);
        if contact.is_some() && !self.is_at_end {
            self.hit_m_s = Some(speed_m_s);
        }
        self.is_at_end = contact.is_some();
        element += contact.unwrap_or_default();
        element
    }
}

/// The drive's share of the axis' mass: of a slide, the carriage.
const DRIVE_SHARE: f64 = 0.75;
/// Friction of the drive's side, N per m/s.
const DRIVE_DAMPING_N_S_PER_M: f64 = 20.0;

/// The joint.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(super) enum Coupling {
    /// The drive's side is that far beyond the joint, m.
    Rigid { beyond_m: f64 },
    /// The drive's side moves by itself.
    Loose(DriveSide),
}

/// The drive's side of a loose joint.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(super) struct DriveSide {
    /// Half of the play, m; infinite where nothing connects the sides.
    half_m: f64,
    /// Where the middle of the play is beyond the joint, m.
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
    /// Where the drive's side is while the joint is at a position, m.
    pub(super) fn drive_m(&self, joint_m: f64) -> f64 {
        match self {
            Self::Rigid { beyond_m } => joint_m + beyond_m,
            Self::Loose(side) => side.position_m,
        }
    }

    /// Gets loose, with that play.
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
        let (mass_kg, acceleration_m_s2, step) = (DRIVE_SHARE * axis_mass_kg, 0.0, Step::default());
        *self = Self::Loose(DriveSide {
            half_m,
            beyond_m,
            mass_kg,
            position_m,
            speed_m_s,
            acceleration_m_s2,
            step,
        });
    }

    /// Gets rigid where it is.
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

    /// The force on the joint in a step in which the drive has a force. The joint is there in the middle of the step.
    pub(super) fn push(&mut self, force_n: f64, joint_m: f64, joint_m_s: f64, step_s: f64) -> Element {
        match self {
            Self::Rigid { .. } => Element { force_n, damping_n_s_per_m: 0.0 },
            Self::Loose(side) => side.push(force_n, joint_m, joint_m_s, step_s),
        }
    }

    /// Solves the drive's side, now that the joint's speed at the end of the step is known.
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
    /// The drive's side obeys m (v′ − v)/h = F − b v′ − c. The force of the contact is c = k g + d (v′ − q̇′), where g is
    /// by how much the gap is closed.
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

    /// By how much the play is closed, and the contact's damping in the step. The first is positive if the drive
    /// pushes upwards. Both are zero if the sides do not touch before the end of the step.
    fn contact(&self, ahead_m: f64, joint_m_s: f64, step_s: f64) -> (f64, f64) {
        let next_m = ahead_m + step_s * (self.speed_m_s - joint_m_s);
        if next_m.abs() <= self.half_m {
            return (0.0, 0.0);
        }
        let damping = CONTACT.damping_n_s_per_m + CONTACT.stiffness_n_per_m * step_s;
        (ahead_m - self.half_m.copysign(next_m), damping)
    }
}

/// The largest force of a seized guide, N.
const MOST_N: f64 = 2000.0;

/// A seized guide.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(super) struct Seizure {
    held_at_m: f64,
}

impl Seizure {
    /// A guide that seizes at a position.
    pub(super) fn at(position_m: f64) -> Self {
        Self { held_at_m: position_m }
    }

    /// The force on the axis in a step.
    pub(super) fn hold(&mut self, position_m: f64, speed_m_s: f64, step_s: f64) -> Element {
        // The spring slides along where it is stretched by more than the largest force takes.
        let most_m = MOST_N / CONTACT.stiffness_n_per_m;
        let stretch_m = (position_m - self.held_at_m).clamp(-most_m, most_m);
        self.held_at_m = position_m - stretch_m;
        let held = Element::spring(CONTACT, stretch_m, speed_m_s, step_s);
        if held.force_n.abs() <= MOST_N {
            return held;
        }
        // The largest damping with which the force stays the largest one and the axis does not turn back.
        let damping_n_s_per_m = held.damping_n_s_per_m.min(MOST_N / speed_m_s.abs());
        Element { force_n: held.force_n.clamp(-MOST_N, MOST_N), damping_n_s_per_m }
    }
}

/// Two stops.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(super) struct Stops {
    low_m: f64,
    high_m: f64,
    spring: Spring,
}

impl Stops {
    /// Stops at these positions, of a stiffness and a damping.
    pub(super) fn between([low_m, high_m]: [f64; 2], spring: Spring) -> Self {
        Self { low_m, high_m, spring }
    }

    /// Stops of steel at these positions.
    pub(super) fn steel(ends_m: [f64; 2]) -> Self {
        Self::between(ends_m, CONTACT)
    }

    /// The force on the axis in a step; none where the axis touches no stop before its end.
    pub(super) fn touch(&self, position_m: f64, speed_m_s: f64, step_s: f64) -> Option<Element> {
        let next_m = position_m + speed_m_s * step_s;
        let (into_m, away) = if next_m > self.high_m {
            (position_m - self.high_m, -1.0)
        } else if next_m < self.low_m {
            (position_m - self.low_m, 1.0)
        } else {
            return None;
        };
        let contact = Element::spring(self.spring, into_m, speed_m_s, step_s);
        (contact.force_n * away > 0.0).then_some(contact)
    }
}

#[cfg(test)]
mod coupling_tests {
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

#[cfg(test)]
mod seizure_tests {
    use super::*;

    /// Where a mass is, and how fast, after so many steps of 125 µs under a load.
    fn after(steps: usize, mass_kg: f64, start_m_s: f64, load_n: f64) -> (f64, f64) {
        const STEP_S: f64 = 1.25e-4;
        let mut seizure = Seizure::at(0.0);
        let (mut position_m, mut speed_m_s) = (0.0, start_m_s);
        for _ in 0..steps {
            let Element { force_n, damping_n_s_per_m } = seizure.hold(position_m, speed_m_s, STEP_S);
            speed_m_s += STEP_S * (force_n + load_n) / (mass_kg + STEP_S * damping_n_s_per_m);
            position_m += STEP_S * speed_m_s;
        }
        (position_m, speed_m_s)
    }

    #[test]
    fn it_holds_a_load_without_creeping_and_yields_to_more_than_two_kilonewtons() {
        // A load that comes at once stretches the spring for a moment by up to twice as much.
        for mass_kg in [0.01, 0.4, 3.0] {
            let (position_m, speed_m_s) = after(8000, mass_kg, 0.0, 900.0);
            assert!((position_m - 0.9e-4).abs() < 1e-6 && speed_m_s.abs() < 1e-6, "{mass_kg}: {position_m}");
        }
        let (position_m, _) = after(800, 1.0, 0.0, 2200.0);
        assert!(position_m > 0.5, "200 N accelerate a kilogram for 0.1 s: {position_m}");
    }

    #[test]
    fn it_stops_a_moving_axis_without_throwing_it_back() {
        for mass_kg in [0.01, 0.4, 3.0] {
            let (position_m, speed_m_s) = after(800, mass_kg, 0.4, 0.0);
            assert!(speed_m_s.abs() < 1e-5, "{mass_kg} kg: {speed_m_s}");
            assert!((-1e-4..4e-4).contains(&position_m), "{mass_kg} kg: {position_m}");
        }
    }
}

#[cfg(test)]
mod stops_tests {
    use super::*;

    #[test]
    fn they_push_back_and_never_pull() {
        let stops = Stops::steel([-0.01, 0.01]);
        let force_n = |position_m, speed_m_s| {
            stops.touch(position_m, speed_m_s, 1e-4).map_or(0.0, |contact| contact.force_n)
        };
        for (position_m, speed_m_s) in [(0.0, 0.0), (0.0099, 0.0), (0.0095, 0.4), (0.01001, -0.4)] {
            assert!(stops.touch(position_m, speed_m_s, 1e-4).is_none(), "{position_m}");
        }
        assert!(force_n(0.01001, 0.0) < -90.0 && force_n(-0.01001, 0.0) > 90.0);
        assert!(force_n(0.00999, 0.4) < -100.0, "it is there within the step");
    }
}
