//! The intervals by name. [`Intervals`](super::intervals::Intervals) defines their ends.

/// An interval that a cycle passes through.
#[derive(Debug, Clone, Copy)]
pub(super) enum Interval {
    PlantWakeUp,
    PlantWakeUpCorrected,
    ProcessData,
    ControllerWakeUp,
    ControllerWakeUpCorrected,
    ReadingTransport,
    ForwardKinematics,
    Control,
    ControllerCycle,
    CommandTransport,
    CommandToWire,
    SampleToWire,
    /// From the plant's wake-up to the reading's publication, and from the reading's reception to the command's: both
    /// processes and the wires, without the waits of the time table.
    RoundTrip,
}

impl Interval {
    /// In the order in which a cycle passes through them.
    pub(super) const ALL: [Self; 13] = [
        Self::PlantWakeUp,
        Self::PlantWakeUpCorrected,
        Self::ProcessData,
        Self::ControllerWakeUp,
        Self::ControllerWakeUpCorrected,
        Self::ReadingTransport,
        Self::ForwardKinematics,
        Self::Control,
        Self::ControllerCycle,
        Self::CommandTransport,
        Self::CommandToWire,
        Self::SampleToWire,
        Self::RoundTrip,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::PlantWakeUp => "plant wake-up",
            Self::PlantWakeUpCorrected => "plant wake-up corrected",
            Self::ProcessData => "process data",
            Self::ControllerWakeUp => "controller wake-up",
            Self::ControllerWakeUpCorrected => "controller wake-up corrected",
            Self::ReadingTransport => "reading transport",
            Self::ForwardKinematics => "forward kinematics",
            Self::Control => "control",
            Self::ControllerCycle => "controller cycle",
            Self::CommandTransport => "command transport",
            Self::CommandToWire => "command to wire",
            Self::SampleToWire => "sample to wire",
            Self::RoundTrip => "round trip",
        }
    }
}

// An interval's number is its place.
const _: () = {
    let mut place = 0;
    while place < Interval::ALL.len() {
        assert!(Interval::ALL[place] as usize == place);
        place += 1;
    }
};
