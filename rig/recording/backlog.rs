//! Records without waiting for the disk: messages queue in memory of a fixed size, and a thread of its own
//! compresses and writes them.
//!
//! When the disk is too slow for the memory to suffice, messages are lost and counted; when it fails, the
//! recording ends there and everything after it is lost and counted. It never blocks the caller.

use std::io::{Seek, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, TrySendError, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use masseter_shared::clock::{self, SECOND_NS};
use masseter_shared::messages::Message;

use super::topic::Topic;
use super::writer::{Recorder, WriteError};

/// Memory of one batch, bytes: 0.7 s of every topic at 10 kHz. There are two.
const BATCH_BYTES: usize = 16 << 20;
/// How often everything goes to the disk for good: what a power cut may take.
const FLUSH_EVERY_NS: u64 = SECOND_NS / 2;

/// Messages on their way to the disk: topic, log time and body of each, one behind the other.
#[derive(Debug, Default)]
struct Batch {
    bytes: Vec<u8>,
    messages: u64,
}

impl Batch {
    fn push(&mut self, topic: Topic, log_time_ns: u64, body: &[u8]) {
        self.bytes.push(topic as u8);
        self.bytes.extend_from_slice(&log_time_ns.to_le_bytes());
        self.bytes.extend_from_slice(body);
        self.messages += 1;
    }

    fn has_room_for(&self, body: &[u8]) -> bool {
        self.bytes.len() + 1 + size_of::<u64>() + body.len() <= BATCH_BYTES
    }

    fn clear(&mut self) {
        self.bytes.clear();
        self.messages = 0;
    }

    fn write_to<W: Write + Seek>(&self, recorder: &mut Recorder<W>) -> Result<(), WriteError> {
        let mut rest = self.bytes.as_slice();
        while let Some((&topic, behind)) = rest.split_first() {
            let topic = Topic::ALL[usize::from(topic)];
            let (time, behind) = behind.split_at(size_of::<u64>());
            let (body, behind) = behind.split_at(topic.body_bytes());
            let log_time_ns = u64::from_le_bytes(time.try_into().expect("eight bytes"));
            recorder.record_body(topic, body, log_time_ns)?;
            rest = behind;
        }
        Ok(())
    }
}

/// How a recording ended.
#[derive(Debug)]
pub struct Outcome {
    /// Messages that were offered and are not safe on the disk.
    pub lost: u64,
    /// Why writing ended early, if it did.
    pub error: Option<WriteError>,
}

/// The offering end.
pub struct Backlog {
    pending: Batch,
    to_disk: SyncSender<Batch>,
    emptied: Receiver<Batch>,
    disk: JoinHandle<(u64, Option<WriteError>)>,
    offered: u64,
    dropped: u64,
}

impl Backlog {
    /// Starts the thread that writes.
    pub fn start<W: Write + Seek + Send + 'static>(recorder: Recorder<W>) -> Self {
        // One batch is filled while the other is written: no more can be under way.
        let (to_disk, batches) = sync_channel(1);
        let (give_back, emptied) = sync_channel(2);
        give_back.try_send(Batch::default()).expect("the channel is new");
        let disk = thread::spawn(move || write_batches(recorder, &batches, &give_back));
        Self { pending: Batch::default(), to_disk, emptied, disk, offered: 0, dropped: 0 }
    }

    /// Takes a message that was received at `log_time_ns`, if there is room for it. Never waits.
    pub fn record<M: Message>(&mut self, message: &M, log_time_ns: u64) {
        let body = bytemuck::bytes_of(message);
        self.offered += 1;
        if !self.pending.has_room_for(body) {
            self.hand_over();
        }
        if self.pending.has_room_for(body) {
            self.pending.push(Topic::of::<M>(), log_time_ns, body);
        } else {
            self.dropped += 1;
        }
    }

    /// Gives what is pending to the disk, if the disk is through with what it had. Never waits.
    pub fn hand_over(&mut self) {
        if self.pending.messages == 0 {
            return;
        }
        match self.emptied.try_recv() {
            Ok(empty) => self.send(empty),
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => self.give_up(),
        }
    }

    fn send(&mut self, empty: Batch) {
        let full = std::mem::replace(&mut self.pending, empty);
        if let Err(TrySendError::Full(batch) | TrySendError::Disconnected(batch)) =
            self.to_disk.try_send(full)
        {
            self.dropped += batch.messages;
        }
    }

    /// Nobody writes any more.
    fn give_up(&mut self) {
        self.dropped += self.pending.messages;
        self.pending.clear();
    }

    /// Messages lost so far for want of room or disk.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Waits until everything is written and the recording has its index.
    pub fn finish(mut self) -> Outcome {
        if self.pending.messages > 0 {
            match self.emptied.recv() {
                Ok(empty) => self.send(empty),
                Err(_) => self.give_up(),
            }
        }
        drop(self.to_disk);
        let (safe, error) = self.disk.join().expect("the writing thread does not panic");
        Outcome { lost: self.offered - safe, error }
    }
}

