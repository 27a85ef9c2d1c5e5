//! Durations of one round.

use hdrhistogram::Histogram;

/// Durations of one round, ns.
pub type Durations = Histogram<u64>;

/// An empty histogram of durations.
pub fn no_durations() -> Durations {
    Histogram::new(3).expect("three digits are allowed")
}

/// Adds `count` times the same duration.
pub fn record(durations: &mut Durations, taken_ns: u64, count: u64) {
    // Recording it zero times would still raise the histogram's maximum.
    if count > 0 {
        durations.record_n(taken_ns, count).expect("a histogram that resizes itself takes any value");
    }
}
