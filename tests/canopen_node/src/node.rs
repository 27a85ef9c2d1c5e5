//! The node: the order in which its parts act on a frame and on time.

use std::collections::VecDeque;

use masseter_can::canopen::dcf::Dcf;
use masseter_can::{CanId, Frame};

use crate::abort::Abort;
use crate::dictionary::{Address, Dictionary};
use crate::drive::{CONTROLWORD, Drive};
use crate::network::{Network, NetworkState};
use crate::pdo::{LengthError, Rpdo, Tpdo};
use crate::rules;
use crate::sdo::{self, Message, Request, Uploads};
use crate::settings::Settings;
use crate::storage::{Storage, StoreError};

/// The last object of communication.
const COMMUNICATION_END: u16 = 0x1FFF;
/// Emergency codes, and the bit of each kind in 1001h beside bit 0.
const HEARTBEAT: (u16, u8) = (0x8130, 1 << 4);
const PDO_SHORT: (u16, u8) = (0x8210, 1 << 4);
const PDO_LONG: (u16, u8) = (0x8220, 1 << 4);
/// Of the device profile.
const OF_DRIVE: u8 = 1 << 5;
/// Motion of more than that is computed in several steps, ns.
const STEP_NS: u64 = 5_000_000;

/// A servo drive on a bus.
#[derive(Debug)]
pub struct Node {
    settings: Settings,
    dictionary: Dictionary,
    network: Network,
    uploads: Uploads,
    rpdos: Vec<Rpdo>,
    tpdos: Vec<Tpdo>,
    storage: Storage,
    drive: Drive,
    outgoing: VecDeque<Frame>,
    to_store: Option<String>,
    now_ns: u64,
}

impl Node {
    /// A node that gets power at that time, with the text of its store.
    ///
    /// # Errors
    /// [`StoreError`] for a text that is no store.
    pub fn new(dcf: &Dcf, settings: Settings, stored: &str, now_ns: u64) -> Result<Self, StoreError> {
        let mut dictionary = Dictionary::new(dcf, settings.node);
        let storage = Storage::parse(stored)?;
        storage.restore(&mut dictionary, u16::MAX);
        let mut node = Self {
            settings,
            network: Network::start(now_ns, settings.quirks.boot_loader),
            uploads: Uploads::default(),
            rpdos: Rpdo::all(&dictionary),
            tpdos: Tpdo::all(&dictionary),
            dictionary,
            storage,
            drive: Drive::new(settings, now_ns),
            outgoing: VecDeque::new(),
            to_store: None,
            now_ns,
        };
        node.show_constants();
        node.step(now_ns);
        Ok(node)
    }

    /// Takes a frame of another node.
    pub fn receive(&mut self, frame: Frame, now_ns: u64) {
        let id = frame.id().number() as u16;
        let sync_id = match self.dictionary.number((0x1005, 0)) as u16 & 0x7FF {
            0 => 0x80,
            id => id,
        };
        let is_common = matches!(id, 0 | 0x701..=0x77F) || id == sync_id || id == self.own(0x600);
        let is_process_data = || self.rpdos.iter().any(|rpdo| rpdo.has(&self.dictionary, frame));
        // Most frames are for others, and cost nothing.
        if frame.id().is_extended() || !is_common && !is_process_data() {
            return;
        }
        self.step(now_ns);
        let state = self.network.state;
        if state == NetworkState::Booting {
            return;
        }
        let is_heard = state != NetworkState::Stopped;
        match (id, frame.data()) {
            (0, &[command, target]) if target == 0 || target == self.settings.node.get() => {
                self.manage(command);
            }
            (0x701..=0x77F, &[_]) => self.network.hear(id as u8 & 0x7F, self.now_ns),
            _ if is_heard && id == self.own(0x600) => {
                if let Ok(message) = frame.data().try_into() {
                    self.serve(message);
                }
            }
            _ if state != NetworkState::Operational => {}
            _ if id == sync_id => self.synchronise(),
            _ => self.take_process_data(frame),
        }
        self.show();
    }

