//! Profile position mode: set-points with the handshake of controlword bits 4, 5, 6 and 8 and statusword
//! bits 10 and 12. One set-point runs, one may wait for it.
//!
//! The state machine returns commands; it moves nothing itself. Motion through a set-point without stopping (bit 9) is
//! not supported.

use masseter_can::cia402::Controlword;

use super::motion::{MotionCommand, PositionView};

/// The set-points, increments of the dictionary.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Positioning {
    /// Under way, or interrupted by a halt.
    running: Option<i32>,
    /// Waits for the running one.
    waiting: Option<i32>,
    /// The last one reached.
    reached: Option<i32>,
    /// Statusword bit 12.
    is_acknowledged: bool,
    /// Whether the newest set-point was clamped to the software position limits.
    is_limited: bool,
}

impl Positioning {
    /// Whether a set-point waits for the running one.
    pub(super) fn has_waiting(&self) -> bool {
        self.waiting.is_some()
    }

    /// Statusword bit 12: the last set-point was taken, and the master has not ended the handshake.
    pub(super) fn is_acknowledged(&self) -> bool {
        self.is_acknowledged
    }

    /// Whether the newest set-point was clamped to the software position limits.
    pub(super) fn is_limited(&self) -> bool {
        self.is_limited
    }

    /// Takes a controlword, given the one before and the target position (607Ah).
    pub(super) fn control(
        &mut self,
        [before, word]: [Controlword; 2],
        target_position: i32,
        view: PositionView,
    ) -> Option<MotionCommand> {
        let mut command = match (before.halts(), word.halts()) {
            (false, true) => Some(MotionCommand::SlowDown),
            (true, false) => self.running.map(|target| MotionCommand::MoveTo { target }),
            _ => None,
        };
        if word.starts() && !before.starts() {
            command = self.take_setpoint(word, target_position, view).or(command);
        }
        self.end_handshake(word);
        command
    }

    /// Starts a set-point, or lets it wait. Where one waits already, the new one is refused: it is not acknowledged.
    fn take_setpoint(
        &mut self,
        word: Controlword,
        target_position: i32,
        view: PositionView,
    ) -> Option<MotionCommand> {
        // A relative target is added to the set-point before, or to the actual position.
        let base = self.waiting.or(self.running).or(self.reached).unwrap_or(view.actual);
        let requested =
            if word.is_relative() { base.saturating_add(target_position) } else { target_position };
        let target = view.clamp(requested);
        let is_free = self.running.is_none() && self.waiting.is_none();
        let mut command = None;
        if word.changes_immediately() || is_free {
            self.waiting = None;
            command = self.start(word, target);
        } else if self.waiting.is_none() {
            self.waiting = Some(target);
        } else {
            return None;
        }
        self.is_acknowledged = true;
        self.is_limited = target != requested;
        command
    }

    fn start(&mut self, word: Controlword, target: i32) -> Option<MotionCommand> {
        self.running = Some(target);
        (!word.halts()).then_some(MotionCommand::MoveTo { target })
    }

    /// Starts the waiting set-point once the running one is over, as `is_at_rest` reports of the demand.
    pub(super) fn step(&mut self, word: Controlword, is_at_rest: bool) -> Option<MotionCommand> {
        if word.halts() || !is_at_rest {
            return None;
        }
        if let Some(target) = self.running.take() {
            self.reached = Some(target);
        }
        let target = self.waiting.take()?;
        let command = self.start(word, target);
        self.end_handshake(word);
        command
    }

    /// Ends the acknowledgement once the master has cleared bit 4 and another set-point has room.
    fn end_handshake(&mut self, word: Controlword) {
        if !word.starts() && self.waiting.is_none() {
            self.is_acknowledged = false;
        }
    }
}
