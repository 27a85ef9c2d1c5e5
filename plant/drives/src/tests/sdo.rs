//! Transfers of the SDO server, and reasons that end them.

use masseter_can::canopen::Segment;

use super::*;

const NUMBER: ObjectAddress = ObjectAddress::new(0x6081, 0);
/// At most 1024 bytes.
pub(super) const USER_DATA: ObjectAddress = ObjectAddress::new(0x2010, 0);
const TEXT: ObjectAddress = ObjectAddress::new(0x1008, 0);

impl Bench {
    fn answer(&mut self, request: SdoRequest) -> SdoResponse {
        self.ask(request).expect("an answer")
    }

    fn aborted(&mut self, request: SdoRequest) -> AbortCode {
        match self.answer(request) {
            SdoResponse::Abort { code, .. } => code,
            other => panic!("{other:?}"),
        }
    }

    /// The abort messages that the drive has sent. The code of other frames with the same command is a segment's.
    pub(super) fn aborts(&self) -> Vec<SdoResponse> {
        let frames = self.sent.iter().filter(|frame| frame.id() == Cob::SdoResponse(id(4)).into());
        let aborts = frames.filter(|frame| frame.data()[0] == 0x80);
        aborts.map(|frame| SdoResponse::decode(frame.data()).unwrap()).collect()
    }
}

fn piece(toggle: bool, data: &[u8], is_last: bool) -> SdoRequest {
    SdoRequest::DownloadSegment { toggle, data: Segment::new(data).unwrap(), is_last }
}

#[test]
fn a_text_comes_in_segments() {
    let mut bench = Bench::new();
    let begun = bench.answer(SdoRequest::InitiateUpload { object: TEXT });
    assert_eq!(begun, SdoResponse::InitiateUpload { object: TEXT, size: Some(23) });
    let (mut text, mut toggle) = (Vec::new(), false);
    loop {
        let SdoResponse::UploadSegment { data, is_last, .. } =
            bench.answer(SdoRequest::UploadSegment { toggle })
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
    assert_eq!(bench.aborted(SdoRequest::UploadSegment { toggle }), AbortCode::UNKNOWN_COMMAND);
}

#[test]
fn a_number_may_be_written_in_segments() {
    let mut bench = Bench::new();
    bench.answer(SdoRequest::InitiateDownload { object: NUMBER, size: Some(4) });
    bench.answer(piece(false, &[1, 2, 3], false));
    assert_eq!(bench.answer(piece(true, &[4], true)), SdoResponse::DownloadSegment { toggle: true });
    assert_eq!(bench.read((0x6081, 0)), Ok(0x0403_0201));
}

#[test]
fn what_breaks_the_order_aborts_the_transfer() {
    let begin = SdoRequest::InitiateDownload { object: NUMBER, size: Some(4) };
    let begin_reading = SdoRequest::InitiateUpload { object: TEXT };
    let cases: [(&[SdoRequest], AbortCode); 10] = [
        (&[begin, piece(true, &[1], false)], AbortCode::TOGGLE),
        (&[begin, piece(false, &[1], false), piece(false, &[1], false)], AbortCode::TOGGLE),
        (&[begin, piece(false, &[1, 2, 3], true)], AbortCode::LENGTH),
        (&[begin, piece(false, &[1, 2, 3, 4, 5], true)], AbortCode::TOO_LONG),
        (&[SdoRequest::InitiateDownload { object: NUMBER, size: Some(5) }], AbortCode::TOO_LONG),
        (&[SdoRequest::InitiateDownload { object: TEXT, size: None }], AbortCode::READ_ONLY),
        (&[begin, SdoRequest::UploadSegment { toggle: false }], AbortCode::UNKNOWN_COMMAND),
        (&[begin_reading, piece(false, &[1], true)], AbortCode::UNKNOWN_COMMAND),
        (&[begin_reading, SdoRequest::UploadSegment { toggle: true }], AbortCode::TOGGLE),
        (&[piece(false, &[1], true)], AbortCode::UNKNOWN_COMMAND),
    ];
    for (requests, code) in cases {
        let mut bench = Bench::new();
        let before = bench.drive.objects.clone();
        let (last, first) = requests.split_last().unwrap();
        for request in first {
            assert!(!matches!(bench.answer(*request), SdoResponse::Abort { .. }));
        }
        assert_eq!(bench.aborted(*last), code, "{requests:?}");
        assert_eq!(bench.aborted(piece(false, &[1], true)), AbortCode::UNKNOWN_COMMAND, "none goes on");
        assert_eq!(bench.drive.objects.get(names::PROFILE_VELOCITY), before.get(names::PROFILE_VELOCITY));
    }
}

#[test]
fn an_abort_names_the_object_of_its_transfer() {
    let mut bench = Bench::new();
    bench.answer(SdoRequest::InitiateUpload { object: TEXT });
    let abort = bench.answer(SdoRequest::UploadSegment { toggle: true });
    assert_eq!(abort, SdoResponse::Abort { object: TEXT, code: AbortCode::TOGGLE });
}

#[test]
fn an_unknown_command_is_aborted_and_a_short_frame_is_ignored() {
    let mut bench = Bench::new();
    bench.receive(pdo(0x604, &[0xE0, 0x08, 0x10, 0, 0, 0, 0, 0]));
    let unknown = SdoResponse::Abort { object: TEXT, code: AbortCode::UNKNOWN_COMMAND };
    assert_eq!(bench.aborts(), [unknown]);
    let sent = bench.sent.len();
    bench.receive(pdo(0x604, &[0x40, 0x08, 0x10]));
    bench.receive(pdo(0x604, &[0xA0, 0x08, 0x10]));
    assert_eq!(bench.sent.len(), sent);
}

#[test]
fn user_data_are_written_and_read_in_segments() {
    let mut bench = Bench::new();
    bench.answer(SdoRequest::InitiateDownload { object: USER_DATA, size: None });
    bench.answer(piece(false, b"seven b", false));
    bench.answer(piece(true, b"ytes", true));
    let begun = bench.answer(SdoRequest::InitiateUpload { object: USER_DATA });
    assert_eq!(begun, SdoResponse::InitiateUpload { object: USER_DATA, size: Some(11) });
    bench.nmt(NmtCommand::ResetNode);
    bench.run_ms(25);
    let emptied = bench.answer(SdoRequest::InitiateUpload { object: USER_DATA });
    assert_eq!(emptied, SdoResponse::InitiateUpload { object: USER_DATA, size: Some(0) });
}

#[test]
fn a_client_that_falls_silent_gets_one_abort_after_a_second() {
    let mut bench = Bench::new();
    bench.answer(SdoRequest::InitiateUpload { object: TEXT });
    bench.run_ms(1000);
    assert_eq!(bench.aborts(), []);
    bench.run_ms(1);
    let expired = SdoResponse::Abort { object: TEXT, code: AbortCode::TIMED_OUT };
    assert_eq!(bench.aborts(), [expired]);
    bench.run_ms(2000);
    assert_eq!(bench.aborts(), [expired]);
}

#[test]
fn an_abort_of_the_client_ends_the_transfer_without_an_answer() {
    let mut bench = Bench::new();
    bench.answer(SdoRequest::InitiateUpload { object: TEXT });
    assert_eq!(bench.ask(SdoRequest::Abort { object: TEXT, code: AbortCode::GENERAL }), None);
    assert_eq!(bench.aborted(SdoRequest::UploadSegment { toggle: false }), AbortCode::UNKNOWN_COMMAND);
}
