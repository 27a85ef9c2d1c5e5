//! The drive profile (CiA 402, IEC 61800-7-201): states, statusword, controlword and the state machine between them.
//!
//! Pure values and tables, for both ends: a drive uses [`DriveState::after`], a master uses [`next_controlword`]. T-numbers
//! are the transitions of CiA 402. T0 (power-on) creates the drive. T16 (operation enabled again out of quick stop) exists
//! only where the quick-stop option code 605A makes the drive stay in quick stop.
//! Modes of operation, targets, ramps and the policy of restarting after a fault are not here.

codes! {
    /// State of a drive's power (CiA 402). Code 0 stands for a drive in an unknown state.
    DriveState as u32 {
        /// Initialising.
        NotReadyToSwitchOn = 1 "not_ready_to_switch_on",
        /// No voltage allowed.
        SwitchOnDisabled = 2 "switch_on_disabled",
        /// Voltage may be applied.
        ReadyToSwitchOn = 3 "ready_to_switch_on",
        /// Voltage applied, no force.
        SwitchedOn = 4 "switched_on",
        /// Following targets.
        OperationEnabled = 5 "operation_enabled",
        /// Braking along the quick-stop ramp.
        QuickStopActive = 6 "quick_stop_active",
        /// Reacting to a fault.
        FaultReactionActive = 7 "fault_reaction_active",
        /// In fault, free of force.
        Fault = 8 "fault",
    }
}

/// The command in a controlword.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StateCommand {
    /// To ready to switch on.
    Shutdown,
    /// To switched on. From operation enabled the same bits are "disable operation".
    SwitchOn,
    /// To operation enabled.
    EnableOperation,
    /// To switch on disabled at once, without braking.
    DisableVoltage,
    /// Brake along the quick-stop ramp.
    QuickStop,
    /// Leave fault.
    FaultReset,
}

impl DriveState {
    /// Whether the power stage has voltage: the drive gives force, or does so at the next command.
    pub const fn is_powered(self) -> bool {
        matches!(
            self,
            Self::SwitchedOn | Self::OperationEnabled | Self::QuickStopActive | Self::FaultReactionActive
        )
    }

    /// The state after a command, unchanged for a command without effect.
    ///
    /// Enable operation in ready to switch on performs T3 and, by itself, T4 after it.
    #[must_use]
    #[expect(clippy::match_same_arms, reason = "one line a transition, as the standard numbers them")]
    pub const fn after(self, command: StateCommand) -> Self {
        use DriveState::{
            Fault, OperationEnabled, QuickStopActive, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn,
        };
        use StateCommand::{DisableVoltage, EnableOperation, FaultReset, QuickStop, Shutdown, SwitchOn};
        #[rustfmt::skip]
        let next = match (self, command) {
            (SwitchOnDisabled, Shutdown)                   => ReadyToSwitchOn,  // T2
            (ReadyToSwitchOn, SwitchOn)                    => SwitchedOn,       // T3
            (ReadyToSwitchOn, EnableOperation)             => OperationEnabled, // T3, T4
            (SwitchedOn, EnableOperation)                  => OperationEnabled, // T4
            (OperationEnabled, SwitchOn)                   => SwitchedOn,       // T5
            (SwitchedOn, Shutdown)                         => ReadyToSwitchOn,  // T6
            (ReadyToSwitchOn, DisableVoltage | QuickStop)  => SwitchOnDisabled, // T7
            (OperationEnabled, Shutdown)                   => ReadyToSwitchOn,  // T8
            (OperationEnabled, DisableVoltage)             => SwitchOnDisabled, // T9
            (SwitchedOn, DisableVoltage | QuickStop)       => SwitchOnDisabled, // T10
            (OperationEnabled, QuickStop)                  => QuickStopActive,  // T11
            (QuickStopActive, DisableVoltage)              => SwitchOnDisabled, // T12
            (Fault, FaultReset)                            => SwitchOnDisabled, // T15
            (unmoved, _)                                   => unmoved,
        };
        next
    }

    /// The state after a command to a drive that stays in quick stop until the next command (605A = 5 or 6). This is
    /// [`after`](Self::after) with T16.
    #[must_use]
    pub const fn after_in_held_quick_stop(self, command: StateCommand) -> Self {
        match (self, command) {
            (Self::QuickStopActive, StateCommand::EnableOperation) => Self::OperationEnabled,
            _ => self.after(command),
        }
    }

    /// The state after the detection of a fault (T13).
    #[must_use]
    pub const fn after_fault(self) -> Self {
        match self {
            Self::Fault => Self::Fault,
            _ => Self::FaultReactionActive,
        }
    }

    /// The state after the drive's own task in this state: initialising (T1), the quick-stop ramp (T12), the reaction
    /// to a fault (T14). Other states have no such task.
    #[must_use]
    pub const fn after_completion(self) -> Self {
        match self {
            Self::NotReadyToSwitchOn | Self::QuickStopActive => Self::SwitchOnDisabled,
            Self::FaultReactionActive => Self::Fault,
            unmoved => unmoved,
        }
    }
}

