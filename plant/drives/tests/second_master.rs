//! An independent second master, the crate `canopen-rs`, meets the emulated drives on a simulated wire. Every message
//! of the master is one of that crate, and that crate reads every answer.

use canopen_rs::sdo::{SdoPayload, block};
use canopen_rs::{
    Address, ByteString, DataType, EmergencyMessage, MappingEntry, NmtCommand, NmtState, NodeId, SdoClient,
    SdoEvent, Value, nmt, pdo, sync,
};
use masseter_can::canopen::{ObjectAddress, dcf::Dcf};
use masseter_can::{Bus, CanId, Frame};
use masseter_drives::{DriveFault, DriveSettings, Stand, eds};

const MILLISECOND_NS: u64 = 1_000_000;
const NODE: u8 = 4;
const USER_DATA: Address = Address::new(0x2010, 0);

/// The master with the stand of one drive.
struct Master {
    stand: Stand,
    now_ns: u64,
    node: NodeId,
    /// Frames that nobody has asked for yet.
    heard: Vec<Frame>,
}

impl Master {
    fn new() -> Self {
        let stand = Stand::new(&[settings()]).unwrap();
        Self { stand, now_ns: 0, node: NodeId::new(NODE).unwrap(), heard: Vec::new() }
    }

    fn run_ms(&mut self, ms: u64) {
        self.now_ns += ms * MILLISECOND_NS;
        self.stand.advance(self.now_ns);
        while let Some(received) = self.stand.master().receive(self.now_ns).unwrap() {
            self.heard.push(received.frame);
        }
    }

    fn send(&mut self, cob_id: u16, data: &[u8]) {
        let frame = Frame::new(CanId::standard(cob_id).unwrap(), data).unwrap();
        self.stand.master().send(self.now_ns, frame).unwrap();
    }

    /// The next frame with that identifier.
    fn receive(&mut self, cob_id: u16) -> Vec<u8> {
        for _ in 0..100 {
            let is_asked_for = |frame: &Frame| frame.id() == CanId::standard(cob_id).unwrap();
            if let Some(place) = self.heard.iter().position(is_asked_for) {
                return self.heard.remove(place).data().to_vec();
            }
            self.run_ms(1);
        }
        panic!("no frame {cob_id:03X} within 100 ms");
    }

    fn answer(&mut self) -> SdoPayload {
        self.receive(0x580 + u16::from(NODE)).try_into().unwrap()
    }

    fn ask(&mut self, request: SdoPayload) -> SdoPayload {
        self.send(0x600 + u16::from(NODE), &request);
        self.answer()
    }

    /// A whole transfer; the abort code as the error.
    fn transfer(&mut self, begin: impl FnOnce(&mut SdoClient) -> SdoPayload) -> Result<Option<Value>, u32> {
        let mut client = SdoClient::new(self.node);
        let mut request = begin(&mut client);
        loop {
            match client.on_response(&self.ask(request)) {
                SdoEvent::Send(next) => request = next,
                SdoEvent::Complete(value) => return Ok(value),
                SdoEvent::Aborted(code) => return Err(code),
            }
        }
    }

    fn read(&mut self, index: u16, subindex: u8, kind: DataType) -> Result<Value, u32> {
        self.transfer(|client| client.read(Address::new(index, subindex), kind)).map(Option::unwrap)
    }

    /// An `INTEGER32`.
    fn integer(&mut self, index: u16) -> i32 {
        match self.read(index, 0, DataType::Integer32) {
            Ok(Value::Integer32(number)) => number,
            other => panic!("{index:04X}h: {other:?}"),
        }
    }

    fn write(&mut self, index: u16, subindex: u8, value: Value) -> Result<(), u32> {
        self.transfer(|client| client.write(Address::new(index, subindex), value)).map(|_| ())
    }

    fn has_state(&mut self, mask: u16, state: u16) -> bool {
        let Ok(Value::Unsigned16(word)) = self.read(0x6041, 0, DataType::Unsigned16) else { return false };
        word & mask == state
    }

    fn enable(&mut self) {
        for (word, state) in [(0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)] {
            self.write(0x6040, 0, Value::Unsigned16(word)).unwrap();
            self.run_ms(1);
            assert!(self.has_state(0x6F, state), "controlword {word:02X}h");
        }
    }

    fn command(&mut self, command: NmtCommand) {
        let data = nmt::encode_command(command, self.node);
        self.send(nmt::NMT_COMMAND_COB_ID, &data);
    }