    /// Moves on to that time.
    pub fn step(&mut self, now_ns: u64) {
        while self.now_ns < now_ns {
            self.now_ns = now_ns.min(self.now_ns + STEP_NS);
            self.show();
        }
        if let Some(state) = self.network.beat(&self.dictionary, self.now_ns) {
            self.send(0x700, &[state]);
        }
        if let Some(text) = self.storage.complete(self.now_ns) {
            self.to_store = Some(text);
        }
        // 1010h reads 1 when it can save.
        for subindex in self.dictionary.subindices(0x1010).collect::<Vec<_>>() {
            self.dictionary.put((0x1010, subindex), i64::from(!self.storage.is_busy()));
        }
        if self.network.misses_a_heartbeat(&self.dictionary, self.now_ns) {
            self.drive.lose_master(&self.dictionary);
            self.report(HEARTBEAT);
            // Error behaviour 1029h: 0, also where there is none, is pre-operational.
            match self.dictionary.number((0x1029, 1)) {
                0 if self.network.state == NetworkState::Operational => {
                    self.network.state = NetworkState::PreOperational;
                }
                2 => self.network.state = NetworkState::Stopped,
                _ => {}
            }
        }
        if self.network.state == NetworkState::Operational {
            let due = self.tpdos.iter_mut().filter_map(|tpdo| tpdo.at_event(&self.dictionary, self.now_ns));
            self.outgoing.extend(due);
        }
    }

    /// The next frame to be sent.
    pub fn outgoing(&mut self) -> Option<Frame> {
        self.outgoing.pop_front()
    }

    /// The new text of the store, if it changed.
    pub fn to_store(&mut self) -> Option<String> {
        self.to_store.take()
    }

    /// A command of network management.
    fn manage(&mut self, command: u8) {
        match command {
            0x01 if self.network.state != NetworkState::Operational => {
                self.tpdos.iter_mut().for_each(Tpdo::restart);
                self.network.state = NetworkState::Operational;
            }
            0x02 => self.network.state = NetworkState::Stopped,
            0x80 => self.network.state = NetworkState::PreOperational,
            0x81 => {
                self.drive.restart();
                self.restart(u16::MAX);
            }
            0x82 => self.restart(COMMUNICATION_END),
            _ => {}
        }
    }

    /// Objects up to that index take their stored values, and the node boots.
    fn restart(&mut self, last: u16) {
        self.dictionary.reset(0, last);
        self.storage.restore(&mut self.dictionary, last);
        self.show_constants();
        self.uploads.end();
        self.rpdos.iter_mut().for_each(Rpdo::clear);
        // The boot loader has no part in a reset of the communication.
        let has_boot_loader = self.settings.quirks.boot_loader && last > COMMUNICATION_END;
        self.network = Network::start(self.now_ns, has_boot_loader);
        self.step(self.now_ns);
    }

    fn serve(&mut self, message: Message) {
        let answer = match sdo::request(message) {
            Err((address, code)) => sdo::refusal(address, code),
            Ok(Request::Abort) => return self.uploads.end(),
            Ok(Request::Segment { toggle }) => self.uploads.next(toggle),
            Ok(Request::Upload(address)) => match self.dictionary.read(address) {
                Ok(value) => self.uploads.begin(address, value),
                Err(code) => sdo::refusal(address, code),
            },
            Ok(Request::Download { address, bytes, length, is_sized }) => {
                match self.write(address, &bytes[..length], is_sized) {
                    Ok(()) => sdo::downloaded(address),
                    Err(code) => sdo::refusal(address, code),
                }
            }
        };
        self.send(0x580, &answer);
    }

