//! The reports of a process to the supervisor, read by a thread. What a report means for the run is not decided here.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read};
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError, channel};
use std::thread;
use std::time::Duration;

use anyhow::Context;
use masseter_shared::lifecycle::{End, Report, Silence};
use masseter_shared::named::Declared;
use masseter_shared::realtime::scheduling::Obtained;

/// The reports that were read and not yet looked at, and those that matter until the end.
pub(super) struct Reports {
    lines: Receiver<String>,
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
    /// Reads the reports of `input`, which the process writes.
    pub(super) fn of(input: impl Read + Send + 'static) -> Self {
        let (sender, lines) = channel();
        thread::spawn(move || {
            for line in BufReader::new(input).lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
        Self { lines, silence: None, due: VecDeque::new(), end: None, is_closed: false }
    }

    /// Waits for the report of readiness, for at most this time.
    pub(super) fn await_ready(&mut self, timeout: Duration) -> anyhow::Result<Readiness> {
        let line = match self.lines.recv_timeout(timeout) {
            Ok(line) => line,
            Err(RecvTimeoutError::Timeout) => return Ok(Readiness::NotYet),
            Err(RecvTimeoutError::Disconnected) => return Ok(Readiness::Closed),
        };
        match serde_json::from_str(&line).with_context(|| format!("its report is '{line}'"))? {
            Report::Ready { scheduling, declared } => Ok(Readiness::Ready(Ready { scheduling, declared })),
            Report::Silence(silence) => {
                self.silence = Some(silence);
                Ok(Readiness::NotYet)
            }
            Report::Due { .. } => Ok(Readiness::NotYet),
            Report::Ended(end) => {
                self.end = Some(end);
                Ok(Readiness::Closed)
            }
        }
    }

    /// The report that another process was silent, if there is one. Once the process has ended, waits for its last reports.
    pub(super) fn silence(&mut self, has_ended: bool) -> Option<Silence> {
        if has_ended {
            while let Ok(line) = self.lines.recv() {
                self.keep(&line);
            }
        }
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
        loop {
            match self.lines.try_recv() {
                Ok(line) => self.keep(&line),
                Err(error) => {
                    self.is_closed |= error == TryRecvError::Disconnected;
                    return;
                }
            }
        }
    }

    fn keep(&mut self, line: &str) {
        match serde_json::from_str(line) {
            Ok(Report::Silence(silence)) => self.silence = Some(silence),
            Ok(Report::Due { fault, now_ns }) => self.due.push_back(Due { fault, now_ns }),
            Ok(Report::Ended(end)) => self.end = Some(end),
            Ok(Report::Ready { .. }) | Err(_) => {}
        }
    }
}
