//! The plan of a bus by the queues of its nodes: the latest arrival of every message behind queues by priority or in
//! order (FIFO).
//!
//! R. Davis, S. Kollmann, V. Pollex, F. Slomka, *Controller Area Network (CAN) schedulability analysis with FIFO queues*,
//! ECRTS 2011: a frame waits for all earlier frames of its FIFO, and competes with the priority of the least urgent of
//! them. A FIFO hides its frames from the bus until they are at its head. J. Palencia, M. González Harbour, *Schedulability
//! analysis for tasks with static and dynamic offsets*, RTSS 1998: all cyclic messages have one clock, and a busy period
//! begins with the latest release of one of them. So cyclic messages are not assumed to be released all at once.
//!
//! The bus is undisturbed. The plan refuses nothing.

use std::fmt;

use crate::plan::least_fixed_point;
use crate::{Bitrate, CanId, NoReleaser, Release, wire::worst_case_bits};

/// The order in which a node sends the frames that wait.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Queue {
    /// The most urgent first: a controller with a mailbox for each message, and the simulated wire.
    Priority,
    /// The oldest first: an interface of the kernel with its queueing discipline, and most controllers behind it.
    Fifo,
}

impl fmt::Display for Queue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Priority => "by priority",
            Self::Fifo => "in order (FIFO)",
        })
    }
}

/// The times at which a node queues a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Queueing {
    /// Once a cycle at most, until that time after the begin of the cycle, ns.
    By(u64),
    /// Once a cycle at most, after the arrival of a more urgent message that is cyclic too.
    After(Release),
    /// At any time, but never twice within that time, ns.
    Apart(u64),
}

/// A message with its node.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct QueuedMessage {
    /// Name of the message in tables.
    pub name: String,
    /// Identifier, which is also the priority.
    pub id: CanId,
    /// Data bytes.
    pub data_length: u32,
    /// The index of the node that sends the message.
    pub node: usize,
    /// When the node queues the message.
    pub queueing: Queueing,
}

/// The latest arrival of a message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LatestArrival {
    /// The message.
    pub message: QueuedMessage,
    /// From the begin of the cycle, or from the queueing of a message without a cycle, ns; `None` without a bound.
    pub latest_ns: Option<u64>,
}

/// A busy period of more cycles counts as one without an end.
const LONGEST_CYCLES: i64 = 32;

