//! The client against scripts of requests and answers of the standard.

use super::*;

const TIMEOUT_NS: u64 = 1_000_000;
const HEARTBEAT: ObjectAddress = ObjectAddress::new(0x1017, 0);
const NAME: ObjectAddress = ObjectAddress::new(0x1008, 0);

fn reading(object: ObjectAddress) -> SdoClient {
    let mut client = SdoClient::default();
    client.begin(object, None);
    client
}

fn writing(object: ObjectAddress, bytes: &[u8]) -> SdoClient {
    let mut client = SdoClient::default();
    client.begin(object, Some(Expedited::new(bytes).unwrap()));
    client
}

/// Sends the client's request and gives the answer, both as bytes on the wire; returns the outcome.
fn play(client: &mut SdoClient, request: [u8; 8], answer: [u8; 8]) -> Result<Expedited, SdoFailure> {
    assert_eq!(client.poll(0).unwrap().encode(), request);
    assert_eq!(client.poll(0), None, "one request at a time");
    let outcome = client.take_answer(SdoResponse::decode(&answer).unwrap(), None).unwrap();
    outcome.map(|value| value.unwrap())
}

#[test]
fn small_values_take_one_exchange() {
    let mut client = reading(HEARTBEAT);
    let read = play(&mut client, [0x40, 0x17, 0x10, 0, 0, 0, 0, 0], [0x4B, 0x17, 0x10, 0, 50, 0, 0, 0]);
    assert_eq!(read.unwrap().data(), [50, 0]);
    assert!(client.is_idle());

    let mut client = writing(HEARTBEAT, &[50, 0]);
    let written = play(&mut client, [0x2B, 0x17, 0x10, 0, 50, 0, 0, 0], [0x60, 0x17, 0x10, 0, 0, 0, 0, 0]);
    assert_eq!(written.unwrap().data(), [50, 0]);
}

#[test]
fn a_refusal_names_object_and_reason() {
    let mut client = writing(HEARTBEAT, &[50, 0]);
    let refusal = [0x80, 0x17, 0x10, 0, 0x02, 0, 0x01, 0x06];
    let error = play(&mut client, [0x2B, 0x17, 0x10, 0, 50, 0, 0, 0], refusal).unwrap_err();
    assert_eq!(error, SdoFailure { object: HEARTBEAT, reason: SdoReason::Aborted(AbortCode::READ_ONLY) });
}

#[test]
fn a_value_longer_than_four_bytes_ends_the_transfer_on_both_sides() {
    let mut client = reading(NAME);
    let outcome = play(&mut client, [0x40, 0x08, 0x10, 0, 0, 0, 0, 0], [0x41, 0x08, 0x10, 0, 9, 0, 0, 0]);
    assert_eq!(outcome, Err(SdoFailure { object: NAME, reason: SdoReason::Aborted(AbortCode::LENGTH) }));
    assert_eq!(client.poll(0), Some(SdoRequest::Abort { object: NAME, code: AbortCode::LENGTH }));
    assert!(client.is_idle());
}

#[test]
fn silence_is_answered_by_asking_again_and_then_given_up() {
    let mut client = reading(HEARTBEAT);
    let mut now_ns = 0;
    for attempt in 1..=ATTEMPTS {
        assert_eq!(client.poll(now_ns), Some(SdoRequest::InitiateUpload { object: HEARTBEAT }));
        client.expire(now_ns + TIMEOUT_NS, TIMEOUT_NS).unwrap();
        assert_eq!(client.poll(now_ns + TIMEOUT_NS), None, "not yet");
        now_ns += TIMEOUT_NS + 1;
        let silent = Err(SdoFailure { object: HEARTBEAT, reason: SdoReason::Silent });
        assert_eq!(client.expire(now_ns, TIMEOUT_NS), if attempt < ATTEMPTS { Ok(()) } else { silent });
    }
    let abort = SdoRequest::Abort { object: HEARTBEAT, code: AbortCode::TIMED_OUT };
    assert_eq!(client.poll(now_ns), Some(abort));
    assert!(client.is_idle());
}

#[test]
fn answers_without_a_request_change_nothing() {
    let answer = SdoResponse::Download { object: HEARTBEAT };
    assert_eq!(SdoClient::default().take_answer(answer, None), None);
    let mut client = reading(NAME);
    assert_eq!(client.take_answer(answer, None), None, "nothing was sent yet");
    client.poll(0);
    let before = client;
    let segment = SdoResponse::DownloadSegment { toggle: false };
    let other = SdoResponse::Abort { object: HEARTBEAT, code: AbortCode::GENERAL };
    let wrong_way = SdoResponse::Download { object: NAME };
    let long = SdoResponse::InitiateUpload { object: HEARTBEAT, size: Some(9) };
    for foreign in [answer, segment, other, wrong_way, long] {
        assert_eq!(client.take_answer(foreign, None), None);
        assert_eq!(client, before);
    }
    let mut client = writing(NAME, &[50, 0]);
    client.poll(0);
    let before = client;
    assert_eq!((client.take_answer(answer, None), client), (None, before), "another object was written");
}

#[test]
fn a_longer_value_comes_in_segments_and_a_wrong_toggle_is_unasked() {
    let (mut client, mut value) = (reading(NAME), Vec::new());
    assert_eq!(client.poll(0), Some(SdoRequest::InitiateUpload { object: NAME }));
    let begun = SdoResponse::InitiateUpload { object: NAME, size: Some(9) };
    assert_eq!(client.take_answer(begun, Some(&mut value)), None);
    for (toggle, text, is_last) in [(false, "Massete", false), (true, "r!", true)] {
        assert_eq!(client.poll(0), Some(SdoRequest::UploadSegment { toggle }));
        let segment = |toggle| {
            let data = masseter_can::canopen::Segment::new(text.as_bytes()).unwrap();
            SdoResponse::UploadSegment { toggle, data, is_last }
        };
        assert_eq!(client.take_answer(segment(!toggle), Some(&mut value)), None);
        assert_eq!(client.poll(0), None, "the right one is still awaited");
        let outcome = client.take_answer(segment(toggle), Some(&mut value));
        assert_eq!(outcome, is_last.then_some(Ok(None)));
    }
    assert_eq!(value, b"Masseter!");
    assert!(client.is_idle());
}

#[test]
fn a_segment_is_not_asked_for_twice() {
    let (mut client, mut value) = (reading(NAME), Vec::new());
    client.poll(0);
    client.take_answer(SdoResponse::InitiateUpload { object: NAME, size: None }, Some(&mut value));
    client.poll(0);
    assert_eq!(
        client.expire(TIMEOUT_NS + 1, TIMEOUT_NS),
        Err(SdoFailure { object: NAME, reason: SdoReason::Silent })
    );
    let abort = SdoRequest::Abort { object: NAME, code: AbortCode::TIMED_OUT };
    assert_eq!(client.poll(0), Some(abort));
}
