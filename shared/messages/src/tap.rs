//! Frames and error reports of a CAN tap as messages of the topic `frame`, and back.

use masseter_can::{
    CanId, ERROR_FLAG, ErrorReport, ErrorReportError, Frame, FrameError, Tapped, TappedFrame,
};

use super::{CanData, FrameTap};

/// Most buses in a link: six drives need at most six.
const MAX_BUSES: usize = 64;

/// A message that holds neither frame nor error report.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TapError {
    /// A frame that CAN does not have.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// An error report of no known class.
    #[error(transparent)]
    Error(#[from] ErrorReportError),
    /// An index without a bus.
    #[error("a frame on bus {0}, of {MAX_BUSES} that a link may have")]
    Bus(u32),
}

/// The message for an observation on the bus with that index. The header is stamped at publication.
pub fn encode(bus: u16, tapped: &Tapped) -> FrameTap {
    match tapped {
        Tapped::Frame(TappedFrame { frame, time_ns, queued_ns }) => FrameTap {
            time_ns: *time_ns,
            queued_ns: queued_ns.unwrap_or(0),
            id: frame.id().flagged(),
            bus: bus.into(),
            data: CanData::of_frame(frame),
            ..FrameTap::default()
        },
        Tapped::Error(report) => {
            let (id, said) = report.encode();
            let data = CanData::new(&said);
            FrameTap { time_ns: report.time_ns, id, bus: bus.into(), data, ..FrameTap::default() }
        }
    }
}

/// Index of the bus of a message, which is safe as an index of arrays with one entry for each bus.
///
/// # Errors
/// [`TapError::Bus`] for an index beyond the most buses.
pub fn bus_of(tap: &FrameTap) -> Result<usize, TapError> {
    let bus = tap.bus as usize;
    if bus < MAX_BUSES { Ok(bus) } else { Err(TapError::Bus(tap.bus)) }
}

/// Whether a message holds an error report, not a frame.
pub fn is_error(tap: &FrameTap) -> bool {
    tap.id & ERROR_FLAG != 0 && tap.id >> 30 == 0
}

/// The frame or error report of a message.
///
/// # Errors
/// [`TapError`] for a message that is neither.
pub fn decode(tap: &FrameTap) -> Result<Tapped, TapError> {
    if is_error(tap) {
        let (said, _) = tap.data.bytes.split_first_chunk().expect("an error message has 8 bytes");
        return Ok(Tapped::Error(ErrorReport::decode(tap.time_ns, tap.id, *said)?));
    }
    let (padded, _) = tap.data.bytes.split_first_chunk().expect("room for the longest frame");
    let frame = Frame::of_padded(CanId::from_flagged(tap.id)?, tap.data.length as usize, *padded)?;
    let queued_ns = Some(tap.queued_ns).filter(|&queued_ns| queued_ns > 0);
    Ok(Tapped::Frame(TappedFrame { frame, time_ns: tap.time_ns, queued_ns }))
}

#[cfg(test)]
mod tests {
    use masseter_can::{ErrorKind, ErrorState};
    use proptest::prelude::*;

    use super::*;

    /// Frames with standard and extended identifiers.
    fn any_frame() -> impl Strategy<Value = Frame> {
        let id = prop_oneof![
            (0..1_u32 << 11).prop_map(|id| CanId::standard(id as u16).unwrap()),
            (0..1_u32 << 29).prop_map(|id| CanId::extended(id).unwrap()),
        ];
        let data = prop::collection::vec(any::<u8>(), 0..=8);
        (id, data).prop_map(|(id, data)| Frame::new(id, &data).unwrap())
    }

    fn of_length(length: usize) -> CanData {
        CanData { length: length as u32, ..CanData::new(&[]) }
    }

    #[test]
    fn what_is_no_frame_is_refused() {
        let tap = FrameTap { data: of_length(9), ..Default::default() };
        assert_eq!(decode(&tap), Err(FrameError::DataLength(9).into()));
        let tap = FrameTap { data: of_length(65), ..Default::default() };
        assert_eq!(decode(&tap), Err(FrameError::DataLength(65).into()));
        let tap = FrameTap { id: 0x800, ..Default::default() };
        assert_eq!(decode(&tap), Err(FrameError::StandardId(0x800).into()));
        let tap = FrameTap { id: ERROR_FLAG, ..Default::default() };
        assert_eq!(decode(&tap), Err(ErrorReportError(ERROR_FLAG).into()));
    }

    #[test]
    fn a_bus_that_no_link_has_is_refused() {
        let of = |bus| bus_of(&FrameTap { bus, ..Default::default() });
        assert_eq!((of(0), of(63)), (Ok(0), Ok(63)));
        for bus in [64, u32::MAX] {
            assert_eq!(of(bus), Err(TapError::Bus(bus)));
        }
    }

    #[test]
    fn an_error_report_survives() {
        let kind = ErrorKind::State(ErrorState::BusOff);
        let tapped = Tapped::Error(ErrorReport { time_ns: 5, port: 2, kind, tec: 255, rec: 3 });
        assert_eq!(decode(&encode(1, &tapped)), Ok(tapped));
    }

    proptest! {
        #[test]
        fn every_frame_survives(
            frame in any_frame(),
            time_ns: u64,
            queued_ns in prop::option::of(1..u64::MAX),
            bus: u16,
        ) {
            let tapped = Tapped::Frame(TappedFrame { frame, time_ns, queued_ns });
            prop_assert_eq!(decode(&encode(bus, &tapped)), Ok(tapped));
        }
    }
}
