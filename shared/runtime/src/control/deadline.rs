//! The end of a run whose controller waits for ever: it never begins the motion, or never ends.
//!
//! The plant counts, and not the accused. What the end means for the verdict is the judge's.

use masseter_scenario::{MotionConfig, Scenario};

use crate::{messages::codes::ControllerState, named::Declared};

/// How long a controller may take, by its own waits and moves, the motion, and `controller.overdue_s` beyond.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deadline {
    /// From the first SYNC to the state `running`, s.
    pub begin_s: f64,
    /// From there to the controller's end, s.
    pub end_s: f64,
    period_s: f64,
    /// The first cycle in which the controller says `running`, or a later state.
    began_cycle: Option<u64>,
}

impl Deadline {
    /// The deadline of a motion that lasts `motion_s` at its full rate. A controller with the parameter `motion_rate` may slow
    /// the motion down.
    pub fn new(scenario: &Scenario, declared: &Declared, motion_s: f64) -> Self {
        let Scenario { controller, can, .. } = scenario;
        let slowest =
            if declared.place_of("motion_rate").is_ok() { MotionConfig::MOST_DURATIONS } else { 1.0 };
        let enabled_s = 2.0 * controller.start_timeout_s + can.longest_enabling_s();
        let stopped_s = controller.stop_ramp_s + controller.hold_s + controller.start_timeout_s;
        Self {
            begin_s: enabled_s + controller.ease_s + controller.overdue_s,
            end_s: slowest * motion_s + stopped_s + scenario.observation_s() + controller.overdue_s,
            period_s: scenario.period_s(),
            began_cycle: None,
        }
    }

    /// Takes the state, as a code, that the controller's command of this cycle says.
    pub fn note(&mut self, cycle: u64, state: u32) {
        if state >= ControllerState::Running.code() {
            self.began_cycle.get_or_insert(cycle);
        }
    }

    /// Whether the controller is overdue in this cycle.
    pub fn is_over(&self, cycle: u64) -> bool {
        let (from, limit_s) = self.began_cycle.map_or((0, self.begin_s), |began| (began, self.end_s));
        cycle.saturating_sub(from) as f64 * self.period_s > limit_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::named::Parameter;

    #[test]
    fn a_controller_has_its_waits_its_motion_and_the_time_beyond() {
        let scenario = Scenario::default();
        let slowed = Declared { parameters: vec![Parameter::new("motion_rate", 1.0)], ..Declared::default() };
        let [plain, slowed] =
            [Declared::default(), slowed].map(|declared| Deadline::new(&scenario, &declared, 4.0));
        let overdue_s = scenario.controller.overdue_s;
        let waits_s = 2.0 * 5.0 + scenario.can.longest_enabling_s();
        assert!((plain.begin_s - (waits_s + 1.0 + overdue_s)).abs() < 1e-9, "{plain:?}");
        assert!((plain.end_s - (4.0 + 0.3 + 0.2 + 5.0 + overdue_s)).abs() < 1e-9, "{plain:?}");
        assert!((slowed.end_s - plain.end_s - 9.0 * 4.0).abs() < 1e-9, "{slowed:?}");
    }

    #[test]
    fn it_counts_to_the_beginning_and_from_there_to_the_end() {
        let deadline = Deadline { begin_s: 2.0, end_s: 3.0, period_s: 0.001, began_cycle: None };
        let after = |states: &[(u64, ControllerState)]| {
            let mut deadline = deadline;
            for (cycle, state) in states {
                deadline.note(*cycle, state.code());
            }
            deadline
        };
        let waits = after(&[(1, ControllerState::WaitReadings), (1900, ControllerState::Easing)]);
        assert!(!waits.is_over(2000) && waits.is_over(2001));
        let runs = after(&[(1900, ControllerState::Running), (3000, ControllerState::Easing)]);
        assert!(!runs.is_over(4900) && runs.is_over(4901));
        assert!(after(&[(9, ControllerState::Finished)]).is_over(3010));
    }
}
