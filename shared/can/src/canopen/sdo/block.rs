//! The messages of SDO block transfer (CiA 301, 7.2.4.3.9 to 7.2.4.3.17).
//!
//! The side with the data is the client of a download and the server of an upload. Its messages are the same in both
//! directions, as are those of the other side; the identifier of the frame is the direction. Segments have a code of
//! their own, so that only the state of a transfer distinguishes a [`BlockSegment`] from other messages.

use super::{LENGTH, Message, SIZED, initiate, size_field};
use crate::canopen::ObjectAddress;

/// "CRC supported", in initiate messages.
const CRC: u8 = 1 << 2;
/// Command specifiers of the side with the data and of the other side.
const SENDER: u8 = 6;
const RECEIVER: u8 = 5;
/// Sub-commands, the lowest bits. That of a sender's initiate message is 0, and bit 1 is "size indicated".
const END: u8 = 1;
const ACKNOWLEDGE: u8 = 2;
const START: u8 = 3;

/// A message of block transfer other than a segment.
///
/// # Examples
/// A client asks for the device name (1008h) in blocks of 127 segments:
///
/// ```
/// use masseter_can::canopen::{BlockMessage, ObjectAddress};
///
/// let object = ObjectAddress::new(0x1008, 0);
/// let request = BlockMessage::Receive { object, has_crc: true, block_size: 127, threshold: 0 };
/// assert_eq!(request.encode(), [0xA4, 0x08, 0x10, 0x00, 0x7F, 0x00, 0x00, 0x00]);
/// assert_eq!(BlockMessage::decode(&request.encode()), Some(request));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BlockMessage {
    /// The side with the data will send an object (C0h).
    Send {
        /// The object.
        object: ObjectAddress,
        /// Whether the side computes a CRC.
        has_crc: bool,
        /// Number of bytes that follow, if known.
        size: Option<u32>,
    },
    /// All data were sent (C1h).
    EndSending {
        /// Bytes of the last segment that are no data, 0 to 7.
        unused: u8,
        /// [`block_crc`] of the data; 0 without a CRC.
        crc: u16,
    },
    /// The other side will receive an object (A0h): the request of an upload, the response of a download.
    Receive {
        /// The object.
        object: ObjectAddress,
        /// Whether the side computes a CRC.
        has_crc: bool,
        /// Segments of a block, 1 to 127.
        block_size: u8,
        /// A size up to which the server may upload in segments instead; 0 for never, and in a response.
        threshold: u8,
    },
    /// The server may send the first block of an upload (A3h).
    Start,
    /// A block has ended (A2h).
    Acknowledge {
        /// The last segment that came in order; 0 for none.
        sequence: u8,
        /// Segments of the next block, 1 to 127.
        block_size: u8,
    },
    /// All data were received (A1h).
    EndReceiving,
}

impl BlockMessage {
    /// The data bytes.
    pub fn encode(self) -> [u8; LENGTH] {
        let flag = |has_crc| if has_crc { CRC } else { 0 };
        match self {
            Self::Send { object, has_crc, size } => {
                let (sized, bytes) = size_field(size);
                // "Size indicated" is bit 1 here, and bit 0 in the other transfers.
                initiate(SENDER, object, (sized << 1 | flag(has_crc), bytes))
            }
            Self::EndSending { unused, crc } => {
                let [low, high] = crc.to_le_bytes();
                [SENDER << 5 | (unused & 0b111) << 2 | END, low, high, 0, 0, 0, 0, 0]
            }
            Self::Receive { object, has_crc, block_size, threshold } => {
                initiate(RECEIVER, object, (flag(has_crc), [block_size, threshold, 0, 0]))
            }
            Self::Start => [RECEIVER << 5 | START, 0, 0, 0, 0, 0, 0, 0],
            Self::Acknowledge { sequence, block_size } => {
                [RECEIVER << 5 | ACKNOWLEDGE, sequence, block_size, 0, 0, 0, 0, 0]
            }
            Self::EndReceiving => [RECEIVER << 5 | END, 0, 0, 0, 0, 0, 0, 0],
        }
    }

