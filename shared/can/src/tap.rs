//! Frames and error reports of a tap on a bus, each with its time.

use super::bus::Received;
use super::error_frame::ErrorReport;
use super::frame::Frame;

/// An observation of a tap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tapped {
    /// A frame.
    Frame(TappedFrame),
    /// An error on the wire, or a controller that changed its error state.
    Error(ErrorReport),
}

/// A frame with its times.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TappedFrame {
    /// The frame.
    pub frame: Frame,
    /// When its last end-of-frame bit was on the wire, ns.
    pub time_ns: u64,
    /// When its transmitter queued it, ns; `None` on real wires.
    pub queued_ns: Option<u64>,
}

impl From<Received> for TappedFrame {
    fn from(Received { frame, time_ns }: Received) -> Self {
        Self { frame, time_ns, queued_ns: None }
    }
}

impl Tapped {
    /// Time of the observation, ns.
    pub fn time_ns(&self) -> u64 {
        match self {
            Self::Frame(tapped) => tapped.time_ns,
            Self::Error(report) => report.time_ns,
        }
    }

    /// The frame, if it is one.
    pub fn frame(&self) -> Option<&TappedFrame> {
        match self {
            Self::Frame(tapped) => Some(tapped),
            Self::Error(_) => None,
        }
    }
}
