//! Homing: methods 35 and 37 (where the axis stands) and 33 and 34 (the next reference mark in negative
//! or positive direction), with controlword bit 4 and statusword bits 10, 12 and 13.
//!
//! The mechanism has no limit or home switches, so methods that need them are not offered, and the
//! speed for their search (6099:1) has no use.

use masseter_can::cia402::{Controlword, StatusBit, Statusword};

use super::axis::Axis;
use crate::encoder::mark_between;

/// Where homing stands.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) enum Homing {
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
    /// Whether the drive knows that method (object 6098).
    pub(super) const fn is_method(method: i8) -> bool {
        matches!(method, 33 | 34 | 35 | 37)
    }

    pub(super) const fn is_running(self) -> bool {
        matches!(self, Self::Searching | Self::Settling { .. })
    }

    /// After another mode or state was entered: what was attained holds as long as the origin does.
    pub(super) const fn interrupted(self) -> Self {
        if matches!(self, Self::Attained) { self } else { Self::Idle }
    }

    /// The statusword with the bits of homing.
    pub(super) const fn show(self, word: Statusword, is_at_rest: bool) -> Statusword {
        let is_attained = matches!(self, Self::Attained);
        let is_running = self.is_running();
        word.with(StatusBit::TargetReached, !is_running && is_at_rest)
            .with(StatusBit::HOMING_ATTAINED, is_attained)
            .with(StatusBit::HOMING_ERROR, matches!(self, Self::Failed))
    }
}

impl Axis {
    /// What a controlword changes, given the one before.
    pub(super) fn control_homing(&mut self, now_ns: u64, before: Controlword) {
        let word = self.controlword;
        let goes = |word: Controlword| word.starts() && !word.halts();
        if goes(word) && !goes(before) {
            self.begin_homing(now_ns);
        } else if !goes(word) && self.homing.is_running() {
            self.homing = Homing::Idle;
            self.slow_down(now_ns, self.parameters.homing.search.deceleration_m_s2);
        }
    }

    fn begin_homing(&mut self, now_ns: u64) {
        match self.parameters.homing.method {
            33 => self.search(now_ns, i32::MIN),
            34 => self.search(now_ns, i32::MAX),
            _ => self.attain(self.counts),
        }
    }

    /// Moves as far that way as the software limits allow, until a mark comes.
    fn search(&mut self, now_ns: u64, far_increments: i32) {
        self.homing = Homing::Searching;
        let limits = self.parameters.homing.search;
        let end_m = self.metres(self.within_limits(now_ns, far_increments));
        self.move_to(now_ns, end_m, &limits);
    }

    /// Looks for the mark between the count before and the present one, and waits for standstill.
    pub(super) fn continue_homing(&mut self, now_ns: u64, before_counts: i32) {
        match self.homing {
            Homing::Searching => {
                if let Some(home_counts) = mark_between(before_counts, self.counts) {
                    self.homing = Homing::Settling { home_counts };
                    self.slow_down(now_ns, self.parameters.homing.search.deceleration_m_s2);
                } else if self.demand.is_at_rest(now_ns) {
                    self.homing = Homing::Failed;
                }
            }
            Homing::Settling { home_counts } if self.demand.is_at_rest(now_ns) => self.attain(home_counts),
            _ => {}
        }
    }

    /// From now on zero is the home offset (607C) beyond that count, which is called minus the offset (CiA 402).
    fn attain(&mut self, home_counts: i32) {
        self.origin_increments =
            0_i32.saturating_sub(home_counts).saturating_sub(self.parameters.homing.offset_increments);
        self.homing = Homing::Attained;
    }
}