/// The bits of the statusword that encode the state, and their value in each state.
const PATTERNS: [(u16, u16, DriveState); 8] = [
    (0x4F, 0x00, DriveState::NotReadyToSwitchOn),
    (0x4F, 0x40, DriveState::SwitchOnDisabled),
    (0x6F, 0x21, DriveState::ReadyToSwitchOn),
    (0x6F, 0x23, DriveState::SwitchedOn),
    (0x6F, 0x27, DriveState::OperationEnabled),
    (0x6F, 0x07, DriveState::QuickStopActive),
    (0x4F, 0x0F, DriveState::FaultReactionActive),
    (0x4F, 0x08, DriveState::Fault),
];

/// A bit of the statusword that is not part of the state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum StatusBit {
    /// The power stage has voltage.
    VoltageEnabled = 4,
    /// A warning is present; the state is unchanged.
    Warning = 7,
    /// The drive obeys the controlword.
    Remote = 9,
    /// Profile position and homing: the target is reached.
    TargetReached = 10,
    /// An internal limit is active, such as the software position limit 607D.
    #[doc(alias = "internal limit active")]
    InternalLimit = 11,
    /// Cyclic synchronous modes: the drive follows the target.
    TargetFollowed = 12,
    /// Position modes: the following error exceeds its window for too long.
    FollowingError = 13,
}

impl StatusBit {
    /// Profile position: the drive has the new set-point.
    pub const SETPOINT_ACKNOWLEDGED: Self = Self::TargetFollowed;
    /// Profile velocity: the axis stands.
    pub const SPEED_ZERO: Self = Self::TargetFollowed;
    /// Homing: the drive has found the home position.
    pub const HOMING_ATTAINED: Self = Self::TargetFollowed;
    /// Homing: the search has failed.
    pub const HOMING_ERROR: Self = Self::FollowingError;
}

/// Object 6041 as it is on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub struct Statusword(pub u16);

/// A statusword whose bits encode no state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("statusword {0:04X}h encodes no state of CiA 402")]
pub struct StatuswordError(pub u16);

impl Statusword {
    /// The statusword of a state, all other bits 0.
    pub fn for_state(state: DriveState) -> Self {
        let mut patterns = PATTERNS.into_iter();
        let pattern = patterns.find(|pattern| pattern.2 == state);
        let (_, bits, _) = pattern.expect("every state has a pattern");
        Self(bits)
    }

    /// The statusword with one bit set or cleared.
    #[must_use]
    pub const fn with(self, bit: StatusBit, set: bool) -> Self {
        let mask = 1 << bit as u8;
        Self(if set { self.0 | mask } else { self.0 & !mask })
    }

    /// Whether that bit is set.
    pub const fn has(self, bit: StatusBit) -> bool {
        self.0 >> bit as u8 & 1 == 1
    }

    /// The state of the drive.
    ///
    /// # Errors
    /// [`StatuswordError`] for bits of no state.
    pub fn state(self) -> Result<DriveState, StatuswordError> {
        let mut patterns = PATTERNS.into_iter();
        let pattern = patterns.find(|&(mask, bits, _)| self.0 & mask == bits);
        pattern.map(|(_, _, state)| state).ok_or(StatuswordError(self.0))
    }
}

/// A bit of the controlword.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum ControlBit {
    /// To switched on.
    SwitchOn = 0,
    /// Cleared: no voltage.
    EnableVoltage = 1,
    /// Low-active: a cleared bit demands a quick stop.
    NoQuickStop = 2,
    /// To operation enabled.
    EnableOperation = 3,
    /// Profile position: a new set-point. Homing: the operation starts.
    Start = 4,
    /// Profile position: the new set-point takes effect before the present motion ends.
    ChangeImmediately = 5,
    /// Profile position: the target is relative to the previous target.
    Relative = 6,
    /// Its rising edge leaves fault.
    FaultReset = 7,
    /// The axis stops.
    Halt = 8,
}

/// Object 6040 as it is on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub struct Controlword(pub u16);

impl Controlword {
    /// Disable voltage.
    pub const DISABLE_VOLTAGE: Self = Self(0);
    /// Quick stop.
    pub const QUICK_STOP: Self = Self::DISABLE_VOLTAGE.with(ControlBit::EnableVoltage);
    /// Shutdown.
    pub const SHUTDOWN: Self = Self::QUICK_STOP.with(ControlBit::NoQuickStop);
    /// Switch on; in operation enabled the same bits disable operation.
    pub const SWITCH_ON: Self = Self::SHUTDOWN.with(ControlBit::SwitchOn);
    /// Enable operation.
    pub const ENABLE_OPERATION: Self = Self::SWITCH_ON.with(ControlBit::EnableOperation);
    /// Fault reset; the controlword before must have this bit cleared.
    pub const FAULT_RESET: Self = Self::DISABLE_VOLTAGE.with(ControlBit::FaultReset);

