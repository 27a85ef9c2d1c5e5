//! Profile position: set-points with the handshake of controlword bits 4, 5, 6 and 8 and statusword
//! bits 10 and 12. One set-point runs, one may wait for it.
//!
//! Motion through a set-point without stopping (bit 9) is not supported.

use masseter_can::cia402::Controlword;

use super::axis::Axis;
use super::dictionary::{Objects, names};

/// The set-points, increments.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Positioning {
    /// Under way, or interrupted by a halt.
    running: Option<i32>,
    waiting: Option<i32>,
    /// The last that was reached.
    reached: Option<i32>,
    is_acknowledged: bool,
}

impl Positioning {
    /// Statusword bit 12.
    pub(super) fn is_acknowledged(self) -> bool {
        self.is_acknowledged
    }
}

impl Axis {
    /// What a controlword changes, given the one before.
    pub(super) fn control_positioning(&mut self, now_ns: u64, before: Controlword, objects: &Objects) {
        let word = self.controlword;
        if word.halts() && !before.halts() {
            self.slow_down(now_ns, self.parameters.profile.deceleration_m_s2);
        }
        if before.halts()
            && !word.halts()
            && let Some(target) = self.positioning.running
        {
            self.start(now_ns, target);
        }
        if word.starts() && !before.starts() {
            self.take_setpoint(now_ns, objects.get(names::TARGET_POSITION));
        }
        self.end_handshake();
    }

    /// A set-point starts, waits, or is refused by not being acknowledged where one waits already.
    fn take_setpoint(&mut self, now_ns: u64, asked_increments: i32) {
        let word = self.controlword;
        let asked = if word.is_relative() {
            self.last_target().saturating_add(asked_increments)
        } else {
            asked_increments
        };
        let target = self.within_limits(now_ns, asked);
        let is_free = self.positioning.running.is_none() && self.positioning.waiting.is_none();
        if word.changes_immediately() || is_free {
            self.positioning.waiting = None;
            self.start(now_ns, target);
        } else if self.positioning.waiting.is_none() {
            self.positioning.waiting = Some(target);
        } else {
            return;
        }
        self.positioning.is_acknowledged = true;
        self.is_cut = target != asked;
    }

    /// What a relative target counts from: the set-point before, or where the axis stands.
    fn last_target(&self) -> i32 {
        let Positioning { running, waiting, reached, .. } = self.positioning;
        waiting.or(running).or(reached).unwrap_or_else(|| self.counts.saturating_add(self.origin_increments))
    }

    fn start(&mut self, now_ns: u64, target_increments: i32) {
        self.positioning.running = Some(target_increments);
        if !self.controlword.halts() {
            let limits = self.parameters.profile;
            self.move_to(now_ns, self.metres(target_increments), &limits);
        }
    }

    /// Starts the set-point that waits once the running one is over.
    pub(super) fn continue_positioning(&mut self, now_ns: u64) {
        if self.controlword.halts() || !self.demand.is_at_rest(now_ns) {
            return;
        }
        if let Some(target) = self.positioning.running.take() {
            self.positioning.reached = Some(target);
        }
        if let Some(target) = self.positioning.waiting.take() {
            self.start(now_ns, target);
            self.end_handshake();
        }
    }

    /// The acknowledgement ends when the master took bit 4 back and another set-point has room.
    fn end_handshake(&mut self) {
        if !self.controlword.starts() && self.positioning.waiting.is_none() {
            self.positioning.is_acknowledged = false;
        }
    }

    /// Statusword bit 10: within the position window of the last set-point, or halted.
    pub(super) fn has_reached_setpoint(&self, now_ns: u64) -> bool {
        if !self.demand.is_at_rest(now_ns) || self.positioning.waiting.is_some() {
            return false;
        }
        let demand_m = self.demand.position_m(now_ns).unwrap_or(self.measured_m());
        self.controlword.halts() || (demand_m - self.measured_m()).abs() <= self.parameters.position_window_m
    }
}
