//! The plan of a bus: worst-case transmission times and response times of its messages.
//!
//! R. Davis, A. Burns, R. Bril, J. Lukkien, *Controller Area Network (CAN) schedulability analysis: refuted, revisited
//! and revised*, Real-Time Systems 35 (2007), equations 7 to 12: non-preemptive transmission by fixed priority. The
//! analysis covers every instance within the longest busy period, behind the longest frame of lower priority. It assumes
//! transmit queues by priority, an undisturbed bus, and no offsets between messages. All messages are periodic. The caller
//! decides which messages a plan contains. For queues in order (FIFO) see [`latest_arrivals`](crate::latest_arrivals).

use std::fmt;

use crate::{Bitrate, CanId, wire::worst_case_bits};

/// A message that a node sends periodically.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PeriodicMessage {
    /// Name of the message in tables.
    pub name: String,
    /// Identifier, which is also the priority.
    pub id: CanId,
    /// Data bytes.
    pub data_length: u32,
    /// The least time between two instances, ns.
    pub period_ns: u64,
    /// Latest arrival after the begin of the period, ns.
    pub deadline_ns: u64,
    /// The message whose arrival releases this message; without one, the begin of the period is the release.
    pub release: Option<Release>,
}

/// The release of a message by the arrival of another message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Release {
    /// The other message, which is more urgent.
    pub by: CanId,
    /// The most time from that arrival to the release, ns.
    pub within_ns: u64,
}

/// A message with the results of the analysis.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlannedMessage {
    /// The message.
    pub message: PeriodicMessage,
    /// Longest time on the wire, interframe space included, ns.
    pub transmission_ns: u64,
    /// The latest release after the begin of the period, ns; `None` without a bound.
    pub jitter_ns: Option<u64>,
    /// The latest arrival after the latest release, ns; `None` without a bound. Up to the jitter longer passes from a
    /// release that comes early.
    pub response_ns: Option<u64>,
}

impl PlannedMessage {
    /// Whether the message always meets its deadline.
    pub fn fits(&self) -> bool {
        self.arrival_ns().is_some_and(|arrival_ns| arrival_ns <= self.message.deadline_ns)
    }

    /// The latest arrival after the begin of the period, ns; `None` without a bound.
    pub fn arrival_ns(&self) -> Option<u64> {
        Some(self.jitter_ns? + self.response_ns?)
    }
}

/// Worst-case share of the bus time.
fn utilisation(messages: &[PlannedMessage]) -> f64 {
    messages.iter().map(|planned| planned.transmission_ns as f64 / planned.message.period_ns as f64).sum()
}

/// The plan of one bus.
///
/// # Examples
/// ```
/// use masseter_can::{Bitrate, BusPlan, CanId, PeriodicMessage};
///
/// let message = |id: u16, data_length| -> Result<_, masseter_can::FrameError> {
///     let (name, id) = (format!("{id:03X}"), CanId::standard(id)?);
///     let (period_ns, deadline_ns) = (1_000_000, 1_000_000);
///     Ok(PeriodicMessage { name, id, data_length, period_ns, deadline_ns, release: None })
/// };
/// let messages = vec![message(0x080, 0)?, message(0x181, 8)?];
/// let plan = BusPlan::new(0, Bitrate::MAX, 1_000_000, messages)?;
/// plan.check()?;
/// let sync_ns = plan.messages[0].response_ns;
/// assert_eq!(sync_ns, Some(190_000), "135 bits of the longer frame, 55 bits of its own");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[doc(alias("schedulability", "response-time analysis"))]
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BusPlan {
    /// Index of the bus in its link.
    pub bus: usize,
    /// Bit rate.
    pub bitrate: Bitrate,
    /// Period of a cycle, ns.
    pub cycle_ns: u64,
    /// The messages, the most urgent first.
    pub messages: Vec<PlannedMessage>,
}

/// A bus whose messages do not arrive in time.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}\nuse a longer period, a faster bit rate or more buses")]
pub struct Overload(pub Box<BusPlan>);

/// A message whose release names no more urgent message of its bus.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{name}: its releaser {releaser}h is not a more urgent message of the same bus")]
pub struct NoReleaser {
    /// The message.
    pub name: String,
    /// The named releaser.
    pub releaser: CanId,
}

