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
//! force in proportion to the desired bite force. All other freedoms keep to the motion. Limit of stability:
//! `docs/dynamics-control.md`.

mod shown_stiffness;

use std::f64::consts::PI;

use masseter_model::geometry::{Pose, Vec3};
use masseter_runtime::{
    control::NoBranch,
    messages::codes::{Cause, ControllerState},
    named::Declared,
};
use masseter_scenario::{BiteProfile, ForceControlConfig, ForceSource, MOST_LEAD_CYCLES, Scenario};
use nalgebra::{Translation3, Vector2};

use crate::pose_law::{Demand, Detour, LawFailed, Notice, PoseLaw};
use crate::{forces::signal, pose_control::PoseControl};
use shown_stiffness::ShownStiffness;

/// Cycles of a fall of the bite force to half when food breaks.
const BREAK_CYCLES: usize = 10;
/// Share of the force left after the break.
const BREAK_SHARE: f64 = 0.5;
/// Cycles at the end of its range after which a load cell counts as full.
const FULL_CYCLES: usize = 3;
/// Time constant of the jaw's approach to the opening motion, s.
const CATCH_UP_S: f64 = 0.02;
/// Largest distance and relative speed at which the jaw is back on the motion, m and m/s.
const NEAR_M: f64 = 2e-6;
const SLOW_M_S: f64 = 2e-3;
/// Share of a bite for the ramp of a hold.
const RAMP_SHARE: f64 = 0.1;
/// Share of the estimate's uncertainty that is taken off a change of force. A larger share hides the stiffness of a bite that
/// shakes; a smaller one takes an error of friction, which turns with the motion, for stiffness, and the bite is slower.
const ESTIMATE_DOUBT: f64 = 0.2;
/// Noise of a load cell that is taken off, in standard deviations: more than its peaks in a bite.
const CELL_DOUBT: f64 = 5.0;
/// Duration of a probe, s: half at the force of contact, half at that of the probe. A right damping settles within 20 ms.
const PROBE_S: f64 = 0.3;
/// Share of the force between contact and peak that the approach may add until the loop answers; the rest is for the swing after it.
const APPROACH_SHARE: f64 = 0.5;
/// Share of the force of contact below which nothing is between the teeth.
const EMPTY_SHARE: f64 = 0.5;

/// The source of the jaw's height.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    /// The motion; before a probe, or on hard food, at a limited speed.
    Free,
    /// The force of a probe, for this long, s. Its second half begins with this bite force, N, and height, m.
    Probing { time_s: f64, from: Option<[f64; 2]> },
    /// The force, for this long, s.
    Biting { time_s: f64 },
    /// The motion again, once the motion is further open than the mouth.
    Opening,
    /// The same, after a break of the food.
    Broken,
}

/// The law with its memory.
#[derive(Debug, Clone)]
pub(crate) struct ForceControl {
    config: ForceControlConfig,
    period_s: f64,
    lead_cycles: f64,
    /// End of the range of the controlled force, N.
    range_n: f64,
    /// Doubt in a change of the load cell's force, N.
    cell_doubt_n: f64,
    /// Corrects the drives' error of the requested pose.
    position: PoseControl,
    /// Height of the platform in the closed mouth, m.
    closed_m: f64,
    /// The stiffness of the present bite.
    stiffness: ShownStiffness,
    phase: Phase,
    /// The last position of the motion, m.
    motion_m: Option<Vec3>,
    /// Velocity of the requested position, and of the motion, m/s.
    speed_m_s: Vec3,
    motion_m_s: Vec3,
    /// Ways from the motion to the requested positions, the newest first, m.
    offsets_m: [Vec3; MOST_LEAD_CYCLES + 1],
    /// Lateral force of the jaw on what it bites, base axes, N.
    lateral_n: Vector2<f64>,
    /// Bite forces of the last cycles, the newest first, N.
    bites_n: [f64; BREAK_CYCLES],
    /// Desired bite force, N; 0 between bites.
    desired_n: f64,
    /// Doubt in a change of the bite force, N.
    doubt_n: f64,
    notice: Option<Notice>,
}

