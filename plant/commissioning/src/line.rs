//! A line to all drives: SDO, NMT and the heartbeat, one question at a time.
//!
//! In every step of the commissioning, the line refuses to switch on a second drive.

use std::io::{self, Write};

use masseter_can::canopen::{
    AbortCode, Expedited, Nmt, NmtCommand, NmtTarget, NodeId, ObjectAddress, SdoRequest, sync,
};
use masseter_can::{Frame, cia402::Controlword};
use masseter_model::geometry::AXES;
use masseter_plant::sdo::{SdoClient, SdoReason, number};
use masseter_plant::wanted::{is_write_only, shown_bits};
use masseter_plant::{Address, PlantError};
use masseter_runtime::clock::MILLISECOND_NS;
use masseter_scenario::{MASTER_NODE, ObjectKey, Scenario};
use serde::{Deserialize, Serialize};

use crate::line_error::{LineError, MasterSign, Restarted};
use crate::traffic::{Heard, Strangers, Traffic};

/// Silence of a server before the repetition of a request.
const TIMEOUT_NS: u64 = 500 * MILLISECOND_NS;
/// The same while a drive has power: a motion that nobody watches must be short.
const POWERED_TIMEOUT_NS: u64 = 100 * MILLISECOND_NS;
/// Time that a node has to answer a scan, ns.
const SCAN_NS: u64 = 10 * MILLISECOND_NS;
/// Longest wait for an answer to SYNC, ns.
const SYNC_NS: u64 = 20 * MILLISECOND_NS;
/// Time that a drive has to show a value that it acknowledged, ns, and the pause between two readings.
const SHOWN_WITHIN_NS: u64 = 100 * MILLISECOND_NS;
const READ_AGAIN_NS: u64 = 5 * MILLISECOND_NS;

/// The line.
pub struct Line {
    pub(crate) traffic: Traffic,
    /// The axis whose drive this line has switched on.
    switched_on: Option<usize>,
    /// The ledger of old values; none if nobody needs old values after a kill.
    ledger: Option<Box<dyn Ledger>>,
}

impl Line {
    /// A line on the scenario's interfaces, or on simulated buses for a scenario without interfaces. Every frame on the
    /// buses goes to `log`, in the format of candump. The constructor sends nothing.
    ///
    /// # Errors
    /// [`PlantError`] for interfaces that cannot be opened and for buses that cannot be built.
    pub fn open(scenario: &Scenario, log: Box<dyn Write + Send>) -> Result<Self, PlantError> {
        Ok(Self { traffic: Traffic::open(scenario, log)?, switched_on: None, ledger: None })
    }

    /// Keeps old values of drives in this ledger from now on.
    pub fn keep_old_values_in(&mut self, ledger: Box<dyn Ledger>) {
        self.ledger = Some(ledger);
    }

    /// Keeps the old values of a drive.
    pub(crate) fn keep_old_values(&mut self, axis: usize, values: &[OldValue]) -> Result<(), LineError> {
        let Some(ledger) = &mut self.ledger else { return Ok(()) };
        ledger.keep(axis, values).map_err(|source| LineError::Ledger { axis, source })
    }

    /// The present time, ns: simulated from 0, or the machine's.
    pub fn now_ns(&self) -> u64 {
        self.traffic.wires.now_ns()
    }

    /// The received messages of a drive.
    pub fn heard(&self, axis: usize) -> &Heard {
        &self.traffic.heard[axis]
    }

    /// The signs of other masters and nodes.
    pub fn strangers(&self) -> &Strangers {
        &self.traffic.strangers
    }

    /// Queues a frame for the bus of an axis.
    pub(crate) fn send(&mut self, axis: usize, frame: Frame) -> Result<(), LineError> {
        self.traffic.send(self.traffic.addresses[axis].bus, frame)
    }

