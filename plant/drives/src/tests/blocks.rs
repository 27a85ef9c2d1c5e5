//! SDO block transfer: a client in the test, on a link that loses frames.

use masseter_can::canopen::{BlockMessage, BlockSegment, block_crc};

use super::sdo::USER_DATA;
use super::*;

const NUMBER: ObjectAddress = ObjectAddress::new(0x6081, 0);
const TEXT: ObjectAddress = ObjectAddress::new(0x1008, 0);

/// The frames that are lost, of both directions, counted from 0.
#[derive(Debug, Clone, Copy)]
enum Lost {
    None,
    One(usize),
    From(usize),
}

/// A client of a drive.
struct Client {
    bench: Bench,
    lost: Lost,
    /// Frames of the present transfer so far.
    frames: usize,
    /// The frames of the drive that the client has looked at.
    seen: usize,
    block_size: u8,
}

/// The client has given up.
#[derive(Debug, PartialEq, Eq)]
struct GivenUp;

impl Client {
    fn new(lost: Lost, block_size: u8) -> Self {
        Self { bench: Bench::new(), lost, frames: 0, seen: 0, block_size }
    }

    fn passes(&mut self) -> bool {
        let number = self.frames;
        self.frames += 1;
        match self.lost {
            Lost::None => true,
            Lost::One(lost) => number != lost,
            Lost::From(first) => number < first,
        }
    }

    fn send(&mut self, data: [u8; 8]) {
        if self.passes() {
            self.bench.receive(pdo(0x604, &data));
        }
    }

    /// What the drive answers, after time for a whole block.
    fn hear(&mut self) -> Vec<[u8; 8]> {
        // A whole block of 127 segments.
        self.bench.run_ms(140);
        let sent: Vec<Frame> = self.bench.sent[self.seen..].to_vec();
        self.seen = self.bench.sent.len();
        let answers = sent.iter().filter(|frame| frame.id() == Cob::SdoResponse(id(4)).into());
        answers.filter(|_| self.passes()).map(|frame| frame.data().try_into().unwrap()).collect()
    }

    fn ask(&mut self, message: BlockMessage) -> Result<BlockMessage, GivenUp> {
        self.send(message.encode());
        self.expect()
    }

    fn expect(&mut self) -> Result<BlockMessage, GivenUp> {
        let answers = self.hear();
        answers.first().and_then(|data| BlockMessage::decode(data)).ok_or(GivenUp)
    }

    fn upload(&mut self, object: ObjectAddress) -> Result<Vec<u8>, GivenUp> {
        self.frames = 0;
        self.try_upload(object).inspect_err(|GivenUp| self.give_up(object))
    }

    fn try_upload(&mut self, object: ObjectAddress) -> Result<Vec<u8>, GivenUp> {
        let block_size = self.block_size;
        let begin = BlockMessage::Receive { object, has_crc: true, block_size, threshold: 0 };
        let BlockMessage::Send { has_crc: true, size: Some(size), .. } = self.ask(begin)? else {
            return Err(GivenUp);
        };
        self.send(BlockMessage::Start.encode());
        let (mut data, mut is_whole) = (Vec::new(), false);
        while !is_whole {
            let segments: Vec<_> =
                self.hear().iter().map(|data| BlockSegment::decode(data).unwrap()).collect();
            let in_order: Vec<_> =
                (1..).zip(&segments).take_while(|(number, segment)| segment.sequence == *number).collect();
            let (Some(last), false) = (segments.last(), in_order.is_empty()) else { return Err(GivenUp) };
            assert!(last.sequence <= block_size);
            data.extend(in_order.iter().flat_map(|(_, segment)| segment.data));
            is_whole = in_order.iter().any(|(_, segment)| segment.is_last);
            let sequence = in_order.len() as u8;
            self.send(BlockMessage::Acknowledge { sequence, block_size }.encode());
        }
        let BlockMessage::EndSending { unused, crc } = self.expect()? else { return Err(GivenUp) };
        data.truncate(data.len() - usize::from(unused));
        assert_eq!((crc, size), (block_crc(&data), data.len() as u32));
        self.send(BlockMessage::EndReceiving.encode());
        Ok(data)
    }

