//! A log as a bus: the frames that one party sends are compared with those of the log, and get the answers of the log.
//!
//! A replay depends neither on CANopen nor on the nodes that the log is of. It never refuses a frame, and has no error states.

use std::collections::VecDeque;

use crate::candump::{self, ReadError};
use crate::{Bus, BusStatus, CanId, ErrorState, Frame, ReceiveError, Received, SendError, Tapped};

/// What a replay does with the frames of an identifier.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// The party under test sent them: it has to send them again.
    Sent,
    /// Others sent them: the party under test receives them.
    Received,
    /// They have no part in the replay, and may be sent or not.
    LeftOut,
}

/// A log that cannot be replayed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ReplayError {
    /// A line cannot be read.
    #[error(transparent)]
    Log(#[from] ReadError),
    /// No frame of the log has a part in the replay.
    #[error("the log has no frames to replay of interface '{0}'; check its name")]
    NoFrames(String),
}

/// The first difference between a log and its replay.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {frame} {deviation}")]
pub struct Difference {
    /// The line in the log, from 1.
    pub line: usize,
    /// Its frame.
    pub frame: Frame,
    /// What is different.
    pub deviation: Deviation,
}

/// How a replay differs from a line of its log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Deviation {
    /// Another frame is sent in its place: one of its identifier, or one of whose identifier the rest of the log has none.
    #[error("in the log, but {0} is sent")]
    Sent(Frame),
    /// The frame is sent that much too late, or too early where negative, ns.
    #[error("is sent {} µs {}", .0.unsigned_abs() / 1000, if *.0 < 0 { "early" } else { "late" })]
    Off(i64),
    /// It is not sent within the window, or before the end of the replay.
    #[error("is not sent")]
    NotSent,
    /// It is not received before the end of the replay.
    #[error("is not received")]
    NotReceived,
}

#[derive(Debug, Clone, Copy)]
struct Line {
    number: usize,
    received: Received,
    is_own: bool,
    is_done: bool,
}

impl Line {
    fn deviates(&self, deviation: Deviation) -> Difference {
        Difference { line: self.number, frame: self.received.frame, deviation }
    }
}

/// One interface of a log of candump, as the port of one party.
///
/// [`send`](Bus::send) compares a frame with the party's next line of the same identifier; frames of different
/// identifiers may change their order, as they do on a wire. [`receive`](Bus::receive) gives the next frame of others,
/// once all of the party's lines before it are sent, and not before its time. So every answer follows its request,
/// however fast or slowly the party runs. A party without a clock takes `u64::MAX` for all times, and sets no window.
///
/// After the first [`Difference`] the replay is over: nothing is compared or received. What the party sends after its
/// last line is not judged, so that a log may be cut anywhere.
///
/// # Examples
/// A client reads object 1000h:
///
/// ```
/// use masseter_can::canopen::{NodeId, ObjectAddress, SdoRequest};
/// use masseter_can::{Bus, ReplayBus, Role};
///
/// let log = "(1.000000) can0 601#4000100000000000\n(1.000200) can0 581#4300100092010200\n";
/// let replay = || ReplayBus::new(log, "can0", |id| if id.number() == 0x601 { Role::Sent } else { Role::Received });
/// let node = NodeId::new(1)?;
/// let read = |index| SdoRequest::InitiateUpload { object: ObjectAddress::new(index, 0) }.frame(node);
///
/// let mut bus = replay()?;
/// assert_eq!(bus.receive(u64::MAX)?, None, "no answer before its request");
/// bus.send(u64::MAX, read(0x1000))?;
/// assert!(bus.receive(u64::MAX)?.is_some());
/// assert_eq!(bus.finish(), Ok(()));
///
/// let mut bus = replay()?;
/// bus.send(u64::MAX, read(0x1001))?;
/// let difference = bus.finish().unwrap_err().to_string();
/// assert_eq!(difference, "line 1: 601#4000100000000000 in the log, but 601#4001100000000000 is sent");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct ReplayBus {
    lines: VecDeque<Line>,
    role: fn(CanId) -> Role,
    window_ns: u64,
    difference: Option<Difference>,
}

impl ReplayBus {
    /// The frames of an interface in a log. Error messages have no part in a replay.
    ///
    /// # Errors
    /// [`ReplayError`]
    pub fn new(log: &str, interface: &str, role: fn(CanId) -> Role) -> Result<Self, ReplayError> {
        let mut lines = VecDeque::new();
        for line in candump::read(log) {
            let line = line?;
            let Tapped::Frame(tapped) = line.tapped else { continue };
            let role = role(tapped.frame.id());
            if line.interface == interface && role != Role::LeftOut {
                let received = Received { frame: tapped.frame, time_ns: tapped.time_ns };
                let is_own = role == Role::Sent;
                lines.push_back(Line { number: line.number, received, is_own, is_done: false });
            }
        }
        if lines.is_empty() {
            return Err(ReplayError::NoFrames(interface.to_owned()));
        }
        Ok(Self { lines, role, window_ns: u64::MAX, difference: None })
    }

