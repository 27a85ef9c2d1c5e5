//! Silence of a drive, and its missing or surplus process data.
//!
//! The master decides the consequence of a loss for the other drives.

use masseter_runtime::messages::codes::Cause;

use super::events::Failure;

/// Cycles in a row in which an operational drive's process data may be missing at most.
pub(super) const MISSING_CYCLES: u32 = 3;
/// Most surplus process data of a single node: all missing process data may come late, at once.
const SURPLUS: u32 = MISSING_CYCLES + 2;

/// Memory of the supervision.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(super) struct Presence {
    /// Time of the drive's last message.
    pub(super) heard_ns: u64,
    /// Time of the newest process data.
    pub(super) answered_ns: u64,
    /// Cycles in a row without process data.
    pub(super) missing_cycles: u32,
    /// Recent surplus of new process data over SYNCs. A late drive makes up for a cycle without process data. A drive
    /// with a repeated SYNC answers twice. Two drives of one id send one more every cycle.
    surplus: u32,
    /// New process data since the last SYNC.
    new_data: u32,
}

impl Presence {
    /// A drive expected from `now_ns` on.
    pub(super) fn new(now_ns: u64) -> Self {
        Self { heard_ns: now_ns, answered_ns: 0, missing_cycles: 0, surplus: 0, new_data: 0 }
    }

    /// Notes a SYNC, which demands new process data.
    pub(super) fn begin_cycle(&mut self) {
        self.surplus = match std::mem::take(&mut self.new_data) {
            0 | 1 => self.surplus.saturating_sub(1),
            several => self.surplus + several - 1,
        };
    }

    /// Notes process data of the drive. A frame repeated by its transmitter is not new.
    pub(super) fn answer(&mut self, time_ns: u64, is_new: bool) {
        self.answered_ns = time_ns;
        self.new_data += u32::from(is_new);
    }

    /// Whether process data came after that time.
    pub(super) fn has_answered_since(&self, time_ns: u64) -> bool {
        self.answered_ns > time_ns
    }

    /// Counts missing and surplus process data anew.
    pub(super) fn restart(&mut self) {
        (self.missing_cycles, self.surplus) = (0, 0);
    }

    /// The reason for the loss of the drive, if lost, given the most cycles in a row without process data.
    pub(super) fn loss(&self, now_ns: u64, heartbeat_timeout_ns: u64, may_miss: u32) -> Option<Failure> {
        let silent_ns = now_ns.saturating_sub(self.heard_ns);
        if silent_ns > heartbeat_timeout_ns {
            let [silent_ms, limit_ms] = [silent_ns, heartbeat_timeout_ns].map(|ns| ns as f64 / 1e6);
            Some(Failure::with(Cause::HeartbeatLost, silent_ms, limit_ms))
        } else if self.surplus > SURPLUS {
            Some(Failure::with(Cause::DuplicateNode, self.surplus, SURPLUS))
        } else if self.missing_cycles > may_miss {
            Some(Failure::with(Cause::ProcessDataLost, self.missing_cycles, may_miss))
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The surplus after a number of SYNCs, each answered by that many new process data.
    fn surplus(syncs: u32, answers: impl Fn(u32) -> u32) -> u32 {
        let mut presence = Presence::new(0);
        for sync in 0..syncs {
            presence.begin_cycle();
            (0..answers(sync)).for_each(|_| presence.answer(0, true));
        }
        presence.begin_cycle();
        presence.surplus
    }

    #[test]
    fn a_drive_that_answers_late_is_still_one() {
        assert!(surplus(100, |sync| if sync % 2 == 0 { 0 } else { 2 }) <= 1, "every other cycle");
        assert!(surplus(100, |sync| if sync % 4 == 3 { 4 } else { 0 }) <= SURPLUS);
    }

    #[test]
    fn a_drive_that_answers_a_repeated_sync_again_is_still_one() {
        assert!(surplus(10_000, |sync| if sync % 3 == 0 { 2 } else { 1 }) <= 1);
    }

    #[test]
    fn a_repeated_frame_is_no_second_answer() {
        let mut presence = Presence::new(0);
        for _ in 0..100 {
            presence.begin_cycle();
            presence.answer(0, true);
            presence.answer(0, false);
        }
        presence.begin_cycle();
        assert_eq!(presence.loss(0, 1, 0), None);
        assert_eq!(presence.surplus, 0);
    }

    #[test]
    fn two_drives_of_one_id_answer_once_too_often_every_cycle() {
        assert_eq!(surplus(10, |_| 1), 0);
        assert_eq!(surplus(10, |_| 2), 10);
    }

    #[test]
    fn a_drive_is_lost_beyond_each_limit_and_not_at_it() {
        let cause = |presence: &Presence, now_ns, may_miss| {
            presence.loss(now_ns, 1000, may_miss).map(|failure| failure.cause)
        };
        let mut presence = Presence::new(500);
        assert_eq!(cause(&presence, 1500, 0), None);
        assert_eq!(cause(&presence, 1501, 0), Some(Cause::HeartbeatLost));
        assert_eq!(cause(&presence, 0, 0), None, "a clock that lags is no silence");
        presence.heard_ns = 2500;
        assert_eq!(cause(&presence, 3500, 0), None);
        let silent = presence.loss(4_002_500, 1_000_000, 0).unwrap();
        assert_eq!((silent.value, silent.limit), (4.0, 1.0), "ms");

        for (missing, may_miss, is_lost) in [(1, 1, false), (2, 1, true), (3, 3, false), (4, 3, true)] {
            presence.missing_cycles = 0;
            (0..missing).for_each(|_| presence.missing_cycles += 1);
            assert_eq!(cause(&presence, 2500, may_miss), is_lost.then_some(Cause::ProcessDataLost));
        }
        for (answers, is_duplicate) in [(1, false), (6, false), (7, true), (9, true)] {
            presence.restart();
            presence.begin_cycle();
            (0..answers).for_each(|_| presence.answer(2500, true));
            presence.begin_cycle();
            assert_eq!(cause(&presence, 2500, 0), is_duplicate.then_some(Cause::DuplicateNode), "{answers}");
        }
        presence.missing_cycles += 1;
        presence.restart();
        assert_eq!(cause(&presence, 2500, 0), None);
    }

    #[test]
    fn an_answer_is_one_after_the_time_that_is_asked_for() {
        let mut presence = Presence::new(0);
        presence.answer(100, true);
        assert!(presence.has_answered_since(99) && !presence.has_answered_since(100));
        presence.answered_ns = 0;
        assert!(!presence.has_answered_since(0));
    }
}
