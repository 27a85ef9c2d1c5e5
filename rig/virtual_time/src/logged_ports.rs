//! The ports of a controller that runs in one thread, with a given reading and given times.

use std::cell::Cell;
use std::convert::Infallible;

use masseter_runtime::control::ControllerPorts;
use masseter_runtime::messages::{Command, Event, Parameters, Reading, Signals, State};
use masseter_runtime::realtime::Wake;

use crate::log::{Log, Publisher};
use crate::sink::Sink;

/// The controller's side of a cycle.
#[derive(Debug)]
pub struct LoggedPorts<'a, S> {
    log: &'a mut Log<S>,
    times_ns: [u64; 3],
    /// How often the time was asked for.
    asked: Cell<usize>,
    reading: Option<Reading>,
    command: Option<Command>,
}

impl<'a, S> LoggedPorts<'a, S> {
    /// The ports of a cycle with this reading, whose parts end at these times: reception, pose, command.
    pub fn new(log: &'a mut Log<S>, times_ns: [u64; 3], reading: Option<&Reading>) -> Self {
        Self { log, times_ns, asked: Cell::new(0), reading: reading.copied(), command: None }
    }

    /// The command that the controller published.
    pub fn into_command(self) -> Option<Command> {
        self.command
    }

    fn published_ns(&self) -> u64 {
        self.times_ns[2]
    }
}

impl<S: Sink> ControllerPorts for LoggedPorts<'_, S> {
    type Reading = Reading;
    type Error = Infallible;

    fn now_ns(&self) -> u64 {
        let asked = self.asked.replace(self.asked.get() + 1);
        self.times_ns[asked.min(2)]
    }

    fn reading(&mut self, _: &Wake) -> Result<Option<Reading>, Infallible> {
        Ok(self.reading.take())
    }

    fn publish_command(&mut self, fill: impl FnOnce(&mut Command)) -> Result<(), Infallible> {
        self.command = Some(self.log.record(Publisher::Command, self.published_ns(), fill));
        Ok(())
    }

    fn publish_state(&mut self, fill: impl FnOnce(&mut State)) -> Result<(), Infallible> {
        self.log.record(Publisher::State, self.published_ns(), fill);
        Ok(())
    }

    fn publish_signals(&mut self, fill: impl FnOnce(&mut Signals)) -> Result<(), Infallible> {
        self.log.record(Publisher::Signals, self.published_ns(), fill);
        Ok(())
    }

    fn publish_parameters(&mut self, fill: impl FnOnce(&mut Parameters)) -> Result<(), Infallible> {
        self.log.record(Publisher::Parameters, self.published_ns(), fill);
        Ok(())
    }

    fn publish_event(&mut self, event: &Event) -> Result<(), Infallible> {
        self.log.record(Publisher::ControllerEvent, self.published_ns(), |message| *message = *event);
        Ok(())
    }
}