impl BusPlan {
    /// Analyses the messages of a bus whose cycle is `cycle_ns` long.
    ///
    /// # Errors
    /// [`NoReleaser`] for a message whose release names no more urgent message.
    pub fn new(
        bus: usize,
        bitrate: Bitrate,
        cycle_ns: u64,
        messages: Vec<PeriodicMessage>,
    ) -> Result<Self, NoReleaser> {
        let mut planned: Vec<_> = messages
            .into_iter()
            .map(|message| {
                let bits = worst_case_bits(message.data_length, message.id.is_extended());
                let transmission_ns = bitrate.bits_to_ns(bits);
                PlannedMessage { message, transmission_ns, jitter_ns: None, response_ns: None }
            })
            .collect();
        planned.sort_by_key(|planned| planned.message.id);
        let bit_ns = bitrate.bits_to_ns(1);
        for index in 0..planned.len() {
            // The analysis of the releaser is done already.
            planned[index].jitter_ns = jitter_ns(&planned[index].message, &planned[..index])?;
            planned[index].response_ns = response_ns(&planned, index, bit_ns);
        }
        Ok(Self { bus, bitrate, cycle_ns, messages: planned })
    }

    /// Worst-case time of all messages of one cycle together, ns.
    pub fn cycle_time_ns(&self) -> u64 {
        let cyclic = self.messages.iter().filter(|planned| planned.message.period_ns == self.cycle_ns);
        cyclic.map(|planned| planned.transmission_ns).sum()
    }

    /// Worst-case share of the bus time of all messages; more than 1 does not fit.
    pub fn utilisation(&self) -> f64 {
        utilisation(&self.messages)
    }

    /// Whether every message arrives in time.
    ///
    /// # Errors
    /// [`Overload`] with the plan, for a message that arrives late.
    pub fn check(&self) -> Result<(), Overload> {
        let fits = self.messages.iter().all(PlannedMessage::fits);
        if fits { Ok(()) } else { Err(Overload(Box::new(self.clone()))) }
    }
}

fn jitter_ns(message: &PeriodicMessage, more_urgent: &[PlannedMessage]) -> Result<Option<u64>, NoReleaser> {
    let Some(Release { by, within_ns }) = message.release else { return Ok(Some(0)) };
    match more_urgent.iter().find(|other| other.message.id == by) {
        Some(other) => Ok(other.arrival_ns().map(|arrival_ns| arrival_ns + within_ns)),
        None => Err(NoReleaser { name: message.name.clone(), releaser: by }),
    }
}

impl fmt::Display for BusPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let us = |ns: u64| format!("{:.1}", ns as f64 / 1e3);
        writeln!(
            f,
            "bus {}: {} bit/s; a cycle of {} µs takes {} µs at worst; load {:.1} %",
            self.bus,
            self.bitrate.bps(),
            us(self.cycle_ns),
            us(self.cycle_time_ns()),
            self.utilisation() * 100.0
        )?;
        write!(
            f,
            "  {:<14} {:>4} {:>5} {:>11} {:>9} {:>9} {:>11} {:>11} {:>11}",
            "message", "id", "bytes", "period, µs", "wire, µs", "jitter", "response", "in all", "deadline"
        )?;
        for planned in &self.messages {
            let PlannedMessage { message, transmission_ns, jitter_ns, response_ns } = planned;
            let bound = |ns: Option<u64>| ns.map_or_else(|| "unbounded".to_owned(), us);
            write!(
                f,
                "\n  {:<14} {:>4} {:>5} {:>11} {:>9} {:>9} {:>11} {:>11} {:>11}{}",
                message.name,
                message.id.to_string(),
                message.data_length,
                us(message.period_ns),
                us(*transmission_ns),
                bound(*jitter_ns),
                bound(*response_ns),
                bound(planned.arrival_ns()),
                us(message.deadline_ns),
                if planned.fits() { "" } else { "  too late" }
            )?;
        }
        Ok(())
    }
}

/// Longest busy period of the analysis. Near a load of 1 the iteration needs ever more steps; a load of 1 has no bound.
const LONGEST_BUSY_NS: u64 = 1_000_000_000;

