//! The state machine of CiA 402 and its bits in the statusword.

/// State of the power. A fault reaction takes no time here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum State {
    SwitchOnDisabled,
    ReadyToSwitchOn,
    SwitchedOn,
    OperationEnabled,
    QuickStopActive,
    Fault,
}

impl State {
    /// Its bits of the statusword.
    pub(crate) const fn bits(self) -> u16 {
        match self {
            Self::SwitchOnDisabled => 0x40,
            Self::ReadyToSwitchOn => 0x21,
            Self::SwitchedOn => 0x33,
            Self::OperationEnabled => 0x37,
            Self::QuickStopActive => 0x17,
            Self::Fault => 0x08,
        }
    }

    /// The state after a controlword; `stays` tells that a quick stop may be left for operation (605Ah above 4).
    pub(crate) const fn after(self, word: u16, previous: u16, stays: bool) -> Self {
        let [on, voltage, no_quick_stop, enable] = [word & 1, word & 2, word & 4, word & 8];
        let is_reset = word & !previous & 0x80 != 0;
        match self {
            Self::Fault if is_reset => Self::SwitchOnDisabled,
            Self::Fault => Self::Fault,
            _ if voltage == 0 => Self::SwitchOnDisabled,
            Self::OperationEnabled | Self::QuickStopActive if no_quick_stop == 0 => Self::QuickStopActive,
            _ if no_quick_stop == 0 => Self::SwitchOnDisabled,
            Self::QuickStopActive if stays && on != 0 && enable != 0 => Self::OperationEnabled,
            Self::QuickStopActive => Self::QuickStopActive,
            Self::SwitchOnDisabled if on != 0 => Self::SwitchOnDisabled,
            _ if on == 0 => Self::ReadyToSwitchOn,
            _ if enable == 0 => Self::SwitchedOn,
            _ => Self::OperationEnabled,
        }
    }
}