    fn download(&mut self, object: ObjectAddress, data: &[u8]) -> Result<(), GivenUp> {
        self.frames = 0;
        self.try_download(object, data).inspect_err(|GivenUp| self.give_up(object))
    }

    fn try_download(&mut self, object: ObjectAddress, data: &[u8]) -> Result<(), GivenUp> {
        let begin = BlockMessage::Send { object, has_crc: true, size: Some(data.len() as u32) };
        let BlockMessage::Receive { mut block_size, .. } = self.ask(begin)? else { return Err(GivenUp) };
        let pieces: Vec<_> = data.chunks(BlockSegment::DATA).collect();
        let mut done = 0;
        while done < pieces.len() {
            for (sequence, place) in (1..=block_size).zip(done..pieces.len()) {
                let mut data = [0; BlockSegment::DATA];
                data[..pieces[place].len()].copy_from_slice(pieces[place]);
                let is_last = place + 1 == pieces.len();
                self.send(BlockSegment { sequence, is_last, data }.encode());
            }
            let BlockMessage::Acknowledge { sequence, block_size: next } = self.expect()? else {
                return Err(GivenUp);
            };
            done += usize::from(sequence);
            block_size = next;
        }
        let unused = (pieces.len() * BlockSegment::DATA - data.len()) as u8;
        let end = BlockMessage::EndSending { unused, crc: block_crc(data) };
        if self.ask(end)? == BlockMessage::EndReceiving { Ok(()) } else { Err(GivenUp) }
    }

    fn give_up(&mut self, object: ObjectAddress) {
        self.send(SdoRequest::Abort { object, code: AbortCode::TIMED_OUT }.encode());
    }

    /// The next transfer works.
    fn recovers(&mut self) {
        self.lost = Lost::None;
        self.hear();
        assert_eq!(self.download(USER_DATA, b"afterwards"), Ok(()));
        assert_eq!(self.upload(USER_DATA).as_deref(), Ok(b"afterwards".as_slice()));
    }
}

fn some(length: usize) -> Vec<u8> {
    (0..length).map(|place| (place * 37 % 251) as u8).collect()
}

#[test]
fn data_of_any_length_come_back_as_they_were_written() {
    for length in [1, 7, 8, 100, 889, 890, 1024] {
        let mut client = Client::new(Lost::None, if length < 889 { 5 } else { 127 });
        client.download(USER_DATA, &some(length)).unwrap();
        assert_eq!(client.upload(USER_DATA), Ok(some(length)));
    }
    let mut client = Client::new(Lost::None, 2);
    assert_eq!(client.upload(USER_DATA), Ok(vec![]), "nothing is written yet");
    assert_eq!(client.upload(TEXT).as_deref(), Ok(b"Masseter emulated drive".as_slice()));
    client.download(NUMBER, &[1, 2, 3, 4]).unwrap();
    assert_eq!(client.upload(NUMBER), Ok(vec![1, 2, 3, 4]));
    assert_eq!(client.bench.read((0x6081, 0)), Ok(0x0403_0201));
}

/// Transfers user data; whether the transfer succeeds.
type Transfer = fn(&mut Client) -> bool;

/// The transfers of 100 bytes in both directions, each with the number of its frames.
fn transfers() -> [(Transfer, usize); 2] {
    fn up(client: &mut Client) -> bool {
        client.upload(USER_DATA).is_ok_and(|data| data == some(100))
    }
    fn down(client: &mut Client) -> bool {
        client.download(USER_DATA, &some(100)).is_ok()
    }
    [up, down].map(|transfer: Transfer| {
        let mut client = prepared();
        assert!(transfer(&mut client));
        (transfer, client.frames)
    })
}

fn prepared() -> Client {
    let mut client = Client::new(Lost::None, 5);
    client.download(USER_DATA, &some(100)).unwrap();
    client
}

#[test]
fn a_lost_segment_is_sent_again_and_any_other_lost_frame_ends_a_transfer_that_the_next_one_follows() {
    for (transfer, frames) in transfers() {
        let mut successes = 0;
        for lost in 0..frames {
            let mut client = prepared();
            client.lost = Lost::One(lost);
            successes += usize::from(transfer(&mut client));
            client.recovers();
        }
        assert!(successes >= 10, "{successes} of {frames}: most frames are segments, which are repeated");
    }
}

