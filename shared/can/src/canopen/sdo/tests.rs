//! The messages on the wire, and the laws of both codecs.

use proptest::prelude::*;

use super::*;

const HEARTBEAT: ObjectAddress = ObjectAddress::new(0x1017, 0);
const NAME: ObjectAddress = ObjectAddress::new(0x1008, 0);
const MAPPED: ObjectAddress = ObjectAddress::new(0x1A00, 2);

fn expedited(data: &[u8]) -> Expedited {
    Expedited::new(data).unwrap()
}

fn segment_of(data: &[u8]) -> Segment {
    Segment::new(data).unwrap()
}

#[test]
fn requests_are_those_of_the_standard() {
    let node = NodeId::new(5).unwrap();
    let abort = SdoRequest::Abort { object: NAME, code: AbortCode::TIMED_OUT };
    let unsized_value = Expedited::of_unknown_size([1, 2, 3, 4]);
    let last = SdoRequest::DownloadSegment { toggle: true, data: segment_of(b"ab"), is_last: true };
    let more = SdoRequest::DownloadSegment { toggle: false, data: segment_of(b"abcdefg"), is_last: false };
    let table = [
        (SdoRequest::Download { object: HEARTBEAT, data: expedited(&[1]) }, "605#2F17100001000000"),
        (SdoRequest::Download { object: HEARTBEAT, data: expedited(&[0x32, 0]) }, "605#2B17100032000000"),
        (SdoRequest::Download { object: HEARTBEAT, data: expedited(&[1, 2, 3]) }, "605#2717100001020300"),
        (
            SdoRequest::Download { object: MAPPED, data: expedited(&[0x20, 0, 0x64, 0x60]) },
            "605#23001A0220006460",
        ),
        (SdoRequest::Download { object: MAPPED, data: unsized_value }, "605#22001A0201020304"),
        (SdoRequest::InitiateDownload { object: NAME, size: Some(9) }, "605#2108100009000000"),
        (SdoRequest::InitiateDownload { object: NAME, size: None }, "605#2008100000000000"),
        (more, "605#0061626364656667"),
        (last, "605#1B61620000000000"),
        (SdoRequest::InitiateUpload { object: NAME }, "605#4008100000000000"),
        (SdoRequest::UploadSegment { toggle: false }, "605#6000000000000000"),
        (SdoRequest::UploadSegment { toggle: true }, "605#7000000000000000"),
        (abort, "605#8008100000000405"),
    ];
    for (request, expected) in table {
        assert_eq!(request.frame(node).to_string(), expected);
    }
}

#[test]
fn responses_are_those_of_the_standard() {
    let node = NodeId::new(5).unwrap();
    let abort = SdoResponse::Abort { object: HEARTBEAT, code: AbortCode::READ_ONLY };
    let last = SdoResponse::UploadSegment { toggle: true, data: segment_of(&[]), is_last: true };
    let table = [
        (SdoResponse::Download { object: HEARTBEAT }, "585#6017100000000000"),
        (SdoResponse::DownloadSegment { toggle: false }, "585#2000000000000000"),
        (SdoResponse::DownloadSegment { toggle: true }, "585#3000000000000000"),
        (SdoResponse::Upload { object: HEARTBEAT, data: expedited(&[5]) }, "585#4F17100005000000"),
        (SdoResponse::Upload { object: HEARTBEAT, data: expedited(&[5, 6]) }, "585#4B17100005060000"),
        (SdoResponse::Upload { object: HEARTBEAT, data: expedited(&[5, 6, 7]) }, "585#4717100005060700"),
        (SdoResponse::Upload { object: HEARTBEAT, data: expedited(&[5, 6, 7, 8]) }, "585#4317100005060708"),
        (SdoResponse::InitiateUpload { object: NAME, size: Some(20) }, "585#4108100014000000"),
        (last, "585#1F00000000000000"),
        (abort, "585#8017100002000106"),
    ];
    for (response, expected) in table {
        assert_eq!(response.frame(node).to_string(), expected);
    }
}

