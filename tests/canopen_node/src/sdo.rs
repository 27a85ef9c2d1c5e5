//! The messages of the SDO server (CiA 301, 7.2.4): expedited transfers, and uploads in segments.

use crate::abort::Abort;
use crate::dictionary::Address;

/// Eight bytes, as every message has.
pub(crate) type Message = [u8; 8];

/// What a client asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Request {
    Upload(Address),
    Download {
        address: Address,
        bytes: [u8; 4],
        length: usize,
        is_sized: bool,
    },
    Segment {
        toggle: u8,
    },
    /// The client gives up.
    Abort,
}

/// Reads a request.
pub(crate) fn request(message: Message) -> Result<Request, (Address, Abort)> {
    let [command, low, high, subindex, bytes @ ..] = message;
    let address = (u16::from_le_bytes([low, high]), subindex);
    match command >> 5 {
        1 if command & 2 != 0 => {
            let is_sized = command & 1 != 0;
            let length = if is_sized { 4 - usize::from(command >> 2 & 3) } else { 4 };
            Ok(Request::Download { address, bytes, length, is_sized })
        }
        2 => Ok(Request::Upload(address)),
        3 => Ok(Request::Segment { toggle: command & 0x10 }),
        4 => Ok(Request::Abort),
        _ => Err((address, Abort::COMMAND)),
    }
}

/// The refusal of a transfer.
pub(crate) fn refusal(address: Address, Abort(code): Abort) -> Message {
    message(0x80, address, &code.to_le_bytes())
}

/// The confirmation of a download.
pub(crate) fn downloaded(address: Address) -> Message {
    message(0x60, address, &[])
}

/// An upload in segments that is under way.
#[derive(Debug, Default)]
pub(crate) struct Uploads {
    address: Address,
    left: Option<Vec<u8>>,
    toggle: u8,
}

impl Uploads {
    /// The answer to a request for a value.
    pub(crate) fn begin(&mut self, address: Address, value: &[u8]) -> Message {
        self.left = None;
        if matches!(value.len(), 1..=4) {
            return message(0x43 | (4 - value.len() as u8) << 2, address, value);
        }
        *self = Self { address, left: Some(value.to_vec()), toggle: 0 };
        message(0x41, address, &(value.len() as u32).to_le_bytes())
    }

    /// The next segment.
    pub(crate) fn next(&mut self, toggle: u8) -> Message {
        let Some(left) = self.left.take() else { return refusal(self.address, Abort::COMMAND) };
        if toggle != self.toggle {
            return refusal(self.address, Abort::TOGGLE);
        }
        let (segment, rest) = left.split_at(left.len().min(7));
        let mut answer = [0; 8];
        answer[0] = toggle | (7 - segment.len() as u8) << 1 | u8::from(rest.is_empty());
        answer[1..=segment.len()].copy_from_slice(segment);
        if !rest.is_empty() {
            (self.left, self.toggle) = (Some(rest.to_vec()), toggle ^ 0x10);
        }
        answer
    }

    /// Nothing is under way any more.
    pub(crate) fn end(&mut self) {
        self.left = None;
    }
}

fn message(command: u8, (index, subindex): Address, data: &[u8]) -> Message {
    let [low, high] = index.to_le_bytes();
    let mut message = [command, low, high, subindex, 0, 0, 0, 0];
    message[4..4 + data.len()].copy_from_slice(data);
    message
}
