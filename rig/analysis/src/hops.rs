//! The hops of a cycle from the plant's deadline to the command on the wire, and the hop furthest above its own median.
//!
//! SYNC on the wire and the waits of the time table lie between the hops, so that a delay counts in one hop alone.

use hdrhistogram::Histogram;
use serde::{Serialize, Serializer};

use super::measured::histogram;

/// A hop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hop {
    /// From the plant's deadline to its wake-up.
    PlantWakeUp,
    /// From SYNC to the last process data of the drives.
    ProcessData,
    /// From there to the reading's publication.
    ReadingPublication,
    /// From the controller's deadline to its wake-up.
    ControllerWakeUp,
    /// From there, or the later publication of the reading, until the controller has it.
    ReadingPickUp,
    /// Until the pose is solved.
    ForwardKinematics,
    /// Until the command is computed.
    Control,
    /// Until the command is published.
    CommandPublication,
    /// Until the plant has the command.
    CommandTransport,
    /// Until its last process data are on the wire.
    CommandToWire,
}

impl Hop {
    /// In the order in which a cycle passes through them.
    pub const ALL: [Self; 10] = [
        Self::PlantWakeUp,
        Self::ProcessData,
        Self::ReadingPublication,
        Self::ControllerWakeUp,
        Self::ReadingPickUp,
        Self::ForwardKinematics,
        Self::Control,
        Self::CommandPublication,
        Self::CommandTransport,
        Self::CommandToWire,
    ];

    /// The name in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::PlantWakeUp => "plant wake-up",
            Self::ProcessData => "process data",
            Self::ReadingPublication => "reading publication",
            Self::ControllerWakeUp => "controller wake-up",
            Self::ReadingPickUp => "reading pick-up",
            Self::ForwardKinematics => "forward kinematics",
            Self::Control => "control",
            Self::CommandPublication => "command publication",
            Self::CommandTransport => "command transport",
            Self::CommandToWire => "command to wire",
        }
    }
}

/// As its name.
impl Serialize for Hop {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// How long each of [`Hop::ALL`] took in a cycle, ns.
pub(super) type HopTimes = [u64; Hop::ALL.len()];

/// A hop of one cycle beside its median.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct HopTime {
    pub(super) hop: Hop,
    pub(super) took_ns: u64,
    pub(super) p50_ns: u64,
}

/// How long the hops typically take.
#[derive(Debug)]
pub(super) struct TypicalHops([Histogram<u64>; Hop::ALL.len()]);

impl Default for TypicalHops {
    fn default() -> Self {
        Self(std::array::from_fn(|_| histogram()))
    }
}

impl TypicalHops {
    pub(super) fn take(&mut self, hops_ns: &HopTimes) {
        for (histogram, &hop_ns) in self.0.iter_mut().zip(hops_ns) {
            histogram.record(hop_ns).expect("a histogram that resizes itself takes any value");
        }
    }

    /// The hop furthest above its median.
    pub(super) fn furthest_above_median(&self, hops_ns: &HopTimes) -> HopTime {
        let hops = Hop::ALL.into_iter().zip(hops_ns).zip(&self.0).map(|((hop, &took_ns), histogram)| {
            HopTime { hop, took_ns, p50_ns: histogram.value_at_quantile(0.5).min(histogram.max()) }
        });
        hops.max_by_key(|hop| hop.took_ns.saturating_sub(hop.p50_ns)).expect("there are hops")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn not_the_longest_hop_is_to_blame_but_the_one_furthest_above_its_median() {
        let typical_ns = [0, 400, 0, 0, 10, 10, 10, 10, 10, 300];
        let mut typical = TypicalHops::default();
        (0..9).for_each(|_| typical.take(&typical_ns));
        let mut hops_ns = typical_ns;
        (hops_ns[1], hops_ns[5]) = (450, 100);
        let expected = HopTime { hop: Hop::ForwardKinematics, took_ns: 100, p50_ns: 10 };
        assert_eq!(typical.furthest_above_median(&hops_ns), expected);
    }
}
