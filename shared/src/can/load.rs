//! The plan of a bus: what its messages take at worst, and by when each of them has arrived.
//!
//! Worst-case response times of non-preemptive transmission by fixed priority: R. Davis, A. Burns, R. Bril,
//! J. Lukkien, *Controller Area Network (CAN) schedulability analysis: refuted, revisited and revised*,
//! Real-Time Systems 35 (2007), equations 7 to 12: every instance within the longest busy period is looked at,
//! behind the longest frame of lower priority. Transmit queues by priority are assumed, an undisturbed bus,
//! and no offsets between messages. Emergencies and network management are not in the rig's plans: they are
//! sent while it does not move, or stops.

use std::fmt::{self, Write as _};

use super::frame::FrameFormat;
use super::id::CanId;
use super::wire::{Rates, longest_bits};

/// A bus that is not idle for so long has no bound worth the name: near a load of 1 the exact one is found in ever more
/// steps, and at 1 there is none.
const LONGEST_BUSY_NS: u64 = 1_000_000_000;

/// A message that is sent again and again.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    /// What it is, as tables show it.
    pub name: String,
    /// Its identifier, which is its priority.
    pub id: CanId,
    /// Data bytes.
    pub data_length: u32,
    /// Least time between two of it, ns.
    pub period_ns: u64,
    /// By when it must have arrived after its release, ns.
    pub deadline_ns: u64,
    /// Where its release is the arrival of another message: that one's worst case is its jitter.
    pub released_by: Option<CanId>,
}

/// A message with what the analysis found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlannedMessage {
    /// The message.
    pub message: Message,
    /// Longest time on the wire, interframe space included, ns.
    pub transmission_ns: u64,
    /// The most that its release may lie behind the beginning of its period, ns.
    pub jitter_ns: u64,
    /// Longest time from release to arrival; `None` where there is no bound.
    pub response_ns: Option<u64>,
}

impl PlannedMessage {
    /// Whether it always arrives in time.
    pub fn fits(&self) -> bool {
        self.arrival_ns().is_some_and(|arrival_ns| arrival_ns <= self.message.deadline_ns)
    }

    /// Longest time from the beginning of its period to arrival, ns: jitter and response; `None` where there is no
    /// bound.
    pub fn arrival_ns(&self) -> Option<u64> {
        self.response_ns.map(|response_ns| self.jitter_ns + response_ns)
    }
}

/// The plan of one bus.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BusPlan {
    bus: usize,
    rates: Rates,
    cycle_ns: u64,
    messages: Vec<PlannedMessage>,
}

/// A bus whose messages do not arrive in time.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}\nuse a longer period, a faster bit rate, CAN FD or more buses")]
pub struct Overload(pub Box<BusPlan>);

impl BusPlan {
    /// Analyses the messages of a bus whose cycle is `cycle_ns` long.
    pub fn new(bus: usize, rates: Rates, format: FrameFormat, cycle_ns: u64, messages: Vec<Message>) -> Self {
        let mut planned: Vec<_> = messages
            .into_iter()
            .map(|message| {
                let bits = longest_bits(message.data_length, message.id.is_extended(), format);
                let transmission_ns = rates.duration_ns(bits);
                PlannedMessage { message, transmission_ns, jitter_ns: 0, response_ns: None }
            })
            .collect();
        planned.sort_by_key(|planned| planned.message.id);
        let bit_ns = rates.nominal().bits_to_ns(1);
        for index in 0..planned.len() {
            // Who releases a message has the higher priority, and is analysed already.
            let releaser = planned[index].message.released_by;
            let releaser =
                releaser.and_then(|id| planned[..index].iter().find(|other| other.message.id == id));
            planned[index].jitter_ns = releaser.and_then(|other| other.response_ns).unwrap_or(0);
            planned[index].response_ns = response_ns(&planned, index, bit_ns);
        }
        Self { bus, rates, cycle_ns, messages: planned }
    }

    /// Index of the bus.
    pub fn bus(&self) -> usize {
        self.bus
    }

    /// Bit rates.
    pub fn rates(&self) -> Rates {
        self.rates
    }

    /// Length of a cycle, ns.
    pub fn cycle_ns(&self) -> u64 {
        self.cycle_ns
    }

    /// The messages, the most urgent first.
    pub fn messages(&self) -> &[PlannedMessage] {
        &self.messages
    }

    /// The longest that all messages of one cycle take together, ns.
    pub fn cycle_time_ns(&self) -> u64 {
        let cyclic = self.messages.iter().filter(|planned| planned.message.period_ns == self.cycle_ns);
        cyclic.map(|planned| planned.transmission_ns).sum()
    }

    /// Share of the time that all messages take at worst; more than 1 does not fit.
    pub fn utilisation(&self) -> f64 {
        let shares = self.messages.iter();
        shares.map(|planned| planned.transmission_ns as f64 / planned.message.period_ns as f64).sum()
    }

