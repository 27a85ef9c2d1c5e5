//! Control of the bite force between the teeth, position control elsewhere.
//!
//! From the contact on, the height of the platform follows an admittance instead of the motion:
//!
//! M v̇ + D v = f_desired − f, with M = D times 3 ms.
//!
//! The speed begins with that of the motion, so that nothing jumps. The damping D grows towards the contact of the
//! teeth, and with the stiffness that the bite shows. A bite ends after its time, at a break of the food, or when the opening motion reaches the jaw. After that
//! the jaw does not close. The jaw waits, gives way to more than the force of contact, and follows the motion again
//! when the motion opens. As an option, the lateral position follows the same admittance in a bite, towards a lateral
//! force in proportion to the desired bite force. All other freedoms follow the motion. Limit of stability:
//! `docs/dynamics-control.md`.

mod bite;
mod shown_stiffness;

use masseter_model::geometry::{Pose, Vec3};
use masseter_runtime::{control::NoBranch, named::Declared};
use masseter_scenario::{ForceControlConfig, MOST_LEAD_CYCLES, Scenario};
use nalgebra::{Translation3, Vector2};

use crate::pose_law::{Demand, Detour, LawFailed, Notice, PoseLaw};
use crate::{forces::signal, pose_control::PoseControl};
use bite::{Bite, Course, NEAR_M, Phase};

/// Time constant of the jaw's approach to the opening motion, s.
const CATCH_UP_S: f64 = 0.02;

/// The law with its memory.
#[derive(Debug, Clone)]
pub(crate) struct ForceControl {
    bite: Bite,
    period_s: f64,
    lead_cycles: f64,
    /// Corrects the drives' error of the requested pose.
    position: PoseControl,
    /// The last position of the motion, m.
    motion_m: Option<Vec3>,
    /// Velocity of the requested position, and of the motion, m/s.
    speed_m_s: Vec3,
    motion_m_s: Vec3,
    /// Ways from the motion to the requested positions, the newest first, m.
    offsets_m: [Vec3; MOST_LEAD_CYCLES + 1],
    /// Lateral force of the jaw on what it bites, base axes, N.
    lateral_n: Vector2<f64>,
}

impl ForceControl {
    /// The law of a scenario with these values. `closed_m` is the height of the platform in the closed mouth, m.
    pub(crate) fn new(scenario: &Scenario, config: ForceControlConfig, closed_m: f64) -> Self {
        Self {
            bite: Bite::new(scenario, config, closed_m),
            period_s: scenario.period_s(),
            lead_cycles: scenario.controller.lead_cycles,
            position: PoseControl::new(&scenario.controller, scenario.rate_hz),
            motion_m: None,
            speed_m_s: Vec3::zeros(),
            motion_m_s: Vec3::zeros(),
            offsets_m: [Vec3::zeros(); MOST_LEAD_CYCLES + 1],
            lateral_n: Vector2::zeros(),
        }
    }

    /// Takes the newest force and the newest position of the motion.
    fn observe(&mut self, demand: &Demand, at_sample_m: &Vec3) -> Result<(), LawFailed> {
        if let Some(external) = &demand.external {
            let [x_n, y_n, _] = external.force_n;
            self.lateral_n = Vector2::new(-x_n, -y_n);
        }
        let motion_m = demand.ahead.translation.vector;
        let before_m = self.motion_m.replace(motion_m).unwrap_or(motion_m);
        self.motion_m_s = (motion_m - before_m) / self.period_s;
        self.bite.observe(demand, demand.desired.translation.z + at_sample_m.z)
    }

    fn course(&self) -> Course {
        Course {
            motion_m: self.motion_m.map_or(0.0, |motion_m| motion_m.z),
            offset_m: self.offsets_m[0].z,
            speed_m_s: self.speed_m_s.z,
            motion_m_s: self.motion_m_s.z,
        }
    }

