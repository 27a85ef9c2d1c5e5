//! The power stage of an axis: its state, and the conditions for a change of state.

use masseter_can::cia402::{DriveState, StateCommand};

use crate::SECOND_NS;
use crate::faults::{DriveFault, DriveFaults};

/// The power stage.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(crate) struct PowerStage {
    pub(crate) state: DriveState,
    /// The state that follows once the axis stands: 605Bh or 605Ch asks for a ramp.
    pub(super) leaves_for: Option<DriveState>,
    /// Before then the torque is safely off, ns.
    torque_from_ns: u64,
    /// Since when a fault delays "operation enabled", ns.
    enabling_since_ns: Option<u64>,
}

impl PowerStage {
    /// Not ready yet; the torque is safely off until then, ns.
    pub(super) fn new(torque_from_ns: u64) -> Self {
        let state = DriveState::NotReadyToSwitchOn;
        Self { state, leaves_for: None, torque_from_ns, enabling_since_ns: None }
    }

    /// Whether the axis has current.
    pub(crate) fn is_enabled(self) -> bool {
        self.state == DriveState::OperationEnabled
    }

    /// Whether the axis follows its mode of operation.
    pub(super) fn is_operated(self) -> bool {
        self.is_enabled() && self.leaves_for.is_none()
    }

    pub(crate) fn is_in_fault(self) -> bool {
        matches!(self.state, DriveState::FaultReactionActive | DriveState::Fault)
    }

    /// The state after a command; `None` if the torque is still off after power-on.
    pub(super) fn after(
        &mut self,
        command: StateCommand,
        holds_quick_stop: bool,
        now_ns: u64,
        faults: &mut DriveFaults,
    ) -> Option<DriveState> {
        let next = if holds_quick_stop {
            self.state.after_in_held_quick_stop(command)
        } else {
            self.state.after(command)
        };
        // The drive does not leave "switch on disabled" while the torque is safely off.
        let leaves_off = self.state == DriveState::SwitchOnDisabled && next != self.state;
        let is_kept_off = leaves_off && faults.strike(DriveFault::Sto);
        let next = if is_kept_off { self.state } else { self.delayed(next, now_ns, faults) };
        let is_torque_off = next == DriveState::ReadyToSwitchOn && now_ns < self.torque_from_ns;
        (!is_torque_off).then_some(next)
    }

    /// The next state, where an injected fault delays "operation enabled".
    fn delayed(&mut self, next: DriveState, now_ns: u64, faults: &mut DriveFaults) -> DriveState {
        let delay_s = faults.size(DriveFault::SlowEnable);
        let is_enabling = next == DriveState::OperationEnabled && !self.is_enabled();
        let Some(delay_s) = delay_s.filter(|_| is_enabling) else {
            self.enabling_since_ns = None;
            return next;
        };
        let since_ns = *self.enabling_since_ns.get_or_insert(now_ns);
        if now_ns - since_ns >= (delay_s * SECOND_NS as f64) as u64 {
            return next;
        }
        faults.strike(DriveFault::SlowEnable);
        match self.state {
            DriveState::ReadyToSwitchOn => DriveState::SwitchedOn,
            state => state,
        }
    }

    /// The state forced by an injected fault without torque: "switch on disabled", or fault.
    pub(super) fn without_torque(self, faults: &mut DriveFaults) -> Option<DriveState> {
        use DriveState::{
            Fault, FaultReactionActive, OperationEnabled, QuickStopActive, ReadyToSwitchOn, SwitchOnDisabled,
            SwitchedOn,
        };
        if !faults.has(DriveFault::Sto) {
            return None;
        }
        let state = match self.state {
            ReadyToSwitchOn | SwitchedOn | OperationEnabled | QuickStopActive => SwitchOnDisabled,
            FaultReactionActive => Fault,
            _ => return None,
        };
        faults.strike(DriveFault::Sto);
        Some(state)
    }
}