    /// The state in the next heartbeat or boot-up message.
    fn heartbeat(&mut self) -> NmtState {
        let data = self.receive(nmt::heartbeat_cob_id(self.node));
        nmt::decode_heartbeat(&data.try_into().unwrap()).unwrap()
    }

    fn upload_in_blocks(&mut self, address: Address, block_size: u8) -> Vec<u8> {
        let begun = self.ask(block::encode_upload_initiate(address, block_size, true));
        assert!(block::decode_upload_initiate_response(&begun).unwrap().crc_support);
        let mut receiver = block::BlockReceiver::<1029>::new();
        self.send(0x600 + u16::from(NODE), &block::encode_upload_start());
        loop {
            let mut sequence = 0;
            while sequence < block_size && !receiver.is_done() {
                let data = self.answer();
                let segment = block::decode_sub_segment(&data);
                sequence += 1;
                assert_eq!(segment.seqno, sequence);
                receiver.push(&segment).unwrap();
            }
            self.send(0x600 + u16::from(NODE), &block::encode_sub_response(sequence, block_size));
            if receiver.is_done() {
                let (unused, crc) = block::decode_end(&self.answer()).unwrap();
                self.send(0x600 + u16::from(NODE), &block::encode_end_response());
                return receiver.finish(unused, crc, true).unwrap().to_vec();
            }
        }
    }

    fn download_in_blocks(&mut self, address: Address, data: &[u8]) {
        let begun = self.ask(block::encode_download_initiate(address, Some(data.len() as u32), true));
        let accepted = block::decode_download_initiate_response(&begun).unwrap();
        let mut writer = block::BlockWriter::new(data, accepted.blksize);
        while !writer.is_done() {
            let mut sent = 0;
            while let Some(segment) = writer.next_segment() {
                self.send(0x600 + u16::from(NODE), &segment);
                self.run_ms(1);
                sent += 1;
            }
            let (acknowledged, next) = block::decode_sub_response(&self.answer()).unwrap();
            assert_eq!(acknowledged, sent);
            writer.start_sub_block(next);
        }
        block::decode_end_response(&self.ask(writer.end_frame(accepted.crc_support))).unwrap();
    }
}

fn settings() -> DriveSettings {
    DriveSettings::new(masseter_can::canopen::NodeId::new(NODE).unwrap())
}

#[test]
fn it_boots_and_reads_every_entry_of_the_data_sheet_as_its_type() {
    let mut master = Master::new();
    assert_eq!(master.heartbeat(), NmtState::Initialising);
    let sheet = Dcf::parse(&eds(&settings()).unwrap()).unwrap();
    for entry in sheet.entries() {
        let ObjectAddress { index, subindex } = entry.address;
        let kind = DataType::from_index(entry.data_type.0).unwrap();
        match master.read(index, subindex, kind) {
            Ok(value) => assert_eq!(value.data_type(), kind, "{}", entry.address),
            Err(code) => assert_eq!((index, code), (0x1003, 0x0800_0024), "{}: no such error", entry.address),
        }
    }
    let Ok(Value::VisibleString(name)) = master.read(0x1008, 0, DataType::VisibleString) else {
        panic!("no name")
    };
    assert_eq!(name.as_bytes(), b"Masseter emulated drive");
    assert_eq!(master.read(0x5555, 0, DataType::Unsigned8), Err(0x0602_0000));
    assert_eq!(master.write(0x1000, 0, Value::Unsigned32(1)), Err(0x0601_0002));
    assert_eq!(master.write(0x6007, 0, Value::Integer16(9)), Err(0x0609_0031));
}

#[test]
fn it_moves_the_axis_in_profile_position_and_profile_velocity() {
    let mut master = Master::new();
    master.heartbeat();
    let start = master.integer(0x6064);
    master.write(0x6060, 0, Value::Integer8(1)).unwrap();
    master.enable();
    master.write(0x607A, 0, Value::Integer32(start + 5000)).unwrap();
    master.write(0x6040, 0, Value::Unsigned16(0x1F)).unwrap();
    master.run_ms(300);
    assert!(master.has_state(1 << 10, 1 << 10) && (master.integer(0x6064) - start - 5000).abs() < 20);
    master.write(0x6060, 0, Value::Integer8(3)).unwrap();
    master.write(0x60FF, 0, Value::Integer32(-50_000)).unwrap();
    master.run_ms(100);
    let velocity = master.read(0x606C, 0, DataType::Integer32).unwrap();
    assert!(matches!(velocity, Value::Integer32(-51_000..=-49_000)), "{velocity:?}");
}

