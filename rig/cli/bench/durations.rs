//! Durations of one round, and threads with the real-time settings of a run.

use std::thread;

use hdrhistogram::Histogram;
use masseter_runtime::realtime::scheduling::{Obtained, SchedulingRequest, obtain};
use masseter_scenario::RealtimeConfig;

/// Durations of one round, ns.
pub(super) type Durations = Histogram<u64>;

/// An empty histogram of durations.
pub(super) fn no_durations() -> Durations {
    Histogram::new(3).expect("three digits are allowed")
}

/// Adds `count` times the same duration.
pub(super) fn record(durations: &mut Durations, taken_ns: u64, count: u64) {
    // Recording it zero times would still raise the histogram's maximum.
    if count > 0 {
        durations.record_n(taken_ns, count).expect("a histogram that resizes itself takes any value");
    }
}

/// Asks the kernel for the settings of a run on behalf of the calling thread.
pub(super) fn realtime_on(core: usize) -> Obtained {
    let priority = RealtimeConfig::default().priority;
    obtain(SchedulingRequest { core: Some(core), fifo_priority: Some(priority), locked_memory: true })
}

/// Runs `work` on a new thread with these settings, as far as the kernel grants them.
pub(super) fn on_core<T: Send>(core: usize, work: impl FnOnce() -> T + Send) -> T {
    thread::scope(|scope| {
        let thread = scope.spawn(|| {
            realtime_on(core);
            work()
        });
        thread.join().expect("measuring does not panic")
    })
}
