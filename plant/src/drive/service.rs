//! The object dictionary as SDO clients see it: reading, writing, and what follows from writing.

use masseter_can::canopen::{AbortCode, Expedited, ObjectAddress};

use super::dictionary::{Access, ENTRIES, Initial, find, names, writable};
use super::errors::{self, DriveError};
use super::heartbeats::Consumer;
use super::node::DriveNode;
use super::rules::{Situation, check};
use super::sdo::{Dictionary, Value};

impl DriveNode {
    /// Answers a request to the drive's SDO server.
    pub(super) fn serve(&mut self, now_ns: u64, data: &[u8]) {
        let mut server = std::mem::take(&mut self.sdo);
        let answer = server.answer(now_ns, data, &mut Service { node: self, now_ns });
        self.sdo = server;
        if let Some(response) = answer {
            self.send(response.frame(self.node));
        }
    }

    /// What changes with an object that was written.
    fn take_up(&mut self, object: ObjectAddress, now_ns: u64) {
        let number = usize::from(object.index & 0xFF);
        match object.index {
            0x1003 => errors::forget(&mut self.objects),
            0x1016 => {
                // Supervision begins anew, and nobody is lost any more.
                self.consumer = Consumer::new(&self.objects);
                self.clear(DriveError::Heartbeat);
            }
            0x1017 => self.producer.configure(&self.objects, now_ns),
            0x1400..0x1800 => {
                self.compile_rpdo(number);
                self.judge_rpdos();
            }
            0x1800..0x1C00 => self.compile_tpdo(number),
            0x6040 => self.control(now_ns),
            0x607A => self.new_targets.position = true,
            0x6071 => self.new_targets.torque = true,
            0x6000.. => self.axis.configure(now_ns, &self.objects),
            _ => {}
        }
    }

    /// Keeps all parameters for the next reset. What commands motion is no parameter.
    fn store(&mut self) {
        for (place, entry) in ENTRIES.iter().enumerate() {
            let is_command =
                matches!(entry.address.index, 0x1003 | 0x1010 | 0x1011 | 0x6040 | 0x6071 | 0x607A);
            if entry.entry.access == Access::ReadWrite && !is_command {
                self.stored.set_word(place, self.objects.word(place));
            }
        }
    }
}

/// A node at an instant.
struct Service<'a> {
    node: &'a mut DriveNode,
    now_ns: u64,
}

impl Dictionary for Service<'_> {
    fn read(&mut self, object: ObjectAddress) -> Result<Value, AbortCode> {
        let place = find(object)?;
        let entry = &ENTRIES[place].entry;
        if let Initial::Text(text) = entry.initial {
            return Ok(Value::Text(text));
        }
        let node = &mut *self.node;
        if object.index == 0x1003 && object.subindex > node.objects.get(names::ERROR_COUNT) {
            return Err(AbortCode::NO_DATA);
        }
        node.axis.show(self.now_ns, &mut node.objects);
        let word = node.objects.word(place).to_le_bytes();
        let data = Expedited::new(&word[..entry.kind.bytes()]).map_err(|_| AbortCode::GENERAL)?;
        Ok(Value::Number(data))
    }

    fn accepts(&self, object: ObjectAddress) -> Result<(), AbortCode> {
        let entry = &ENTRIES[find(object)?].entry;
        if entry.access == Access::ReadWrite { Ok(()) } else { Err(AbortCode::READ_ONLY) }
    }

    fn write(&mut self, object: ObjectAddress, data: &[u8], is_sized: bool) -> Result<(), AbortCode> {
        let place = find(object)?;
        let word = writable(place, data, is_sized)?;
        let node = &mut *self.node;
        let situation = Situation {
            is_operational: node.is_operational(),
            is_enabled: node.axis.is_enabled(),
            homes: node.axis.homing.is_running(),
        };
        check(object, word, &node.objects, situation)?;
        match object.index {
            0x1010 => node.store(),
            0x1011 => node.stored = node.factory.clone(),
            _ => {
                node.objects.set_word(place, word);
                node.take_up(object, self.now_ns);
            }
        }
        Ok(())
    }
}