    /// Listens for that long.
    ///
    /// # Errors
    /// [`LineError`] except those of transfers.
    pub fn listen(&mut self, for_ns: u64) -> Result<(), LineError> {
        let until_ns = self.now_ns() + for_ns;
        while self.now_ns() < until_ns {
            self.traffic.step()?;
        }
        Ok(())
    }

    /// Listens until a condition holds, and returns whether the condition holds within that time.
    ///
    /// # Errors
    /// [`LineError`] except those of transfers.
    pub fn listen_until(
        &mut self,
        within_ns: u64,
        mut holds: impl FnMut(&Self) -> bool,
    ) -> Result<bool, LineError> {
        let until_ns = self.now_ns() + within_ns;
        while !holds(self) {
            if self.now_ns() >= until_ns {
                return Ok(false);
            }
            self.traffic.step()?;
        }
        Ok(true)
    }

    /// Looks at intervals until a value is right or the time is over. Returns the last value.
    pub(crate) fn look_until<T: Copy, E: From<LineError>>(
        &mut self,
        within_ns: u64,
        every_ns: u64,
        mut look: impl FnMut(&mut Self) -> Result<T, E>,
        is_right: impl Fn(T) -> bool,
    ) -> Result<T, E> {
        let until_ns = self.now_ns() + within_ns;
        loop {
            let seen = look(self)?;
            if is_right(seen) || self.now_ns() >= until_ns {
                return Ok(seen);
            }
            self.listen(every_ns)?;
        }
    }

    /// Reads an object of any length.
    ///
    /// # Errors
    /// [`LineError`].
    pub fn read(&mut self, axis: usize, object: ObjectAddress) -> Result<Vec<u8>, LineError> {
        self.transfer(axis, object, None)
    }

    /// Reads an object of at most four bytes as a number without a sign.
    ///
    /// # Errors
    /// [`LineError`].
    pub fn read_number(&mut self, axis: usize, object: ObjectAddress) -> Result<u32, LineError> {
        let value = self.read(axis, object)?;
        if value.len() > Expedited::MAX {
            return Err(LineError::Sdo { axis, object, reason: SdoReason::Aborted(AbortCode::LENGTH) });
        }
        Ok(number(&value))
    }

    /// Reads such an object; none for a refusal, as by a drive without the object.
    ///
    /// # Errors
    /// [`LineError`].
    pub(crate) fn read_if_there(
        &mut self,
        axis: usize,
        object: ObjectAddress,
    ) -> Result<Option<u32>, LineError> {
        match self.read_number(axis, object) {
            Err(error) if error.abort_code().is_some() => Ok(None),
            read => read.map(Some),
        }
    }

    /// Writes the lowest bytes of a value to an object, and reads the object back. A write counts when the drive shows
    /// the value, which may take a moment. The caller must prove a value that the drive does not show. The controlword
    /// has [its own function](Self::control).
    ///
    /// # Errors
    /// [`LineError`].
    ///
    /// # Panics
    /// For 6040h, and for other than one to four bytes.
    pub fn write(
        &mut self,
        axis: usize,
        object: ObjectAddress,
        value: u32,
        bytes: usize,
    ) -> Result<(), LineError> {
        assert!(object.index != 0x6040, "controlwords go through control");
        self.download(axis, object, value, bytes)?;
        let Some(bits) = shown_bits(object, value, bytes) else { return Ok(()) };
        let is_shown = |found: u32| (found ^ value) & bits == 0;
        let look = |line: &mut Self| match line.read_number(axis, object) {
            Err(error) if error.abort_code().is_some_and(is_write_only) => Ok(Some(value)),
            Err(error) if error.abort_code().is_some() => Ok(None),
            read => read.map(Some),
        };
        let found =
            self.look_until(SHOWN_WITHIN_NS, READ_AGAIN_NS, look, |found| found.is_none_or(is_shown))?;
        let is_kept = found.is_some_and(is_shown);
        if is_kept { Ok(()) } else { Err(LineError::NotKept { axis, object, written: value, found }) }
    }