#[test]
fn it_maps_each_pdo_and_exchanges_them_at_sync() {
    for number in 1..=4 {
        let mut master = Master::new();
        master.heartbeat();
        let place = u16::from(number) - 1;
        let maps = [
            (
                0x1800,
                pdo::PdoKind::Transmit,
                [MappingEntry::new(0x606C, 0, 32), MappingEntry::new(0x6061, 0, 8)],
            ),
            (
                0x1400,
                pdo::PdoKind::Receive,
                [MappingEntry::new(0x60FF, 0, 32), MappingEntry::new(0x6060, 0, 8)],
            ),
        ];
        let [sent, received] = maps.map(|(first, kind, entries)| {
            let communication = first + place;
            let cob_id = pdo::default_cob_id(kind, number, master.node).unwrap();
            let invalid = Value::Unsigned32(1 << 31 | u32::from(cob_id));
            master.write(communication, 1, invalid).unwrap();
            master.write(communication + 0x200, 0, Value::Unsigned8(0)).unwrap();
            for (place, entry) in (1..).zip(entries) {
                master.write(communication + 0x200, place, Value::Unsigned32(entry.to_u32())).unwrap();
            }
            master.write(communication + 0x200, 0, Value::Unsigned8(2)).unwrap();
            master.write(communication, 2, Value::Unsigned8(1)).unwrap();
            master.write(communication, 1, Value::Unsigned32(cob_id.into())).unwrap();
            cob_id
        });
        master.command(NmtCommand::StartRemoteNode);
        while master.heartbeat() != NmtState::Operational {}
        master.enable();
        let [velocity, mode] = [20_000_i32.to_le_bytes().to_vec(), vec![9]];
        for _ in 0..100 {
            master.send(received, &[velocity.clone(), mode.clone()].concat());
            master.send(sync::SYNC_COB_ID, &[]);
            master.run_ms(1);
        }
        master.heard.clear();
        master.send(sync::SYNC_COB_ID, &[]);
        let data = master.receive(sent);
        let actual = i32::from_le_bytes(data[..4].try_into().unwrap());
        assert!((actual - 20_000).abs() < 500 && data[4] == 9, "PDO {number}: {data:02X?}");
    }
}

#[test]
fn it_changes_the_state_of_the_node_that_heartbeats_show() {
    let mut master = Master::new();
    for (command, state) in [
        (NmtCommand::StartRemoteNode, NmtState::Operational),
        (NmtCommand::StopRemoteNode, NmtState::Stopped),
        (NmtCommand::EnterPreOperational, NmtState::PreOperational),
        (NmtCommand::ResetCommunication, NmtState::Initialising),
        (NmtCommand::ResetNode, NmtState::Initialising),
    ] {
        master.run_ms(200);
        master.heard.clear();
        master.command(command);
        master.run_ms(1);
        assert_eq!(master.heartbeat(), state, "{command:?}");
    }
}

/// The drive supervises the master: its heartbeats stay away after the first.
#[test]
fn it_is_missed_by_the_drive_when_its_heartbeats_stay_away() {
    let mut master = Master::new();
    master.heartbeat();
    master.write(0x1016, 1, Value::Unsigned32(0x7F << 16 | 0x32)).unwrap();
    let me = NodeId::new(0x7F).unwrap();
    let alive = nmt::encode_heartbeat(NmtState::Operational);
    for _ in 0..5 {
        master.send(nmt::heartbeat_cob_id(me), &alive);
        master.run_ms(40);
    }
    assert!(master.heard.iter().all(|frame| frame.id().number() != 0x84), "none is missed yet");
    master.run_ms(20);
    let emergency = EmergencyMessage::decode(&master.receive(0x084)).unwrap();
    assert_eq!(emergency.error_code, 0x8130);
}

/// An enabled drive in that mode.
fn enabled(mode: i8) -> Master {
    let mut master = Master::new();
    master.heartbeat();
    master.write(0x6060, 0, Value::Integer8(mode)).unwrap();
    master.enable();
    master
}

#[test]
fn it_homes_the_axis_where_the_axis_is() {
    let mut master = enabled(6);
    master.write(0x6098, 0, Value::Integer8(37)).unwrap();
    master.write(0x6040, 0, Value::Unsigned16(0x1F)).unwrap();
    master.run_ms(10);
    assert!(master.has_state(1 << 12, 1 << 12), "attained");
    assert!(master.integer(0x6064).abs() < 20);
}

