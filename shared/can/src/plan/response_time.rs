//! Worst-case response times of non-preemptive transmission by fixed priority.
//!
//! R. Davis, A. Burns, R. Bril, J. Lukkien, *Controller Area Network (CAN) schedulability analysis: refuted, revisited
//! and revised*, Real-Time Systems 35 (2007), equations 7 to 12: the analysis covers every instance within the longest busy
//! period, behind the longest frame of lower priority. It assumes transmit queues by priority, an undisturbed bus, and
//! no offsets between messages.

use super::message::{PlannedMessage, utilisation};

/// Longest busy period of the analysis. Near a load of 1 the iteration takes ever more steps, and at 1 there is no bound.
const LONGEST_BUSY_NS: u64 = 1_000_000_000;

/// Worst-case response time of the message of that index (Davis et al. 2007, equations 7 to 12), without its
/// own jitter; the messages are in the order of priority.
pub(super) fn response_ns(messages: &[PlannedMessage], index: usize, bit_ns: u64) -> Option<u64> {
    let (own, more_urgent) = (&messages[index], &messages[..index]);
    if utilisation(&messages[..=index]) >= 1.0 {
        return None;
    }
    let blocking_ns = messages[index + 1..].iter().map(|other| other.transmission_ns).max().unwrap_or(0);
    let own_jitter_ns = own.jitter_ns?;
    let busy_ns = settle(own.transmission_ns, |busy_ns| {
        Some(blocking_ns + interference_ns(busy_ns, &messages[..=index])?)
    })?;
    let instances = (busy_ns + own_jitter_ns).div_ceil(own.message.period_ns);
    (0..instances).try_fold(0, |longest_ns, instance| {
        let before_ns = blocking_ns + instance * own.transmission_ns;
        let queued_ns = settle(before_ns, |queued_ns| {
            Some(before_ns + interference_ns(queued_ns + bit_ns, more_urgent)?)
        })?;
        let response_ns = (queued_ns + own.transmission_ns).saturating_sub(instance * own.message.period_ns);
        Some(longest_ns.max(response_ns))
    })
}

/// The most time that those messages take in a window of that length; `None` when the release of one of them has no
/// bound.
fn interference_ns(window_ns: u64, of: &[PlannedMessage]) -> Option<u64> {
    let taken_ns = |other: &PlannedMessage| {
        let instances = (window_ns + other.jitter_ns?).div_ceil(other.message.period_ns);
        Some(instances * other.transmission_ns)
    };
    of.iter().map(taken_ns).sum()
}

/// The least fixed point of a growing function from `start_ns` on; `None` beyond the longest busy period.
fn settle(start_ns: u64, grow: impl Fn(u64) -> Option<u64>) -> Option<u64> {
    let mut at_ns = start_ns;
    while at_ns <= LONGEST_BUSY_NS {
        let next_ns = grow(at_ns)?;
        if next_ns <= at_ns {
            return Some(at_ns);
        }
        at_ns = next_ns;
    }
    None
}
