//! Records without waiting for the disk: messages queue in memory of a fixed size, and a separate thread compresses and
//! writes them.
//!
//! When the memory is full, the caller's [`Pace`] decides: messages are dropped and counted, or the caller waits. When
//! the disk fails, the recording ends there, and all later messages are lost and counted.

#[cfg(test)]
mod tests;

use std::sync::mpsc::{
    Receiver, RecvTimeoutError, SyncSender, TryRecvError, TrySendError, channel, sync_channel,
};
use std::thread::{self, JoinHandle};
use std::{mem, time::Duration};

use masseter_runtime::clock::{self, SECOND_NS};
use masseter_scenario::wording::counted;

use crate::topic::Recorded;
use crate::writer::{Medium, Recorder, WriteError};

/// Whether the caller may wait for the disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    /// Never: messages without room are dropped, and all others are synced to the disk twice a second.
    RealTime,
    /// The caller waits for room. There are no flushes, whose times would decide where chunks end: the same messages give
    /// the same bytes.
    Virtual,
}

impl Pace {
    /// Most messages of a batch. There are two. In real time, 0.8 s of every topic at 10 kHz; else no more than both
    /// ends need to work at the same time.
    const fn batch_messages(self) -> usize {
        match self {
            Self::RealTime => 150_000,
            Self::Virtual => 4_000,
        }
    }

    /// Time between two syncs to the disk, ns: the most that a power cut can take.
    const fn flush_every_ns(self) -> Option<u64> {
        match self {
            Self::RealTime => Some(SECOND_NS / 2),
            Self::Virtual => None,
        }
    }
}

/// Messages on their way to the disk, each with the time of its reception, ns.
type Batch = Vec<(u64, Recorded)>;

/// How a recording ended.
#[derive(Debug)]
pub struct WriteOutcome {
    /// Messages that were offered and are not safe on the disk.
    pub lost: u64,
    /// Why writing ended early, if it did.
    pub error: Option<WriteError>,
}

impl WriteOutcome {
    /// The messages that the recording lacks, and why, in words; none if it is complete.
    pub fn loss(&self) -> Option<String> {
        let lost = format!("{} did not reach the disk", counted(self.lost, "message"));
        match &self.error {
            None if self.lost == 0 => None,
            None => Some(lost),
            // Only the end of the file failed.
            Some(error) if self.lost == 0 => Some(error.to_string()),
            Some(error) => Some(format!("{error}; {lost}")),
        }
    }
}

/// The caller's end of the queue.
///
/// ```
/// use masseter_recording::{Backlog, Pace, Reader, Recorded, Recorder, Scene};
/// use masseter_scenario::Scenario;
/// use masseter_model::geometry::{Mechanism, MechanismConfig};
/// use masseter_runtime::messages::{Message, State};
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("recording.mcap");
/// let scene = Scene::new(&Mechanism::new(&MechanismConfig::default())?, &Scenario::default().jaw);
/// let mut backlog = Backlog::start(Recorder::create(&path, scene)?, Pace::Virtual);
/// let mut state = State { cycle: 1, ..State::default() };
/// state.stamp(1, 1_000_000);
/// backlog.record(&Recorded::State(state), 1_000_000);
/// assert_eq!(backlog.finish().loss(), None);
/// assert!(Reader::open(&path)?.next_message()?.is_some());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Backlog {
    pace: Pace,
    pending: Batch,
    to_disk: SyncSender<Batch>,
    emptied: Receiver<Batch>,
    /// Its thread; it returns how many messages are safe.
    disk: JoinHandle<u64>,
    /// Why it ended early.
    failures: Receiver<WriteError>,
    error: Option<WriteError>,
    offered: u64,
    dropped: u64,
}