/// The disk's thread: writes, flushes every now and then, and ends the file when no more can come. Returns
/// how many messages are safe.
fn write_batches<W: Write + Seek>(
    mut recorder: Recorder<W>,
    batches: &Receiver<Batch>,
    give_back: &SyncSender<Batch>,
) -> (u64, Option<WriteError>) {
    let mut safe = 0;
    match write_until_the_end(&mut recorder, batches, give_back, &mut safe) {
        Ok(written) => match recorder.finish() {
            Ok(()) => (written, None),
            Err(error) => (safe, Some(error)),
        },
        Err(error) => {
            eprintln!("masseter: {error}; the rig goes on, what follows is not recorded");
            (safe, Some(error))
        }
    }
}

fn write_until_the_end<W: Write + Seek>(
    recorder: &mut Recorder<W>,
    batches: &Receiver<Batch>,
    give_back: &SyncSender<Batch>,
    safe: &mut u64,
) -> Result<u64, WriteError> {
    let mut written = 0;
    let mut flush_ns = clock::now_ns() + FLUSH_EVERY_NS;
    loop {
        let wait = Duration::from_nanos(flush_ns.saturating_sub(clock::now_ns()));
        match batches.recv_timeout(wait) {
            Ok(mut batch) => {
                batch.write_to(recorder)?;
                written += batch.messages;
                batch.clear();
                // Without a taker the recording is about to end.
                let _ = give_back.try_send(batch);
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Ok(written),
        }
        if clock::now_ns() >= flush_ns {
            if written > *safe {
                recorder.flush()?;
                *safe = written;
            }
            flush_ns = clock::now_ns() + FLUSH_EVERY_NS;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{self, Cursor, SeekFrom};
    use std::sync::mpsc::{Receiver, channel};

    use masseter_shared::config::JawConfig;
    use masseter_shared::geometry::{Mechanism, MechanismConfig};
    use masseter_shared::messages::Reading;

    use super::super::Scene;
    use super::*;

    fn scene() -> Scene {
        Scene::new(&Mechanism::new(&MechanismConfig::default()).unwrap(), &JawConfig::default())
    }

    /// A disk that does not answer before it is told to, and then does as it is told.
    struct Stuck {
        definitions: u64,
        bytes: Cursor<Vec<u8>>,
        go_on: Receiver<()>,
        then: io::ErrorKind,
    }

    /// What a disk that is well again says.
    const WELL: io::ErrorKind = io::ErrorKind::Other;

    impl Write for Stuck {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.bytes.position() >= self.definitions {
                // An error means that the test let go.
                let _ = self.go_on.recv();
                if self.then != WELL {
                    return Err(self.then.into());
                }
            }
            self.bytes.write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Seek for Stuck {
        fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
            self.bytes.seek(to)
        }
    }

    /// Length of a recording that holds nothing but its definitions.
    fn definitions() -> u64 {
        let mut bytes = Cursor::new(Vec::new());
        std::mem::forget(Recorder::on(&mut bytes, scene()).unwrap());
        bytes.position()
    }

    /// Offers readings until `bytes` of them have come to a disk that is stuck meanwhile.
    fn record_on_a_stuck_disk(bytes: usize, then: io::ErrorKind) -> (u64, Outcome) {
        let (let_go, go_on) = channel();
        let disk = Stuck { definitions: definitions(), bytes: Cursor::default(), go_on, then };
        let mut backlog = Backlog::start(Recorder::on(disk, scene()).unwrap());
        let offered = (bytes / size_of::<Reading>()) as u64;
        for seq in 1..=offered {
            backlog.record(&Reading { seq, ..Default::default() }, seq);
        }
        let dropped = backlog.dropped();
        drop(let_go);
        (dropped, backlog.finish())
    }

    #[test]
    fn a_disk_that_hangs_for_a_while_loses_nothing() {
        let (dropped, recorded) = record_on_a_stuck_disk(BATCH_BYTES / 2, WELL);
        assert_eq!((dropped, recorded.lost), (0, 0));
        assert!(recorded.error.is_none());
    }

    #[test]
    fn a_disk_that_hangs_too_long_loses_what_memory_cannot_hold_and_no_more() {
        let (dropped, recorded) = record_on_a_stuck_disk(BATCH_BYTES * 4, WELL);
        assert!(dropped > 0);
        assert_eq!(recorded.lost, dropped);
        assert!(recorded.error.is_none());
    }

    #[test]
    fn a_disk_that_is_gone_loses_everything_behind_the_last_flush() {
        let (_, recorded) = record_on_a_stuck_disk(BATCH_BYTES / 2, io::ErrorKind::StorageFull);
        assert_eq!(recorded.lost, (BATCH_BYTES / 2 / size_of::<Reading>()) as u64);
        assert!(recorded.error.is_some());
    }
}