    /// Desired lateral force of the jaw, base axes, N.
    fn desired_lateral_n(&self) -> Vector2<f64> {
        let peak_n = self.bite.config.lateral.map_or([0.0; 2], |lateral| lateral.peak_n);
        Vector2::from(peak_n) * (self.bite.desired_n / self.bite.config.peak_n)
    }

    /// Velocity at which the jaw leaves its lateral way from the motion, m/s.
    fn back_to_side_m_s(&self) -> Vector2<f64> {
        // A period that is longer than the time is all of the way.
        (self.offsets_m[0].xy() / CATCH_UP_S.max(self.period_s)).cap_magnitude(self.bite.config.closing_m_s)
    }

    /// The desired velocity in this phase, m/s. A lateral force moves the jaw only in a bite: later nothing holds the jaw
    /// against an error of the estimate.
    fn wanted_m_s(&self) -> Vec3 {
        let (bite, offset_m) = (&self.bite, self.offsets_m[0]);
        let (damping, most_m_s) = (bite.damping_n_s_per_m(&self.course()), bite.config.closing_m_s);
        let back_m_s = self.motion_m_s - self.back_to_side_m_s().push(offset_m.z / CATCH_UP_S);
        match bite.phase {
            // At the end of its reach the jaw goes as fast as the motion.
            Phase::Free => {
                let reached_m_s = self.motion_m_s.z - (offset_m.z + bite.config.reach_m) / CATCH_UP_S;
                let mut back_m_s = back_m_s;
                back_m_s.z = back_m_s.z.min(bite.approach_m_s()).max(reached_m_s);
                back_m_s
            }
            Phase::Probing { .. } | Phase::Biting { .. } => {
                let lateral_m_s = (self.desired_lateral_n() - self.lateral_n) / damping;
                let closing_m_s = ((bite.desired_n - bite.force_n()) / damping).min(most_m_s);
                lateral_m_s.cap_magnitude(most_m_s).push(closing_m_s)
            }
            Phase::Opening | Phase::Broken if offset_m.z < 0.0 => {
                let gives_way_m_s = (bite.force_n() - bite.config.contact_n).max(0.0) / damping;
                Vec3::new(0.0, 0.0, -gives_way_m_s.min(most_m_s))
            }
            Phase::Opening | Phase::Broken => back_m_s,
        }
    }

    /// The next way from the motion, m.
    fn advance(&mut self) -> Result<Vec3, LawFailed> {
        let is_free = self.bite.phase == Phase::Free;
        if is_free && self.offsets_m[0].z.abs() < NEAR_M && self.motion_m_s.z <= self.bite.approach_m_s() {
            // What a bite has left to the side fades out.
            let back_m_s = self.back_to_side_m_s();
            self.speed_m_s = self.motion_m_s - back_m_s.push(0.0);
            return Ok((self.offsets_m[0].xy() - back_m_s * self.period_s).push(0.0));
        }
        let share = self.period_s / (self.period_s + ForceControlConfig::MASS_TIME_S);
        self.speed_m_s += (self.wanted_m_s() - self.speed_m_s) * share;
        let offset_m = self.offsets_m[0] + (self.speed_m_s - self.motion_m_s) * self.period_s;
        let reach_m = self.bite.config.reach_m;
        if offset_m.z > reach_m {
            self.speed_m_s.z = self.speed_m_s.z.min(self.motion_m_s.z);
        }
        // Without lateral control the reach is 0: the jaw keeps to the motion.
        let lateral_reach_m = self.bite.config.lateral.map_or(0.0, |lateral| lateral.reach_m);
        let lateral_m = offset_m.xy();
        if lateral_m.norm() >= lateral_reach_m {
            (self.speed_m_s.x, self.speed_m_s.y) = (self.motion_m_s.x, self.motion_m_s.y);
        }
        // Under a further press, food can push back with any force.
        if offset_m.z < -reach_m && !is_free {
            return Err(LawFailed);
        }
        Ok(lateral_m.cap_magnitude(lateral_reach_m).push(offset_m.z.clamp(-reach_m, reach_m)))
    }