impl Backlog {
    /// Starts the thread that writes.
    pub fn start<W: Medium + Send + 'static>(recorder: Recorder<W>, pace: Pace) -> Self {
        // One batch is filled while the other is written: no more can be under way.
        let (to_disk, batches) = sync_channel(1);
        let (give_back, emptied) = sync_channel(2);
        give_back.try_send(Batch::default()).expect("the channel is new");
        let (failed, failures) = channel();
        let disk = thread::spawn(move || {
            let mut safe = 0;
            if let Err(error) = write_batches(recorder, &batches, &give_back, pace, &mut safe) {
                // The caller may have gone.
                let _ = failed.send(error);
            }
            safe
        });
        let pending = Batch::default();
        Self { pace, pending, to_disk, emptied, disk, failures, error: None, offered: 0, dropped: 0 }
    }

    /// Takes a message that was received at `log_time_ns`; without room it is dropped or waited for, by the pace.
    pub fn record(&mut self, message: &Recorded, log_time_ns: u64) {
        self.offered += 1;
        if self.is_full() {
            match self.pace {
                Pace::RealTime => self.hand_over(),
                Pace::Virtual => self.hand_over_waiting(),
            }
        }
        if self.is_full() {
            self.dropped += 1;
        } else {
            self.pending.push((log_time_ns, *message));
        }
    }

    fn is_full(&self) -> bool {
        self.pending.len() >= self.pace.batch_messages()
    }

    /// Passes the pending batch to the disk, if the disk has written the last one. Never waits.
    pub fn hand_over(&mut self) {
        if !self.pending.is_empty() {
            self.exchange(self.emptied.try_recv());
        }
    }

    /// Passes the pending batch to the disk as soon as the disk has written the last one.
    fn hand_over_waiting(&mut self) {
        self.exchange(self.emptied.recv().map_err(TryRecvError::from));
    }

    /// Sends the pending batch, if there is an empty one in its place; drops it if the disk's thread has ended.
    fn exchange(&mut self, emptied: Result<Batch, TryRecvError>) {
        let unsent = match emptied {
            Ok(empty) => self.to_disk.try_send(mem::replace(&mut self.pending, empty)).err(),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(TrySendError::Disconnected(mem::take(&mut self.pending))),
        };
        if let Some(TrySendError::Full(batch) | TrySendError::Disconnected(batch)) = unsent {
            self.dropped += batch.len() as u64;
        }
    }

    /// Messages lost so far for want of room or disk.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// The error that ended writing: once, after it occurred.
    pub fn new_failure(&mut self) -> Option<&WriteError> {
        let error = self.failures.try_recv().ok()?;
        Some(self.error.insert(error))
    }

    /// Waits until everything is written and the recording has its index.
    pub fn finish(mut self) -> WriteOutcome {
        if !self.pending.is_empty() {
            self.hand_over_waiting();
        }
        drop(self.to_disk);
        let safe = self.disk.join().expect("the writing thread does not panic");
        WriteOutcome {
            lost: self.offered - safe,
            error: self.error.or_else(|| self.failures.try_recv().ok()),
        }
    }
}

/// Writes, flushes at intervals, and ends the file when the caller has finished. Counts the messages that are `safe`.
fn write_batches<W: Medium>(
    mut recorder: Recorder<W>,
    batches: &Receiver<Batch>,
    give_back: &SyncSender<Batch>,
    pace: Pace,
    safe: &mut u64,
) -> Result<(), WriteError> {
    let mut written = 0;
    let next_flush_ns = || pace.flush_every_ns().map_or(u64::MAX, |every_ns| clock::now_ns() + every_ns);
    let mut flush_ns = next_flush_ns();
    loop {
        let wait = Duration::from_nanos(flush_ns.saturating_sub(clock::now_ns()));
        match batches.recv_timeout(wait) {
            Ok(mut batch) => {
                batch.iter().try_for_each(|(log_time_ns, message)| recorder.record(message, *log_time_ns))?;
                written += batch.len() as u64;
                batch.clear();
                // The caller may have finished.
                let _ = give_back.try_send(batch);
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        if clock::now_ns() >= flush_ns {
            if written > *safe {
                recorder.flush()?;
                *safe = written;
            }
            flush_ns = next_flush_ns();
        }
    }
    recorder.finish()?;
    *safe = written;
    Ok(())
}
