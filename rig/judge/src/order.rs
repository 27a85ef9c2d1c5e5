//! The order of the controller's states: when its motion has to begin, and what is out of order.

use std::fmt::{self, Display, Formatter};

use masseter_model::geometry::AXES;
use masseter_runtime::messages::Reading;
use masseter_runtime::messages::codes::ControllerState;
use masseter_runtime::named::{Declared, PlayedMotion};
use masseter_scenario::Scenario;

use crate::poses::{MOVING, are_enabled};

/// Cycles of the lead-in beside the move to the first pose.
const MORE_CYCLES: f64 = 3.0;

/// What is out of order in the states of a controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Disorder {
    /// It was never in the state `running`.
    NeverBegan,
    /// It was in the state `running` before all drives were enabled.
    BeforeDrives,
    /// After the drives were enabled it went back to an earlier state.
    Back {
        /// The state before.
        from: ControllerState,
        /// The earlier state.
        to: ControllerState,
    },
}

impl Display for Disorder {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::NeverBegan => {
                f.write_str("the controller never began the motion: it was never in the state running")
            }
            Self::BeforeDrives => {
                f.write_str("the controller began the motion before all drives were enabled")
            }
            Self::Back { from, to } => write!(f, "the controller went back from the state {from} to {to}"),
        }
    }
}

/// Follows the states, cycle by cycle.
#[derive(Debug, Clone, Default)]
pub(crate) struct StateOrder {
    /// An own motion may hold and go on.
    is_own: bool,
    lead_in_cycles: u64,
    /// Cycles with a complete reading of enabled drives.
    ready_cycles: u64,
    were_enabled: bool,
    state: Option<ControllerState>,
    has_run: bool,
    /// The first, and when it was, ns of the run's clock.
    disorder: Option<(Disorder, Option<u64>)>,
}

impl StateOrder {
    pub(crate) fn new(scenario: &Scenario, declared: &Declared) -> Self {
        let lead_in_cycles = (scenario.controller.ease_s / scenario.period_s() + MORE_CYCLES).ceil() as u64;
        Self { is_own: declared.motion == PlayedMotion::Own, lead_in_cycles, ..Self::default() }
    }

    /// Takes a cycle. `is_counted`: whether no loop lost it.
    pub(crate) fn advance(&mut self, state: Option<u32>, reading: Option<&Reading>, is_counted: bool) {
        let are_enabled = reading.map(are_enabled);
        self.were_enabled |= are_enabled == Some(true);
        let is_complete =
            are_enabled == Some(true) && reading.is_some_and(|of| of.fresh_axes == (1 << AXES) - 1);
        self.ready_cycles += u64::from(is_counted && is_complete);
        let Some(to) = state.and_then(|code| ControllerState::try_from(code).ok()) else { return };
        let from = self.state.replace(to).unwrap_or(to);
        self.has_run |= to == ControllerState::Running;
        let is_before_drives = to == ControllerState::Running && !self.were_enabled && are_enabled.is_some();
        let is_early = |state: ControllerState| state.code() < ControllerState::Easing.code();
        let is_pause = self.is_own && MOVING.contains(&from) && MOVING.contains(&to);
        let is_back = to.code() < from.code() && !is_early(from) && !is_pause;
        let found = is_back.then_some(Disorder::Back { from, to });
        let found = if is_before_drives { Some(Disorder::BeforeDrives) } else { found };
        self.disorder = self.disorder.or(found.map(|found| (found, reading.map(|of| of.sampled_ns))));
    }

    /// Whether the controller is in a state before the motion.
    pub(crate) fn is_before_motion(&self) -> bool {
        !self.has_run && self.state.is_some_and(|state| state.code() <= ControllerState::Easing.code())
    }

    /// Whether the lead-in is over, and the controller has not begun its motion.
    pub(crate) fn is_overdue(&self) -> bool {
        self.is_before_motion() && self.ready_cycles > self.lead_in_cycles
    }

    /// What is out of order first, and when.
    pub(crate) fn disorder(&self) -> Option<(Disorder, Option<u64>)> {
        self.disorder.or((!self.has_run).then_some((Disorder::NeverBegan, None)))
    }
}
