//! Simulated time in three processes: plant and controller take turns, and the plant never runs far ahead of the
//! recorder.
//!
//! A turn ends with a signal to the other loop, after all messages of the turn. A process that waits sleeps. The wait
//! for a silent process ends after the [`Patience`], for the plant after twice that. The waiting process reports the
//! silence to the supervisor and goes on alone, in real time, so that its watchdogs end the run.

use std::{mem, time::Duration};

use crate::clock;
use crate::lifecycle::{
    Party, Patience, ProcessContext, ProcessError, Report, Silence, StopRequest, SupervisorLink,
};
use crate::realtime::{Cycle, Waiter, Wake};
use crate::transport::{DomainError, SignalReceiver, SignalSender};

/// Time of the first SYNC, ns.
pub const EPOCH_NS: u64 = clock::SECOND_NS;

// The signals.
const TURN_ENDED: u8 = 0;
const LAST_TURN_ENDED: u8 = 1;
const RECORD: u8 = 2;
const RECORDED: u8 = 3;

/// Longest uninterrupted sleep.
const SLICE: Duration = Duration::from_millis(20);
/// Longest silence of another process after the request to end, ns: the other process has probably ended.
const STOP_PATIENCE_NS: u64 = clock::SECOND_NS;
/// Longest wait for the request to end, after the last turn, ns.
const STOP_REQUEST_NS: u64 = 10 * clock::SECOND_NS;
/// Polling interval of the request to end.
const STOP_POLL: Duration = Duration::from_millis(1);
/// Messages of the plant between two requests to the recorder. The recorder has room for more than two such windows and
/// one cycle's messages.
const WINDOW_MESSAGES: usize = 256;

/// The clock of a loop's cycles.
#[derive(Debug)]
pub enum Clock {
    /// The machine's.
    RealTime(Cycle),
    /// Simulated.
    Lockstep(Box<Lockstep>),
}

impl Clock {
    /// The clock of a loop with its first cycle due at this time, ns.
    pub fn start(lockstep: Option<Lockstep>, first_due_ns: u64, period_ns: u64) -> Self {
        match lockstep {
            None => Self::RealTime(Cycle::new(first_due_ns, period_ns)),
            Some(lockstep) => Self::Lockstep(Box::new(Lockstep { first_due_ns, ..lockstep })),
        }
    }

    /// Now, ns.
    pub fn now_ns(&self) -> u64 {
        match self {
            Self::RealTime(_) => clock::now_ns(),
            Self::Lockstep(lockstep) => lockstep.now_ns(),
        }
    }
}

/// A loop that takes turns with another one, and its simulated clock.
#[derive(Debug)]
pub struct Lockstep {
    signals: SignalReceiver,
    /// The arrived signals that no wait has taken, as bits.
    arrived: u8,
    other: (Party, SignalSender),
    recorder: SignalSender,
    patience: Patience,
    stop: StopRequest,
    supervisor: SupervisorLink,
    waiter: Waiter,
    first_due_ns: u64,
    period_ns: u64,
    cycle: u64,
    now_ns: u64,
    /// The lost process.
    lost: Option<Party>,
    /// Whether the other loop's last turn is over.
    is_last: bool,
    /// The silence of the other loop in the awaited turn.
    silence: SilenceCount,
    unrecorded: usize,
    is_recording: bool,
}

/// The silence of a process.
#[derive(Debug, Clone, Copy, Default)]
struct SilenceCount {
    /// Time of the last look for a signal; none before the first look.
    looked_ns: Option<u64>,
    /// In all, and since the request to end, ns.
    silent_ns: [u64; 2],
}

impl SilenceCount {
    /// Counts a look without a signal. Stretches in which this process itself is stopped hardly count.
    fn look(&mut self, is_stop_requested: bool) {
        let now_ns = clock::now_ns();
        let looked_ns = self.looked_ns.replace(now_ns).unwrap_or(now_ns);
        let counted_ns = (now_ns - looked_ns).min(SLICE.as_nanos() as u64);
        self.silent_ns[0] += counted_ns;
        self.silent_ns[1] += if is_stop_requested { counted_ns } else { 0 };
    }
}

