//! Acknowledgement of commands: the motion makes its next step after the drives have received the last one.
//!
//! While either process stalls, the drives hold their last target. If the motion continued meanwhile, it would have to
//! catch up in one cycle.

/// Cycles until the reading that answers a command: the next one's, and either may be a cycle late.
const LATEST_ANSWER_CYCLES: u64 = 2;

/// The cycle of the last step of the motion.
#[derive(Debug, Clone, Default)]
#[doc(alias("flow control", "stop-and-wait"))]
pub(crate) struct CommandAcknowledgement {
    step_cycle: u64,
}

impl CommandAcknowledgement {
    /// Whether the motion makes a step in this cycle, when a fresh reading last acknowledged the command of
    /// `answered_cycle`. Without an acknowledgement the motion waits and repeats its last target until the drives
    /// acknowledge a later command.
    pub(crate) fn takes_step(&mut self, cycle: u64, answered_cycle: u64) -> bool {
        let is_answered = answered_cycle >= self.step_cycle;
        let is_under_way = cycle.saturating_sub(answered_cycle) <= LATEST_ANSWER_CYCLES;
        let steps = is_answered || is_under_way;
        if steps {
            self.step_cycle = cycle;
        }
        steps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cycles, each with the command answered in it, if any, and whether the motion makes a step.
    fn plays(cycles: &[(u64, Option<u64>, bool)]) {
        let (mut acknowledgement, mut answered_cycle) = (CommandAcknowledgement::default(), 0);
        for &(cycle, answered, steps) in cycles {
            answered_cycle = answered.unwrap_or(answered_cycle);
            assert_eq!(acknowledgement.takes_step(cycle, answered_cycle), steps, "cycle {cycle}");
        }
    }

    #[test]
    fn a_motion_answered_in_time_or_a_cycle_late_goes_on() {
        plays(&[
            (1, Some(0), true),
            (2, Some(1), true),
            (3, None, true),
            (4, Some(2), true),
            (5, Some(3), true),
        ]);
    }

    #[test]
    fn a_step_without_answer_is_waited_for_and_made_again_when_the_drives_are_back() {
        plays(&[
            (8, Some(7), true),
            (9, None, true),
            (10, None, false),
            (11, None, false),
            (12, Some(8), false),
            (13, Some(12), true),
        ]);
    }

    #[test]
    fn skipped_cycles_are_one_step() {
        plays(&[(8, Some(7), true), (23, Some(8), true), (24, Some(23), true)]);
    }
}
