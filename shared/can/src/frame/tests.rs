use proptest::prelude::*;

use super::*;

pub(crate) fn any_id() -> impl Strategy<Value = CanId> {
    prop_oneof![
        (0..=STANDARD_MAX as u16).prop_map(|id| CanId::standard(id).unwrap()),
        (0..=EXTENDED_MAX).prop_map(|id| CanId::extended(id).unwrap()),
    ]
}

/// Frames also with the runs of equal bits that need the most stuff bits.
pub(crate) fn any_frame() -> impl Strategy<Value = Frame> {
    let byte = prop_oneof![Just(0_u8), Just(0xFF), any::<u8>()];
    (any_id(), prop::collection::vec(byte, 0..=Frame::MAX_DATA))
        .prop_map(|(id, data)| Frame::new(id, &data).unwrap())
}

fn standard(id: u16) -> CanId {
    CanId::standard(id).unwrap()
}

fn extended(id: u32) -> CanId {
    CanId::extended(id).unwrap()
}

#[test]
fn an_identifier_that_is_too_large_is_refused_with_its_value() {
    assert_eq!(CanId::standard(0x800), Err(FrameError::StandardId(0x800)));
    assert_eq!(CanId::extended(0x2000_0000), Err(FrameError::ExtendedId(0x2000_0000)));
}

#[test]
fn flags_of_remote_and_error_frames_are_refused() {
    for flags in [1 << 30, 1 << 29, 1 << 31 | 1 << 30, 1 << 31 | 1 << 29] {
        assert!(CanId::from_flagged(flags | 0x123).is_err());
    }
}

#[test]
fn order_is_that_of_arbitration() {
    assert!(standard(0x080) < standard(0x181));
    assert!(standard(0x100) < extended(0x100 << 18), "equal base: the standard frame wins by its IDE bit");
    assert!(extended(0x0FF << 18 | EXTENSION_MASK) < standard(0x100), "the base decides first");
    assert!(extended(0x100 << 18) < extended(0x100 << 18 | 1));
}

proptest! {
    #[test]
    fn an_identifier_survives_its_flagged_form(id in any_id()) {
        prop_assert_eq!(CanId::from_flagged(id.flagged()), Ok(id));
    }
}

fn id() -> CanId {
    CanId::standard(0x123).unwrap()
}

#[test]
fn a_frame_carries_at_most_eight_bytes() {
    for length in 0..=9 {
        let frame = Frame::new(id(), &vec![1; length]).map(|frame| frame.data().len());
        assert_eq!(frame, if length <= 8 { Ok(length) } else { Err(FrameError::DataLength(length)) });
    }
    assert_eq!(FrameError::DataLength(9).to_string(), "9 data bytes: a classical frame carries at most 8");
}

#[test]
fn bytes_behind_the_length_are_no_data() {
    for length in 0..=9 {
        let frame = Frame::of_padded(id(), length, [0xA5; 8]);
        let expected = if length <= 8 {
            Frame::new(id(), &vec![0xA5; length])
        } else {
            Err(FrameError::DataLength(length))
        };
        assert_eq!(frame, expected);
    }
}

#[test]
fn frames_show_as_in_a_candump_log() {
    assert_eq!(Frame::fixed(id(), [0x11, 0x22]).to_string(), "123#1122");
    assert_eq!(Frame::fixed(CanId::extended(0x123).unwrap(), []).to_string(), "00000123#");
}

proptest! {
    #[test]
    fn a_frame_keeps_what_it_was_made_of(frame in any_frame()) {
        prop_assert_eq!(Frame::new(frame.id(), frame.data()), Ok(frame));
    }
}