/// The latest arrivals on a bus, the most urgent message first. A node queues its cyclic messages in the order in which
/// `messages` has them. `queues` has the queue of each node.
///
/// # Examples
/// A heartbeat in the FIFO of a node delays the next SYNC by itself and by the more urgent message of another node.
/// ```
/// use masseter_can::{Bitrate, CanId, Queue, QueuedMessage, Queueing, latest_arrivals};
///
/// let message = |id: u16, data_length, node, queueing| -> Result<_, masseter_can::FrameError> {
///     Ok(QueuedMessage { name: format!("{id:03X}"), id: CanId::standard(id)?, data_length, node, queueing })
/// };
/// let messages = [
///     message(0x080, 0, 0, Queueing::By(0))?,
///     message(0x77F, 1, 0, Queueing::By(999_000))?,
///     message(0x701, 1, 1, Queueing::Apart(50_000_000))?,
/// ];
/// let sync_ns = |queue| -> Result<_, masseter_can::NoReleaser> {
///     Ok(latest_arrivals(Bitrate::MAX, 1_000_000, &[queue, Queue::Priority], &messages)?[0].latest_ns)
/// };
/// assert_eq!(sync_ns(Queue::Priority)?, Some(65_000 + 55_000));
/// assert_eq!(sync_ns(Queue::Fifo)?, Some(65_000 + 65_000 - 1_000 + 55_000));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`NoReleaser`] for a message whose release names no more urgent message.
pub fn latest_arrivals(
    bitrate: Bitrate,
    cycle_ns: u64,
    queues: &[Queue],
    messages: &[QueuedMessage],
) -> Result<Vec<LatestArrival>, NoReleaser> {
    let mut order: Vec<_> = messages.iter().enumerate().collect();
    order.sort_by_key(|(_, message)| message.id);
    let stream = |(index, &(place, message)): (usize, &(usize, &QueuedMessage))| {
        let times = match message.queueing {
            Queueing::By(by_ns) => Times::By(by_ns as i64),
            Queueing::Apart(apart_ns) => Times::Apart((apart_ns as i64).max(1)),
            Queueing::After(Release { by, within_ns }) => {
                let is_releaser =
                    |other: &QueuedMessage| other.id == by && !matches!(other.queueing, Queueing::Apart(_));
                let releaser = order[..index].iter().position(|(_, other)| is_releaser(other));
                let missing = || NoReleaser { name: message.name.clone(), releaser: by };
                Times::After(releaser.ok_or_else(missing)?, within_ns as i64)
            }
        };
        let wire_ns =
            bitrate.bits_to_ns(worst_case_bits(message.data_length, message.id.is_extended())) as i64;
        let fifo = Some(message.node).filter(|&node| queues.get(node) == Some(&Queue::Fifo));
        Ok(Stream { wire_ns, place, fifo, times, latest_ns: Some(0) })
    };
    let streams = order.iter().enumerate().map(stream).collect::<Result<_, _>>()?;
    let mut bus =
        Traffic { cycle_ns: (cycle_ns as i64).max(1), bit_ns: bitrate.bits_to_ns(1) as i64, streams };
    // From no delay upwards: each message delays others, which delay it in turn.
    while bus.grow() {}
    let latest = order.iter().zip(&bus.streams).map(|((_, message), stream)| LatestArrival {
        message: (*message).clone(),
        latest_ns: stream.latest_ns.map(i64::unsigned_abs),
    });
    Ok(latest.collect())
}

/// [`Queueing`] with the index of the releaser.
#[derive(Debug, Clone, Copy)]
enum Times {
    By(i64),
    After(usize, i64),
    Apart(i64),
}

/// A message in the analysis.
#[derive(Debug, Clone)]
struct Stream {
    wire_ns: i64,
    /// Its place in the order in which its node queues the messages of a cycle.
    place: usize,
    /// The node, if it has a FIFO.
    fifo: Option<usize>,
    times: Times,
    /// The latest arrival that is known so far; `None` without a bound.
    latest_ns: Option<i64>,
}

/// The messages of a bus, the most urgent first.
#[derive(Debug)]
struct Traffic {
    cycle_ns: i64,
    bit_ns: i64,
    streams: Vec<Stream>,
}

/// What may be sent before a frame of one message, in a busy period without a frame below one priority.
struct Level<'a> {
    bus: &'a Traffic,
    /// The message.
    of: usize,
    /// The messages of its queue, then those of other queues.
    same: Vec<(usize, Load)>,
    others: Vec<(usize, Load)>,
    /// The longest frame that is less urgent.
    blocking_ns: i64,
}

/// A message in a busy period.
#[derive(Debug, Clone, Copy)]
struct Load {
    /// Time of a frame, with the wait for what the frame's arrival releases.
    each_ns: i64,
    /// The cycle, or the least time between two frames.
    step_ns: i64,
    /// The longest time by which the bus sees a frame late.
    late_ns: i64,
    /// Of a cyclic message the last cycle whose frame goes before that of cycle 0.
    last_cycle: Option<i64>,
}

impl Load {
    /// The most frames in a busy period from `begin_ns` that others see until `end_ns`.
    fn frames(&self, begin_ns: i64, end_ns: i64) -> i64 {
        match self.last_cycle {
            Some(last) => {
                let first = -(self.late_ns - begin_ns).div_euclid(self.step_ns);
                (last.min(end_ns.div_euclid(self.step_ns)) - first + 1).max(0)
            }
            None => self.most_frames(end_ns - begin_ns + 1),
        }
    }

    /// The most frames in any busy period of that length.
    fn most_frames(&self, busy_ns: i64) -> i64 {
        (busy_ns - 1 + self.late_ns).div_euclid(self.step_ns) + 1
    }
}

