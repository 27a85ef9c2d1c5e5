//! The log of a line, for tests.

use std::io::{self, Write};
use std::sync::{Arc, Mutex};

use masseter_can::cia402::Controlword;

/// A log that a test can read.
#[derive(Debug, Clone, Default)]
pub(super) struct Log(Arc<Mutex<Vec<u8>>>);

impl Write for Log {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Log {
    /// Everything that was written.
    pub(super) fn text(&self) -> String {
        String::from_utf8(self.0.lock().unwrap().clone()).unwrap()
    }

    /// Every controlword that was sent, with the node.
    pub(super) fn controlwords(&self) -> Vec<(u8, Controlword)> {
        let text = self.text();
        let words = text.lines().filter_map(|line| {
            let (id, data) = line.split_whitespace().last()?.split_once('#')?;
            let node = u16::from_str_radix(id, 16).ok()?.checked_sub(0x600)?;
            let word = data.strip_prefix("2B406000")?;
            let low = u16::from_str_radix(word.get(..4)?, 16).ok()?;
            Some((u8::try_from(node).ok()?, Controlword(low.swap_bytes())))
        });
        words.collect()
    }
}
