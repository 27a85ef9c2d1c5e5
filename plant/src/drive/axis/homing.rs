//! Homing mode: methods 35 and 37 (the present position) and 33 and 34 (the next reference mark in negative
//! or positive direction), with controlword bit 4 and statusword bits 10, 12 and 13.
//!
//! The state machine returns commands; it moves nothing itself. The mechanism has no limit or home switches, so methods
//! that need switches are not offered, and the speed for their search (6099h:1) has no use.

use masseter_can::cia402::{Controlword, StatusBit, Statusword};

use super::encoder::mark_between;
use super::motion::{MotionCommand, PositionView};

/// Progress of homing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum Homing {
    /// Not started, or interrupted.
    #[default]
    Idle,
    /// On the way to a reference mark.
    Searching,
    /// Slowing down after the mark at that count.
    Settling { home_counts: i32 },
    /// Done.
    Attained,
    /// There was no mark before the software limit.
    Failed,
}

impl Homing {
    /// Whether the drive supports that method (6098h).
    pub(crate) const fn is_method(method: i8) -> bool {
        matches!(method, 33 | 34 | 35 | 37)
    }

    /// Whether homing is under way.
    pub(crate) const fn is_running(self) -> bool {
        matches!(self, Self::Searching | Self::Settling { .. })
    }

    /// The state after another mode or power state was entered: an attained home position stays.
    pub(super) const fn interrupted(self) -> Self {
        if matches!(self, Self::Attained) { self } else { Self::Idle }
    }

    /// The statusword with the bits of homing.
    pub(super) const fn show(self, word: Statusword, is_at_rest: bool) -> Statusword {
        word.with(StatusBit::TargetReached, !self.is_running() && is_at_rest)
            .with(StatusBit::HOMING_ATTAINED, matches!(self, Self::Attained))
            .with(StatusBit::HOMING_ERROR, matches!(self, Self::Failed))
    }

    /// Takes a controlword, given the one before, the method (6098h) and the encoder's last count.
    pub(super) fn control(
        &mut self,
        [before, word]: [Controlword; 2],
        method: i8,
        counts: i32,
        view: PositionView,
    ) -> Option<MotionCommand> {
        let is_start = |word: Controlword| word.starts() && !word.halts();
        if is_start(word) && !is_start(before) {
            Some(self.start(method, counts, view))
        } else if !is_start(word) && self.is_running() {
            *self = Self::Idle;
            Some(MotionCommand::SlowDown)
        } else {
            None
        }
    }

    /// Methods 33 and 34 move as far as the software position limits allow, until a mark is passed.
    fn start(&mut self, method: i8, counts: i32, view: PositionView) -> MotionCommand {
        let [lowest, highest] = view.allowed;
        *self = Self::Searching;
        match method {
            33 => MotionCommand::MoveTo { target: lowest },
            34 => MotionCommand::MoveTo { target: highest },
            _ => self.attain(counts),
        }
    }

    /// Looks for a mark between the count before and the present one, then waits for standstill.
    pub(super) fn step(&mut self, [before, now]: [i32; 2], is_at_rest: bool) -> Option<MotionCommand> {
        match *self {
            Self::Searching => {
                if let Some(home_counts) = mark_between(before, now) {
                    *self = Self::Settling { home_counts };
                    return Some(MotionCommand::SlowDown);
                }
                if is_at_rest {
                    *self = Self::Failed;
                }
                None
            }
            Self::Settling { home_counts } if is_at_rest => Some(self.attain(home_counts)),
            _ => None,
        }
    }

    fn attain(&mut self, counts: i32) -> MotionCommand {
        *self = Self::Attained;
        MotionCommand::SetHome { counts }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_without_switches_are_offered() {
        let methods: Vec<_> = (i8::MIN..=i8::MAX).filter(|&method| Homing::is_method(method)).collect();
        assert_eq!(methods, [33, 34, 35, 37]);
    }
}
