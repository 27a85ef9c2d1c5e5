//! The NMT state of a drive (CiA 301) and its boot-up.
//!
//! The node decides what a change of state means for the rest of the drive.

use masseter_can::canopen::NmtState;
use masseter_runtime::clock::MILLISECOND_NS;

/// From power-on to the boot-up message, ns.
pub(super) const BOOT_NS: u64 = 20 * MILLISECOND_NS;

/// The state.
#[derive(Debug, Clone, Copy)]
pub(super) struct Nmt {
    /// None while the node boots.
    state: Option<NmtState>,
    boot_at_ns: u64,
    /// Boot-up messages left before the node has booted: a boot loader sends one of its own.
    boot_ups: u8,
}

impl Nmt {
    /// A node that begins to boot at `now_ns`, and sends so many boot-up messages.
    pub(super) fn booting(now_ns: u64, boot_ups: u8) -> Self {
        Self { state: None, boot_at_ns: now_ns + BOOT_NS, boot_ups }
    }

    /// The state; none while the node boots.
    pub(super) fn state(self) -> Option<NmtState> {
        self.state
    }

    /// Enters a state.
    pub(super) fn enter(&mut self, state: NmtState) {
        self.state = Some(state);
    }

    /// Whether process data are exchanged.
    pub(super) fn is_operational(self) -> bool {
        self.state == Some(NmtState::Operational)
    }

    /// Whether the node takes part in SDO, SYNC and EMCY.
    pub(super) fn is_served(self) -> bool {
        matches!(self.state, Some(NmtState::Operational | NmtState::PreOperational))
    }

    /// Ends the boot when it is time; returns whether a boot-up message is due.
    pub(super) fn boot(&mut self, now_ns: u64) -> bool {
        let is_due = self.state.is_none() && now_ns >= self.boot_at_ns;
        if is_due {
            self.boot_ups = self.boot_ups.saturating_sub(1);
            self.boot_at_ns += BOOT_NS;
            self.state = (self.boot_ups == 0).then_some(NmtState::PreOperational);
        }
        is_due
    }
}
