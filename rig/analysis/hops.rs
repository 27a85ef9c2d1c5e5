//! The hops of a cycle from the plant's deadline to the command on the wire, and which of them is to blame for a long
//! one: the one furthest above its own median.
//!
//! Between them lie SYNC on the wire and the waits of the time table, so that a delay counts in one of them alone.

use hdrhistogram::Histogram;

use super::measured::histogram;

/// The hops, in the order in which a cycle passes through them.
pub(super) const HOPS: [&str; 10] = [
    "plant wake-up",
    "process data",
    "reading publication",
    "controller wake-up",
    "reading pick-up",
    "forward kinematics",
    "control",
    "command publication",
    "command transport",
    "command to wire",
];

/// How long each hop of a cycle took, ns.
pub(super) type HopTimes = [u64; HOPS.len()];

/// A hop to blame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Blamed {
    pub(super) hop: &'static str,
    pub(super) took_ns: u64,
    pub(super) p50_ns: u64,
}

/// How long the hops usually take.
#[derive(Debug)]
pub(super) struct Usual([Histogram<u64>; HOPS.len()]);

impl Default for Usual {
    fn default() -> Self {
        Self(std::array::from_fn(|_| histogram()))
    }
}

impl Usual {
    pub(super) fn take(&mut self, hops_ns: &HopTimes) {
        for (histogram, &hop_ns) in self.0.iter_mut().zip(hops_ns) {
            histogram.record(hop_ns).expect("a histogram that resizes itself takes any value");
        }
    }

    pub(super) fn blame(&self, hops_ns: &HopTimes) -> Blamed {
        let hops = HOPS.iter().zip(hops_ns).zip(&self.0).map(|((hop, &took_ns), histogram)| Blamed {
            hop,
            took_ns,
            p50_ns: histogram.value_at_quantile(0.5).min(histogram.max()),
        });
        hops.max_by_key(|hop| hop.took_ns.saturating_sub(hop.p50_ns)).expect("there are hops")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn not_the_longest_hop_is_to_blame_but_the_one_furthest_above_its_median() {
        let usual_ns = [0, 400, 0, 0, 10, 10, 10, 10, 10, 300];
        let mut usual = Usual::default();
        (0..9).for_each(|_| usual.take(&usual_ns));
        let mut hops_ns = usual_ns;
        (hops_ns[1], hops_ns[5]) = (450, 100);
        let expected = Blamed { hop: "forward kinematics", took_ns: 100, p50_ns: 10 };
        assert_eq!(usual.blame(&hops_ns), expected);
    }
}
