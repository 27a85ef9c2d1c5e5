//! The plan of one bus, and the check that every message arrives in time.

use super::message::{PeriodicMessage, PlannedMessage, Release, utilisation};
use super::response_time::response_ns;
use crate::id::CanId;
use crate::wire::{Bitrate, worst_case_bits};

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

/// A message whose release is not by a more urgent message of its bus.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{name} is said to be released by {releaser}h, which is no more urgent message of its bus")]
pub struct NoReleaser {
    /// The message.
    pub name: String,
    /// The message that should release it.
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
            // The message that releases this one is analysed already.
            planned[index].jitter_ns = jitter_ns(&planned[index].message, &planned[..index])?;
            planned[index].response_ns = response_ns(&planned, index, bit_ns);
        }
        Ok(Self { bus, bitrate, cycle_ns, messages: planned })
    }

    /// The longest that all messages of one cycle take together, ns.
    pub fn cycle_time_ns(&self) -> u64 {
        let cyclic = self.messages.iter().filter(|planned| planned.message.period_ns == self.cycle_ns);
        cyclic.map(|planned| planned.transmission_ns).sum()
    }

    /// Share of the bus time that all messages take at worst; more than 1 does not fit.
    pub fn utilisation(&self) -> f64 {
        utilisation(&self.messages)
    }

    /// Whether every message arrives in time.
    ///
    /// # Errors
    /// [`Overload`], which shows the plan, where one does not.
    pub fn check(&self) -> Result<(), Overload> {
        if self.messages.iter().all(PlannedMessage::fits) {
            Ok(())
        } else {
            Err(Overload(Box::new(self.clone())))
        }
    }
}

fn jitter_ns(message: &PeriodicMessage, more_urgent: &[PlannedMessage]) -> Result<Option<u64>, NoReleaser> {
    let Some(Release { by, within_ns }) = message.release else { return Ok(Some(0)) };
    match more_urgent.iter().find(|other| other.message.id == by) {
        Some(other) => Ok(other.arrival_ns().map(|arrival_ns| arrival_ns + within_ns)),
        None => Err(NoReleaser { name: message.name.clone(), releaser: by }),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::Bitrate;

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

    /// Table 2 of the paper: three messages of 1 ms transmission time at 125 kbit/s, where the second instance of
    /// the least urgent one is the late one, which earlier analyses missed.
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
        // SYNC, three TPDO1 and three RPDO1 in just the time that they take, and a heartbeat that blocks them.
        let mut messages = vec![message(1, 0, 805)];
        messages.extend((2..5).map(|id| message(id, 8, 805)));
        messages.extend((5..8).map(|id| message(id, 6, 805)));
        messages.push(message(8, 1, 50_000));
        let responses = responses_us(&plan(1_000_000, messages));
        assert!(responses[0].is_some(), "{responses:?}");
        assert_eq!(responses[6..], [None, None]);
    }

    proptest! {
        /// Every message released at once at the worst instant, behind the longest frame of lower priority:
        /// what a bus really does then is within the bound.
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
