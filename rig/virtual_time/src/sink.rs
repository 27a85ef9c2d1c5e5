//! Where the messages of a run under virtual time go: into a recording, or directly into the analysis.

use masseter_analysis::{Analysis, Figures};
use masseter_recording::{Backlog, Recorded};
use masseter_runtime::messages::tap::TapError;

/// Takes every message of a run.
pub trait Sink {
    /// Takes a message that was published at `now_ns`.
    fn take(&mut self, message: &Recorded, now_ns: u64);

    /// Whether it lacks a message, so that the run is useless from here on.
    fn has_failed(&self) -> bool;
}

impl Sink for Backlog {
    fn take(&mut self, message: &Recorded, now_ns: u64) {
        self.record(message, now_ns);
    }

    fn has_failed(&self) -> bool {
        self.dropped() > 0
    }
}

/// The analysis of a run that is not recorded.
#[derive(Debug)]
pub struct Stream {
    analysis: Analysis,
    error: Option<TapError>,
}

impl Stream {
    /// A stream into an analysis that has no message yet.
    pub fn new(analysis: Analysis) -> Self {
        Self { analysis, error: None }
    }

    /// The figures of all messages.
    ///
    /// # Errors
    /// A frame that is none.
    pub fn finish(self) -> Result<Figures, TapError> {
        self.error.map_or_else(|| Ok(self.analysis.finish(false, &[])), Err)
    }
}

impl Sink for Stream {
    fn take(&mut self, message: &Recorded, _: u64) {
        if let Err(error) = self.analysis.take(message) {
            self.error.get_or_insert(error);
        }
    }

    fn has_failed(&self) -> bool {
        self.error.is_some()
    }
}
