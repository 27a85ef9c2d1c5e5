//! A bite, and the probe before the first one: phases, desired force and damping, which follow from the measured force.

use masseter_runtime::messages::codes::{Cause, ControllerState};
use masseter_scenario::{BiteProfile, ForceControlConfig, ForceSource, Scenario};

use super::shown_stiffness::ShownStiffness;
use crate::pose_law::{Demand, LawFailed, Notice};

/// Cycles of a fall of the bite force to half when food breaks.
const BREAK_CYCLES: usize = 10;
/// Share of the force left after the break.
const BREAK_SHARE: f64 = 0.5;
/// Cycles at the end of its range after which a load cell counts as full.
pub(super) const FULL_CYCLES: usize = 3;
/// Largest distance and relative speed at which the jaw is back on the motion, m and m/s.
pub(super) const NEAR_M: f64 = 2e-6;
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
pub(super) enum Phase {
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

/// The vertical course of the jaw: height of the motion, way from there to the requested height, and their speeds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Course {
    pub motion_m: f64,
    pub offset_m: f64,
    /// Of the requested height, and of the motion.
    pub speed_m_s: f64,
    pub motion_m_s: f64,
}

/// The present bite.
#[derive(Debug, Clone)]
pub(super) struct Bite {
    pub config: ForceControlConfig,
    period_s: f64,
    /// End of the range of the controlled force, N.
    range_n: f64,
    /// Doubt in a change of the load cell's force, N.
    cell_doubt_n: f64,
    /// Height of the platform in the closed mouth, m.
    closed_m: f64,
    /// The largest stiffness between the teeth so far, from force and height of the jaw.
    pub stiffness: ShownStiffness,
    pub phase: Phase,
    /// Bite forces of the last cycles, the newest first, N.
    bites_n: [f64; BREAK_CYCLES],
    /// Desired bite force, N; 0 between bites.
    pub desired_n: f64,
    /// Doubt in a change of the bite force, N.
    doubt_n: f64,
    pub notice: Option<Notice>,
}

impl Bite {
    pub(super) fn new(scenario: &Scenario, config: ForceControlConfig, closed_m: f64) -> Self {
        let (source_s, delay_s) = (scenario.source_s(&config), scenario.force_delay_s(&config));
        Self {
            config,
            period_s: scenario.period_s(),
            range_n: match config.source {
                ForceSource::Estimate => f64::INFINITY,
                ForceSource::LoadCell => scenario.load_cell.map_or(f64::INFINITY, |cell| cell.range_n),
            },
            cell_doubt_n: CELL_DOUBT * scenario.counted_cell().map_or(0.0, |cell| cell.noise_n),
            closed_m,
            stiffness: ShownStiffness::new(scenario.period_s(), source_s, delay_s),
            phase: Phase::Free,
            bites_n: [0.0; BREAK_CYCLES],
            desired_n: 0.0,
            doubt_n: f64::INFINITY,
            notice: None,
        }
    }

    /// The newest bite force, N.
    pub(super) fn force_n(&self) -> f64 {
        self.bites_n[0]
    }

    /// Takes the newest force, and the requested height at its sample (m). A cycle without a force keeps the last force. A load
    /// cell that stays at the end of its range hides the bite force, so the law fails.
    pub(super) fn observe(&mut self, demand: &Demand, at_sample_m: f64) -> Result<(), LawFailed> {
        let (known_n, doubt_n) = match self.config.source {
            ForceSource::Estimate => (
                demand.external.map(|external| external.bite_n()),
                demand.external.map_or(f64::INFINITY, |external| {
                    self.cell_doubt_n.max(ESTIMATE_DOUBT * external.uncertainty_n)
                }),
            ),
            ForceSource::LoadCell => (demand.load_cell_n, self.cell_doubt_n),
        };
        let bite_n = known_n.unwrap_or(self.force_n());
        self.bites_n.rotate_right(1);
        (self.bites_n[0], self.doubt_n) = (bite_n, doubt_n);
        self.stiffness.take(at_sample_m, bite_n, doubt_n);
        if self.phase == Phase::Free && bite_n < EMPTY_SHARE * self.config.contact_n {
            self.stiffness.forget();
        }
        let is_full = self.bites_n[..FULL_CYCLES].iter().all(|bite_n| bite_n.abs() >= self.range_n);
        if is_full { Err(LawFailed) } else { Ok(()) }
    }

