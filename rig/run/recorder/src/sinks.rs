//! The sinks of every received message: the recording, the clients of the live page and Foxglove, and the progress on
//! standard error.
//!
//! The progress is a line that is rewritten in place on a terminal, and a new line every ten seconds elsewhere. It leaves no
//! mode of the terminal changed.

use std::io::{self, IsTerminal};

use masseter_judge::{MOVING, SequenceCheck};
use masseter_recording::{Backlog, Recorded};
use masseter_runtime::clock::SECOND_NS;
use masseter_runtime::messages::codes::{Cause, ControllerState};
use masseter_runtime::messages::{Reading, State, explain};
use masseter_scenario::wording::counted;
use masseter_terminal::{Exit, StderrWriter};
use nalgebra::Vector3;

use crate::live::{ClientCounts, ClientLosses, LiveServer};

pub(super) struct Sinks {
    pub backlog: Backlog,
    pub server: Option<LiveServer>,
    pub progress: Option<Progress>,
    pub stderr: StderrWriter,
}

impl Sinks {
    /// Hands a message that was received at `now_ns` to every sink.
    pub(super) fn distribute(&mut self, message: &Recorded, now_ns: u64) {
        self.backlog.record(message, now_ns);
        if let Some(progress) = &mut self.progress {
            progress.count_message(message);
            self.show_news(message);
        }
        if let Some(server) = &self.server {
            server.offer(message, now_ns);
        }
    }

    /// Shows what the user may have to act on while the run waits.
    fn show_news(&mut self, message: &Recorded) {
        let Recorded::Event(event) = message else { return };
        let is_news = [Cause::WaitsForDrive, Cause::FaultReset].iter().any(|news| news.code() == event.cause);
        if let Some(text) = explain(event, &[]).filter(|_| is_news) {
            self.end_line(self.losses());
            self.stderr.write(&format!("masseter: {text}\n"));
        }
    }

    fn losses(&self) -> Losses {
        let clients = self.server.as_ref().map(LiveServer::counts);
        Losses { unrecorded: self.backlog.dropped(), clients }
    }

    /// Shows the progress if it is due and the output before it is written.
    pub(super) fn show_progress(&mut self, now_ns: u64) {
        let losses = self.losses();
        let failure = self.backlog.new_failure().map(ToString::to_string);
        if let Some(failure) = failure {
            self.end_line(losses);
            self.stderr.write(&format!("masseter: {failure}; the run goes on without recording\n"));
        }
        if let Some(progress) = &mut self.progress
            && progress.is_due(now_ns)
            && self.stderr.is_idle()
        {
            self.stderr.control(progress.next_line(now_ns, losses));
        }
    }

    /// Ends the line that shows the progress, since other text follows.
    fn end_line(&self, losses: Losses) {
        if let Some(line) = self.progress.as_ref().and_then(|progress| progress.last_line(losses)) {
            self.stderr.control(line);
        }
    }

    /// Closes every sink and reports what each lacks. The recording comes first, because clients can delay the rest.
    pub(super) fn close_all(self) -> Exit {
        self.end_line(self.losses());
        let loss = self.backlog.finish().loss();
        if let Some(loss) = &loss {
            self.stderr.write(&format!("masseter: {loss}\n"));
        }
        if let Some(losses) = self.server.and_then(|server| client_losses(server.close())) {
            self.stderr.write(&format!("masseter: {losses}\n"));
        }
        self.stderr.finish();
        if loss.is_some() { Exit::Incomplete } else { Exit::Passed }
    }
}

/// A sentence on what Foxglove clients missed; none if they missed nothing.
fn client_losses(ClientLosses { dropped, cut_off }: ClientLosses) -> Option<String> {
    let dropped = (dropped > 0)
        .then(|| format!("{} not shown live, because clients read too slowly", counted(dropped, "message")));
    let cut_off =
        (cut_off > 0).then(|| format!("{} did not read to the end", counted(cut_off as u64, "client")));
    let losses: Vec<_> = [dropped, cut_off].into_iter().flatten().collect();
    (!losses.is_empty()).then(|| losses.join("; "))
}