    fn write(&mut self, address: Address, bytes: &[u8], is_sized: bool) -> Result<(), Abort> {
        let number = self.dictionary.writable(address, bytes, is_sized)?;
        let is_closed = self.settings.quirks.pdos_closed_in_operational
            && self.network.state == NetworkState::Operational
            && rules::is_of_pdo(address.0);
        if is_closed || self.storage.is_busy() && matches!(address.0, 0x1010 | 0x1011) {
            return Err(Abort::DEVICE_STATE);
        }
        rules::check(&self.dictionary, address, number)?;
        let done_ns = self.now_ns + u64::from(self.settings.quirks.save_ms) * 1_000_000;
        match address {
            (0x1010, _) => self.storage.save(&self.dictionary, done_ns),
            (0x1011, _) => self.storage.clear(done_ns),
            _ => {
                self.dictionary.set(address, bytes);
                self.obey(&[address]);
            }
        }
        self.step(self.now_ns);
        Ok(())
    }

    /// A controlword acts when it is written.
    fn obey(&mut self, written: &[Address]) {
        if written.contains(&CONTROLWORD) && self.drive.command(&self.dictionary) {
            self.report((0, 0));
        }
    }

    fn take_process_data(&mut self, frame: Frame) {
        for place in 0..self.rpdos.len() {
            if self.rpdos[place].take(&self.dictionary, frame) {
                self.apply(place);
            }
        }
    }

    /// SYNC: process data that wait take effect, and synchronous ones go out with values of this moment.
    fn synchronise(&mut self) {
        (0..self.rpdos.len()).for_each(|place| self.apply(place));
        self.show();
        self.drive.sync(&self.dictionary, self.now_ns);
        let due = self.tpdos.iter_mut().filter_map(|tpdo| tpdo.at_sync(&self.dictionary, self.now_ns));
        self.outgoing.extend(due);
    }

    fn apply(&mut self, place: usize) {
        match self.rpdos[place].apply(&mut self.dictionary) {
            Ok(written) => self.obey(&written),
            Err(LengthError::Short) => self.report(PDO_SHORT),
            Err(LengthError::Long) => self.report(PDO_LONG),
        }
    }

    /// The drive moves on, and the dictionary shows it.
    fn show(&mut self) {
        if let Some(code) = self.drive.step(&mut self.dictionary, self.now_ns) {
            self.report((code, OF_DRIVE));
        }
    }

    /// Sends an emergency message, and keeps it in 1001h, 1003h and 603Fh; code 0 clears all but the history.
    fn report(&mut self, (code, kind): (u16, u8)) {
        let register = if code == 0 { 0 } else { self.dictionary.number((0x1001, 0)) as u8 | 1 | kind };
        self.dictionary.put((0x1001, 0), register.into());
        self.dictionary.put((0x603F, 0), code.into());
        if code != 0 {
            let places: Vec<_> = self.dictionary.subindices(0x1003).collect();
            for pair in places.windows(2).rev() {
                self.dictionary.put((0x1003, pair[1]), self.dictionary.number((0x1003, pair[0])));
            }
            self.dictionary.put((0x1003, 1), code.into());
            let count = self.dictionary.number((0x1003, 0)) + 1;
            self.dictionary.put((0x1003, 0), count.min(places.len() as i64));
        }
        let [low, high] = code.to_le_bytes();
        self.send(0x80, &[low, high, register, 0, 0, 0, 0, 0]);
    }

    fn show_constants(&mut self) {
        if let Some(serial) = self.settings.serial {
            self.dictionary.put((0x1018, 4), serial.into());
        }
        // It can restore.
        for subindex in self.dictionary.subindices(0x1011).collect::<Vec<_>>() {
            self.dictionary.put((0x1011, subindex), 1);
        }
    }

    /// An identifier of the predefined connection set.
    fn own(&self, function: u16) -> u16 {
        function + u16::from(self.settings.node.get())
    }

    fn send(&mut self, function: u16, data: &[u8]) {
        let id = CanId::standard(self.own(function)).expect("node ids leave room for every function");
        self.outgoing.push_back(Frame::new(id, data).expect("at most eight bytes"));
    }
}