impl Traffic {
    /// One step of all bounds; whether one of them grew.
    fn grow(&mut self) -> bool {
        let next = |index: usize| {
            let latest_ns = self.latest_ns(index)?.max(self.streams[index].latest_ns?);
            (latest_ns <= self.longest_ns()).then_some(latest_ns)
        };
        let next: Vec<_> = (0..self.streams.len()).map(next).collect();
        let mut grows = false;
        for (stream, latest_ns) in self.streams.iter_mut().zip(next) {
            grows |= stream.latest_ns != latest_ns;
            stream.latest_ns = latest_ns;
        }
        grows
    }

    fn longest_ns(&self) -> i64 {
        LONGEST_CYCLES * self.cycle_ns
    }

    /// The latest queueing after the begin of the cycle.
    fn by_ns(&self, index: usize) -> Option<i64> {
        match self.streams[index].times {
            Times::By(by_ns) => Some(by_ns),
            Times::After(releaser, within_ns) => Some(self.streams[releaser].latest_ns? + within_ns),
            Times::Apart(_) => Some(0),
        }
    }

    fn share_queue(&self, one: usize, other: usize) -> bool {
        one == other || self.streams[one].fifo.is_some_and(|fifo| self.streams[other].fifo == Some(fifo))
    }

    fn latest_ns(&self, of: usize) -> Option<i64> {
        // The least urgent frame before the own frame in a FIFO decides which frames of other queues go first.
        let mut levels = (of..self.streams.len()).filter(|&level| self.share_queue(of, level));
        levels.try_fold(0, |most_ns, level| Some(most_ns.max(self.level(of, level)?.latest_ns()?)))
    }

    fn level(&self, of: usize, level: usize) -> Option<Level<'_>> {
        let less_urgent = (level + 1..self.streams.len()).filter(|&index| !self.share_queue(of, index));
        let blocking_ns = less_urgent.map(|index| self.streams[index].wire_ns).max().unwrap_or(0);
        let loads = (0..=level).map(|index| Some((index, self.load(of, index, level, blocking_ns)?)));
        let loads = loads.collect::<Option<Vec<_>>>()?;
        let (same, others) = loads.into_iter().partition(|&(index, _)| self.share_queue(of, index));
        Some(Level { bus: self, of, same, others, blocking_ns })
    }

    fn load(&self, of: usize, index: usize, level: usize, blocking_ns: i64) -> Option<Load> {
        let is_same = |index: usize| self.share_queue(of, index);
        let is_seen = |index: usize| is_same(index) || self.streams[index].fifo.is_none();
        // Such a releaser is in the busy period, or has arrived before. In that case the period counts from the
        // releaser's own begin, with the wait between the two and a less urgent frame therein.
        let releaser = |index: usize| match self.streams[index].times {
            Times::After(by, within_ns) if is_seen(index) && is_seen(by) => Some((by, within_ns)),
            _ => None,
        };
        let waits = (0..=level).filter_map(releaser).filter(|&(by, within_ns)| by == index && within_ns > 0);
        let wait_ns = waits.map(|(_, within_ns)| within_ns + blocking_ns).max().unwrap_or(0);
        let root = std::iter::successors(Some(index), |&index| Some(releaser(index)?.0)).last()?;
        let Stream { wire_ns, times, latest_ns, .. } = self.streams[root];
        let late_ns = if is_seen(root) { self.by_ns(root)? } else { latest_ns? - wire_ns };
        let (step_ns, is_cyclic) = match times {
            Times::Apart(apart_ns) => (apart_ns, false),
            _ => (self.cycle_ns, true),
        };
        let last_cycle = is_cyclic.then(|| self.last_cycle(of, index));
        Some(Load { each_ns: self.streams[index].wire_ns + wait_ns, step_ns, late_ns, last_cycle })
    }

    /// The last cycle whose frame of that message goes before the frame `of` of cycle 0, by the order of their queue.
    fn last_cycle(&self, of: usize, index: usize) -> i64 {
        if matches!(self.streams[of].times, Times::Apart(_)) {
            return i64::MAX;
        }
        let place = |index: usize| self.streams[index].place;
        if self.share_queue(of, index) {
            return if place(index) <= place(of) { 0 } else { -1 };
        }
        match self.streams[index].times {
            Times::After(by, _) if by == of => -1,
            // What another frame of the queue releases comes after that frame.
            Times::After(by, _) => self.last_cycle(of, by),
            _ => i64::MAX,
        }
    }
}

