//! The sinks of every received message: the recording, the clients of the live page and Foxglove, and the progress on standard error.

use masseter_recording::{Backlog, Recorded};
use masseter_runtime::messages::codes::Cause;
use masseter_runtime::messages::explain;
use masseter_scenario::wording::counted;
use masseter_terminal::Exit;

use super::progress::{Losses, Progress};
use crate::live::{ClientLosses, LiveServer};
use crate::stderr_writer::StderrWriter;

pub(super) struct Sinks {
    pub backlog: Backlog,
    pub server: Option<LiveServer>,
    pub progress: Option<Progress>,
    pub stderr: StderrWriter,
}

impl Sinks {
    /// Hands a message that was received at `now_ns` to every sink.
    pub(super) fn write(&mut self, message: &Recorded, now_ns: u64) {
        self.backlog.record(message, now_ns);
        if let Some(progress) = &mut self.progress {
            progress.add(message);
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
        if let Some(text) = explain(event).filter(|_| is_news) {
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
            self.stderr.control(progress.next(now_ns, losses));
        }
    }

    /// Ends the line that shows the progress, since other text follows.
    fn end_line(&self, losses: Losses) {
        if let Some(line) = self.progress.as_ref().and_then(|progress| progress.end_line(losses)) {
            self.stderr.control(line);
        }
    }

    /// Closes every sink and reports what each lacks. The recording comes first, because clients can delay the rest.
    pub(super) fn finish(self) -> Exit {
        self.end_line(self.losses());
        let loss = self.backlog.finish().loss();
        if let Some(loss) = &loss {
            self.stderr.write(&format!("masseter: {loss}\n"));
        }
        if let Some(losses) = self.server.and_then(|server| client_losses(server.finish())) {
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
