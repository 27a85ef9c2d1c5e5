//! The greatest loads of teeth and drives: what the lower teeth of the emulated jaw bore, and how each drive of a dry run met
//! the demands. Which load is too great is no question here.

use std::collections::VecDeque;

use masseter_model::geometry::AXES;
use masseter_runtime::messages::Contact;
use masseter_scenario::Scenario;
use serde::Serialize;

use crate::{poses::is_running, series::Band, signals::CycleMessages};

/// What the teeth of the emulated jaw bore.
#[derive(Debug, Clone, Default, Serialize)]
pub struct ContactFigures {
    /// The greatest sum of the forces on all teeth, N.
    pub total_max_n: f64,
    /// When that was, ns of the run's clock.
    pub total_max_at_ns: u64,
    /// The lower teeth, in the order of their numbers.
    pub teeth: Vec<ToothFigures>,
    /// What the teeth bore over time, as often as a screen shows it; of a long run not to its end.
    #[serde(skip)]
    pub moments: Vec<ToothLoads>,
    #[serde(skip)]
    frame_ends_s: f64,
}

/// What a tooth bore.
#[derive(Debug, Clone, Default, Serialize)]
pub struct ToothFigures {
    /// FDI number.
    pub number: u32,
    /// Where its force acts, platform frame, m.
    pub place_m: [f64; 3],
    /// The greatest force on it, N.
    pub max_n: f64,
    /// The force on it when the sum of all was greatest, base axes, N.
    pub at_total_max_n: [f64; 3],
    /// The force since the run's first SYNC, N.
    #[serde(skip)]
    pub force_n: Band,
}

/// What the teeth bore when their sum was greatest within the time of a frame on a screen.
#[derive(Debug, Clone, PartialEq)]
pub struct ToothLoads {
    /// When, s since the run's first SYNC.
    pub at_s: f64,
    /// Place of a tooth in the list of teeth, and the force on it, base axes, N; those without a force are left out.
    pub forces_n: Vec<(usize, [f64; 3])>,
    total_n: f64,
}

/// Length of a frame, s, and the frames that are kept.
const FRAME_S: f64 = 1.0 / 60.0;
const MOST_FRAMES: usize = 2048;
/// Less is no force to be shown, N.
const LEAST_N: f64 = 0.1;

impl ContactFigures {
    /// Takes a message, sampled so long after the run's first SYNC; `None` if no course is shown.
    pub(super) fn add_contact(&mut self, contact: &Contact, since_ns: Option<u64>) {
        self.teeth.resize_with(contact.teeth().count(), ToothFigures::default);
        let mut total_n = 0.0;
        for (figures, tooth) in self.teeth.iter_mut().zip(contact.teeth()) {
            let load_n = tooth.load_n();
            total_n += load_n;
            (figures.number, figures.place_m) = (tooth.number, tooth.place_m);
            figures.max_n = figures.max_n.max(load_n);
            if let Some(since_ns) = since_ns {
                figures.force_n.add(since_ns, load_n);
            }
        }
        if let Some(since_ns) = since_ns {
            self.add_moment(since_ns as f64 / 1e9, total_n, contact);
        }
        if total_n > self.total_max_n {
            (self.total_max_n, self.total_max_at_ns) = (total_n, contact.sampled_ns);
            for (figures, tooth) in self.teeth.iter_mut().zip(contact.teeth()) {
                figures.at_total_max_n = tooth.force_n;
            }
        }
    }

    fn add_moment(&mut self, at_s: f64, total_n: f64, contact: &Contact) {
        let is_of_last = at_s < self.frame_ends_s;
        let is_less = self.moments.last().is_some_and(|last| is_of_last && total_n <= last.total_n);
        if total_n < LEAST_N || is_less {
            return;
        }
        if is_of_last {
            self.moments.pop();
        } else if self.moments.len() == MOST_FRAMES {
            return;
        } else {
            self.frame_ends_s = at_s + FRAME_S;
        }
        let loaded = contact.teeth().enumerate().filter(|(_, tooth)| tooth.load_n() >= LEAST_N);
        let forces_n = loaded.map(|(place, tooth)| (place, tooth.force_n)).collect();
        self.moments.push(ToothLoads { at_s, forces_n, total_n });
    }
}

/// Cycles in a row of which every command and reading must be there: a drive settles from a lost one.
const UNDISTURBED: u64 = 12;

/// The largest magnitudes of an axis.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AxisFigures {
    /// Distance of the position from the target that should be reached, m.
    pub following_error_m: f64,
    /// Force of the drive, N.
    pub force_n: f64,
}

/// Collects them.
#[derive(Debug, Clone, Default)]
pub(super) struct AxisWatch {
    /// From a command to the reading of the position that its targets lead to.
    lead_cycles: usize,
    /// The targets whose positions are still to come; none of a cycle without a command of the motion.
    targets_m: VecDeque<Option<[f64; AXES]>>,
    last_cycle: u64,
    /// Cycles in a row with targets and positions.
    undisturbed: u64,
    pub(super) figures: [AxisFigures; AXES],
}

impl AxisWatch {
    pub(super) fn new(scenario: &Scenario) -> Self {
        Self { lead_cycles: scenario.controller.lead_cycles.round() as usize, ..Self::default() }
    }

    /// Takes the next cycle in the order of time.
    pub(super) fn add_cycle(&mut self, messages: &CycleMessages) {
        if std::mem::replace(&mut self.last_cycle, messages.cycle) + 1 != messages.cycle {
            (self.undisturbed, self.targets_m) = (0, VecDeque::new());
        }
        let command = messages.command.filter(|command| is_running(Some(command.controller_state)));
        self.targets_m.push_back(command.map(|command| command.target_m));
        if self.targets_m.len() <= self.lead_cycles {
            return;
        }
        let targets_m = self.targets_m.pop_front().flatten();
        let Some((targets_m, reading)) = targets_m.zip(messages.reading) else {
            self.undisturbed = 0;
            return;
        };
        if self.undisturbed >= UNDISTURBED {
            for (axis, figures) in self.figures.iter_mut().enumerate() {
                let error_m = (targets_m[axis] - reading.position_m[axis]).abs();
                figures.following_error_m = figures.following_error_m.max(error_m);
                figures.force_n = figures.force_n.max(reading.force_n[axis].abs());
            }
        }
        self.undisturbed += 1;
    }
}

#[cfg(test)]
mod tests;
