//! The run's supervisor, which a client may ask to end the run.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rustix::process::{Pid, Signal, getppid, kill_process};

/// The parent of this process.
#[derive(Debug, Clone)]
pub(super) struct Supervisor {
    process: Option<Pid>,
    is_asked: Arc<AtomicBool>,
}

impl Supervisor {
    /// The parent at this moment.
    pub(super) fn of_this_process() -> Self {
        Self { process: getppid(), is_asked: Arc::default() }
    }

    /// Asks for an orderly end, once: a second signal would end the run at once.
    pub(super) fn stop(&self) {
        let is_first = !self.is_asked.swap(true, Ordering::Relaxed);
        // A process whose parent has died has another parent, which is no supervisor.
        if let Some(process) = self.process.filter(|_| is_first && getppid() == self.process) {
            // It fails where the supervisor has just ended.
            let _ = kill_process(process, Signal::INT);
        }
    }
}