    /// Reads the data bytes; `None` for another length than 8 and for messages of other transfers. Bits and bytes that
    /// a message does not use are ignored.
    pub fn decode(data: &[u8]) -> Option<Self> {
        let message = Message(data.try_into().ok()?);
        let [command, low, high, _, block_size, threshold, ..] = message.0;
        let (object, has_crc) = (message.object(), message.has(CRC));
        Some(match (message.specifier(), command & 0b11) {
            (SENDER, END) => {
                Self::EndSending { unused: command >> 2 & 0b111, crc: u16::from_le_bytes([low, high]) }
            }
            (SENDER, _) if !message.has(END) => {
                let size = message.has(SIZED << 1).then(|| message.number());
                Self::Send { object, has_crc, size }
            }
            (RECEIVER, START) => Self::Start,
            (RECEIVER, ACKNOWLEDGE) => Self::Acknowledge { sequence: low, block_size: high },
            (RECEIVER, END) => Self::EndReceiving,
            (RECEIVER, _) => Self::Receive { object, has_crc, block_size, threshold },
            _ => return None,
        })
    }
}

/// A segment of a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BlockSegment {
    /// Its place in the block, 1 to 127.
    pub sequence: u8,
    /// Whether the data end with this segment.
    pub is_last: bool,
    /// The data; [`BlockMessage::EndSending`] says how many bytes of the last segment are none.
    pub data: [u8; Self::DATA],
}

impl BlockSegment {
    /// Bytes of a segment.
    pub const DATA: usize = 7;
    /// The most segments of a block.
    pub const MAX: u8 = 127;

    /// The data bytes.
    pub fn encode(self) -> [u8; LENGTH] {
        let mut bytes = [0; LENGTH];
        bytes[0] = self.sequence & Self::MAX | if self.is_last { !Self::MAX } else { 0 };
        bytes[1..].copy_from_slice(&self.data);
        bytes
    }

    /// Reads the data bytes; `None` for another length than 8 and for the number 0, which an abort has.
    pub fn decode(data: &[u8]) -> Option<Self> {
        let (&first, rest) = data.split_first()?;
        let sequence = first & Self::MAX;
        let data = rest.try_into().ok().filter(|_| sequence > 0)?;
        Some(Self { sequence, is_last: first > Self::MAX, data })
    }
}

/// The CRC of block transfer: polynomial x¹⁶ + x¹² + x⁵ + 1, initially 0 (CRC-16/XMODEM).
pub fn block_crc(data: &[u8]) -> u16 {
    data.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte) << 8, |crc, _| crc << 1 ^ if crc >> 15 == 1 { 0x1021 } else { 0 })
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const NAME: ObjectAddress = ObjectAddress::new(0x1008, 0);

    #[test]
    fn messages_are_those_of_the_standard() {
        let table = [
            (BlockMessage::Send { object: NAME, has_crc: true, size: Some(23) }, "C6 08 10 00 17 00 00 00"),
            (BlockMessage::Send { object: NAME, has_crc: false, size: None }, "C0 08 10 00 00 00 00 00"),
            (BlockMessage::EndSending { unused: 5, crc: 0x31C3 }, "D5 C3 31 00 00 00 00 00"),
            (
                BlockMessage::Receive { object: NAME, has_crc: true, block_size: 127, threshold: 9 },
                "A4 08 10 00 7F 09 00 00",
            ),
            (BlockMessage::Start, "A3 00 00 00 00 00 00 00"),
            (BlockMessage::Acknowledge { sequence: 4, block_size: 127 }, "A2 04 7F 00 00 00 00 00"),
            (BlockMessage::EndReceiving, "A1 00 00 00 00 00 00 00"),
        ];
        for (message, bytes) in table {
            let encoded = message.encode();
            assert_eq!(encoded.map(|byte| format!("{byte:02X}")).join(" "), bytes);
            assert_eq!(BlockMessage::decode(&encoded), Some(message));
        }
        let last = BlockSegment { sequence: 4, is_last: true, data: *b"ve\0\0\0\0\0" };
        assert_eq!(last.encode(), [0x84, b'v', b'e', 0, 0, 0, 0, 0]);
    }

    /// The check value of CRC-16/XMODEM, and of the example of CiA 301.
    #[test]
    fn the_crc_is_that_of_the_standard() {
        assert_eq!((block_crc(b"123456789"), block_crc(b"")), (0x31C3, 0));
    }

    proptest! {
        #[test]
        fn whatever_arrives_is_a_message_or_refused(data in prop::collection::vec(any::<u8>(), 0..=9)) {
            if let Some(message) = BlockMessage::decode(&data) {
                prop_assert!(data.len() == LENGTH && matches!(data[0] >> 5, SENDER | RECEIVER));
                prop_assert_eq!(BlockMessage::decode(&message.encode()), Some(message));
            }
            if let Some(segment) = BlockSegment::decode(&data) {
                prop_assert_eq!(segment.encode().to_vec(), data);
            }
        }
    }
}