    /// Sends a controlword by SDO. Refuses a controlword that switches a drive on while another drive is on.
    ///
    /// # Errors
    /// [`LineError`].
    pub fn control(&mut self, axis: usize, word: Controlword) -> Result<(), LineError> {
        let switches_on = word.0 & Controlword::SWITCH_ON.0 == Controlword::SWITCH_ON.0;
        match self.switched_on {
            Some(other) if other != axis && switches_on => return Err(LineError::SecondAxis { axis, other }),
            _ if switches_on => self.switched_on = Some(axis),
            _ => {}
        }
        self.download(axis, ObjectAddress::new(0x6040, 0), word.0.into(), 2)
    }

    /// Notes that the statusword of an axis' drive shows no voltage: another drive may be switched on.
    pub fn note_off(&mut self, axis: usize) {
        self.switched_on = self.switched_on.filter(|&on| on != axis);
    }

    /// Sends a command of network management to the node of an axis.
    ///
    /// # Errors
    /// [`LineError::Send`].
    pub fn command(&mut self, axis: usize, command: NmtCommand) -> Result<(), LineError> {
        let Address { bus, node } = self.traffic.addresses[axis];
        self.traffic.send(bus, Nmt { command, target: NmtTarget::Node(node) }.frame())
    }

    /// Asks every node id for its device type. Nodes that are none of the scenario's show as [strangers](Self::strangers).
    ///
    /// # Errors
    /// [`LineError`] except those of transfers.
    pub fn scan(&mut self) -> Result<(), LineError> {
        let request = SdoRequest::InitiateUpload { object: ObjectAddress::new(0x1000, 0) };
        for id in 1..=MASTER_NODE.get() {
            let node = NodeId::new(id).expect("the id is in range");
            for bus in 0..self.traffic.names.len() {
                self.traffic.send(bus, request.frame(node))?;
            }
            self.listen(SCAN_NS)?;
        }
        Ok(())
    }

    /// Sends SYNC to the bus of an axis. Returns the time from its end to the start of the drive's process data, ns;
    /// none without process data.
    pub(crate) fn sync_answer_ns(&mut self, axis: usize) -> Result<Option<u64>, LineError> {
        (self.traffic.sync_ns, self.traffic.heard[axis].process_data_ns) = (None, None);
        self.send(axis, sync::frame())?;
        self.listen_until(SYNC_NS, |line| line.heard(axis).process_data_ns.is_some())?;
        let times_ns = self.heard(axis).process_data_ns.zip(self.traffic.sync_ns);
        Ok(times_ns.map(|(begin_ns, sync_ns)| begin_ns.saturating_sub(sync_ns)))
    }

    /// Flushes the log to its file.
    ///
    /// # Errors
    /// [`LineError::Log`].
    pub fn flush(&mut self) -> Result<(), LineError> {
        Ok(self.traffic.log.flush()?)
    }

    fn download(
        &mut self,
        axis: usize,
        object: ObjectAddress,
        value: u32,
        bytes: usize,
    ) -> Result<(), LineError> {
        let data = Expedited::new(&value.to_le_bytes()[..bytes]).expect("one to four bytes");
        self.transfer(axis, object, Some(data)).map(drop)
    }

    /// Reads an object, or writes a value to it; returns that value.
    fn transfer(
        &mut self,
        axis: usize,
        object: ObjectAddress,
        written: Option<Expedited>,
    ) -> Result<Vec<u8>, LineError> {
        let Address { bus, node } = self.traffic.addresses[axis];
        let timeout_ns = if self.switched_on.is_some() { POWERED_TIMEOUT_NS } else { TIMEOUT_NS };
        let (mut client, mut long) = (SdoClient::default(), Vec::new());
        client.begin(object, written);
        self.traffic.heard[axis].answers.clear();
        let failure = 'transfer: loop {
            if let Some(request) = client.poll(self.now_ns()) {
                self.traffic.send(bus, request.frame(node))?;
            }
            self.traffic.step()?;
            for answer in std::mem::take(&mut self.traffic.heard[axis].answers) {
                match client.take_answer(answer, Some(&mut long)) {
                    Some(Ok(short)) => return Ok(short.map_or(long, |short| short.data().to_vec())),
                    Some(Err(failure)) => break 'transfer failure,
                    None => {}
                }
            }
            if let Err(failure) = client.expire(self.now_ns(), timeout_ns) {
                break failure;
            }
        };
        if let Some(abort) = client.poll(self.now_ns()) {
            self.traffic.send(bus, abort.frame(node))?;
        }
        Err(LineError::Sdo { axis, object, reason: failure.reason })
    }
}

