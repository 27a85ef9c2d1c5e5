//! The server with a dictionary of two entries, and reasons that end a transfer.

use super::*;

const NUMBER: ObjectAddress = ObjectAddress::new(0x6081, 0);
const TEXT: ObjectAddress = ObjectAddress::new(0x1008, 0);

/// Four bytes that can be written, and a text that cannot.
#[derive(Default)]
struct Memory([u8; 4]);

impl Dictionary for Memory {
    fn read(&mut self, object: ObjectAddress) -> Result<Value, AbortCode> {
        match object {
            NUMBER => Ok(Value::Number(Expedited::new(&self.0).unwrap())),
            TEXT => Ok(Value::Text("Masseter emulated drive")),
            _ => Err(AbortCode::NO_OBJECT),
        }
    }

    fn accepts(&self, object: ObjectAddress) -> Result<(), AbortCode> {
        if object == NUMBER { Ok(()) } else { Err(AbortCode::READ_ONLY) }
    }

    fn write(&mut self, object: ObjectAddress, data: &[u8], _: bool) -> Result<(), AbortCode> {
        self.accepts(object)?;
        self.0 = data.try_into().map_err(|_| AbortCode::TOO_SHORT)?;
        Ok(())
    }
}

struct Client {
    server: SdoServer,
    memory: Memory,
    now_ns: u64,
}

impl Client {
    fn new() -> Self {
        Self { server: SdoServer::default(), memory: Memory::default(), now_ns: 0 }
    }

    fn ask(&mut self, request: SdoRequest) -> SdoResponse {
        self.server.answer(self.now_ns, &request.encode(), &mut self.memory).expect("an answer")
    }

    fn aborted(&mut self, request: SdoRequest) -> AbortCode {
        match self.ask(request) {
            SdoResponse::Abort { code, .. } => code,
            other => panic!("{other:?}"),
        }
    }
}

fn piece(toggle: bool, data: &[u8], is_last: bool) -> SdoRequest {
    SdoRequest::DownloadSegment { toggle, data: Segment::new(data).unwrap(), is_last }
}

#[test]
fn a_text_comes_in_segments() {
    let mut client = Client::new();
    let begun = client.ask(SdoRequest::InitiateUpload { object: TEXT });
    assert_eq!(begun, SdoResponse::InitiateUpload { object: TEXT, size: Some(23) });
    let (mut text, mut toggle) = (Vec::new(), false);
    loop {
        let SdoResponse::UploadSegment { data, is_last, .. } =
            client.ask(SdoRequest::UploadSegment { toggle })
        else {
            panic!("no segment")
        };
        text.extend_from_slice(data.data());
        toggle = !toggle;
        if is_last {
            break;
        }
    }
    assert_eq!(text, b"Masseter emulated drive");
    assert_eq!(client.aborted(SdoRequest::UploadSegment { toggle }), AbortCode::UNKNOWN_COMMAND);
}

#[test]
fn a_number_may_be_written_in_segments() {
    let mut client = Client::new();
    client.ask(SdoRequest::InitiateDownload { object: NUMBER, size: Some(4) });
    client.ask(piece(false, &[1, 2, 3], false));
    assert_eq!(client.ask(piece(true, &[4], true)), SdoResponse::DownloadSegment { toggle: true });
    assert_eq!(client.memory.0, [1, 2, 3, 4]);
}

#[test]
fn what_breaks_the_order_aborts_the_transfer() {
    let begin = SdoRequest::InitiateDownload { object: NUMBER, size: Some(4) };
    let cases: [(&[SdoRequest], AbortCode); 8] = [
        (&[begin, piece(true, &[1], false)], AbortCode::TOGGLE),
        (&[begin, piece(false, &[1], false), piece(false, &[1], false)], AbortCode::TOGGLE),
        (&[begin, piece(false, &[1, 2, 3], true)], AbortCode::LENGTH),
        (&[begin, piece(false, &[1, 2, 3, 4, 5], true)], AbortCode::TOO_LONG),
        (&[SdoRequest::InitiateDownload { object: NUMBER, size: Some(5) }], AbortCode::TOO_LONG),
        (&[SdoRequest::InitiateDownload { object: TEXT, size: None }], AbortCode::READ_ONLY),
        (&[begin, SdoRequest::UploadSegment { toggle: false }], AbortCode::UNKNOWN_COMMAND),
        (&[piece(false, &[1], true)], AbortCode::UNKNOWN_COMMAND),
    ];
    for (requests, code) in cases {
        let mut client = Client::new();
        let (last, before) = requests.split_last().unwrap();
        for request in before {
            assert!(!matches!(client.ask(*request), SdoResponse::Abort { .. }));
        }
        assert_eq!(client.aborted(*last), code, "{requests:?}");
        assert_eq!(client.memory.0, [0; 4], "nothing is written by halves");
    }
}

#[test]
fn block_transfer_is_unknown_and_a_short_frame_is_ignored() {
    let mut client = Client::new();
    let answer = client.server.answer(0, &[0xA0, 0x08, 0x10, 0, 0, 0, 0, 0], &mut client.memory);
    assert_eq!(answer, Some(SdoResponse::Abort { object: TEXT, code: AbortCode::UNKNOWN_COMMAND }));
    assert_eq!(client.server.answer(0, &[0x40, 0x08, 0x10], &mut client.memory), None);
}

#[test]
fn a_client_that_falls_silent_gets_an_abort_after_a_second() {
    let mut client = Client::new();
    client.ask(SdoRequest::InitiateUpload { object: TEXT });
    assert_eq!(client.server.expire(TIMEOUT_NS), None);
    let expired = client.server.expire(TIMEOUT_NS + 1);
    assert_eq!(expired, Some(SdoResponse::Abort { object: TEXT, code: AbortCode::TIMED_OUT }));
    assert_eq!(client.server.expire(u64::MAX), None);
}

#[test]
fn an_abort_of_the_client_ends_the_transfer_without_an_answer() {
    let mut client = Client::new();
    client.ask(SdoRequest::InitiateUpload { object: TEXT });
    let abort = SdoRequest::Abort { object: TEXT, code: AbortCode::GENERAL };
    assert_eq!(client.server.answer(0, &abort.encode(), &mut client.memory), None);
    assert_eq!(client.aborted(SdoRequest::UploadSegment { toggle: false }), AbortCode::UNKNOWN_COMMAND);
}
