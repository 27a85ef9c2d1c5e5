//! The reports of a process to the supervisor. What a report means for the run is not decided here.

use std::collections::VecDeque;
use std::io;
use std::os::fd::OwnedFd;
use std::time::Duration;

use masseter_runtime::clock;
use masseter_runtime::conversation::{Conversation, Left, Limits};
use masseter_runtime::lifecycle::{End, Order, Report, ReportError, Silence, line};
use masseter_runtime::named::Declared;
use masseter_runtime::realtime::scheduling::Obtained;

/// Bytes of all reports of a process: a declaration, a fault that is due now and then, and an end.
const MOST_BYTES: usize = 1 << 20;

/// The reports that were read and not yet looked at, and those that matter until the end.
///
/// They are read where they are looked at: a report that was made before is seen.
pub(super) struct Reports {
    conversation: Conversation,
    silence: Option<Silence>,
    due: VecDeque<Due>,
    end: Option<End>,
    left: Option<Left>,
}

/// The report of a process that is ready.
pub(super) struct Ready {
    pub(super) scheduling: Obtained,
    /// Of the controller.
    pub(super) declared: Declared,
}

/// A fault of a process that is due.
#[derive(Debug, Clone, Copy)]
pub(super) struct Due {
    /// Its place in the scenario's list.
    pub(super) fault: usize,
    /// When it became due, ns of the run's clock.
    pub(super) now_ns: u64,
}

/// The next step on the way to readiness.
pub(super) enum Readiness {
    Ready(Ready),
    NotYet,
    /// Its report cannot be recorded or shown.
    Refused(ReportError),
    /// The process has closed the line.
    Closed,
}

impl Reports {
    /// The reports that the process writes into `input`.
    pub(super) fn of(input: OwnedFd) -> io::Result<Self> {
        let now_ns = clock::now_ns();
        Ok(Self::over(Conversation::begin(input, Limits::admitted(MOST_BYTES), now_ns)?))
    }

    /// The reports of a program that was admitted.
    pub(super) fn of_admitted(mut conversation: Conversation) -> Self {
        conversation.renew(Limits::admitted(MOST_BYTES), clock::now_ns());
        Self::over(conversation)
    }

    fn over(conversation: Conversation) -> Self {
        Self { conversation, silence: None, due: VecDeque::new(), end: None, left: None }
    }

    /// Sends an order to a program. A program that does not read its orders is out.
    pub(super) fn order(&mut self, order: &Order) {
        self.conversation.say(line(order).as_bytes());
    }

    /// Closes the line, by which a program notices that the rig is gone.
    pub(super) fn close(&self) {
        self.conversation.close();
    }

    /// Waits for the report of readiness, for at most this time.
    pub(super) fn await_ready(&mut self, timeout: Duration) -> Readiness {
        let mut line = self.conversation.next_line();
        if line.is_none() {
            self.conversation.wait(timeout);
            self.conversation.hear();
            line = self.conversation.next_line();
        }
        let Some(line) = line else {
            return if self.has_left() { Readiness::Closed } else { Readiness::NotYet };
        };
        match Report::read(&line) {
            Ok(Report::Ready { scheduling, declared }) => Readiness::Ready(Ready { scheduling, declared }),
            Ok(Report::Ended(end)) => {
                self.end = Some(end);
                Readiness::Closed
            }
            Ok(report) => {
                self.keep(report);
                Readiness::NotYet
            }
            Err(refusal) => Readiness::Refused(refusal),
        }
    }

    /// The report that another process was silent, if there is one.
    pub(super) fn silence(&mut self) -> Option<Silence> {
        self.look();
        self.silence.take()
    }

    /// The next report that a fault is due.
    pub(super) fn due(&mut self) -> Option<Due> {
        self.look();
        self.due.pop_front()
    }

    /// How the program ended its work, if it has reported that.
    pub(super) fn end(&mut self) -> Option<End> {
        self.look();
        self.end.clone()
    }

    /// Why the process reports nothing more; none while it can.
    pub(super) fn left(&mut self) -> Option<&Left> {
        self.look();
        self.has_left();
        self.left.as_ref()
    }

    fn has_left(&mut self) -> bool {
        if self.left.is_none() {
            self.left = self.conversation.left(clock::now_ns());
        }
        self.left.is_some()
    }

    fn look(&mut self) {
        self.conversation.hear();
        while let Some(line) = self.conversation.next_line() {
            match Report::read(&line) {
                Ok(report) => self.keep(report),
                // The first one counts: whoever reports what cannot be is no controller.
                Err(refusal) => {
                    let reason = format!("its report is refused: {refusal}");
                    self.end.get_or_insert(End::Failed { reason });
                }
            }
        }
    }

    fn keep(&mut self, report: Report) {
        match report {
            Report::Silence(silence) => self.silence = Some(silence),
            Report::Due { fault, now_ns } => self.due.push_back(Due { fault, now_ns }),
            Report::Ended(end) => drop(self.end.get_or_insert(end)),
            Report::Ready { .. } => {}
        }
    }
}