/// A changed object with its old value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct OldValue {
    /// The object.
    pub object: ObjectKey,
    /// Its value before the change.
    pub value: u32,
    /// Bytes of the value.
    pub bytes: usize,
}

/// The place of old values.
pub trait Ledger: Send {
    /// Replaces the kept values of the drive of an axis by these values, the oldest change first. Without values,
    /// removes the kept values.
    ///
    /// # Errors
    /// When the write of the values fails.
    fn keep(&mut self, axis: usize, values: &[OldValue]) -> io::Result<()>;
}

/// The boot-up messages received until a moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BootUps([u32; AXES]);

impl BootUps {
    /// Those until now.
    pub fn until_now(line: &Line) -> Self {
        Self(std::array::from_fn(|axis| line.heard(axis).boot_ups))
    }

    /// Refuses a drive that has restarted since then.
    ///
    /// # Errors
    /// The drive of this axis.
    pub fn check_axis(&self, line: &Line, axis: usize) -> Result<(), Restarted> {
        let by_master = line.strangers().masters.iter().any(|master| master.sign == MasterSign::Nmt);
        let is_same = line.heard(axis).boot_ups == self.0[axis];
        if is_same { Ok(()) } else { Err(Restarted { axis, by_master }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::Log;

    fn line() -> (Line, Log) {
        let log = Log::default();
        (Line::open(&Scenario::default(), Box::new(log.clone())).unwrap(), log)
    }

    #[test]
    fn objects_of_every_length_are_read_and_written() {
        let (mut line, _) = line();
        line.listen(100 * MILLISECOND_NS).unwrap();
        let name = line.read(3, ObjectAddress::new(0x1008, 0)).unwrap();
        assert_eq!(String::from_utf8(name).unwrap(), "Masseter emulated drive");
        let window = ObjectAddress::new(0x6065, 0);
        line.write(3, window, 123, 4).unwrap();
        assert_eq!(line.read_number(3, window).unwrap(), 123);
        let missing = line.read(3, ObjectAddress::new(0x2000, 0)).unwrap_err();
        assert_eq!(missing.abort_code(), Some(AbortCode::NO_OBJECT));
        assert_eq!(missing.to_string(), "l1: object 2000h:00h: 06020000h (object does not exist)");
        assert_eq!((line.heard(3).boot_ups, *line.strangers() == Strangers::default()), (1, true));
    }

    #[test]
    fn a_second_drive_is_not_switched_on() {
        let (mut line, log) = line();
        line.listen(100 * MILLISECOND_NS).unwrap();
        for word in [Controlword::SHUTDOWN, Controlword::SWITCH_ON] {
            line.control(3, word).unwrap();
        }
        line.control(4, Controlword::SHUTDOWN).unwrap();
        let refusal = line.control(4, Controlword::ENABLE_OPERATION).unwrap_err().to_string();
        assert_eq!(refusal, "l2: not switched on, because l1 still is; end that step first");
        line.control(3, Controlword::DISABLE_VOLTAGE).unwrap();
        line.note_off(3);
        line.control(4, Controlword::SWITCH_ON).unwrap();
        let log = log.text();
        assert_eq!(log.matches(" can1 605#2B40600007").count(), 1, "{log}");
    }
}
