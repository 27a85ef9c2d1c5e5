//! The drive's SDO server: one transfer at a time, expedited or in segments.
//!
//! Keeps the order of a transfer only; what an entry is and may become is the dictionary's.

use masseter_shared::can::canopen::{
    AbortCode, Expedited, ObjectAddress, SdoError, SdoRequest, SdoResponse, Segment,
};

/// Silence of a client in the middle of a transfer that ends it, ns.
const TIMEOUT_NS: u64 = 1_000_000_000;
/// The longest value that can be written.
const WRITABLE_BYTES: usize = 4;

/// A value that was read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Value {
    Number(Expedited),
    Text(&'static str),
}

/// What the server gives access to.
pub(super) trait Dictionary {
    /// The value of an entry.
    fn read(&mut self, object: ObjectAddress) -> Result<Value, AbortCode>;
    /// Whether an entry may be written at all.
    fn accepts(&self, object: ObjectAddress) -> Result<(), AbortCode>;
    /// Writes an entry; where `is_sized` is false, `data` may be longer than the value.
    fn write(&mut self, object: ObjectAddress, data: &[u8], is_sized: bool) -> Result<(), AbortCode>;
}

/// A transfer that has begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Progress {
    Upload { rest: &'static [u8] },
    Download { bytes: [u8; WRITABLE_BYTES], length: usize, announced: Option<u32> },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Transfer {
    object: ObjectAddress,
    /// What the next segment must have.
    toggle: bool,
    heard_ns: u64,
    progress: Progress,
}

/// The server's memory.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SdoServer {
    transfer: Option<Transfer>,
}

impl SdoServer {
    /// Takes a request that arrived at `now_ns`; the answer, if it gets one.
    pub(super) fn answer(
        &mut self,
        now_ns: u64,
        data: &[u8],
        dictionary: &mut impl Dictionary,
    ) -> Option<SdoResponse> {
        let request = match SdoRequest::decode(data) {
            Ok(request) => request,
            Err(SdoError::UnknownCommand { object, .. }) => {
                self.transfer = None;
                return Some(SdoResponse::Abort { object, code: AbortCode::UNKNOWN_COMMAND });
            }
            Err(SdoError::Length(_)) => return None,
        };
        let object = self.object_of(request);
        let answer = match request {
            SdoRequest::Abort { .. } => {
                self.transfer = None;
                return None;
            }
            SdoRequest::InitiateUpload { object } => self.begin_upload(now_ns, object, dictionary),
            SdoRequest::UploadSegment { toggle } => self.upload(now_ns, toggle),
            SdoRequest::Download { object, data } => {
                self.transfer = None;
                let written = dictionary.write(object, data.data(), data.is_sized());
                written.map(|()| SdoResponse::Download { object })
            }
            SdoRequest::InitiateDownload { object, size } => {
                self.begin_download(now_ns, object, size, dictionary)
            }
            SdoRequest::DownloadSegment { toggle, data, is_last } => {
                self.download(now_ns, toggle, data, is_last, dictionary)
            }
        };
        Some(answer.unwrap_or_else(|code| {
            self.transfer = None;
            SdoResponse::Abort { object, code }
        }))
    }

    /// Gives up a transfer whose client fell silent; what to tell it.
    pub(super) fn expire(&mut self, now_ns: u64) -> Option<SdoResponse> {
        let is_late = |transfer: &mut Transfer| now_ns.saturating_sub(transfer.heard_ns) > TIMEOUT_NS;
        let transfer = self.transfer.take_if(is_late)?;
        Some(SdoResponse::Abort { object: transfer.object, code: AbortCode::TIMED_OUT })
    }