impl ForceControl {
    /// The law of a scenario with these values. `closed_m` is the height of the platform in the closed mouth, m.
    pub(crate) fn new(scenario: &Scenario, config: ForceControlConfig, closed_m: f64) -> Self {
        Self {
            config,
            period_s: scenario.period_s(),
            lead_cycles: scenario.controller.lead_cycles,
            range_n: match config.source {
                ForceSource::Estimate => f64::INFINITY,
                ForceSource::LoadCell => scenario.load_cell.map_or(f64::INFINITY, |cell| cell.range_n),
            },
            cell_doubt_n: CELL_DOUBT * scenario.counted_cell().map_or(0.0, |cell| cell.noise_n),
            position: PoseControl::new(&scenario.controller, scenario.rate_hz),
            closed_m,
            stiffness: ShownStiffness::new(
                scenario.period_s(),
                scenario.source_s(&config),
                scenario.force_delay_s(&config),
            ),
            phase: Phase::Free,
            motion_m: None,
            speed_m_s: Vec3::zeros(),
            motion_m_s: Vec3::zeros(),
            offsets_m: [Vec3::zeros(); MOST_LEAD_CYCLES + 1],
            lateral_n: Vector2::zeros(),
            bites_n: [0.0; BREAK_CYCLES],
            desired_n: 0.0,
            doubt_n: f64::INFINITY,
            notice: None,
        }
    }

    fn bite_n(&self) -> f64 {
        self.bites_n[0]
    }

    /// Takes the newest force and the newest position of the motion. A cycle without a force keeps the last force. A load
    /// cell that stays at the end of its range hides the bite force, so the law fails.
    fn observe(&mut self, demand: &Demand) -> Result<(), LawFailed> {
        let known_n = match self.config.source {
            ForceSource::Estimate => demand.external.map(|external| external.bite_n()),
            ForceSource::LoadCell => demand.load_cell_n,
        };
        let bite_n = known_n.unwrap_or(self.bite_n());
        self.bites_n.rotate_right(1);
        self.bites_n[0] = bite_n;
        if let Some(external) = &demand.external {
            let [x_n, y_n, _] = external.force_n;
            self.lateral_n = Vector2::new(-x_n, -y_n);
        }
        let motion_m = demand.ahead.translation.vector;
        let before_m = self.motion_m.replace(motion_m).unwrap_or(motion_m);
        self.motion_m_s = (motion_m - before_m) / self.period_s;
        self.doubt_n = match self.config.source {
            ForceSource::Estimate => demand.external.map_or(f64::INFINITY, |external| {
                self.cell_doubt_n.max(ESTIMATE_DOUBT * external.uncertainty_n)
            }),
            ForceSource::LoadCell => self.cell_doubt_n,
        };
        let at_sample_m = demand.desired.translation.z + self.detour().at_sample_m.z;
        self.stiffness.take(at_sample_m, bite_n, self.doubt_n);
        if self.phase == Phase::Free && bite_n < EMPTY_SHARE * self.config.contact_n {
            self.stiffness.forget();
        }
        let is_full = self.bites_n[..FULL_CYCLES].iter().all(|bite_n| bite_n.abs() >= self.range_n);
        if is_full { Err(LawFailed) } else { Ok(()) }
    }

    /// Whether the force has fallen by a break of the food.
    fn has_broken(&self) -> bool {
        let before_n = self.bites_n[BREAK_CYCLES - 1].min(self.desired_n);
        before_n >= self.config.contact_n && self.bite_n() < BREAK_SHARE * before_n
    }

    fn next_phase(&mut self, state: ControllerState) -> Phase {
        let is_running = state == ControllerState::Running;
        // A bite that a slow approach delayed ends with the motion: its turns would press on.
        let may_end = self.config.probe.is_some() || self.offsets_m[0].z >= 0.0;
        let is_taken_along = self.motion_m_s.z < -SLOW_M_S && may_end;
        match self.phase {
            // An approach that is not at its end when the motion is must not press on.
            Phase::Free if state == ControllerState::Holding && self.offsets_m[0].z < -NEAR_M => {
                Phase::Opening
            }
            Phase::Free => {
                let follows = self.offsets_m[0].z < 0.0 && self.speed_m_s.z > 0.0;
                let closes = is_running && (self.motion_m_s.z > 0.0 || follows);
                match closes && self.bite_n() >= self.config.contact_n {
                    false => Phase::Free,
                    true if self.config.probe.is_some() && !self.stiffness.is_probed() => {
                        Phase::Probing { time_s: 0.0, from: None }
                    }
                    true => Phase::Biting { time_s: 0.0 },
                }
            }
            Phase::Probing { .. } | Phase::Biting { .. } if self.has_broken() => Phase::Broken,
            Phase::Probing { .. } if !is_running || is_taken_along => Phase::Opening,
            Phase::Probing { time_s, from } => self.go_on_probing(time_s + self.period_s, from),
            Phase::Biting { time_s } => {
                let time_s = time_s + self.period_s;
                let goes_on = is_running && time_s < self.config.bite_s && !is_taken_along;
                if goes_on { Phase::Biting { time_s } } else { Phase::Opening }
            }
            waiting => {
                let is_near = self.offsets_m[0].z.abs() < NEAR_M;
                let is_slow = (self.speed_m_s - self.motion_m_s).z.abs() < SLOW_M_S;
                if is_near && is_slow { Phase::Free } else { waiting }
            }
        }
    }

