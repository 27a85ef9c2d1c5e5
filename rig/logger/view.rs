//! How a run goes, while it goes: a picture that stays in its place on a terminal, a line a second
//! elsewhere.
//!
//! It looks at what the logger drains anyway; no other process knows of it.
//! It changes nothing of the terminal that outlives a picture.

mod seen;
#[cfg(test)]
mod tests;

use std::fmt::Write as _;
use std::io::{self, IsTerminal};

use masseter_can::wire::Rates;
use masseter_shared::clock::SECOND_NS;
use masseter_shared::geometry::AXIS_NAMES;
use masseter_shared::messages::codes::{ControllerState, drive_state_name};

use crate::live::Watched;
use masseter_recording::Recorded;
use seen::{CLASS_NAMES, Lateness, Seen};

/// How often a line is written, ns.
const LINE_NS: u64 = SECOND_NS;
/// How often the picture is drawn, ns.
const PICTURE_NS: u64 = SECOND_NS / 5;
/// Length of the longest bar.
const BAR: usize = 40;
/// To the beginning of the line, and nothing of what stood below; a picture begins with it.
const ERASE_BELOW: &str = "\r\x1b[J";
/// Lines that are too long end at the edge of the terminal while the picture is drawn, and wrap again
/// afterwards: a wrapped line would move the picture.
const CUT_LINES: &str = "\x1b[?7l";
const WRAP_LINES: &str = "\x1b[?7h";

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
        let can_move_cursor =
            io::stderr().is_terminal() && std::env::var_os("TERM").is_some_and(|t| t != "dumb");
        match (quiet, can_move_cursor) {
            (true, _) => Self::Quiet,
            (false, true) => Self::Picture,
            (false, false) => Self::Lines,
        }
    }
}

/// What was not recorded, and who watches elsewhere and misses what.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Losses {
    /// Messages that were received and not recorded.
    pub lost: u64,
    /// Who watches elsewhere, if anybody may.
    pub live: Option<Watched>,
}

/// Shows how the run goes.
#[derive(Debug)]
pub(super) struct View {
    mode: Mode,
    seen: Seen,
    /// How far the motion will come, s, if that is known.
    motion_s: Option<f64>,
    shown_ns: u64,
    /// Lines of the picture that stands on the terminal.
    standing: usize,
}

impl View {
    pub(super) fn new(mode: Mode, rates: Rates, motion_s: Option<f64>, now_ns: u64) -> Self {
        Self { mode, seen: Seen::new(rates), motion_s, shown_ns: now_ns, standing: 0 }
    }

    /// Whether anything is to be shown.
    pub(super) fn looks(&self) -> bool {
        self.mode != Mode::Quiet
    }

    /// Looks at a message.
    pub(super) fn take(&mut self, message: &Recorded) {
        if self.looks() {
            self.seen.take(message);
        }
    }

    /// Whether it is time to show what was seen.
    pub(super) fn is_due(&self, now_ns: u64) -> bool {
        let passed_ns = now_ns.saturating_sub(self.shown_ns);
        match self.mode {
            Mode::Quiet => false,
            Mode::Lines => passed_ns >= LINE_NS,
            Mode::Picture => passed_ns >= PICTURE_NS,
        }
    }

    /// What was seen since the last time, for a terminal with so many rows.
    pub(super) fn next(&mut self, now_ns: u64, losses: Losses, rows: Option<usize>) -> String {
        let text = match self.mode {
            Mode::Picture => self.draw(now_ns, losses, rows),
            Mode::Quiet | Mode::Lines => self.line(losses) + "\n",
        };
        self.shown_ns = now_ns;
        self.seen.forget_lately();
        text
    }

    /// The last picture, where pictures are shown.
    pub(super) fn last(&mut self, now_ns: u64, losses: Losses, rows: Option<usize>) -> Option<String> {
        (self.mode == Mode::Picture).then(|| self.draw(now_ns, losses, rows))
    }

    /// Something else was written below the picture: the next one begins there.
    pub(super) fn leave_picture(&mut self) {
        self.standing = 0;
    }

    /// Draws over the picture before. What the terminal has no rows for is left out: a picture that scrolls cannot be
    /// drawn over.
    fn draw(&mut self, now_ns: u64, losses: Losses, rows: Option<usize>) -> String {
        let passed_ns = now_ns.saturating_sub(self.shown_ns).max(1);
        let picture = self.picture(losses, passed_ns).expect("a string takes any text");
        // The cursor stands below it.
        let most = rows.map_or(usize::MAX, |rows| rows - 1);
        let picture: Vec<_> = picture.split_inclusive('\n').take(most).collect();
        let up = if self.standing > 0 { format!("\x1b[{}A", self.standing) } else { String::new() };
        self.standing = picture.len();
        format!("{up}{ERASE_BELOW}{CUT_LINES}{}{WRAP_LINES}", picture.concat())
    }

