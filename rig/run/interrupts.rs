//! Requests to end a run: SIGINT, SIGTERM, and SIGHUP of a closed terminal.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::{io, sync::Arc};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use crate::prelude::*;

/// The first signal requests an orderly stop, the second an immediate end.
#[derive(Debug, Clone, Default)]
pub(crate) struct Interrupts {
    /// Set by the handler itself: what a signal has done to other processes is seen after this.
    is_requested: Arc<AtomicBool>,
    count: Arc<AtomicUsize>,
    is_over: Arc<AtomicBool>,
}

impl Interrupts {
    /// Handles the signals from now on. SIGHUP stays ignored if the parent ignores it, as `nohup` does.
    fn listen() -> io::Result<Self> {
        let interrupts = Self::default();
        let hang_up = (!is_ignored(SIGHUP)).then_some(SIGHUP);
        let caught: Vec<_> = [SIGINT, SIGTERM].into_iter().chain(hang_up).collect();
        let mut signals = signal_hook::iterator::Signals::new(&caught)?;
        for signal in caught {
            signal_hook::flag::register(signal, Arc::clone(&interrupts.is_requested))?;
        }
        std::thread::spawn({
            let Self { count, is_over, .. } = interrupts.clone();
            move || {
                for signal in signals.forever() {
                    if is_over.load(Ordering::Relaxed) {
                        let _ = signal_hook::low_level::emulate_default_handler(signal);
                    }
                    count.fetch_add(1, Ordering::Relaxed);
                }
            }
        });
        Ok(interrupts)
    }

    /// The same for a verb that plays runs.
    pub(crate) fn of_verb() -> Result<Self, Failure> {
        Self::listen().context("cannot listen for signals").died()
    }

    /// Restores the default action of the signals, for after the run.
    pub(crate) fn restore_default_actions(&self) {
        self.is_over.store(true, Ordering::Relaxed);
    }
}

impl masseter_virtual_time::Requests for Interrupts {
    fn is_stop_requested(&self) -> bool {
        self.is_requested.load(Ordering::Relaxed) || self.count.load(Ordering::Relaxed) > 0
    }

    fn is_abort_requested(&self) -> bool {
        self.count.load(Ordering::Relaxed) > 1
    }
}

fn is_ignored(signal: i32) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok())
        .is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}
