//! The controlword, object 6040, and the command in its bits.
//!
//! The bits of the modes of operation (4 to 6) and halt (8) can be set and read; their effect is not part of this module.

use super::{DriveState, StateCommand};

const SWITCH_ON: u16 = 1 << 0;
const ENABLE_VOLTAGE: u16 = 1 << 1;
/// Low-active: a cleared bit demands a quick stop.
const NO_QUICK_STOP: u16 = 1 << 2;
const ENABLE_OPERATION: u16 = 1 << 3;
const MODE_START: u16 = 1 << 4;
const CHANGE_IMMEDIATELY: u16 = 1 << 5;
const RELATIVE: u16 = 1 << 6;
const FAULT_RESET: u16 = 1 << 7;
const HALT: u16 = 1 << 8;

/// Object 6040 as it is on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Controlword(pub u16);

impl Controlword {
    /// Disable voltage.
    pub const DISABLE_VOLTAGE: Self = Self(0x0000);
    /// Quick stop.
    pub const QUICK_STOP: Self = Self(ENABLE_VOLTAGE);
    /// Shutdown.
    pub const SHUTDOWN: Self = Self(ENABLE_VOLTAGE | NO_QUICK_STOP);
    /// Switch on; in operation enabled the same bits disable operation.
    pub const SWITCH_ON: Self = Self(Self::SHUTDOWN.0 | SWITCH_ON);
    /// Enable operation.
    pub const ENABLE_OPERATION: Self = Self(Self::SWITCH_ON.0 | ENABLE_OPERATION);
    /// Fault reset; it takes a controlword without this bit before it.
    pub const FAULT_RESET: Self = Self(FAULT_RESET);

    /// The command to a drive in that state, given the controlword before.
    ///
    /// Fault reset is the rising edge of bit 7 in the state fault. Any other bit 7 is ignored and leaves the other
    /// bits valid, so that bit 7 can never mask a quick stop.
    pub const fn command(self, previous: Self, state: DriveState) -> StateCommand {
        let is_edge = self.has(FAULT_RESET) && !previous.has(FAULT_RESET);
        if is_edge && matches!(state, DriveState::Fault) {
            StateCommand::FaultReset
        } else if !self.has(ENABLE_VOLTAGE) {
            StateCommand::DisableVoltage
        } else if !self.has(NO_QUICK_STOP) {
            StateCommand::QuickStop
        } else if !self.has(SWITCH_ON) {
            StateCommand::Shutdown
        } else if !self.has(ENABLE_OPERATION) {
            StateCommand::SwitchOn
        } else {
            StateCommand::EnableOperation
        }
    }

    /// Whether the fault reset bit is set, so that the next word cannot raise it.
    pub(super) const fn holds_fault_reset(self) -> bool {
        self.has(FAULT_RESET)
    }

    /// Bit 4: new set-point in profile position, operation start in homing.
    pub const fn starts(self) -> bool {
        self.has(MODE_START)
    }

    /// Bit 5 in profile position: the new set-point takes effect before the present motion ends.
    pub const fn changes_immediately(self) -> bool {
        self.has(CHANGE_IMMEDIATELY)
    }

    /// Bit 6 in profile position: the target counts from the one before.
    pub const fn is_relative(self) -> bool {
        self.has(RELATIVE)
    }

    /// Bit 8: the axis stops.
    pub const fn halts(self) -> bool {
        self.has(HALT)
    }

    /// The same with bit 4: a new set-point, or the start of homing.
    #[must_use]
    pub const fn with_start(self) -> Self {
        Self(self.0 | MODE_START)
    }

    /// The same with bit 5: a new set-point takes effect at once.
    #[must_use]
    pub const fn with_immediate_change(self) -> Self {
        Self(self.0 | CHANGE_IMMEDIATELY)
    }

    /// The same with bit 8: the axis stops.
    #[must_use]
    pub const fn with_halt(self) -> Self {
        Self(self.0 | HALT)
    }

    const fn has(self, bit: u16) -> bool {
        self.0 & bit != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDLE: Controlword = Controlword::DISABLE_VOLTAGE;

    #[test]
    fn words_are_those_of_the_standard() {
        let table = [
            (Controlword::SHUTDOWN, 0x06, StateCommand::Shutdown),
            (Controlword::SWITCH_ON, 0x07, StateCommand::SwitchOn),
            (Controlword::ENABLE_OPERATION, 0x0F, StateCommand::EnableOperation),
            (Controlword::DISABLE_VOLTAGE, 0x00, StateCommand::DisableVoltage),
            (Controlword::QUICK_STOP, 0x02, StateCommand::QuickStop),
            (Controlword::FAULT_RESET, 0x80, StateCommand::FaultReset),
        ];
        for (word, bits, command) in table {
            assert_eq!(word.0, bits);
            assert_eq!(word.command(IDLE, DriveState::Fault), command);
        }
    }

    #[test]
    fn dont_care_bits_do_not_matter() {
        let table = [
            (0b0000_1110, StateCommand::Shutdown),
            (0b0000_1101, StateCommand::DisableVoltage),
            (0b0000_1011, StateCommand::QuickStop),
            (0b1_0111_1111, StateCommand::EnableOperation),
        ];
        for (bits, command) in table {
            assert_eq!(Controlword(bits).command(IDLE, DriveState::Fault), command, "{bits:04X}h");
        }
    }

    #[test]
    fn only_the_rising_edge_of_bit_7_resets() {
        for previous in 0..=0xFF {
            let command = Controlword::FAULT_RESET.command(Controlword(previous), DriveState::Fault);
            assert_eq!(command == StateCommand::FaultReset, previous & FAULT_RESET == 0);
        }
    }

    #[test]
    fn bit_7_masks_no_stop() {
        let held = Controlword(Controlword::QUICK_STOP.0 | FAULT_RESET);
        assert_eq!(held.command(Controlword::FAULT_RESET, DriveState::Fault), StateCommand::QuickStop);
        let enabled = DriveState::OperationEnabled;
        assert_eq!(held.command(Controlword::ENABLE_OPERATION, enabled), StateCommand::QuickStop);
        let off = Controlword::FAULT_RESET.command(Controlword::ENABLE_OPERATION, enabled);
        assert_eq!(off, StateCommand::DisableVoltage);
    }
}