    fn line(&self, losses: Losses) -> String {
        let seen = &self.seen;
        let worst_ns = seen.controller.of_run_ns.max().max(seen.plant.of_run_ns.max());
        format!(
            "  {:<13} {}   off by {:>6.3} mm, at most {:.3}   late at most {:.0} µs   missed {}   {}",
            self.controller(),
            self.motion(),
            seen.error_now_mm(),
            seen.error_mm.largest,
            worst_ns as f64 / 1e3,
            seen.missed(),
            self.dropped(losses),
        )
    }

    /// The picture; `passed_ns` since the last one.
    fn picture(&self, losses: Losses, passed_ns: u64) -> Result<String, std::fmt::Error> {
        let Seen { state, controller, plant, error_mm, .. } = &self.seen;
        let mut text = String::new();
        writeln!(text, "  {:<13} {}  {}", self.controller(), self.motion(), self.progress())?;
        writeln!(
            text,
            "  cycle {:>8}   missed {}   {}",
            state.cycle,
            self.seen.missed(),
            self.dropped(losses)
        )?;
        writeln!(
            text,
            "  platform off by {:.3} mm, rms {:.3}, at most {:.3}",
            self.seen.error_now_mm(),
            error_mm.rms(),
            error_mm.largest,
        )?;
        writeln!(text, "  woke late, µs      p50       p99       max")?;
        write_percentiles(&mut text, "controller", controller)?;
        write_percentiles(&mut text, "plant", plant)?;
        write_classes(&mut text, controller, plant)?;
        self.write_buses(&mut text, passed_ns)?;
        self.write_drives(&mut text)?;
        Ok(text)
    }

    fn controller(&self) -> &'static str {
        self.seen.controller_state().map_or("?", ControllerState::name)
    }

    fn motion_time_s(&self) -> f64 {
        self.seen.state.motion_time_s.max(0.0)
    }

    fn motion(&self) -> String {
        let time_s = self.motion_time_s();
        match self.motion_s {
            Some(motion_s) => format!("motion {time_s:>7.2} of {motion_s:.2} s"),
            None => format!("motion {time_s:>7.2} s"),
        }
    }

    fn progress(&self) -> String {
        self.motion_s.map_or_else(String::new, |motion_s| {
            let share = (self.motion_time_s() / motion_s.max(f64::MIN_POSITIVE)).min(1.0);
            let done = (share * BAR as f64) as usize;
            format!("{}{} {:>3.0} %", "█".repeat(done), "░".repeat(BAR - done), share * 100.0)
        })
    }

    fn dropped(&self, Losses { lost, live }: Losses) -> String {
        let dropped = format!("dropped {}", self.seen.missing + lost);
        match live {
            Some(Watched { clients, dropped: unseen }) => {
                format!("{dropped}   live {clients} watching, {unseen} dropped")
            }
            None => dropped,
        }
    }

    fn write_buses(&self, text: &mut String, passed_ns: u64) -> std::fmt::Result {
        text.push_str("  buses ");
        for (bus, busy_ns) in self.seen.busy_ns.iter().enumerate() {
            write!(text, "  can{bus} {:>3.0} %", *busy_ns as f64 / passed_ns as f64 * 100.0)?;
        }
        writeln!(text)
    }

    fn write_drives(&self, text: &mut String) -> std::fmt::Result {
        let name = |code| drive_state_name(code).unwrap_or("?");
        let conditions = self.seen.reading.drive_state.map(name);
        if conditions.iter().all(|condition| *condition == conditions[0]) {
            return writeln!(text, "  drives   all {}", conditions[0]);
        }
        text.push_str("  drives ");
        for (axis, condition) in AXIS_NAMES.iter().zip(conditions) {
            write!(text, "  {axis} {condition}")?;
        }
        writeln!(text)
    }
}

fn write_percentiles(
    text: &mut String,
    name: &str,
    Lateness { of_run_ns, .. }: &Lateness,
) -> std::fmt::Result {
    let [p50, p99] = [0.5, 0.99].map(|quantile| of_run_ns.value_at_quantile(quantile) as f64 / 1e3);
    let max = of_run_ns.max() as f64 / 1e3;
    writeln!(text, "    {name:<12} {p50:>8.1}  {p99:>8.1}  {max:>8.1}")
}

/// Both loops' wake-ups since the last picture.
fn write_classes(text: &mut String, controller: &Lateness, plant: &Lateness) -> std::fmt::Result {
    let counts: [u64; CLASS_NAMES.len()] =
        std::array::from_fn(|class| controller.lately[class] + plant.lately[class]);
    let most = counts.iter().copied().max().unwrap_or(0).max(1);
    for (name, count) in CLASS_NAMES.iter().zip(counts) {
        let bar = "█".repeat((count * BAR as u64).div_ceil(most) as usize);
        writeln!(text, "    within {name:>6} {count:>7} {bar}")?;
    }
    Ok(())
}
