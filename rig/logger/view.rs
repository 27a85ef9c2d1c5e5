//! How a run goes, while it goes: a picture that stays in its place on a terminal, a line a second
//! elsewhere.
//!
//! It looks at what the logger drains anyway and writes to standard error; no other process knows of it.

use std::fmt::Write as _;
use std::io::{self, IsTerminal, Write as _};

use masseter_shared::can::tap::{self, Tapped};
use masseter_shared::can::wire::{self, Rates};
use masseter_shared::clock::SECOND_NS;
use masseter_shared::geometry::AXIS_NAMES;
use masseter_shared::messages::codes::{ControllerState, DriveCondition};
use masseter_shared::messages::{Reading, State};
use nalgebra::Vector3;

use crate::recording::{Recorded, Topic};

/// How often a line is written, ns.
const LINE_NS: u64 = SECOND_NS;
/// How often the picture is drawn, ns.
const PICTURE_NS: u64 = SECOND_NS / 5;
/// Upper ends of the histogram's classes, ns late; what is later has a class of its own.
const CLASSES_NS: [u64; 5] = [1_000, 10_000, 100_000, 1_000_000, 10_000_000];
const CLASS_NAMES: [&str; 6] = ["1 µs", "10 µs", "100 µs", "1 ms", "10 ms", "later"];
/// Length of the histogram's longest bar.
const BAR: f64 = 40.0;

/// How progress is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    /// Not at all.
    Quiet,
    /// A line a second.
    Lines,
    /// A picture in its place.
    Picture,
}

impl Mode {
    /// What suits standard error.
    pub(super) fn suitable(quiet: bool) -> Self {
        if quiet {
            Self::Quiet
        } else if io::stderr().is_terminal() {
            Self::Picture
        } else {
            Self::Lines
        }
    }
}

/// What has been seen lately.
#[derive(Debug, Default)]
struct Seen {
    state: State,
    reading: Reading,
    /// Wake-ups of both loops since the last picture, by their class.
    late: [u64; CLASS_NAMES.len()],
    /// Time that frames took on each bus since the last picture, ns.
    busy_ns: Vec<u64>,
    /// Last sequence number of each topic with one publisher.
    last: [u64; Topic::ALL.len()],
    dropped: u64,
}

impl Seen {
    fn take(&mut self, message: &Recorded, rates: Rates) {
        match message {
            Recorded::State(state) => {
                self.late(state.woke_ns.saturating_sub(state.due_ns));
                self.count(Topic::State, state.seq);
                self.state = *state;
            }
            Recorded::Reading(reading) => {
                self.late(reading.woke_ns.saturating_sub(reading.due_ns));
                self.count(Topic::Reading, reading.seq);
                self.reading = *reading;
            }
            Recorded::Frame(frame) => {
                self.count(Topic::Frame, frame.seq);
                if let Ok(Tapped::Frame(received)) = tap::decode(frame) {
                    let bus = usize::from(frame.bus);
                    self.busy_ns.resize(self.busy_ns.len().max(bus + 1), 0);
                    self.busy_ns[bus] += rates.duration_ns(wire::frame_bits(&received.frame));
                }
            }
            Recorded::Command(command) => self.count(Topic::Command, command.seq),
            Recorded::Truth(truth) => self.count(Topic::Truth, truth.seq),
            Recorded::Event(_) => {}
        }
    }

    fn late(&mut self, late_ns: u64) {
        let class = CLASSES_NS.iter().position(|end_ns| late_ns < *end_ns).unwrap_or(CLASSES_NS.len());
        self.late[class] += 1;
    }

    fn count(&mut self, topic: Topic, seq: u64) {
        let last = &mut self.last[topic as usize];
        self.dropped += seq.saturating_sub(*last + 1);
        *last = seq;
    }

    /// Distance of the estimated from the wanted platform, mm.
    fn error_mm(&self) -> f64 {
        let wanted = Vector3::from(self.state.desired_position_m);
        let found = Vector3::from(self.state.estimated_position_m);
        (wanted - found).norm() * 1e3
    }