#[test]
fn it_leads_the_axis_by_cyclic_positions() {
    let mut master = enabled(8);
    let start = master.integer(0x6064);
    for step in 1..=100 {
        master.write(0x607A, 0, Value::Integer32(start + 10 * step)).unwrap();
        master.send(sync::SYNC_COB_ID, &[]);
        master.run_ms(1);
    }
    master.run_ms(100);
    assert!((master.integer(0x6064) - start - 1000).abs() < 20);
}

/// 10 ‰ of 500 N move 1 kg by 5 m/s².
#[test]
fn it_gives_torques_of_a_profile_and_cyclic_ones() {
    for mode in [4, 10] {
        let mut master = enabled(mode);
        master.write(0x6071, 0, Value::Integer16(10)).unwrap();
        master.send(sync::SYNC_COB_ID, &[]);
        master.run_ms(20);
        let torque = master.read(0x6077, 0, DataType::Integer16).unwrap();
        assert!(matches!(torque, Value::Integer16(9..=11)), "mode {mode}: {torque:?}");
        assert!(master.integer(0x606C) > 10_000);
    }
}

/// How far an axis at 0.1 m/s comes to rest with that option of 605Ah, 605Dh or 605Eh.
fn way_to_rest(option: (u16, i16), stop: fn(&mut Master)) -> (Master, i32) {
    let mut master = enabled(3);
    master.write(option.0, 0, Value::Integer16(option.1)).unwrap();
    master.write(0x60FF, 0, Value::Integer32(100_000)).unwrap();
    master.run_ms(100);
    assert!((master.integer(0x606C) - 100_000).abs() < 2000);
    let before = master.integer(0x6064);
    stop(&mut master);
    master.run_ms(200);
    let speed = master.integer(0x606C);
    assert!(speed.abs() < 2000, "{option:X?}: {speed} increments/s");
    let way = master.integer(0x6064) - before;
    (master, way)
}

#[test]
fn it_stops_the_axis_quickly_or_by_halt_and_finds_a_fault_at_rest_as_the_options_say() {
    let quick = |master: &mut Master| master.write(0x6040, 0, Value::Unsigned16(0x02)).unwrap();
    for (option, mask, state) in [(2, 0x4F, 0x40), (6, 0x6F, 0x07)] {
        let (mut master, _) = way_to_rest((0x605A, option), quick);
        assert!(master.has_state(mask, state), "605Ah = {option}");
    }
    let halt = |master: &mut Master| master.write(0x6040, 0, Value::Unsigned16(0x10F)).unwrap();
    let fail = |master: &mut Master| master.stand.drive(0).set_fault(DriveFault::Fault, Some(1.0));
    let ways = |object, stop| [1, 2].map(|option| way_to_rest((object, option), stop));
    for (object, stopped, mask, state) in
        [(0x605D, ways(0x605D, halt), 0x6F, 0x27), (0x605E, ways(0x605E, fail), 0x4F, 0x08)]
    {
        let [(mut slow, slow_way), (mut quick, quick_way)] = stopped;
        assert!(slow.has_state(mask, state) && quick.has_state(mask, state), "{object:X}h");
        assert!(slow_way > 2 * quick_way, "{object:X}h: {slow_way} and {quick_way} increments");
    }
}

#[test]
fn it_reads_the_emergency_of_process_data_that_are_too_short() {
    let mut master = Master::new();
    master.heartbeat();
    master.command(NmtCommand::StartRemoteNode);
    while master.heartbeat() != NmtState::Operational {}
    master.send(0x200 + u16::from(NODE), &[6]);
    let emergency = EmergencyMessage::decode(&master.receive(0x080 + u16::from(NODE))).unwrap();
    assert_eq!((emergency.error_code, emergency.error_register.0), (0x8210, 0x11));
}

#[test]
fn it_transfers_data_in_segments_both_ways() {
    let mut master = Master::new();
    master.heartbeat();
    let text = Value::VisibleString(ByteString::from_bytes(b"a text in more than one segment").unwrap());
    master.write(USER_DATA.index, USER_DATA.subindex, text).unwrap();
    assert_eq!(master.read(USER_DATA.index, USER_DATA.subindex, DataType::VisibleString), Ok(text));
}

#[test]
fn it_transfers_blocks_both_ways_with_their_crc() {
    let mut master = Master::new();
    master.heartbeat();
    for (length, block_size) in [(1, 127), (7, 1), (100, 5), (889, 127), (1024, 127)] {
        let data: Vec<u8> = (0..length).map(|place| (place * 37 % 251) as u8).collect();
        master.download_in_blocks(USER_DATA, &data);
        assert_eq!(master.upload_in_blocks(USER_DATA, block_size), data);
    }
}