    /// The way from the motion, this many cycles before the coming one, m.
    fn offset_before_m(&self, cycles: f64) -> Vec3 {
        let at = (cycles - 1.0).clamp(0.0, (MOST_LEAD_CYCLES - 1) as f64);
        let (place, share) = (at.floor() as usize, at.fract());
        self.offsets_m[place] + (self.offsets_m[place + 1] - self.offsets_m[place]) * share
    }
}

impl PoseLaw for ForceControl {
    fn command(&mut self, demand: &Demand) -> Result<Pose, LawFailed> {
        let at_sample_m = self.detour().at_sample_m;
        self.observe(demand, &at_sample_m)?;
        let course = self.course();
        self.bite.go_on(demand.state, &course);
        let offset_m = self.advance()?;
        self.offsets_m.rotate_right(1);
        self.offsets_m[0] = offset_m;
        let desired = Translation3::from(at_sample_m) * demand.desired;
        let ahead = Translation3::from(offset_m) * demand.ahead;
        self.position.command(&Demand { desired, ahead, ..*demand })
    }

    fn detour(&self) -> Detour {
        Detour {
            at_sample_m: self.offset_before_m(self.lead_cycles),
            ahead_m_s: self.speed_m_s - self.motion_m_s,
        }
    }

    fn declared(&self) -> Declared {
        let mut signals = vec![
            signal("desired_bite_force_n", "N", "What the bite force is to be; 0 between bites."),
            signal("force_detour_m", "m", "Height asked for above that of the motion."),
            signal("force_stiffness_n_per_m", "N/m", "Stiffness that the bite has shown so far."),
            signal("force_phase", "", "0: position control; 1: force control; 2: opening; 3: food broke."),
        ];
        if self.bite.config.probe.is_some() {
            let about = "Stiffness that a probe has shown; 0 before.";
            signals.push(signal("probed_stiffness_n_per_m", "N/m", about));
        }
        if self.bite.config.lateral.is_some() {
            signals.extend([
                signal(
                    "desired_lateral_force_x_n",
                    "N",
                    "What the lateral force of the jaw along x of the base is to be.",
                ),
                signal("desired_lateral_force_y_n", "N", "The same along y."),
                signal("lateral_detour_x_m", "m", "Way asked for beside the motion along x of the base."),
                signal("lateral_detour_y_m", "m", "The same along y."),
            ]);
        }
        Declared { signals, ..self.position.declared() }
    }

    fn set_parameter(&mut self, place: usize, value: f64) {
        self.position.set_parameter(place, value);
    }

    fn fill_signals(&self, signals: &mut [f64]) {
        let phase = match self.bite.phase {
            Phase::Free => 0.0,
            Phase::Probing { .. } | Phase::Biting { .. } => 1.0,
            Phase::Opening => 2.0,
            Phase::Broken => 3.0,
        };
        let [offset_m, lateral_n] = [self.offsets_m[0], self.desired_lateral_n().push(0.0)];
        let vertical = [self.bite.desired_n, offset_m.z, self.bite.stiffness.n_per_m, phase];
        let probed = self.bite.config.probe.map(|_| self.bite.stiffness.probed_n_per_m());
        let lateral = [lateral_n.x, lateral_n.y, offset_m.x, offset_m.y];
        signals
            .iter_mut()
            .zip(vertical.into_iter().chain(probed).chain(lateral))
            .for_each(|(signal, value)| *signal = value);
    }

    fn take_notice(&mut self) -> Option<Notice> {
        self.bite.notice.take()
    }

    fn branch(&self) -> Result<Box<dyn PoseLaw>, NoBranch> {
        Ok(Box::new(self.clone()))
    }
}

#[cfg(test)]
mod tests;
