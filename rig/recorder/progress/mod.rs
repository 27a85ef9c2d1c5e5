//! The progress of a run on standard error: a panel that is redrawn in place on a terminal, one line a second elsewhere.
//!
//! It uses what the recorder receives anyway. It leaves no mode of the terminal changed.

mod figures;
#[cfg(test)]
mod tests;

use std::fmt::Write as _;
use std::io::{self, IsTerminal};

use hdrhistogram::Histogram;
use masseter_can::Bitrate;
use masseter_recording::Recorded;
use masseter_shared::clock::SECOND_NS;
use masseter_shared::geometry::AXIS_NAMES;
use masseter_shared::messages::codes::{ControllerState, drive_state_name};

use crate::foxglove::ClientCounts;
use figures::ProgressFigures;

/// Time between two lines, ns.
const LINE_INTERVAL_NS: u64 = SECOND_NS;
/// Time between two panels, ns.
const PANEL_INTERVAL_NS: u64 = SECOND_NS / 5;
/// Columns of the progress bar.
const BAR: usize = 40;
/// Moves the cursor to the beginning of the line and erases everything below.
const ERASE_BELOW: &str = "\r\x1b[J";
/// Switches line wrapping off and on: a wrapped line would move the panel.
const WRAP_OFF: &str = "\x1b[?7l";
const WRAP_ON: &str = "\x1b[?7h";

/// What did not reach the recording or a Foxglove client.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Losses {
    /// Messages received but not recorded.
    pub unrecorded: u64,
    /// Foxglove clients, if a server runs.
    pub clients: Option<ClientCounts>,
}

/// Gathers figures and writes them as text.
#[derive(Debug)]
pub(super) struct Progress {
    /// Whether a panel is drawn instead of lines.
    is_panel: bool,
    figures: ProgressFigures,
    /// Duration of the motion in its own time, s.
    motion_s: f64,
    shown_ns: u64,
    /// Lines of the panel above the cursor.
    panel_lines: usize,
}

impl Progress {
    /// In the form that suits standard error.
    pub(super) fn new(bitrate: Bitrate, motion_s: f64, now_ns: u64) -> Self {
        let is_dumb = std::env::var_os("TERM").is_none_or(|term| term == "dumb");
        Self::with_form(io::stderr().is_terminal() && !is_dumb, bitrate, motion_s, now_ns)
    }

    fn with_form(is_panel: bool, bitrate: Bitrate, motion_s: f64, now_ns: u64) -> Self {
        Self { is_panel, figures: ProgressFigures::new(bitrate), motion_s, shown_ns: now_ns, panel_lines: 0 }
    }

    pub(super) fn add(&mut self, message: &Recorded) {
        self.figures.add(message);
    }

    /// Whether the next text is due.
    pub(super) fn is_due(&self, now_ns: u64) -> bool {
        let interval_ns = if self.is_panel { PANEL_INTERVAL_NS } else { LINE_INTERVAL_NS };
        now_ns.saturating_sub(self.shown_ns) >= interval_ns
    }

    /// The next line, or the next panel for a terminal with `rows` rows.
    pub(super) fn next(&mut self, now_ns: u64, losses: Losses, rows: Option<usize>) -> String {
        let text = if self.is_panel { self.redraw(now_ns, losses, rows) } else { self.line(losses) + "\n" };
        self.shown_ns = now_ns;
        self.figures.start_interval();
        text
    }

    /// The panel at the end of the run, where panels are drawn.
    pub(super) fn last_panel(mut self, now_ns: u64, losses: Losses, rows: Option<usize>) -> Option<String> {
        self.is_panel.then(|| self.redraw(now_ns, losses, rows))
    }

    /// Leaves the panel on the terminal, since other text follows: the next one is drawn below.
    pub(super) fn start_new_panel(&mut self) {
        self.panel_lines = 0;
    }

