//! Threads with the real-time settings of a run.

use masseter_runtime::realtime::scheduling::{Obtained, SchedulingRequest, obtain};
use masseter_scenario::RealtimeConfig;

/// Asks the kernel for the settings of a run on behalf of the calling thread.
pub fn realtime_on(core: usize) -> Obtained {
    let priority = RealtimeConfig::default().priority;
    obtain(SchedulingRequest { core: Some(core), fifo_priority: Some(priority), locked_memory: true })
}

/// Runs `work` on a new thread with these settings, as far as the kernel grants them.
pub fn on_core<T: Send>(core: usize, work: impl FnOnce() -> T + Send) -> T {
    std::thread::scope(|scope| {
        let thread = scope.spawn(|| {
            realtime_on(core);
            work()
        });
        thread.join().expect("measuring does not panic")
    })
}
