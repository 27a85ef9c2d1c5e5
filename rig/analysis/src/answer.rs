//! Reception and sending of a command, from the readings that answer it.

use masseter_runtime::messages::Reading;

/// A command that the plant took.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Answer {
    /// The controller's.
    pub(super) cycle: u64,
    pub(super) received_ns: u64,
    /// None where nothing went out, as before the drives exchange process data.
    pub(super) sent_ns: Option<u64>,
}

/// Finds the readings that answer a new command.
#[derive(Debug, Clone, Default)]
pub(super) struct Answers {
    last: u64,
}

impl Answers {
    /// Once for each command.
    pub(super) fn take(&mut self, reading: &Reading) -> Option<Answer> {
        if reading.answers_cycle <= self.last {
            return None;
        }
        self.last = reading.answers_cycle;
        let (received_ns, sent_ns) = (reading.command_received_ns, reading.command_sent_ns);
        // An older instant belongs to an older command, whose times the plant repeats.
        let is_of_this = sent_ns > 0 && sent_ns >= received_ns;
        Some(Answer { cycle: self.last, received_ns, sent_ns: is_of_this.then_some(sent_ns) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_answered_once_and_was_sent_only_after_it_was_received() {
        let mut answers = Answers::default();
        let mut sent_of = |[answers_cycle, command_received_ns, command_sent_ns]: [u64; 3]| {
            let reading =
                Reading { answers_cycle, command_received_ns, command_sent_ns, ..Default::default() };
            answers.take(&reading).map(|answer| answer.sent_ns)
        };
        // Nothing has gone out yet; then one does, the next does not, and the old targets go out once more.
        assert_eq!(sent_of([0, 0, 0]), None);
        assert_eq!(sent_of([3, 900, 0]), Some(None));
        assert_eq!(sent_of([4, 1900, 2100]), Some(Some(2100)));
        assert_eq!(sent_of([5, 2900, 2100]), Some(None));
        assert_eq!(sent_of([5, 2900, 3100]), None);
    }
}