impl Lockstep {
    /// The lockstep of the loop `own` with the loop `other`.
    ///
    /// # Errors
    /// Those of the signals.
    pub fn open(context: &ProcessContext, own: Party, other: Party) -> Result<Option<Self>, DomainError> {
        let Some(patience) = context.lockstep else { return Ok(None) };
        let node = &context.node;
        let period_ns = context.scenario.period_ns();
        Ok(Some(Self {
            signals: SignalReceiver::open(node, own.name(), SLICE)?,
            arrived: 0,
            other: (other, SignalSender::open(node, other.name())?),
            recorder: SignalSender::open(node, Party::Recorder.name())?,
            patience,
            stop: context.stop.clone(),
            supervisor: context.link.clone(),
            waiter: Waiter::new(period_ns),
            first_due_ns: EPOCH_NS,
            period_ns,
            cycle: 0,
            now_ns: 0,
            lost: None,
            is_last: false,
            silence: SilenceCount::default(),
            unrecorded: 0,
            is_recording: false,
        }))
    }

    /// Begins the next cycle, in time.
    pub fn begin_cycle(&mut self) -> Wake {
        if self.lost.is_some() {
            // Only this sleep keeps the loop from running far ahead of the recorder.
            clock::sleep(Duration::from_nanos(self.period_ns));
        }
        self.cycle += 1;
        self.now_ns = self.first_due_ns + (self.cycle - 1) * self.period_ns;
        Wake::on_time(self.cycle, self.now_ns)
    }

    /// Now, ns of simulated time.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Advances simulated time to `now_ns`, and returns it.
    pub fn advance(&mut self, now_ns: u64) -> u64 {
        self.now_ns = now_ns;
        now_ns
    }

    /// Looks at the arrived signals, without a wait.
    pub fn waiter(&mut self) -> &mut Waiter {
        &mut self.waiter
    }

    /// The lost process, if any. No later call waits for this process.
    pub fn lost(&self) -> Option<Party> {
        self.lost
    }

    /// Whether the other loop's last turn is over.
    pub fn is_last(&self) -> bool {
        self.is_last
    }

    /// Ends a turn of this loop.
    ///
    /// # Errors
    /// Those of the signals.
    pub fn end_turn(&mut self, is_last: bool) -> Result<(), DomainError> {
        if self.lost == Some(self.other.0) {
            return Ok(());
        }
        self.other.1.send(if is_last { LAST_TURN_ENDED } else { TURN_ENDED })
    }

    /// Waits for the end of the other loop's turn; false for a lost process.
    ///
    /// # Errors
    /// Those of the signals, and of standard output.
    pub fn await_turn(&mut self) -> Result<bool, ProcessError> {
        let ended = self.wait(&[TURN_ENDED, LAST_TURN_ENDED], self.other.0)?;
        self.is_last |= ended == Some(LAST_TURN_ENDED);
        Ok(ended.is_some())
    }

    /// Whether the other loop ends its turn within this time, or is lost. [`Self::await_turn`] then returns at once.
    /// The silence counts from one call to the next.
    ///
    /// # Errors
    /// As [`Self::await_turn`].
    pub fn is_turn_within(&mut self, timeout: Duration) -> Result<bool, ProcessError> {
        let other = self.other.0;
        let until_ns = clock::now_ns().saturating_add(timeout.as_nanos() as u64);
        while self.arrived & (1 << TURN_ENDED | 1 << LAST_TURN_ENDED) == 0 && self.lost != Some(other) {
            let left = Duration::from_nanos(until_ns.saturating_sub(clock::now_ns()));
            if let Some(signal) = self.signals.receive_within(left.min(SLICE))? {
                self.arrived |= 1 << signal;
                continue;
            }
            self.silence.look(self.stop.is_made());
            self.give_up_silent(other, self.silence)?;
            if left.is_zero() {
                return Ok(self.lost == Some(other));
            }
        }
        Ok(true)
    }

