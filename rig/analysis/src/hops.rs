//! The path of a cycle from the plant's deadline to the command on the wire, its hops, and the hop furthest above its own
//! median.
//!
//! SYNC on the wire and the waits of the time table lie between the hops, so that a delay counts in one hop alone.

use hdrhistogram::Histogram;
use masseter_runtime::messages::{Reading, State};

use super::measured::histogram;

/// A cycle's path, joined from messages of both processes.
#[derive(Debug, Clone, Copy)]
pub(super) struct CyclePath {
    pub(super) reading: Reading,
    pub(super) state: State,
    /// Publication of the command.
    pub(super) published_ns: u64,
    /// Reception by the plant of the command that ended the path.
    pub(super) received_ns: u64,
    /// When its last process data were on the wire.
    pub(super) sent_ns: u64,
    /// Time for which the machine stalled meanwhile.
    pub(super) stalled_ns: u64,
}

impl CyclePath {
    pub(super) fn total_ns(&self) -> u64 {
        passed_ns(self.reading.due_ns, self.sent_ns)
    }
}

/// The beginning and the end of a hop, ns.
type Ends = fn(&CyclePath) -> [u64; 2];

/// The hops in the order in which a cycle passes through them.
const HOPS: [(&str, Ends); 10] = [
    ("plant wake-up", |path| [path.reading.due_ns, path.reading.woke_ns]),
    ("process data", |path| [path.reading.sampled_ns, path.reading.complete_ns]),
    ("reading publication", |path| [path.reading.complete_ns, path.reading.published_ns]),
    ("controller wake-up", |path| [path.state.due_ns, path.state.woke_ns]),
    // Until it wakes, the controller does not wait for the reading.
    ("reading pick-up", |path| [path.reading.published_ns.max(path.state.woke_ns), path.state.received_ns]),
    ("forward kinematics", |path| [path.state.received_ns, path.state.solved_ns]),
    ("control", |path| [path.state.solved_ns, path.state.commanded_ns]),
    ("command publication", |path| [path.state.commanded_ns, path.published_ns]),
    ("command transport", |path| [path.published_ns, path.received_ns]),
    ("command to wire", |path| [path.received_ns, path.sent_ns]),
];

/// The names of the hops, in the order in which a cycle passes through them.
pub fn hop_names() -> impl Iterator<Item = &'static str> {
    HOPS.into_iter().map(|(name, _)| name)
}

/// A hop of one cycle beside its median.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct HopTime {
    pub(super) name: &'static str,
    pub(super) took_ns: u64,
    pub(super) p50_ns: u64,
}

/// How long the hops typically take.
#[derive(Debug, Clone)]
pub(super) struct TypicalHops([Histogram<u64>; HOPS.len()]);

impl Default for TypicalHops {
    fn default() -> Self {
        Self(std::array::from_fn(|_| histogram()))
    }
}

impl TypicalHops {
    pub(super) fn take(&mut self, path: &CyclePath) {
        for (histogram, (_, ends)) in self.0.iter_mut().zip(HOPS) {
            histogram.record(took_ns(ends, path)).expect("a histogram that resizes itself takes any value");
        }
    }

    /// The hop furthest above its median.
    pub(super) fn furthest_above_median(&self, path: &CyclePath) -> HopTime {
        let hops = HOPS.into_iter().zip(&self.0).map(|((name, ends), histogram)| HopTime {
            name,
            took_ns: took_ns(ends, path),
            p50_ns: histogram.value_at_quantile(0.5).min(histogram.max()),
        });
        hops.max_by_key(|hop| hop.took_ns.saturating_sub(hop.p50_ns)).expect("there are hops")
    }
}

fn took_ns(ends: Ends, path: &CyclePath) -> u64 {
    let [from_ns, to_ns] = ends(path);
    passed_ns(from_ns, to_ns)
}

/// 0 where the two are in the wrong order, as in a damaged recording.
pub(super) fn passed_ns(from_ns: u64, to_ns: u64) -> u64 {
    to_ns.saturating_sub(from_ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Process data and forward kinematics take as long as given, the other hops no time.
    fn path(data_ns: u64, solving_ns: u64) -> CyclePath {
        let reading = Reading { complete_ns: data_ns, published_ns: data_ns, ..Default::default() };
        let solved_ns = data_ns + solving_ns;
        let state = State { received_ns: data_ns, solved_ns, commanded_ns: solved_ns, ..Default::default() };
        let (published_ns, received_ns, sent_ns) = (solved_ns, solved_ns, solved_ns);
        CyclePath { reading, state, published_ns, received_ns, sent_ns, stalled_ns: 0 }
    }

    #[test]
    fn not_the_longest_hop_is_to_blame_but_the_one_furthest_above_its_median() {
        let mut typical = TypicalHops::default();
        (0..9).for_each(|_| typical.take(&path(400, 10)));
        let expected = HopTime { name: "forward kinematics", took_ns: 100, p50_ns: 10 };
        assert_eq!(typical.furthest_above_median(&path(450, 100)), expected);
    }
}