    /// The same, with frames that must be sent within `window_ns` of their times in the log. Without a window times are
    /// not compared.
    #[must_use]
    pub fn within(self, window_ns: u64) -> Self {
        Self { window_ns, ..self }
    }

    /// The next frame of this identifier that is to be sent, with its time; none after the last, or after a difference.
    pub fn next_due(&self, id: CanId) -> Option<Received> {
        if self.difference.is_some() {
            return None;
        }
        self.unsent_lines().map(|line| line.received).find(|received| received.frame.id() == id)
    }

    /// Ends the replay.
    ///
    /// # Errors
    /// The first [`Difference`].
    pub fn finish(&self) -> Result<(), Difference> {
        if let Some(difference) = self.difference {
            return Err(difference);
        }
        let Some(rest) = self.lines.iter().find(|line| !line.is_done) else { return Ok(()) };
        Err(rest.deviates(if rest.is_own { Deviation::NotSent } else { Deviation::NotReceived }))
    }

    fn unsent_lines(&self) -> impl Iterator<Item = &Line> {
        self.lines.iter().filter(|line| line.is_own && !line.is_done)
    }

    /// Takes a frame of the party as its next one of that identifier.
    fn compare(&mut self, now_ns: u64, got: Frame) -> Result<(), Difference> {
        let Some(&next) = self.unsent_lines().next() else { return Ok(()) };
        // An answer that waits for this frame leads to other differences, which are only consequences.
        if next.received.frame != got && now_ns.saturating_sub(next.received.time_ns) > self.window_ns {
            return Err(next.deviates(Deviation::NotSent));
        }
        let is_it = |line: &&mut Line| line.is_own && !line.is_done && line.received.frame.id() == got.id();
        let Some(line) = self.lines.iter_mut().find(is_it) else {
            return Err(next.deviates(Deviation::Sent(got)));
        };
        let Received { frame, time_ns } = line.received;
        if frame != got {
            return Err(line.deviates(Deviation::Sent(got)));
        }
        if now_ns.abs_diff(time_ns) > self.window_ns {
            return Err(line.deviates(Deviation::Off(now_ns.wrapping_sub(time_ns) as i64)));
        }
        line.is_done = true;
        Ok(())
    }
}

impl Bus for ReplayBus {
    fn send(&mut self, now_ns: u64, frame: Frame) -> Result<(), SendError> {
        if self.difference.is_none() && (self.role)(frame.id()) != Role::LeftOut {
            self.difference = self.compare(now_ns, frame).err();
        }
        Ok(())
    }

    fn receive(&mut self, now_ns: u64) -> Result<Option<Received>, ReceiveError> {
        while self.lines.front().is_some_and(|line| line.is_done) {
            self.lines.pop_front();
        }
        let has_come =
            |line: &&Line| !line.is_own && line.received.time_ns <= now_ns && self.difference.is_none();
        let received = self.lines.front().filter(has_come).map(|line| line.received);
        if received.is_some() {
            self.lines.pop_front();
        }
        Ok(received)
    }

    fn status(&self) -> BusStatus {
        BusStatus { state: ErrorState::Active, tec: 0, rec: 0 }
    }