/// Time between two lines, ns: a log of a short run has its verdict in sight.
const LINE_INTERVAL_NS: u64 = 10 * SECOND_NS;
/// The same where the line is rewritten, ns.
const REWRITE_INTERVAL_NS: u64 = SECOND_NS / 5;
/// What separates two figures.
const BETWEEN: &str = "   ";
/// Erases the line and switches wrapping off: a wrapped line could not be rewritten.
const BEFORE_REWRITE: &str = "\r\x1b[2K\x1b[?7l";
/// Switches wrapping on again, and leaves the cursor where an echoed ^C stays in the line.
const AFTER_REWRITE: &str = "\x1b[?7h\r";

/// What did not reach the recording or a Foxglove client.
#[derive(Debug, Clone, Copy, Default)]
struct Losses {
    /// Messages received but not recorded.
    unrecorded: u64,
    /// Foxglove clients, if a server runs.
    clients: Option<ClientCounts>,
}

/// Gathers figures and writes them as text.
#[derive(Debug, Default)]
pub(super) struct Progress {
    /// Whether the line is rewritten.
    is_in_place: bool,
    /// Duration of the motion, and of a cycle, s.
    motion_s: f64,
    period_s: f64,
    /// Cycles in which the motion ran.
    running: u64,
    shown_ns: u64,
    /// The newest state and reading.
    state: State,
    reading: Reading,
    max_late_ns: u64,
    /// Largest distance between desired and estimated position in a moving state, mm.
    max_error_mm: f64,
    /// Of all messages but the events.
    sequence: SequenceCheck,
}

impl Progress {
    /// In the form that suits standard error.
    pub(super) fn new(motion_s: f64, period_s: f64, now_ns: u64) -> Self {
        let is_dumb = std::env::var_os("TERM").is_none_or(|term| term == "dumb");
        Self::with_form(io::stderr().is_terminal() && !is_dumb, motion_s, period_s, now_ns)
    }

    fn with_form(is_in_place: bool, motion_s: f64, period_s: f64, now_ns: u64) -> Self {
        Self { is_in_place, motion_s, period_s, shown_ns: now_ns, ..Self::default() }
    }

    fn count_message(&mut self, message: &Recorded) {
        if !matches!(message, Recorded::Event(_)) {
            self.sequence.take(message);
        }
        match message {
            Recorded::State(state) => {
                self.max_late_ns = self.max_late_ns.max(state.woke_ns.saturating_sub(state.due_ns));
                let is_fresh = state.reading_cycle > self.state.reading_cycle;
                self.state = *state;
                self.running += u64::from(self.controller_state() == Some(ControllerState::Running));
                if is_fresh && self.controller_state().is_some_and(|state| MOVING.contains(&state)) {
                    self.max_error_mm = self.max_error_mm.max(self.error_mm());
                }
            }
            Recorded::Reading(reading) => {
                self.max_late_ns = self.max_late_ns.max(reading.woke_ns.saturating_sub(reading.due_ns));
                self.reading = *reading;
            }
            _ => {}
        }
    }

    /// Whether the next text is due.
    fn is_due(&self, now_ns: u64) -> bool {
        let interval_ns = if self.is_in_place { REWRITE_INTERVAL_NS } else { LINE_INTERVAL_NS };
        now_ns.saturating_sub(self.shown_ns) >= interval_ns
    }

    /// The next line, or the same line again.
    fn next_line(&mut self, now_ns: u64, losses: Losses) -> String {
        self.shown_ns = now_ns;
        if self.is_in_place { self.rewritten(losses) } else { self.line_within(losses, usize::MAX) + "\n" }
    }

    /// Ends the line that is rewritten, with its last figures; other text follows.
    fn last_line(&self, losses: Losses) -> Option<String> {
        self.is_in_place.then(|| self.rewritten(losses) + "\n")
    }

    fn rewritten(&self, losses: Losses) -> String {
        let columns = masseter_terminal::columns(io::stderr()).unwrap_or(usize::MAX);
        format!("{BEFORE_REWRITE}{}{AFTER_REWRITE}", self.line_within(losses, columns))
    }

    /// The figures for which a line of that many columns has room, the first of them always.
    fn line_within(&self, losses: Losses, columns: usize) -> String {
        let mut figures = self.figures(losses);
        while figures.len() > 1 && figures.join(BETWEEN).chars().count() > columns {
            figures.pop();
        }
        figures.join(BETWEEN)
    }