/// Worst-case response time of the message with that index (Davis et al. 2007, equations 7 to 12), without its own
/// jitter. The messages are in the order of priority.
fn response_ns(messages: &[PlannedMessage], index: usize, bit_ns: u64) -> Option<u64> {
    let (own, more_urgent) = (&messages[index], &messages[..index]);
    if utilisation(&messages[..=index]) >= 1.0 {
        return None;
    }
    let blocking_ns = messages[index + 1..].iter().map(|other| other.transmission_ns).max().unwrap_or(0);
    let own_jitter_ns = own.jitter_ns?;
    let busy_ns = least_fixed_point(own.transmission_ns, LONGEST_BUSY_NS, |busy_ns| {
        Some(blocking_ns + interference_ns(busy_ns, &messages[..=index])?)
    })?;
    let instances = (busy_ns + own_jitter_ns).div_ceil(own.message.period_ns);
    (0..instances).try_fold(0, |longest_ns, instance| {
        let before_ns = blocking_ns + instance * own.transmission_ns;
        let queued_ns = least_fixed_point(before_ns, LONGEST_BUSY_NS, |queued_ns| {
            Some(before_ns + interference_ns(queued_ns + bit_ns, more_urgent)?)
        })?;
        let response_ns = (queued_ns + own.transmission_ns).saturating_sub(instance * own.message.period_ns);
        Some(longest_ns.max(response_ns))
    })
}

/// The most time of the messages in a window of that length; `None` when a release has no bound.
fn interference_ns(window_ns: u64, of: &[PlannedMessage]) -> Option<u64> {
    let taken_ns = |other: &PlannedMessage| {
        let instances = (window_ns + other.jitter_ns?).div_ceil(other.message.period_ns);
        Some(instances * other.transmission_ns)
    };
    of.iter().map(taken_ns).sum()
}

