//! A candump log of what a port sends and receives.

use std::fmt::Write;

use crate::can::bus::{Bus, BusStatus, ReceiveError, Received, SendError};
use crate::can::candump;
use crate::can::frame::Frame;

/// A log in candump's form. A frame sent has the time it was handed to the port, one received that of its
/// arrival; so lines are in the order of use, which need not be that of the wire.
///
/// Whether writing allocates or blocks is up to `W`; on the real-time path it may do neither.
#[derive(Debug)]
pub struct CandumpTap<W> {
    interface: String,
    out: W,
    is_complete: bool,
}

impl<W: Write> CandumpTap<W> {
    /// Into `out`, with that name of the interface.
    pub fn new(interface: &str, out: W) -> Self {
        Self { interface: interface.to_owned(), out, is_complete: true }
    }

    /// Logs what goes through that port.
    pub fn over<B: Bus>(&mut self, bus: B) -> Logged<'_, B, W> {
        Logged { tap: self, bus }
    }

    /// Where the log goes.
    pub fn out(&self) -> &W {
        &self.out
    }

    /// Whether every line could be written.
    pub fn is_complete(&self) -> bool {
        self.is_complete
    }

    fn log(&mut self, time_ns: u64, frame: &Frame) {
        let written = candump::write(&mut self.out, time_ns, &self.interface, frame);
        self.is_complete &= written.and_then(|()| self.out.write_char('\n')).is_ok();
    }
}

/// A port whose frames are logged.
#[derive(Debug)]
pub struct Logged<'a, B, W> {
    tap: &'a mut CandumpTap<W>,
    bus: B,
}

impl<B: Bus, W: Write> Bus for Logged<'_, B, W> {
    fn send(&mut self, now_ns: u64, frame: Frame) -> Result<(), SendError> {
        self.bus.send(now_ns, frame)?;
        self.tap.log(now_ns, &frame);
        Ok(())
    }

    fn receive(&mut self, now_ns: u64) -> Result<Option<Received>, ReceiveError> {
        let received = self.bus.receive(now_ns)?;
        if let Some(Received { frame, time_ns }) = &received {
            self.tap.log(*time_ns, frame);
        }
        Ok(received)
    }

    fn status(&self) -> BusStatus {
        self.bus.status()
    }
}