    /// The longest time from release to arrival of a message; `None` for one that is not in the plan, or
    /// has no bound.
    pub fn response_ns(&self, id: CanId) -> Option<u64> {
        self.messages.iter().find(|planned| planned.message.id == id)?.response_ns
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

/// Worst-case response time of the message of that index (Davis et al. 2007, equations 7 to 12), without its
/// own jitter; the messages are in the order of priority.
fn response_ns(messages: &[PlannedMessage], index: usize, bit_ns: u64) -> Option<u64> {
    let (own, more_urgent) = (&messages[index], &messages[..index]);
    let load: f64 = messages[..=index].iter().map(share).sum();
    if load >= 1.0 {
        return None;
    }
    let blocking_ns = messages[index + 1..].iter().map(|other| other.transmission_ns).max().unwrap_or(0);
    let interference_ns = |window_ns: u64, of: &[PlannedMessage]| -> u64 {
        of.iter()
            .map(|other| {
                (window_ns + other.jitter_ns).div_ceil(other.message.period_ns) * other.transmission_ns
            })
            .sum()
    };
    let busy_ns =
        settle(own.transmission_ns, |busy_ns| blocking_ns + interference_ns(busy_ns, &messages[..=index]))?;
    let instances = (busy_ns + own.jitter_ns).div_ceil(own.message.period_ns);
    (0..instances).try_fold(0, |longest_ns, instance| {
        let before_ns = blocking_ns + instance * own.transmission_ns;
        let queued_ns =
            settle(before_ns, |queued_ns| before_ns + interference_ns(queued_ns + bit_ns, more_urgent))?;
        let response_ns = (queued_ns + own.transmission_ns).saturating_sub(instance * own.message.period_ns);
        Some(longest_ns.max(response_ns))
    })
}

fn share(planned: &PlannedMessage) -> f64 {
    planned.transmission_ns as f64 / planned.message.period_ns as f64
}

/// The least fixed point from `start_ns` on of a function that grows, as far as the longest busy time.
fn settle(start_ns: u64, grow: impl Fn(u64) -> u64) -> Option<u64> {
    let mut at_ns = start_ns;
    while at_ns <= LONGEST_BUSY_NS {
        let next_ns = grow(at_ns);
        if next_ns <= at_ns {
            return Some(at_ns);
        }
        at_ns = next_ns;
    }
    None
}

impl fmt::Display for BusPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let us = |ns: u64| format!("{:.1}", ns as f64 / 1e3);
        write!(f, "bus {}: {} bit/s", self.bus, self.rates.nominal().bps())?;
        if self.rates.data() != self.rates.nominal() {
            write!(f, ", data phase {} bit/s", self.rates.data().bps())?;
        }
        writeln!(
            f,
            "; a cycle of {} µs takes {} µs at worst; load {:.1} %",
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
            let [response, in_all] = [*response_ns, planned.arrival_ns()]
                .map(|bound_ns| bound_ns.map_or_else(|| "unbounded".to_owned(), us));
            let mut line = String::new();
            write!(
                line,
                "  {:<14} {:>4} {:>5} {:>11} {:>9} {:>9} {:>11} {:>11} {:>11}{}",
                message.name,
                message.id.to_string(),
                message.data_length,
                us(message.period_ns),
                us(*transmission_ns),
                us(*jitter_ns),
                response,
                in_all,
                us(message.deadline_ns),
                if planned.fits() { "" } else { "  too late" }
            )?;
            write!(f, "\n{line}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::can::Bitrate;

    fn message(id: u16, data_length: u32, period_us: u64) -> Message {
        let (id, period_ns) = (CanId::standard(id).unwrap(), period_us * 1000);
        Message {
            name: format!("m{id}"),
            id,
            data_length,
            period_ns,
            deadline_ns: period_ns,
            released_by: None,
        }
    }

    fn plan(bps: u32, messages: Vec<Message>) -> BusPlan {
        let rates = Rates::classical(Bitrate::new(bps).unwrap());
        BusPlan::new(0, rates, FrameFormat::Classical, 1_000_000, messages)
    }

    fn responses_us(plan: &BusPlan) -> Vec<Option<u64>> {
        plan.messages().iter().map(|planned| planned.response_ns.map(|ns| ns / 1000)).collect()
    }

    /// Table 2 of the paper: three messages of 1 ms transmission time at 125 kbit/s, where the second instance of
    /// the least urgent one is the late one, which earlier analyses missed.
    #[test]
    fn the_example_that_refuted_earlier_analyses() {
        let messages = vec![message(1, 7, 2500), message(2, 7, 3500), message(3, 7, 3500)];
        let plan = plan(125_000, messages);
        assert_eq!(plan.messages()[0].transmission_ns, 1_000_000, "125 bits at 125 kbit/s");
        assert_eq!(responses_us(&plan), [Some(2000), Some(3000), Some(3500)]);
        assert_eq!(plan.check(), Ok(()));
    }

    #[test]
    fn the_least_urgent_message_waits_for_one_of_each_other() {
        let messages = vec![message(1, 8, 10_000), message(2, 0, 10_000), message(3, 8, 10_000)];
        assert_eq!(responses_us(&plan(1_000_000, messages)), [Some(270), Some(325), Some(325)]);
    }

    #[test]
    fn a_message_released_by_another_inherits_its_response_as_jitter() {
        let mut answer = message(2, 8, 1000);
        answer.released_by = Some(CanId::standard(1).unwrap());
        let plan = plan(1_000_000, vec![message(1, 0, 1000), answer]);
        let [first, second] = plan.messages() else { panic!("{plan}") };
        assert_eq!(Some(second.jitter_ns), first.response_ns);
        assert_eq!(second.arrival_ns(), Some(second.jitter_ns + second.response_ns.unwrap()));
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
            let planned = plan.messages();
            for (index, own) in planned.iter().enumerate() {
                let Some(bound_ns) = own.response_ns else { continue };
                let blocking_ns = planned[index + 1..].iter().map(|other| other.transmission_ns).max();
                let burst_ns: u64 = planned[..=index].iter().map(|other| other.transmission_ns).sum();
                prop_assert!(blocking_ns.unwrap_or(0) + burst_ns <= bound_ns);
            }
        }
    }
}