/// The least fixed point of a growing function from `start` on; `None` beyond `last`, or where the function has no value.
pub(crate) fn least_fixed_point<T: Copy + PartialOrd>(
    start: T,
    last: T,
    grow: impl Fn(T) -> Option<T>,
) -> Option<T> {
    let mut at = start;
    while at <= last {
        let next = grow(at)?;
        if next <= at {
            return Some(at);
        }
        at = next;
    }
    None
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn message(id: u16, data_length: u32, period_us: u64) -> PeriodicMessage {
        let (id, period_ns) = (CanId::standard(id).unwrap(), period_us * 1000);
        PeriodicMessage {
            name: format!("m{id}"),
            id,
            data_length,
            period_ns,
            deadline_ns: period_ns,
            release: None,
        }
    }

    fn plan(bps: u32, messages: Vec<PeriodicMessage>) -> BusPlan {
        BusPlan::new(0, Bitrate::new(bps).unwrap(), 1_000_000, messages).unwrap()
    }

    fn responses_us(plan: &BusPlan) -> Vec<Option<u64>> {
        plan.messages.iter().map(|planned| planned.response_ns.map(|ns| ns / 1000)).collect()
    }

    /// Table 2 of the paper: three messages of 1 ms transmission time at 125 kbit/s. The second instance of the least
    /// urgent message is the late one; earlier analyses miss it.
    #[test]
    fn the_example_that_refuted_earlier_analyses() {
        let messages = vec![message(1, 7, 2500), message(2, 7, 3500), message(3, 7, 3500)];
        let plan = plan(125_000, messages);
        assert_eq!(plan.messages[0].transmission_ns, 1_000_000, "125 bits at 125 kbit/s");
        assert_eq!(responses_us(&plan), [Some(2000), Some(3000), Some(3500)]);
        assert_eq!(plan.check(), Ok(()));
    }

    #[test]
    fn the_least_urgent_message_waits_for_one_of_each_other() {
        let messages = vec![message(1, 8, 10_000), message(2, 0, 10_000), message(3, 8, 10_000)];
        assert_eq!(responses_us(&plan(1_000_000, messages)), [Some(270), Some(325), Some(325)]);
    }

    fn released(by: u16, message: PeriodicMessage) -> PeriodicMessage {
        let by = CanId::standard(by).unwrap();
        PeriodicMessage { release: Some(Release { by, within_ns: 0 }), ..message }
    }

    #[test]
    fn a_message_released_by_another_inherits_its_latest_arrival_as_jitter() {
        let messages =
            vec![message(1, 0, 2000), released(1, message(2, 8, 2000)), released(2, message(3, 8, 2000))];
        let plan = plan(1_000_000, messages);
        let [first, second, third] = &plan.messages[..] else { panic!("{plan}") };
        let latest_ns = |planned: &PlannedMessage| planned.jitter_ns.unwrap() + planned.response_ns.unwrap();
        assert_eq!(first.jitter_ns, Some(0));
        assert_eq!(second.jitter_ns, first.response_ns);
        assert_eq!(third.jitter_ns, Some(latest_ns(second)));
        assert!(third.jitter_ns > second.response_ns);
    }

    #[test]
    fn a_nodes_answer_time_adds_to_its_jitter_and_delays_the_others() {
        let answering = |within_ns: u64| {
            let by = CanId::standard(1).unwrap();
            let answer = PeriodicMessage { release: Some(Release { by, within_ns }), ..message(2, 8, 1000) };
            plan(1_000_000, vec![message(1, 0, 1000), answer, message(3, 8, 1000)])
        };
        let [at_once, late] = [0, 890_000].map(|within_ns| answering(within_ns).messages);
        assert_eq!(late[1].jitter_ns, at_once[1].jitter_ns.map(|jitter_ns| jitter_ns + 890_000));
        assert_eq!(late[1].response_ns, at_once[1].response_ns);
        assert!(late[2].response_ns > at_once[2].response_ns, "two of it may meet the next");
    }

    #[test]
    fn what_an_unbounded_message_releases_has_no_bound_either() {
        let messages = vec![message(1, 8, 100), released(1, message(2, 0, 1_000_000))];
        let plan = plan(1_000_000, messages);
        assert_eq!((plan.messages[1].jitter_ns, responses_us(&plan)), (None, vec![None, None]));
        assert!(plan.check().is_err());
    }

    #[test]
    fn a_message_whose_releaser_is_not_there_or_less_urgent_is_refused() {
        for other in [3, 5] {
            let messages = vec![released(other, message(4, 8, 1000)), message(5, 8, 1000)];
            let error = BusPlan::new(0, Bitrate::MAX, 1_000_000, messages).unwrap_err();
            assert_eq!(error.releaser, CanId::standard(other).unwrap());
            assert_eq!(error.name, "m004");
        }
    }

    #[test]
    fn an_overloaded_bus_has_no_bound_and_says_so() {
        let messages = (1..=13).map(|id| message(id, 8, 1000)).collect();
        let error = plan(1_000_000, messages).check().unwrap_err().to_string();
        assert!(error.contains("takes 1755.0 µs at worst; load"), "{error}");
        assert!(error.contains("unbounded") && error.contains("too late"), "{error}");
    }

    #[test]
    fn a_bus_without_a_free_moment_has_no_bound() {
        // SYNC, three TPDO1 and three RPDO1 fill their period, and a heartbeat blocks them.
        let mut messages = vec![message(1, 0, 805)];
        messages.extend((2..5).map(|id| message(id, 8, 805)));
        messages.extend((5..8).map(|id| message(id, 6, 805)));
        messages.push(message(8, 1, 50_000));
        let responses = responses_us(&plan(1_000_000, messages));
        assert!(responses[0].is_some(), "{responses:?}");
        assert_eq!(responses[6..], [None, None]);
    }

    proptest! {
        /// At the worst instant all messages are released at once, behind the longest frame of lower priority. The time
        /// of this burst is within the bound.
        #[test]
        fn a_burst_behind_the_longest_frame_is_within_the_bounds(
            set in prop::collection::btree_map(1_u16..100, (0_u32..=8, 2_u64..20), 1..8),
        ) {
            let messages = set.iter().map(|(&id, &(length, period))| message(id, length, period * 1000)).collect();
            let plan = plan(1_000_000, messages);
            let planned = &plan.messages;
            for (index, own) in planned.iter().enumerate() {
                let Some(bound_ns) = own.response_ns else { continue };
                let blocking_ns = planned[index + 1..].iter().map(|other| other.transmission_ns).max();
                let burst_ns: u64 = planned[..=index].iter().map(|other| other.transmission_ns).sum();
                prop_assert!(blocking_ns.unwrap_or(0) + burst_ns <= bound_ns);
            }
        }
    }
}