    fn controller(&self) -> &'static str {
        ControllerState::try_from(self.state.controller_state).map_or("?", ControllerState::name)
    }

    fn skipped(&self) -> u64 {
        self.state.skipped_cycles + self.reading.skipped_cycles
    }

    fn line(&self, lost: u64) -> String {
        format!(
            "  {:<13} cycle {:>8}   motion {:>7.2} s   platform off by {:>6.3} mm   skipped {}   dropped {}",
            self.controller(),
            self.state.cycle,
            self.state.motion_time_s.max(0.0),
            self.error_mm(),
            self.skipped(),
            self.dropped + lost,
        )
    }

    /// The picture; `passed_ns` since the last one.
    fn picture(&self, lost: u64, passed_ns: u64) -> Result<String, std::fmt::Error> {
        let mut text = self.line(lost) + "\n";
        let most = self.late.iter().copied().max().unwrap_or(0).max(1) as f64;
        for (name, count) in CLASS_NAMES.iter().zip(self.late) {
            let bar = "█".repeat((count as f64 / most * BAR).ceil() as usize);
            writeln!(text, "  wake-up within {name:>6} {count:>7} {bar}")?;
        }
        text.push_str("  buses ");
        for (bus, busy_ns) in self.busy_ns.iter().enumerate() {
            write!(text, "  can{bus} {:>3.0} %", *busy_ns as f64 / passed_ns as f64 * 100.0)?;
        }
        text.push_str("\n  drives");
        for (axis, state) in AXIS_NAMES.iter().zip(self.reading.drive_state) {
            write!(text, "  {axis} {}", DriveCondition::try_from(state).map_or("?", DriveCondition::name))?;
        }
        text.push('\n');
        Ok(text)
    }
}

/// Shows how the run goes.
#[derive(Debug)]
pub(super) struct View {
    mode: Mode,
    seen: Seen,
    rates: Rates,
    shown_ns: u64,
    /// Lines of the picture that stands on the terminal.
    standing: usize,
}

impl View {
    pub(super) fn new(mode: Mode, rates: Rates, now_ns: u64) -> Self {
        Self { mode, seen: Seen::default(), rates, shown_ns: now_ns, standing: 0 }
    }

    /// Looks at a message.
    pub(super) fn take(&mut self, message: &Recorded) {
        if self.mode != Mode::Quiet {
            self.seen.take(message, self.rates);
        }
    }

    /// Shows what was seen, if it is time to. `lost` messages were received and not recorded.
    pub(super) fn show(&mut self, now_ns: u64, lost: u64) {
        let passed_ns = now_ns.saturating_sub(self.shown_ns);
        match self.mode {
            Mode::Lines if passed_ns >= LINE_NS => eprintln!("{}", self.seen.line(lost)),
            Mode::Picture if passed_ns >= PICTURE_NS => self.draw(passed_ns, lost),
            _ => return,
        }
        self.shown_ns = now_ns;
        self.seen.late = Default::default();
        self.seen.busy_ns.fill(0);
    }

    /// Draws over the picture before. A terminal that is gone is no fault of the run.
    fn draw(&mut self, passed_ns: u64, lost: u64) {
        let picture = self.seen.picture(lost, passed_ns).expect("a string takes any text");
        let up = if self.standing > 0 { format!("\x1b[{}A", self.standing) } else { String::new() };
        let lines = picture.replace('\n', "\x1b[K\n");
        let _ = io::stderr().write_all((up + &lines).as_bytes());
        self.standing = picture.lines().count();
    }
}

#[cfg(test)]
mod tests {
    use masseter_shared::can::Bitrate;
    use masseter_shared::geometry::AXES;
    use masseter_shared::messages::FrameTap;

    use super::*;

    fn seen() -> Seen {
        let mut seen = Seen::default();
        let rates = Rates::classical(Bitrate::MAX);
        for cycle in 1..=10 {
            seen.take(
                &Recorded::State(State {
                    seq: cycle,
                    cycle,
                    due_ns: 1000,
                    woke_ns: if cycle == 3 { 51_000 } else { 1100 },
                    controller_state: ControllerState::Running.code(),
                    estimated_position_m: [0.002, 0.0, 0.0],
                    ..Default::default()
                }),
                rates,
            );
        }
        seen.take(
            &Recorded::Reading(Reading {
                seq: 4,
                drive_state: [DriveCondition::OperationEnabled.code(); AXES],
                ..Default::default()
            }),
            rates,
        );
        seen.take(&Recorded::Frame(FrameTap { seq: 1, bus: 1, length: 8, ..Default::default() }), rates);
        seen
    }

    #[test]
    fn the_line_says_state_error_and_losses() {
        let line = seen().line(2);
        for words in ["running", "cycle       10", "off by  2.000 mm", "skipped 0", "dropped 5"] {
            assert!(line.contains(words), "{words}: {line}");
        }
    }

    #[test]
    fn the_picture_shows_histogram_buses_and_drives() {
        let seen = seen();
        let picture = seen.picture(0, seen.busy_ns[1] * 4).unwrap();
        for words in [
            "within   1 µs      10",
            "within 100 µs       1",
            "can0   0 %  can1  25 %",
            "l3 operation_enabled",
        ] {
            assert!(picture.contains(words), "{words}: {picture}");
        }
    }
}