    /// Goes on to the phase of this cycle and its desired force.
    pub(super) fn go_on(&mut self, state: ControllerState, course: &Course) {
        self.phase = self.next_phase(state, course);
        self.desired_n = match self.phase {
            Phase::Biting { time_s } => desired_n(&self.config, time_s),
            Phase::Probing { from, .. } => match (from, &self.config.probe) {
                (Some(_), Some(probe)) => probe.force_n,
                _ => self.config.contact_n,
            },
            Phase::Free | Phase::Opening | Phase::Broken => 0.0,
        };
    }

    /// Whether the force has fallen by a break of the food.
    fn has_broken(&self) -> bool {
        let before_n = self.bites_n[BREAK_CYCLES - 1].min(self.desired_n);
        before_n >= self.config.contact_n && self.force_n() < BREAK_SHARE * before_n
    }

    fn next_phase(&mut self, state: ControllerState, course: &Course) -> Phase {
        let is_running = state == ControllerState::Running;
        // A bite that a slow approach delayed ends with the motion: its turns would press on.
        let may_end = self.config.probe.is_some() || course.offset_m >= 0.0;
        let is_taken_along = course.motion_m_s < -SLOW_M_S && may_end;
        match self.phase {
            // An approach that is not at its end when the motion is must not press on.
            Phase::Free if state == ControllerState::Holding && course.offset_m < -NEAR_M => Phase::Opening,
            Phase::Free => {
                let follows = course.offset_m < 0.0 && course.speed_m_s > 0.0;
                let closes = is_running && (course.motion_m_s > 0.0 || follows);
                match closes && self.force_n() >= self.config.contact_n {
                    false => Phase::Free,
                    true if self.config.probe.is_some() && !self.stiffness.is_probed() => {
                        Phase::Probing { time_s: 0.0, from: None }
                    }
                    true => Phase::Biting { time_s: 0.0 },
                }
            }
            Phase::Probing { .. } | Phase::Biting { .. } if self.has_broken() => Phase::Broken,
            Phase::Probing { .. } if !is_running || is_taken_along => Phase::Opening,
            Phase::Probing { time_s, from } => self.go_on_probing(time_s + self.period_s, from, course),
            Phase::Biting { time_s } => {
                let time_s = time_s + self.period_s;
                let goes_on = is_running && time_s < self.config.bite_s && !is_taken_along;
                if goes_on { Phase::Biting { time_s } } else { Phase::Opening }
            }
            waiting => {
                let is_near = course.offset_m.abs() < NEAR_M;
                let is_slow = (course.speed_m_s - course.motion_m_s).abs() < SLOW_M_S;
                if is_near && is_slow { Phase::Free } else { waiting }
            }
        }
    }

    /// The next phase of a probe. At its end the stiffness is known, and reported if it is far from the stated one.
    fn go_on_probing(&mut self, time_s: f64, from: Option<[f64; 2]>, course: &Course) -> Phase {
        let here = [self.force_n(), course.offset_m + course.motion_m];
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
    pub(super) fn approach_m_s(&self) -> f64 {
        let Some(probe) = &self.config.probe else { return f64::INFINITY };
        let room_n = APPROACH_SHARE * (self.config.peak_n - self.config.contact_n);
        self.stiffness.approach_m_s(room_n).unwrap_or(probe.closing_m_s)
    }

    /// Damping at the last requested height, N per m/s: between food and teeth by the opening of the mouth, and at least what
    /// the shown stiffness needs.
    pub(super) fn damping_n_s_per_m(&self, course: &Course) -> f64 {
        let Self { config, closed_m, .. } = self;
        let opening_m = closed_m - course.motion_m - course.offset_m;
        let share = (opening_m / config.tooth_zone_m).clamp(0.0, 1.0);
        let ratio = config.damping_n_s_per_m / config.tooth_damping_n_s_per_m;
        (config.tooth_damping_n_s_per_m * ratio.powf(share)).max(self.stiffness.least_damping_n_s_per_m())
    }
}

/// The desired bite force of a bite at a time since the contact (s), N.
pub(super) fn desired_n(config: &ForceControlConfig, time_s: f64) -> f64 {
    let share = time_s / config.bite_s;
    let raised = match config.profile {
        BiteProfile::HalfSine => (std::f64::consts::PI * share).sin(),
        BiteProfile::Hold => (share / RAMP_SHARE).min(1.0),
    };
    config.contact_n + (config.peak_n - config.contact_n) * raised
}
