//! How the drives met the demands while the motion played.

use masseter_model::geometry::AXES;
use masseter_runtime::messages::codes::ControllerState;
use masseter_runtime::messages::{Command, Reading};
use masseter_scenario::Scenario;

use crate::by_cycle::ByCycle;

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
#[derive(Debug, Clone)]
pub(super) struct AxisWatch {
    /// From a command to the reading of the position that its targets lead to.
    lead_cycles: u64,
    targets_m: ByCycle<[f64; AXES]>,
    /// Positions and forces.
    found: ByCycle<([f64; AXES], [f64; AXES])>,
    figures: [AxisFigures; AXES],
}

impl AxisWatch {
    pub(super) fn new(scenario: &Scenario) -> Self {
        Self {
            lead_cycles: scenario.controller.lead_cycles.round() as u64,
            targets_m: ByCycle::default(),
            found: ByCycle::default(),
            figures: Default::default(),
        }
    }

    pub(super) fn command(&mut self, command: &Command) {
        if command.controller_state == ControllerState::Running.code() {
            self.targets_m.insert(command.cycle, command.target_m);
            self.compare(command.cycle);
        }
    }

    pub(super) fn reading(&mut self, reading: &Reading) {
        self.found.insert(reading.cycle, (reading.position_m, reading.force_n));
        self.compare(reading.cycle.saturating_sub(self.lead_cycles));
    }

    /// Compares the targets of a cycle with the positions that they led to, once both are known.
    fn compare(&mut self, cycle: u64) {
        let pair = self.targets_m.get(cycle).zip(self.found.get(cycle + self.lead_cycles));
        let Some((targets_m, (positions_m, forces_n))) = pair else { return };
        let is_there = |cycle: u64| {
            self.targets_m.get(cycle).is_some() && self.found.get(cycle + self.lead_cycles).is_some()
        };
        if !(cycle.saturating_sub(UNDISTURBED)..cycle).all(is_there) {
            return;
        }
        for (axis, figures) in self.figures.iter_mut().enumerate() {
            let error_m = (targets_m[axis] - positions_m[axis]).abs();
            figures.following_error_m = figures.following_error_m.max(error_m);
            figures.force_n = figures.force_n.max(forces_n[axis].abs());
        }
    }

    pub(super) fn finish(self) -> [AxisFigures; AXES] {
        self.figures
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive that lags by 1 µm, and by 1 mm just after a lost reading.
    #[test]
    fn targets_are_compared_with_the_positions_two_cycles_later_unless_a_cycle_was_lost() {
        let mut watch = AxisWatch::new(&Scenario::default());
        let controller_state = ControllerState::Running.code();
        for cycle in 1..=60_u64 {
            let target_m = [cycle as f64 * 1e-3; AXES];
            watch.command(&Command { cycle, target_m, controller_state, ..Command::default() });
            let late_m = if (31..40).contains(&cycle) { 1e-3 } else { 1e-6 };
            let position_m = [cycle.saturating_sub(2) as f64 * 1e-3 - late_m; AXES];
            if cycle != 30 {
                watch.reading(&Reading { cycle, position_m, force_n: [-7.0; AXES], ..Reading::default() });
            }
        }
        let [figures, ..] = watch.finish();
        assert!((figures.following_error_m - 1e-6).abs() < 1e-12, "{figures:?}");
        assert!((figures.force_n - 7.0).abs() < 1e-12);
    }
}