    /// The figures, the most important ones first.
    fn figures(&self, Losses { unrecorded, clients }: Losses) -> Vec<String> {
        let state = self.controller_state().map_or("?", ControllerState::name);
        let (motion_s, of_s) = (self.motion_s.min(self.running as f64 * self.period_s), self.motion_s);
        let missing: u64 = self.sequence.clone().finish().iter().map(|topic| topic.missing).sum();
        let dropped = missing + unrecorded;
        let missed = self.state.skipped_cycles + self.reading.skipped_cycles;
        let mut figures = vec![
            format!("{state:<13} motion {motion_s:>5.2} of {of_s:.2} s"),
            format!("missed {missed}"),
            format!("tracking error {:.3} mm", self.error_mm()),
            format!("dropped {dropped}"),
            format!("max {:.3} mm", self.max_error_mm),
            format!("latest {:.0} µs", self.max_late_ns as f64 / 1e3),
        ];
        figures.extend(
            clients
                .map(|clients| format!("live {} watching, {} dropped", clients.connected, clients.dropped)),
        );
        figures
    }

    /// Distance between desired and estimated position of the platform in the newest state, mm.
    fn error_mm(&self) -> f64 {
        let desired = Vector3::from(self.state.desired_position_m);
        (desired - Vector3::from(self.state.estimated_position_m)).norm() * 1e3
    }

    fn controller_state(&self) -> Option<ControllerState> {
        ControllerState::try_from(self.state.controller_state).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after_ten_cycles(is_in_place: bool) -> Progress {
        let mut progress = Progress::with_form(is_in_place, 4.0, 0.1, 0);
        for cycle in 1..=10 {
            progress.count_message(&Recorded::State(State {
                seq: cycle,
                cycle,
                reading_cycle: cycle,
                due_ns: 1000,
                woke_ns: if cycle == 3 { 51_000 } else { 1100 },
                controller_state: ControllerState::Running.code(),
                estimated_position_m: [if cycle == 3 { 0.004 } else { 0.002 }, 0.0, 0.0],
                ..Default::default()
            }));
        }
        progress.count_message(&Recorded::Reading(Reading {
            seq: 4,
            skipped_cycles: 6,
            ..Default::default()
        }));
        progress
    }

    #[test]
    fn the_line_shows_state_error_latency_and_losses() {
        let clients = Some(ClientCounts { connected: 1, dropped: 7 });
        let line = after_ten_cycles(false).next_line(SECOND_NS, Losses { unrecorded: 2, clients });
        assert_eq!(
            line,
            "running       motion  1.00 of 4.00 s   missed 6   tracking error 2.000 mm   dropped 5   max 4.000 mm   latest 50 µs   \
             live 1 watching, 7 dropped\n"
        );
    }

    #[test]
    fn a_narrow_terminal_shows_what_matters_most() {
        let progress = after_ten_cycles(true);
        let shown = |columns| progress.line_within(Losses::default(), columns);
        assert_eq!(shown(80), "running       motion  1.00 of 4.00 s   missed 6   tracking error 2.000 mm");
        assert_eq!(shown(20), "running       motion  1.00 of 4.00 s");
        assert_eq!(shown(120), shown(usize::MAX));
    }

    #[test]
    fn on_a_terminal_the_line_is_rewritten_until_other_text_follows() {
        let mut progress = after_ten_cycles(true);
        let rewritten = progress.next_line(SECOND_NS, Losses::default());
        assert!(rewritten.starts_with(BEFORE_REWRITE) && rewritten.ends_with(AFTER_REWRITE), "{rewritten:?}");
        assert!(!rewritten.contains("live"), "{rewritten}");
        assert_eq!(progress.last_line(Losses::default()), Some(rewritten + "\n"));
        assert_eq!(after_ten_cycles(false).last_line(Losses::default()), None);
    }

    #[test]
    fn a_line_is_due_every_ten_seconds_and_rewritten_five_times_a_second() {
        for (is_in_place, interval_ns) in [(false, 10 * SECOND_NS), (true, SECOND_NS / 5)] {
            let progress = Progress::with_form(is_in_place, 4.0, 0.1, 0);
            assert!(progress.is_due(interval_ns) && !progress.is_due(interval_ns - 1));
        }
    }
}
