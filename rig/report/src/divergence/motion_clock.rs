//! Time since the start of the motion, from the states and events of a recording.

use masseter_recording::Recorded;
use masseter_runtime::messages::State;
use masseter_runtime::messages::codes::{ControllerState, EventKind, Source};

/// What tells the time of a cycle.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct MotionClock {
    /// Cycle and deadline of the first state, ns.
    first: Option<(u64, u64)>,
    period_ns: Option<u64>,
    /// The cycle in which the motion began.
    running_from: Option<u64>,
    /// The newest cycle.
    pub(super) cycle: u64,
}

impl MotionClock {
    pub(super) fn take(&mut self, message: &Recorded) {
        match message {
            Recorded::State(state) => self.take_state(state),
            // A thinned recording has all events, and few states.
            Recorded::Event(event)
                if event.source == Source::Controller.code()
                    && event.kind == EventKind::Transition.code()
                    && event.to == ControllerState::Running.code() =>
            {
                self.running_from.get_or_insert(event.cycle);
            }
            _ => {}
        }
    }

    fn take_state(&mut self, state: &State) {
        self.cycle = state.cycle;
        let (first_cycle, first_ns) = *self.first.get_or_insert((state.cycle, state.due_ns));
        let cycles = state.cycle.saturating_sub(first_cycle);
        self.period_ns =
            self.period_ns.or_else(|| (state.due_ns.saturating_sub(first_ns)).checked_div(cycles));
        if state.controller_state == ControllerState::Running.code() {
            self.running_from.get_or_insert(state.cycle);
        }
    }

    /// The time of a cycle since the motion began, s; negative before. None without a motion.
    pub(super) fn motion_s(&self, cycle: u64) -> Option<f64> {
        let cycles = cycle as f64 - self.running_from? as f64;
        Some(cycles * self.period_ns? as f64 / 1e9)
    }
}
