//! The client against scripts of requests and answers of the standard.

use super::*;

const HEARTBEAT: ObjectAddress = ObjectAddress::new(0x1017, 0);
const NAME: ObjectAddress = ObjectAddress::new(0x1008, 0);

fn reading(object: ObjectAddress) -> SdoClient {
    let mut client = SdoClient::default();
    client.read(object);
    client
}

fn writing(object: ObjectAddress, bytes: &[u8]) -> SdoClient {
    let mut client = SdoClient::default();
    client.write(object, Expedited::new(bytes).unwrap());
    client
}

/// The client's requests and the answers it gets, both as bytes on the wire, one pair a line.
fn play(client: &mut SdoClient, script: &[([u8; 8], [u8; 8])]) {
    for (request, answer) in script {
        assert_eq!(client.poll(0).unwrap().encode(), *request);
        assert_eq!(client.poll(0), None, "one request at a time");
        assert!(client.take(SdoResponse::decode(answer).unwrap()));
    }
}

#[test]
fn small_values_take_one_exchange() {
    let mut client = reading(HEARTBEAT);
    play(&mut client, &[([0x40, 0x17, 0x10, 0, 0, 0, 0, 0], [0x4B, 0x17, 0x10, 0, 50, 0, 0, 0])]);
    assert_eq!(client.outcome().unwrap().unwrap().number(), Some(50));
    assert!(client.is_idle());

    let mut client = writing(HEARTBEAT, &[50, 0]);
    play(&mut client, &[([0x2B, 0x17, 0x10, 0, 50, 0, 0, 0], [0x60, 0x17, 0x10, 0, 0, 0, 0, 0])]);
    assert!(client.outcome().unwrap().is_ok());
}

#[test]
fn long_values_come_in_segments_with_alternating_toggle_bits() {
    let mut client = reading(NAME);
    let script = [
        ([0x40, 0x08, 0x10, 0, 0, 0, 0, 0], [0x41, 0x08, 0x10, 0, 9, 0, 0, 0]),
        ([0x60, 0, 0, 0, 0, 0, 0, 0], [0x00, b'm', b'a', b's', b's', b'e', b't', b'e']),
        ([0x70, 0, 0, 0, 0, 0, 0, 0], [0x1B, b'r', b'!', 0, 0, 0, 0, 0]),
    ];
    play(&mut client, &script);
    assert_eq!(client.outcome().unwrap().unwrap().bytes(), b"masseter!");
}

#[test]
fn a_refusal_names_object_and_reason() {
    let mut client = writing(HEARTBEAT, &[50, 0]);
    play(&mut client, &[([0x2B, 0x17, 0x10, 0, 50, 0, 0, 0], [0x80, 0x17, 0x10, 0, 0x02, 0, 0x01, 0x06])]);
    let error = client.outcome().unwrap().unwrap_err();
    assert_eq!(error, SdoFailure::Aborted { object: HEARTBEAT, code: AbortCode::READ_ONLY });
}

#[test]
fn a_toggle_bit_that_does_not_alternate_ends_the_transfer_on_both_sides() {
    let mut client = reading(NAME);
    let initiate = ([0x40, 0x08, 0x10, 0, 0, 0, 0, 0], [0x41, 0x08, 0x10, 0, 9, 0, 0, 0]);
    play(&mut client, &[initiate, ([0x60, 0, 0, 0, 0, 0, 0, 0], [0x10, 1, 2, 3, 4, 5, 6, 7])]);
    let failure = SdoFailure::Aborted { object: NAME, code: AbortCode::TOGGLE };
    assert_eq!(client.outcome(), Some(Err(failure)));
    assert_eq!(client.poll(0), Some(SdoRequest::Abort { object: NAME, code: AbortCode::TOGGLE }));
    assert!(client.is_idle());
}

#[test]
fn a_value_too_long_to_keep_is_refused_before_it_comes() {
    let mut client = reading(NAME);
    play(&mut client, &[([0x40, 0x08, 0x10, 0, 0, 0, 0, 0], [0x41, 0x08, 0x10, 0, 65, 0, 0, 0])]);
    let failure = SdoFailure::Aborted { object: NAME, code: AbortCode::OUT_OF_MEMORY };
    assert_eq!(client.outcome(), Some(Err(failure)));
}

#[test]
fn silence_is_answered_by_asking_again_and_then_given_up() {
    let mut client = reading(HEARTBEAT);
    let mut now_ns = 0;
    for _ in 0..ATTEMPTS {
        assert_eq!(client.poll(now_ns), Some(SdoRequest::InitiateUpload { object: HEARTBEAT }));
        client.expire(now_ns + TIMEOUT_NS);
        assert_eq!(client.poll(now_ns + TIMEOUT_NS), None, "not yet");
        now_ns += TIMEOUT_NS + 1;
        client.expire(now_ns);
    }
    let error = client.outcome().unwrap().unwrap_err();
    assert_eq!(error, SdoFailure::Silent { object: HEARTBEAT });
    let abort = SdoRequest::Abort { object: HEARTBEAT, code: AbortCode::TIMED_OUT };
    assert_eq!(client.poll(now_ns), Some(abort));
    assert!(client.is_idle());
}

#[test]
fn answers_without_a_request_change_nothing() {
    let answer = SdoResponse::Download { object: HEARTBEAT };
    assert!(!SdoClient::default().take(answer));
    let mut client = reading(NAME);
    assert!(!client.take(answer), "nothing was sent yet");
    client.poll(0);
    let before = client;
    let segment = SdoResponse::DownloadSegment { toggle: false };
    let other = SdoResponse::Abort { object: HEARTBEAT, code: AbortCode::GENERAL };
    let wrong_way = SdoResponse::Download { object: NAME };
    for foreign in [answer, segment, other, wrong_way] {
        assert!(!client.take(foreign));
        assert_eq!(client, before);
    }
}