#[test]
fn what_no_message_carries_is_refused() {
    assert_eq!([0, 5].map(|length| Expedited::new(&[0; 5][..length])), [None; 2], "1 to 4 bytes");
    assert_eq!(Segment::new(&[0; 8]), None, "0 to 7 bytes");
}

#[test]
fn a_message_of_block_transfer_is_refused_with_its_object() {
    let data = [0xC6, 0x08, 0x10, 0, 0, 0, 0, 0];
    let error = SdoRequest::decode(&data).unwrap_err();
    assert_eq!(error, SdoError::UnknownCommand { command: 0xC6, object: NAME });
    assert!(SdoResponse::decode(&data).is_err());
}

#[test]
fn abort_codes_display_their_meaning() {
    assert_eq!(AbortCode::NO_SUBINDEX.to_string(), "06090011h (sub-index does not exist)");
    assert_eq!(AbortCode(0x0F00_FFC0).to_string(), "0F00FFC0h");
}

fn any_object() -> impl Strategy<Value = ObjectAddress> {
    any::<(u16, u8)>().prop_map(|(index, subindex)| ObjectAddress { index, subindex })
}

fn any_expedited() -> impl Strategy<Value = Expedited> {
    prop_oneof![
        prop::collection::vec(any::<u8>(), 1..=Expedited::MAX).prop_map(|data| expedited(&data)),
        any::<[u8; 4]>().prop_map(Expedited::of_unknown_size),
    ]
}

fn any_segment() -> impl Strategy<Value = Segment> {
    prop::collection::vec(any::<u8>(), 0..=Segment::MAX).prop_map(|data| segment_of(&data))
}

fn any_request() -> impl Strategy<Value = SdoRequest> {
    prop_oneof![
        (any_object(), any_expedited()).prop_map(|(object, data)| SdoRequest::Download { object, data }),
        (any_object(), any::<Option<u32>>())
            .prop_map(|(object, size)| SdoRequest::InitiateDownload { object, size }),
        (any::<bool>(), any_segment(), any::<bool>())
            .prop_map(|(toggle, data, is_last)| SdoRequest::DownloadSegment { toggle, data, is_last }),
        any_object().prop_map(|object| SdoRequest::InitiateUpload { object }),
        any::<bool>().prop_map(|toggle| SdoRequest::UploadSegment { toggle }),
        (any_object(), any::<u32>())
            .prop_map(|(object, code)| SdoRequest::Abort { object, code: AbortCode(code) }),
    ]
}

fn any_response() -> impl Strategy<Value = SdoResponse> {
    prop_oneof![
        any_object().prop_map(|object| SdoResponse::Download { object }),
        any::<bool>().prop_map(|toggle| SdoResponse::DownloadSegment { toggle }),
        (any_object(), any_expedited()).prop_map(|(object, data)| SdoResponse::Upload { object, data }),
        (any_object(), any::<Option<u32>>())
            .prop_map(|(object, size)| SdoResponse::InitiateUpload { object, size }),
        (any::<bool>(), any_segment(), any::<bool>())
            .prop_map(|(toggle, data, is_last)| SdoResponse::UploadSegment { toggle, data, is_last }),
        (any_object(), any::<u32>())
            .prop_map(|(object, code)| SdoResponse::Abort { object, code: AbortCode(code) }),
    ]
}

proptest! {
    #[test]
    fn every_request_decodes_to_itself(request in any_request()) {
        prop_assert_eq!(SdoRequest::decode(&request.encode()), Ok(request));
    }

    #[test]
    fn every_response_decodes_to_itself(response in any_response()) {
        prop_assert_eq!(SdoResponse::decode(&response.encode()), Ok(response));
    }

    #[test]
    fn whatever_arrives_is_a_message_or_refused(data in prop::collection::vec(any::<u8>(), 0..=8)) {
        let is_whole = data.len() == LENGTH;
        if let Ok(request) = SdoRequest::decode(&data) {
            prop_assert!(is_whole);
            prop_assert_eq!(SdoRequest::decode(&request.encode()), Ok(request));
        }
        if let Ok(response) = SdoResponse::decode(&data) {
            prop_assert!(is_whole);
            prop_assert_eq!(SdoResponse::decode(&response.encode()), Ok(response));
        }
    }
}