    /// Counts a cycle with this many messages on the fullest topic. Waits for a recorder that lags behind.
    ///
    /// # Errors
    /// As [`Self::await_turn`].
    pub fn await_recorder(&mut self, messages: usize) -> Result<(), ProcessError> {
        self.unrecorded += messages;
        let is_first = !self.is_recording;
        if (self.unrecorded < WINDOW_MESSAGES && !is_first) || self.lost == Some(Party::Recorder) {
            return Ok(());
        }
        if is_first {
            // Before any message: a recorder that connects after the end of a short run receives none of its messages.
            self.recorder.send(RECORD)?;
        }
        self.wait(&[RECORDED], Party::Recorder)?;
        self.unrecorded = 0;
        self.is_recording = true;
        Ok(self.recorder.send(RECORD)?)
    }

    /// Waits for the request to end, after the last turn; false without the request.
    pub fn await_stop(&self) -> bool {
        let mut waited_ns = 0;
        while !self.stop.is_made() && waited_ns < STOP_REQUEST_NS {
            clock::sleep(STOP_POLL);
            waited_ns += STOP_POLL.as_nanos() as u64;
        }
        self.stop.is_made()
    }

    /// Waits for one of the signals from a process; none for a lost process.
    fn wait(&mut self, signals: &[u8], from: Party) -> Result<Option<u8>, ProcessError> {
        // Looks with a time limit may have found no signal before.
        let mut silence =
            if from == self.other.0 { mem::take(&mut self.silence) } else { SilenceCount::default() };
        while self.lost != Some(from) {
            let wanted = signals.iter().find(|&&signal| self.arrived >> signal & 1 == 1);
            if let Some(&signal) = wanted {
                self.arrived &= !(1 << signal);
                return Ok(Some(signal));
            }
            silence.looked_ns.get_or_insert_with(clock::now_ns);
            if let Some(signal) = self.signals.receive()? {
                self.arrived |= 1 << signal;
                continue;
            }
            silence.look(self.stop.is_made());
            self.give_up_silent(from, silence)?;
        }
        Ok(None)
    }

    /// Reports a process lost after a silence that is too long.
    fn give_up_silent(&mut self, process: Party, silence: SilenceCount) -> Result<(), ProcessError> {
        let [silent_ns, since_stop_ns] = silence.silent_ns;
        // The plant may wait for the recorder meanwhile.
        let waits = if process == Party::Plant { 2 } else { 1 };
        if !self.patience.lasts(silent_ns / waits) {
            self.lost = Some(process);
            let silence = Silence { process, cycle: self.cycle, silent_s: silent_ns as f64 / 1e9 };
            self.supervisor.report(&Report::Silence(silence))?;
        } else if since_stop_ns / waits >= STOP_PATIENCE_NS {
            self.lost = Some(process);
        }
        Ok(())
    }
}

/// The recorder's end, which gets the plant's requests for an acknowledgement of all messages.
#[derive(Debug)]
pub struct RecorderSignals {
    signals: SignalReceiver,
    plant: SignalSender,
}

impl RecorderSignals {
    /// Opens the signals between plant and recorder. Each wait lasts at most `timeout`.
    ///
    /// # Errors
    /// Those of the signals.
    pub fn open(context: &ProcessContext, timeout: Duration) -> Result<Self, DomainError> {
        let signals = SignalReceiver::open(&context.node, Party::Recorder.name(), timeout)?;
        Ok(Self { signals, plant: SignalSender::open(&context.node, Party::Plant.name())? })
    }

    /// Waits for a request of the plant; returns whether one came.
    ///
    /// # Errors
    /// Those of the signals.
    pub fn wait(&mut self) -> Result<bool, DomainError> {
        Ok(self.signals.receive()? == Some(RECORD))
    }

    /// Answers a request, after the reception of all earlier messages.
    ///
    /// # Errors
    /// Those of the signals.
    pub fn answer(&self) -> Result<(), DomainError> {
        self.plant.send(RECORDED)
    }
}