impl Level<'_> {
    fn latest_ns(&self) -> Option<i64> {
        let (cycle_ns, by_ns) = (self.bus.cycle_ns, self.bus.by_ns(self.of)?);
        let own = self.same.iter().find(|(index, _)| *index == self.of)?.1;
        let all = || self.same.iter().chain(&self.others).map(|(_, load)| load);
        let busy_ns = least_fixed_point(1, self.bus.longest_ns(), |busy_ns| {
            Some(self.blocking_ns + all().map(|load| load.each_ns * load.most_frames(busy_ns)).sum::<i64>())
        })?;
        // The times `anchor_ns` plus whole steps, up to `last_ns`, whose busy period may last into the cycle 0.
        let grid = move |anchor_ns: i64, step_ns: i64, last_ns: i64| {
            let last_ns = last_ns - (last_ns - anchor_ns).rem_euclid(step_ns);
            (0..).map(move |steps| last_ns - steps * step_ns).take_while(move |&at_ns| at_ns >= -busy_ns)
        };
        let cyclic = || all().filter(|load| load.last_cycle.is_some());
        let sporadic = || self.same.iter().map(|(_, load)| load).filter(|load| load.last_cycle.is_none());
        let mut most_ns = 0;
        if own.last_cycle.is_some() {
            let begins = cyclic().flat_map(|load| grid(load.late_ns, cycle_ns, own.late_ns));
            for begin_ns in begins.chain(sporadic().flat_map(|load| grid(by_ns, load.step_ns, own.late_ns))) {
                most_ns = most_ns.max(self.arrival_ns(begin_ns, by_ns)?);
            }
            return Some(most_ns);
        }
        for begin_ns in cyclic().map(|load| load.late_ns.rem_euclid(cycle_ns)).chain([0]) {
            // The frame waits longest if it is queued together with another one of its queue.
            let own_steps = sporadic().map(|load| (0, load.step_ns));
            let steps = own_steps.chain([(cycle_ns - begin_ns, cycle_ns)]);
            for (first_ns, step_ns) in steps {
                for after_ns in (0..).map(|step| first_ns + step * step_ns).take_while(|&ns| ns < busy_ns) {
                    let queued_ns = begin_ns + after_ns;
                    most_ns = most_ns.max(self.arrival_ns(begin_ns, queued_ns)? - queued_ns);
                }
            }
        }
        Some(most_ns)
    }

    /// The arrival of a frame that is queued at that time, in the cycle 0, in a busy period from `begin_ns` on.
    fn arrival_ns(&self, begin_ns: i64, queued_ns: i64) -> Option<i64> {
        let own = self.same.iter().find(|(index, _)| *index == self.of)?.1;
        let least_urgent = self.same.last()?.1;
        if least_urgent.frames(begin_ns, queued_ns) == 0 {
            // A more urgent level has this case.
            return Some(0);
        }
        let before = self.same.iter().map(|(_, load)| load.each_ns * load.frames(begin_ns, queued_ns));
        let before_ns = self.blocking_ns + before.sum::<i64>() - own.each_ns;
        let waits_ns = least_fixed_point(before_ns, self.bus.longest_ns(), |waits_ns| {
            let end_ns = begin_ns + waits_ns + self.bus.bit_ns - 1;
            let others = self.others.iter().map(|(_, load)| load.each_ns * load.frames(begin_ns, end_ns));
            Some(before_ns + others.sum::<i64>())
        })?;
        Some(begin_ns + waits_ns + self.bus.streams[self.of].wire_ns)
    }
}

#[cfg(test)]
mod tests;
