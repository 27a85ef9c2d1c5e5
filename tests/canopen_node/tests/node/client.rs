//! What the tests need of a master: SDO, process data and time, spoken to a node without a wire.

use canopen_node::{Dcf, Frame, Node, NodeId, Settings};
use masseter_can::CanId;

pub(crate) const EPOS4: &str = include_str!("../../epos4-like.dcf");
pub(crate) const N5: &str = include_str!("../../n5-like.dcf");
pub(crate) const MILLISECOND_NS: u64 = 1_000_000;

/// A node with the id 5, and all that it sent.
pub(crate) struct Client {
    pub(crate) node: Node,
    pub(crate) heard: Vec<String>,
    pub(crate) now_ns: u64,
}

pub(crate) fn settings() -> Settings {
    Settings { serial: Some(77), ..Settings::new(NodeId::new(5).unwrap()) }
}

fn frame(id: u16, data: &[u8]) -> Frame {
    Frame::new(CanId::standard(id).unwrap(), data).unwrap()
}

impl Client {
    pub(crate) fn new(dcf: &str, settings: Settings) -> Self {
        let node = Node::new(&Dcf::parse(dcf).unwrap(), settings, "", 0).unwrap();
        let mut client = Self { node, heard: Vec::new(), now_ns: 0 };
        client.collect();
        client
    }

    pub(crate) fn send(&mut self, id: u16, data: &[u8]) {
        self.node.receive(frame(id, data), self.now_ns);
        self.collect();
    }

    pub(crate) fn wait_ms(&mut self, ms: u64) {
        for _ in 0..ms {
            self.now_ns += MILLISECOND_NS;
            self.node.step(self.now_ns);
            self.collect();
        }
    }

    fn collect(&mut self) {
        while let Some(frame) = self.node.outgoing() {
            self.heard.push(frame.to_string());
        }
    }

    /// Frames of that identifier, which are forgotten then.
    pub(crate) fn take(&mut self, id: &str) -> Vec<String> {
        let (taken, kept) = self.heard.drain(..).partition(|frame: &String| frame.starts_with(id));
        self.heard = kept;
        taken
    }

    /// The answer to an SDO request.
    pub(crate) fn ask(&mut self, request: [u8; 8]) -> [u8; 8] {
        self.take("585");
        self.send(0x605, &request);
        let answers = self.take("585");
        assert_eq!(answers.len(), 1, "{request:02X?}: {answers:?}");
        let digits = answers[0].strip_prefix("585#").unwrap();
        std::array::from_fn(|byte| u8::from_str_radix(&digits[2 * byte..2 * byte + 2], 16).unwrap())
    }

    /// A number of at most four bytes, or the abort code.
    pub(crate) fn read(&mut self, index: u16, subindex: u8) -> Result<i64, u32> {
        let [low, high] = index.to_le_bytes();
        let answer = self.ask([0x40, low, high, subindex, 0, 0, 0, 0]);
        let word = u32::from_le_bytes(answer[4..].try_into().unwrap());
        match answer[0] {
            0x43 => Ok((word as i32).into()),
            0x4B => Ok((word as u16 as i16).into()),
            0x4F => Ok((word as u8 as i8).into()),
            0x80 => Err(word),
            other => panic!("{other:02X}h"),
        }
    }

    pub(crate) fn write(&mut self, index: u16, subindex: u8, number: i64, bytes: u8) -> Result<(), u32> {
        let ([low, high], data) = (index.to_le_bytes(), (number as u32).to_le_bytes());
        let command = 0x23 | (4 - bytes) << 2;
        let answer = self.ask([command, low, high, subindex, data[0], data[1], data[2], data[3]]);
        match answer[0] {
            0x60 => Ok(()),
            0x80 => Err(u32::from_le_bytes(answer[4..].try_into().unwrap())),
            other => panic!("{other:02X}h"),
        }
    }

    /// A text in segments.
    pub(crate) fn read_text(&mut self, index: u16) -> String {
        let [low, high] = index.to_le_bytes();
        let answer = self.ask([0x40, low, high, 0, 0, 0, 0, 0]);
        assert_eq!(answer[0], 0x41);
        let (mut text, mut toggle) = (Vec::new(), 0);
        loop {
            let segment = self.ask([0x60 | toggle, 0, 0, 0, 0, 0, 0, 0]);
            assert_eq!(segment[0] & 0x10, toggle);
            text.extend(&segment[1..8 - usize::from(segment[0] >> 1 & 7)]);
            if segment[0] & 1 == 1 {
                assert_eq!(u32::from_le_bytes(answer[4..].try_into().unwrap()) as usize, text.len());
                return String::from_utf8(text).unwrap();
            }
            toggle ^= 0x10;
        }
    }

    /// The controlwords that enable a drive.
    pub(crate) fn enable(&mut self) {
        for (word, status) in [(0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)] {
            self.write(0x6040, 0, word, 2).unwrap();
            assert_eq!(self.read(0x6041, 0).unwrap() & 0x6F, status);
        }
    }

    /// RPDO1 takes 6040h and 607Ah, TPDO1 shows 6041h and 6064h, both with every SYNC.
    pub(crate) fn map(&mut self) {
        let pdos = [(0x1400, 0x205, [0x6040_0010, 0x607A_0020]), (0x1800, 0x185, [0x6041_0010, 0x6064_0020])];
        for (communication, cob_id, mapped) in pdos {
            self.write(communication, 1, 0x8000_0000 | cob_id, 4).unwrap();
            self.write(communication + 0x200, 0, 0, 1).unwrap();
            for (place, object) in (1..).zip(mapped) {
                self.write(communication + 0x200, place, object, 4).unwrap();
            }
            self.write(communication + 0x200, 0, 2, 1).unwrap();
            self.write(communication, 2, 1, 1).unwrap();
            self.write(communication, 1, cob_id, 4).unwrap();
        }
    }
}