    /// The next phase of a probe. At its end the stiffness is known, and reported if it is far from the stated one.
    fn go_on_probing(&mut self, time_s: f64, from: Option<[f64; 2]>) -> Phase {
        let here = [self.bite_n(), self.offsets_m[0].z + self.motion_m.map_or(0.0, |motion_m| motion_m.z)];
        let from = from.or((time_s >= PROBE_S / 2.0).then_some(here));
        let Some([from_n, from_m]) = from.filter(|_| time_s >= PROBE_S) else {
            return Phase::Probing { time_s, from };
        };
        let Some(shown_n_per_m) = self.stiffness.take_probe(here[0] - from_n, here[1] - from_m, self.doubt_n)
        else {
            return Phase::Opening;
        };
        let config = &self.config;
        let is_on_teeth = self.closed_m - here[1] < config.tooth_zone_m;
        let stated_n_per_m =
            if is_on_teeth { config.tooth_stiffness_n_per_m } else { config.food_stiffness_n_per_m };
        let ratio = shown_n_per_m / stated_n_per_m;
        let most = config.probe.map_or(f64::INFINITY, |probe| probe.factor);
        self.notice = (ratio.max(1.0 / ratio) > most).then_some(Notice {
            cause: Cause::WrongStiffness,
            value: shown_n_per_m,
            limit: stated_n_per_m,
        });
        Phase::Biting { time_s: 0.0 }
    }

    /// Largest speed of closing before a contact, m/s: until the loop answers to a contact, the force stays below the peak.
    fn approach_m_s(&self) -> f64 {
        let Some(probe) = &self.config.probe else { return f64::INFINITY };
        let room_n = APPROACH_SHARE * (self.config.peak_n - self.config.contact_n);
        self.stiffness.approach_m_s(room_n).unwrap_or(probe.closing_m_s)
    }

    /// Damping at the last requested height, N per m/s: between food and teeth by the opening of the mouth, and at least what
    /// the shown stiffness needs.
    fn damping_n_s_per_m(&self) -> f64 {
        let Self { config, closed_m, offsets_m, motion_m, .. } = self;
        let opening_m = closed_m - motion_m.map_or(*closed_m, |motion_m| motion_m.z) - offsets_m[0].z;
        let share = (opening_m / config.tooth_zone_m).clamp(0.0, 1.0);
        let ratio = config.damping_n_s_per_m / config.tooth_damping_n_s_per_m;
        (config.tooth_damping_n_s_per_m * ratio.powf(share)).max(self.stiffness.least_damping_n_s_per_m())
    }

    /// Desired lateral force of the jaw, base axes, N.
    fn desired_lateral_n(&self) -> Vector2<f64> {
        let peak_n = self.config.lateral.map_or([0.0; 2], |lateral| lateral.peak_n);
        Vector2::from(peak_n) * (self.desired_n / self.config.peak_n)
    }

    /// Velocity at which the jaw leaves its lateral way from the motion, m/s.
    fn back_to_side_m_s(&self) -> Vector2<f64> {
        (self.offsets_m[0].xy() / CATCH_UP_S).cap_magnitude(self.config.closing_m_s)
    }

