//! The reports of a process to the supervisor. What a report means for the run is not decided here.

use std::collections::VecDeque;
use std::os::fd::OwnedFd;
use std::time::Duration;

use anyhow::Context;
use masseter_shared::lifecycle::{End, Report, Silence};
use masseter_shared::named::Declared;
use masseter_shared::realtime::scheduling::Obtained;
use rustix::buffer::spare_capacity;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::{Errno, read};

/// Most bytes of one read; all that a process has to report is less.
const READ_BYTES: usize = 65_536;

/// The reports that were read and not yet looked at, and those that matter until the end.
///
/// They are read where they are looked at: a report that was made before is seen.
pub(super) struct Reports {
    input: OwnedFd,
    /// Read, and not yet taken as lines.
    unread: Vec<u8>,
    silence: Option<Silence>,
    due: VecDeque<Due>,
    end: Option<End>,
    is_closed: bool,
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
    /// The process has closed the line.
    Closed,
}

impl Reports {
    /// The reports in `input`, which the process writes.
    pub(super) fn of(input: OwnedFd) -> Self {
        Self { input, unread: Vec::new(), silence: None, due: VecDeque::new(), end: None, is_closed: false }
    }

    /// Waits for the report of readiness, for at most this time.
    pub(super) fn await_ready(&mut self, timeout: Duration) -> anyhow::Result<Readiness> {
        let line = self.next_line().or_else(|| {
            self.receive(timeout);
            self.next_line()
        });
        let Some(line) = line else {
            return Ok(if self.is_closed { Readiness::Closed } else { Readiness::NotYet });
        };
        match serde_json::from_str(&line).with_context(|| format!("its report is '{line}'"))? {
            Report::Ready { scheduling, declared } => Ok(Readiness::Ready(Ready { scheduling, declared })),
            Report::Ended(end) => {
                self.end = Some(end);
                Ok(Readiness::Closed)
            }
            report => {
                self.keep(report);
                Ok(Readiness::NotYet)
            }
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

    /// Whether the process has closed the line.
    pub(super) fn is_closed(&mut self) -> bool {
        self.look();
        self.is_closed
    }

    fn look(&mut self) {
        self.receive(Duration::ZERO);
        while let Some(line) = self.next_line() {
            if let Ok(report) = serde_json::from_str(&line) {
                self.keep(report);
            }
        }
    }

    fn keep(&mut self, report: Report) {
        match report {
            Report::Silence(silence) => self.silence = Some(silence),
            Report::Due { fault, now_ns } => self.due.push_back(Due { fault, now_ns }),
            Report::Ended(end) => self.end = Some(end),
            Report::Ready { .. } => {}
        }
    }

    /// Reads what has come, and waits at most this time for that.
    fn receive(&mut self, timeout: Duration) {
        let timeout = Timespec::try_from(timeout).expect("a few milliseconds");
        if self.is_closed || poll(&mut [PollFd::new(&self.input, PollFlags::IN)], Some(&timeout)) != Ok(1) {
            return;
        }
        self.unread.reserve(READ_BYTES);
        match read(&self.input, spare_capacity(&mut self.unread)) {
            Err(Errno::INTR) => {}
            // A line that cannot be read is closed.
            read => self.is_closed = read.unwrap_or(0) == 0,
        }
    }

    /// Takes a line that is complete.
    fn next_line(&mut self) -> Option<String> {
        let end = self.unread.iter().position(|byte| *byte == b'\n')?;
        let line: Vec<u8> = self.unread.drain(..=end).collect();
        Some(String::from_utf8_lossy(&line[..end]).into_owned())
    }
}