    fn unsent(&self) -> usize {
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A master of two nodes that sends SYNC, and asks both by SDO.
    const LOG: &str = "\
        (1.000000) can0 080#\n\
        (1.000100) can1 080#\n\
        (1.000200) can0 701#00\n\
        (1.000300) can0 601#01\n\
        (1.000400) can0 602#02\n\
        (1.000500) can0 582#04\n\
        (1.000600) can0 581#03\n\
        (1.000700) can0 77F#05\n\
        (1.010000) can0 080#\n\
        (1.010100) can0 601#05\n";

    fn role(id: CanId) -> Role {
        match id.number() {
            0x080 | 0x601 | 0x602 => Role::Sent,
            0x77F => Role::LeftOut,
            _ => Role::Received,
        }
    }

    fn replay() -> ReplayBus {
        ReplayBus::new(LOG, "can0", role).unwrap()
    }

    fn frame(id: u16, data: &[u8]) -> Frame {
        Frame::new(CanId::standard(id).unwrap(), data).unwrap()
    }

    fn differs(line: usize, frame: Frame, deviation: Deviation) -> Difference {
        Difference { line, frame, deviation }
    }

    fn received(bus: &mut ReplayBus, now_ns: u64) -> Vec<u32> {
        std::iter::from_fn(|| bus.receive(now_ns).unwrap())
            .map(|received| received.frame.id().number())
            .collect()
    }

    /// Sends them at these times, ms after the start of the log, and fetches what has come after each.
    fn play(bus: &mut ReplayBus, frames: &[(u64, u16, &[u8])]) {
        for &(ms, id, data) in frames {
            let now_ns = 1_000_000_000 + ms * 1_000_000;
            bus.send(now_ns, frame(id, data)).unwrap();
            received(bus, u64::MAX);
        }
    }

    const AS_RECORDED: [(u64, u16, &[u8]); 5] =
        [(0, 0x080, &[]), (0, 0x601, &[1]), (0, 0x602, &[2]), (10, 0x080, &[]), (10, 0x601, &[5])];

    #[test]
    fn an_answer_comes_after_all_that_was_sent_before_it_and_not_before_its_time() {
        let mut bus = replay();
        assert_eq!(received(&mut bus, u64::MAX), []);
        bus.send(0, frame(0x080, &[])).unwrap();
        assert_eq!(received(&mut bus, 1_000_199_999), []);
        assert_eq!(received(&mut bus, 1_000_200_000), [0x701]);
        bus.send(0, frame(0x602, &[2])).unwrap();
        assert_eq!(received(&mut bus, u64::MAX), [], "601 was sent before the answer too");
        bus.send(0, frame(0x601, &[1])).unwrap();
        assert_eq!(received(&mut bus, u64::MAX), [0x582, 0x581], "in the order of the log");
        assert_eq!(bus.next_due(CanId::standard(0x080).unwrap()).unwrap().time_ns, 1_010_000_000);
        assert_eq!(bus.finish(), Err(differs(9, frame(0x080, &[]), Deviation::NotSent)));
    }

    #[test]
    fn a_replay_ends_without_a_difference_and_what_follows_is_not_judged() {
        let mut bus = replay();
        play(&mut bus, &AS_RECORDED);
        play(&mut bus, &[(20, 0x080, &[]), (20, 0x77F, &[5]), (20, 0x000, &[1, 1])]);
        assert_eq!(bus.finish(), Ok(()));
        let mut bus = replay();
        for (_, id, data) in AS_RECORDED {
            bus.send(0, frame(id, data)).unwrap();
        }
        assert_eq!(bus.finish(), Err(differs(3, frame(0x701, &[0]), Deviation::NotReceived)));
    }

    #[test]
    fn every_change_of_what_is_sent_is_a_difference() {
        let with = |place: usize, other: &[(u64, u16, &'static [u8])], removed: usize| {
            let mut frames = AS_RECORDED.to_vec();
            frames.splice(place..place + removed, other.iter().copied());
            let mut bus = replay().within(1_000_000);
            play(&mut bus, &frames);
            bus.finish()
        };
        assert_eq!(with(0, &[], 0), Ok(()));
        let differs = |line, id, data: &[u8], deviation| Err(differs(line, frame(id, data), deviation));
        let other = Deviation::Sent(frame(0x601, &[1, 0]));
        assert_eq!(with(1, &[(0, 0x601, &[1, 0])], 1), differs(4, 0x601, &[1], other));
        assert_eq!(with(1, &[], 1), differs(4, 0x601, &[1], Deviation::NotSent), "removed");
        assert_eq!(with(4, &[], 1), differs(10, 0x601, &[5], Deviation::NotSent), "removed at the end");
        let start = Deviation::Sent(frame(0x000, &[1, 1]));
        assert_eq!(with(3, &[(0, 0x000, &[1, 1])], 0), differs(9, 0x080, &[], start), "inserted");
        let answer = Deviation::Sent(frame(0x581, &[]));
        assert_eq!(with(3, &[(0, 0x581, &[])], 0), differs(9, 0x080, &[], answer), "a frame of others");
        let early = with(3, &[(3, 0x080, &[])], 1);
        assert_eq!(early, differs(9, 0x080, &[], Deviation::Off(-7_000_000)));
        assert_eq!(early.unwrap_err().to_string(), "line 9: 080# is sent 7000 µs early");
        let late = with(4, &[(20, 0x601, &[5])], 1);
        assert_eq!(late, differs(10, 0x601, &[5], Deviation::Off(9_900_000)));
    }

    #[test]
    fn nothing_is_received_after_a_difference() {
        let mut bus = replay();
        bus.send(0, frame(0x080, &[1])).unwrap();
        assert_eq!(received(&mut bus, u64::MAX), []);
        assert_eq!(bus.next_due(CanId::standard(0x601).unwrap()), None);
    }

    #[test]
    fn a_log_without_frames_of_the_interface_or_with_a_bad_line_is_refused() {
        let error = ReplayBus::new(LOG, "can2", role).unwrap_err().to_string();
        assert_eq!(error, "the log has no frames to replay of interface 'can2'; check its name");
        let error = ReplayBus::new(&format!("{LOG}(1."), "can0", role).unwrap_err().to_string();
        assert!(error.starts_with("line 11: expected "), "{error}");
    }
}