    /// The desired velocity in this phase, m/s. A lateral force moves the jaw only in a bite: later nothing holds the jaw
    /// against an error of the estimate.
    fn wanted_m_s(&self) -> Vec3 {
        let (offset_m, damping) = (self.offsets_m[0], self.damping_n_s_per_m());
        let most_m_s = self.config.closing_m_s;
        let back_m_s = self.motion_m_s - self.back_to_side_m_s().push(offset_m.z / CATCH_UP_S);
        match self.phase {
            // At the end of its reach the jaw goes as fast as the motion.
            Phase::Free => {
                let reached_m_s = self.motion_m_s.z - (offset_m.z + self.config.reach_m) / CATCH_UP_S;
                let mut back_m_s = back_m_s;
                back_m_s.z = back_m_s.z.min(self.approach_m_s()).max(reached_m_s);
                back_m_s
            }
            Phase::Probing { .. } | Phase::Biting { .. } => {
                let lateral_m_s = (self.desired_lateral_n() - self.lateral_n) / damping;
                let closing_m_s = ((self.desired_n - self.bite_n()) / damping).min(most_m_s);
                lateral_m_s.cap_magnitude(most_m_s).push(closing_m_s)
            }
            Phase::Opening | Phase::Broken if offset_m.z < 0.0 => {
                let gives_way_m_s = (self.bite_n() - self.config.contact_n).max(0.0) / damping;
                Vec3::new(0.0, 0.0, -gives_way_m_s.min(most_m_s))
            }
            Phase::Opening | Phase::Broken => back_m_s,
        }
    }

    /// The next way from the motion, m.
    fn advance(&mut self) -> Result<Vec3, LawFailed> {
        let is_free = self.phase == Phase::Free;
        if is_free && self.offsets_m[0].z.abs() < NEAR_M && self.motion_m_s.z <= self.approach_m_s() {
            // What a bite has left to the side fades out.
            let back_m_s = self.back_to_side_m_s();
            self.speed_m_s = self.motion_m_s - back_m_s.push(0.0);
            return Ok((self.offsets_m[0].xy() - back_m_s * self.period_s).push(0.0));
        }
        let share = self.period_s / (self.period_s + ForceControlConfig::MASS_TIME_S);
        self.speed_m_s += (self.wanted_m_s() - self.speed_m_s) * share;
        let offset_m = self.offsets_m[0] + (self.speed_m_s - self.motion_m_s) * self.period_s;
        let reach_m = self.config.reach_m;
        if offset_m.z > reach_m {
            self.speed_m_s.z = self.speed_m_s.z.min(self.motion_m_s.z);
        }
        // Without lateral control the reach is 0: the jaw keeps to the motion.
        let lateral_reach_m = self.config.lateral.map_or(0.0, |lateral| lateral.reach_m);
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
        self.observe(demand)?;
        self.phase = self.next_phase(demand.state);
        self.desired_n = match self.phase {
            Phase::Biting { time_s } => desired_n(&self.config, time_s).unwrap_or(0.0),
            Phase::Probing { from, .. } => match (from, &self.config.probe) {
                (Some(_), Some(probe)) => probe.force_n,
                _ => self.config.contact_n,
            },
            Phase::Free | Phase::Opening | Phase::Broken => 0.0,
        };
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
        if self.config.lateral.is_some() {
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
        let phase = match self.phase {
            Phase::Free => 0.0,
            Phase::Probing { .. } | Phase::Biting { .. } => 1.0,
            Phase::Opening => 2.0,
            Phase::Broken => 3.0,
        };
        let [offset_m, lateral_n] = [self.offsets_m[0], self.desired_lateral_n().push(0.0)];
        let vertical = [self.desired_n, offset_m.z, self.stiffness.n_per_m, phase];
        let lateral = [lateral_n.x, lateral_n.y, offset_m.x, offset_m.y];
        signals
            .iter_mut()
            .zip(vertical.into_iter().chain(lateral))
            .for_each(|(signal, value)| *signal = value);
    }

    fn take_notice(&mut self) -> Option<Notice> {
        self.notice.take()
    }

    fn branch(&self) -> Result<Box<dyn PoseLaw>, NoBranch> {
        Ok(Box::new(self.clone()))
    }
}

/// The desired bite force at a time since the contact (s), N; none after the bite.
fn desired_n(config: &ForceControlConfig, time_s: f64) -> Option<f64> {
    let share = time_s / config.bite_s;
    let raised = match config.profile {
        BiteProfile::HalfSine => (PI * share).sin(),
        BiteProfile::Hold => (share / RAMP_SHARE).min(1.0),
    };
    (share < 1.0).then_some(config.contact_n + (config.peak_n - config.contact_n) * raised)
}

#[cfg(test)]
mod tests;