    /// The object a request is about: its own, or that of the transfer.
    fn object_of(&self, request: SdoRequest) -> ObjectAddress {
        match request {
            SdoRequest::Download { object, .. }
            | SdoRequest::InitiateDownload { object, .. }
            | SdoRequest::InitiateUpload { object }
            | SdoRequest::Abort { object, .. } => object,
            SdoRequest::DownloadSegment { .. } | SdoRequest::UploadSegment { .. } => {
                self.transfer.map_or(ObjectAddress::new(0, 0), |transfer| transfer.object)
            }
        }
    }

    fn begin(&mut self, now_ns: u64, object: ObjectAddress, progress: Progress) {
        self.transfer = Some(Transfer { object, toggle: false, heard_ns: now_ns, progress });
    }

    /// The transfer that a segment continues, its toggle bit turned.
    fn continued(&mut self, now_ns: u64, toggle: bool) -> Result<&mut Transfer, AbortCode> {
        let transfer = self.transfer.as_mut().ok_or(AbortCode::UNKNOWN_COMMAND)?;
        if transfer.toggle != toggle {
            return Err(AbortCode::TOGGLE);
        }
        (transfer.toggle, transfer.heard_ns) = (!toggle, now_ns);
        Ok(transfer)
    }

    fn begin_upload(
        &mut self,
        now_ns: u64,
        object: ObjectAddress,
        dictionary: &mut impl Dictionary,
    ) -> Result<SdoResponse, AbortCode> {
        self.transfer = None;
        match dictionary.read(object)? {
            Value::Number(data) => Ok(SdoResponse::Upload { object, data }),
            Value::Text(text) => {
                self.begin(now_ns, object, Progress::Upload { rest: text.as_bytes() });
                Ok(SdoResponse::InitiateUpload { object, size: Some(text.len() as u32) })
            }
        }
    }

    fn upload(&mut self, now_ns: u64, toggle: bool) -> Result<SdoResponse, AbortCode> {
        let transfer = self.continued(now_ns, toggle)?;
        let Progress::Upload { rest } = &mut transfer.progress else {
            return Err(AbortCode::UNKNOWN_COMMAND);
        };
        let (now, later) = rest.split_at(rest.len().min(Segment::MAX));
        *rest = later;
        let is_last = later.is_empty();
        if is_last {
            self.transfer = None;
        }
        let data = Segment::new(now).expect("no more than a segment holds");
        Ok(SdoResponse::UploadSegment { toggle, data, is_last })
    }

    fn begin_download(
        &mut self,
        now_ns: u64,
        object: ObjectAddress,
        size: Option<u32>,
        dictionary: &impl Dictionary,
    ) -> Result<SdoResponse, AbortCode> {
        dictionary.accepts(object)?;
        if size.is_some_and(|size| size > WRITABLE_BYTES as u32) {
            return Err(AbortCode::TOO_LONG);
        }
        let progress = Progress::Download { bytes: [0; WRITABLE_BYTES], length: 0, announced: size };
        self.begin(now_ns, object, progress);
        Ok(SdoResponse::Download { object })
    }

    fn download(
        &mut self,
        now_ns: u64,
        toggle: bool,
        data: Segment,
        is_last: bool,
        dictionary: &mut impl Dictionary,
    ) -> Result<SdoResponse, AbortCode> {
        let transfer = self.continued(now_ns, toggle)?;
        let Progress::Download { bytes, length, announced } = &mut transfer.progress else {
            return Err(AbortCode::UNKNOWN_COMMAND);
        };
        let end = *length + data.data().len();
        bytes.get_mut(*length..end).ok_or(AbortCode::TOO_LONG)?.copy_from_slice(data.data());
        *length = end;
        if is_last {
            if announced.is_some_and(|size| size as usize != end) {
                return Err(AbortCode::LENGTH);
            }
            let (object, bytes) = (transfer.object, *bytes);
            self.transfer = None;
            dictionary.write(object, &bytes[..end], true)?;
        }
        Ok(SdoResponse::DownloadSegment { toggle })
    }
}

#[cfg(test)]
mod tests {
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
    fn a_client_that_falls_silent_is_told_after_a_second() {
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
}