    /// The command to a drive in that state, after the previous controlword.
    ///
    /// Fault reset is the rising edge of bit 7 in the state fault. Any other bit 7 is ignored and leaves the other
    /// bits valid, so that bit 7 can never mask a quick stop.
    pub const fn command(self, previous: Self, state: DriveState) -> StateCommand {
        let is_edge = self.has(ControlBit::FaultReset) && !previous.has(ControlBit::FaultReset);
        if is_edge && matches!(state, DriveState::Fault) {
            StateCommand::FaultReset
        } else if !self.has(ControlBit::EnableVoltage) {
            StateCommand::DisableVoltage
        } else if !self.has(ControlBit::NoQuickStop) {
            StateCommand::QuickStop
        } else if !self.has(ControlBit::SwitchOn) {
            StateCommand::Shutdown
        } else if !self.has(ControlBit::EnableOperation) {
            StateCommand::SwitchOn
        } else {
            StateCommand::EnableOperation
        }
    }

    /// Whether that bit is set.
    pub const fn has(self, bit: ControlBit) -> bool {
        self.0 >> bit as u8 & 1 == 1
    }

    /// The controlword with that bit set.
    #[must_use]
    pub const fn with(self, bit: ControlBit) -> Self {
        Self(self.0 | 1 << bit as u8)
    }
}

codes! {
    /// The request of a master to a drive.
    DriveRequest as u32 {
        /// No voltage: the drive is free.
        Off = 0 "off",
        /// Operation enabled, following the targets.
        Enable = 1 "enable",
        /// Stop along the quick-stop ramp, then switch on disabled.
        QuickStop = 2 "quick_stop",
    }
}

/// The next controlword (6040h) on the way from `state` to the requested state. `previous` is the last controlword
/// sent to the drive.
///
/// - [`DriveRequest::Enable`] climbs one transition a call, resets a fault by an edge of bit 7 and lets a running quick
///   stop end. The request restarts a drive in fault: a caller that must not restart drives requests something else.
/// - [`DriveRequest::QuickStop`] brakes a drive that moves and switches off one that does not.
/// - [`DriveRequest::Off`] takes the voltage away at once; a moving drive coasts.
///
/// The function does not wait: without an answer of the drive, the word and the edge of a fault reset repeat.
///
/// # Examples
/// From "switch on disabled" to "operation enabled":
///
/// ```
/// use masseter_can::cia402::{Controlword, DriveRequest, DriveState, next_controlword};
///
/// let (mut state, mut word) = (DriveState::SwitchOnDisabled, Controlword::DISABLE_VOLTAGE);
/// let mut words = Vec::new();
/// while state != DriveState::OperationEnabled {
///     let next = next_controlword(state, DriveRequest::Enable, word);
///     state = state.after(next.command(word, state));
///     word = next;
///     words.push(word.0);
/// }
/// assert_eq!(words, [0x06, 0x07, 0x0F], "shutdown, switch on, enable operation");
/// ```
#[doc(alias("device control", "device control command"))]
pub const fn next_controlword(
    state: DriveState,
    request: DriveRequest,
    previous: Controlword,
) -> Controlword {
    match request {
        DriveRequest::Off => Controlword::DISABLE_VOLTAGE,
        DriveRequest::QuickStop => Controlword::QUICK_STOP,
        DriveRequest::Enable => match state {
            DriveState::SwitchOnDisabled => Controlword::SHUTDOWN,
            DriveState::ReadyToSwitchOn => Controlword::SWITCH_ON,
            DriveState::SwitchedOn | DriveState::OperationEnabled => Controlword::ENABLE_OPERATION,
            DriveState::QuickStopActive => Controlword::QUICK_STOP,
            // A word with the bit set gives no rising edge.
            DriveState::Fault if !previous.has(ControlBit::FaultReset) => Controlword::FAULT_RESET,
            DriveState::NotReadyToSwitchOn | DriveState::FaultReactionActive | DriveState::Fault => {
                Controlword::DISABLE_VOLTAGE
            }
        },
    }
}

/// Longest value of 60C2:1.
const LONGEST: u64 = u8::MAX as u64;

/// A period in the form of object 60C2: value and power of ten, in seconds. The value has at most 255 steps, no finer
/// than 1 µs. The value has the fewest digits (1 · 10⁻³ rather than 100 · 10⁻⁵), because some drives accept whole ms
/// only.
///
/// A period between two values is rounded up: a drive that ends its move too early rests until the next SYNC.
pub const fn interpolation_period(period_ns: u64) -> (u8, i8) {
    let (mut unit_ns, mut exponent) = (1000, -6);
    while period_ns.div_ceil(unit_ns) > LONGEST && exponent < 0 {
        (unit_ns, exponent) = (unit_ns * 10, exponent + 1);
    }
    let mut value = period_ns.div_ceil(unit_ns);
    while value > 0 && value.is_multiple_of(10) && exponent < 0 {
        (value, exponent) = (value / 10, exponent + 1);
    }
    let value = if value > LONGEST { LONGEST } else { value };
    (if value == 0 { 1 } else { value as u8 }, exponent)
}

#[cfg(test)]
mod tests;