    /// Draws over the panel before. Lines without room on the terminal are left out: a panel that scrolls cannot be
    /// drawn over.
    fn redraw(&mut self, now_ns: u64, losses: Losses, rows: Option<usize>) -> String {
        let interval_ns = now_ns.saturating_sub(self.shown_ns).max(1);
        let panel = self.panel(losses, interval_ns).expect("a string takes any text");
        // The cursor takes a row below the panel.
        let room = rows.map_or(usize::MAX, |rows| rows - 1);
        let panel: Vec<_> = panel.split_inclusive('\n').take(room).collect();
        let up = if self.panel_lines > 0 { format!("\x1b[{}A", self.panel_lines) } else { String::new() };
        self.panel_lines = panel.len();
        format!("{up}{ERASE_BELOW}{WRAP_OFF}{}{WRAP_ON}", panel.concat())
    }

    fn line(&self, losses: Losses) -> String {
        let figures = &self.figures;
        let max_late_ns = figures.controller_late_ns.max().max(figures.plant_late_ns.max());
        format!(
            "  {}   tracking error {:.3} mm, max {:.3}   wake-up latency max {:.0} µs   {}",
            self.motion(),
            figures.tracking_error_mm(),
            figures.tracking_errors_mm.largest,
            max_late_ns as f64 / 1e3,
            self.counts(losses),
        )
    }

    /// The panel; the load of the buses is that of the last `interval_ns`.
    fn panel(&self, losses: Losses, interval_ns: u64) -> Result<String, std::fmt::Error> {
        let figures = &self.figures;
        let mut text = String::new();
        writeln!(text, "  {}  {}", self.motion(), self.bar())?;
        writeln!(text, "  cycle {:>8}   {}", figures.state.cycle, self.counts(losses))?;
        writeln!(
            text,
            "  tracking error {:.3} mm, rms {:.3}, max {:.3}",
            figures.tracking_error_mm(),
            figures.tracking_errors_mm.rms(),
            figures.tracking_errors_mm.largest,
        )?;
        writeln!(text, "  wake-up latency, µs    p50       p99       max")?;
        write_percentiles(&mut text, "controller", &figures.controller_late_ns)?;
        write_percentiles(&mut text, "plant", &figures.plant_late_ns)?;
        text.push_str("  bus load");
        for (bus, busy_ns) in figures.busy_ns.iter().enumerate() {
            write!(text, "  can{bus} {:>3.0} %", *busy_ns as f64 / interval_ns as f64 * 100.0)?;
        }
        writeln!(text, "\n  drives  {}", self.drives())?;
        Ok(text)
    }

    fn motion(&self) -> String {
        let state = self.figures.controller_state().map_or("?", ControllerState::name);
        format!("{state:<13} motion {:>7.2} of {:.2} s", self.motion_time_s(), self.motion_s)
    }

    fn motion_time_s(&self) -> f64 {
        self.figures.state.motion_time_s.max(0.0)
    }

    fn bar(&self) -> String {
        let share = (self.motion_time_s() / self.motion_s.max(f64::MIN_POSITIVE)).min(1.0);
        let done = (share * BAR as f64) as usize;
        format!("{}{} {:>3.0} %", "█".repeat(done), "░".repeat(BAR - done), share * 100.0)
    }

    fn counts(&self, Losses { unrecorded, clients }: Losses) -> String {
        let Self { figures, .. } = self;
        let counts = format!("missed {}   dropped {}", figures.missed_cycles(), figures.missing + unrecorded);
        match clients {
            Some(ClientCounts { connected, dropped }) => {
                format!("{counts}   live {connected} watching, {dropped} dropped")
            }
            None => counts,
        }
    }

    fn drives(&self) -> String {
        let states = self.figures.reading.drive_state.map(|code| drive_state_name(code).unwrap_or("?"));
        if states.iter().all(|state| *state == states[0]) {
            return format!("all {}", states[0]);
        }
        AXIS_NAMES
            .iter()
            .zip(states)
            .map(|(axis, state)| format!("{axis} {state}"))
            .collect::<Vec<_>>()
            .join("  ")
    }
}

fn write_percentiles(text: &mut String, loop_name: &str, late_ns: &Histogram<u64>) -> std::fmt::Result {
    let [p50, p99] = [0.5, 0.99].map(|quantile| late_ns.value_at_quantile(quantile) as f64 / 1e3);
    let max = late_ns.max() as f64 / 1e3;
    writeln!(text, "    {loop_name:<12} {p50:>9.1} {p99:>9.1} {max:>9.1}")
}