/// The client is cut off, and its abort does not arrive either.
#[test]
fn a_transfer_cut_at_any_frame_ends_with_an_abort_of_the_drive_and_the_next_one_works() {
    for (transfer, frames) in transfers() {
        for cut in 0..frames {
            let mut client = prepared();
            client.lost = Lost::From(cut);
            // Only the last frame may be lost: the drive's of a download, the client's of an upload.
            assert!(!transfer(&mut client) || cut == frames - 1, "cut at {cut}");
            client.bench.run_ms(1100);
            let aborts = client.bench.aborts();
            let timed_out = SdoResponse::Abort { object: USER_DATA, code: AbortCode::TIMED_OUT };
            assert!(aborts.is_empty() || aborts == [timed_out], "cut at {cut}: {aborts:?}");
            assert!(!aborts.is_empty() || cut == 0 || cut == frames - 1, "cut at {cut}");
            client.recovers();
        }
    }
}

#[test]
fn what_breaks_the_rules_of_a_block_is_aborted_with_the_reason() {
    let receive =
        |block_size| BlockMessage::Receive { object: TEXT, has_crc: true, block_size, threshold: 0 }.encode();
    let send = |object, size: u32| BlockMessage::Send { object, has_crc: true, size: Some(size) }.encode();
    let segment = |sequence, is_last| BlockSegment { sequence, is_last, data: *b"0123456" }.encode();
    let end = |unused, crc| BlockMessage::EndSending { unused, crc }.encode();
    let acknowledge = |sequence, block_size| BlockMessage::Acknowledge { sequence, block_size }.encode();
    let (start, crc) = (BlockMessage::Start.encode(), block_crc(b"01234"));
    let cases: [(&[[u8; 8]], AbortCode); 13] = [
        (&[receive(0)], AbortCode::BLOCK_SIZE),
        (&[receive(128)], AbortCode::BLOCK_SIZE),
        (&[receive(2), start, acknowledge(3, 2)], AbortCode::SEQUENCE),
        (&[receive(2), start, acknowledge(2, 0)], AbortCode::BLOCK_SIZE),
        (&[receive(2), start, BlockMessage::EndReceiving.encode()], AbortCode::UNKNOWN_COMMAND),
        (&[receive(2), acknowledge(0, 2)], AbortCode::UNKNOWN_COMMAND),
        (&[start], AbortCode::UNKNOWN_COMMAND),
        (&[send(TEXT, 7)], AbortCode::READ_ONLY),
        (&[send(USER_DATA, 1025)], AbortCode::TOO_LONG),
        (&[send(NUMBER, 4), segment(1, false), segment(2, true)], AbortCode::TOO_LONG),
        (&[send(USER_DATA, 5), segment(1, true), end(2, crc ^ 1)], AbortCode::CRC),
        (&[send(USER_DATA, 6), segment(1, true), end(2, crc)], AbortCode::LENGTH),
        (&[send(USER_DATA, 5), [0; 8]], AbortCode::UNKNOWN_COMMAND),
    ];
    for (requests, expected) in cases {
        let mut client = Client::new(Lost::None, 127);
        for request in requests {
            assert_eq!(client.bench.aborts(), [], "{requests:02X?}");
            client.send(*request);
            client.hear();
        }
        let aborts = client.bench.aborts();
        assert!(
            matches!(aborts[..], [SdoResponse::Abort { code, .. }] if code == expected),
            "{requests:02X?}: {aborts:?}"
        );
        client.recovers();
    }
}

#[test]
fn an_abort_within_a_block_ends_the_transfer_and_changes_nothing() {
    let mut client = prepared();
    let begin = BlockMessage::Send { object: USER_DATA, has_crc: true, size: Some(14) };
    client.ask(begin).unwrap();
    client.send(BlockSegment { sequence: 1, is_last: false, data: [7; 7] }.encode());
    client.give_up(USER_DATA);
    assert_eq!(client.hear(), Vec::<[u8; 8]>::new());
    assert_eq!(client.upload(USER_DATA), Ok(some(100)));
}
