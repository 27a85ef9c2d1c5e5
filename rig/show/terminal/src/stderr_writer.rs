//! Standard error, written from a thread of its own, and lines about refused peers that stay few.
//!
//! A stopped terminal or a paused reader blocks the writer. The recorder must not wait, since it would lose messages,
//! nor the server of the simulated buses, whose drives go on.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::{sync::Arc, thread, time::Duration};

use crate::{control, escaped};

/// Most texts that wait; more are dropped.
const QUEUE: usize = 1000;
/// The longest wait of [`StderrWriter::finish`].
const PATIENCE: Duration = Duration::from_secs(2);
/// Least time between two lines about refused peers, ns.
const SECOND_NS: u64 = 1_000_000_000;

/// Queues texts for standard error and never waits.
#[derive(Debug)]
pub struct StderrWriter {
    texts: SyncSender<String>,
    unwritten: Arc<AtomicUsize>,
    /// Disconnected once the thread has written everything and ended.
    ended: Receiver<()>,
}

impl StderrWriter {
    /// Starts the thread.
    pub fn start() -> Self {
        Self::with_output(|text| control(&text))
    }

    fn with_output(mut write: impl FnMut(String) + Send + 'static) -> Self {
        let (texts, queued) = sync_channel(QUEUE);
        let (ends, ended) = sync_channel(0);
        let unwritten = Arc::new(AtomicUsize::new(0));
        let remaining = Arc::clone(&unwritten);
        thread::spawn(move || {
            for text in queued {
                write(text);
                remaining.fetch_sub(1, Ordering::Relaxed);
            }
            drop(ends);
        });
        Self { texts, unwritten, ended }
    }

    /// Whether everything is written. Progress is queued only then: it is soon out of date.
    pub fn is_idle(&self) -> bool {
        self.unwritten.load(Ordering::Relaxed) == 0
    }

    /// Queues a text behind all others, its control characters as their codes.
    pub fn write(&self, text: &str) {
        self.control(escaped(text));
    }

    /// Queues a text with control sequences.
    pub fn control(&self, text: String) {
        self.unwritten.fetch_add(1, Ordering::Relaxed);
        if self.texts.try_send(text).is_err() {
            self.unwritten.fetch_sub(1, Ordering::Relaxed);
        }
    }

    /// Waits until everything is written, at most 2 s.
    pub fn finish(self) {
        drop(self.texts);
        // Either the thread has ended, or standard error takes too long.
        let _ = self.ended.recv_timeout(PATIENCE);
    }
}

/// Refused peers of a server: counted, and said at most once a second, however many come.
#[derive(Debug)]
pub struct Refusals {
    one: String,
    several: String,
    count: u64,
    last: String,
    said_ns: Option<u64>,
}

impl Refusals {
    /// None so far. `one` begins the line about one peer; `several` follows the number of more.
    pub fn new(one: String, several: String) -> Self {
        Self { one, several, count: 0, last: String::new(), said_ns: None }
    }

    /// Counts a refusal.
    pub fn count(&mut self, reason: String) {
        self.count += 1;
        self.last = reason;
    }

    /// The line about the refusals since the last one; none without any, and within a second after that.
    pub fn line(&mut self, now_ns: u64) -> Option<String> {
        let is_time = self.said_ns.is_none_or(|said_ns| now_ns >= said_ns.saturating_add(SECOND_NS));
        if self.count == 0 || !is_time {
            return None;
        }
        let Self { one, several, count, last, .. } = &*self;
        let line = match count {
            1 => format!("{one}: {last}"),
            _ => format!("masseter: {count} {several}, the last one: {last}"),
        };
        (self.count, self.said_ns) = (0, Some(now_ns));
        Some(line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_paused_reader_blocks_no_writer_and_gets_every_text_in_order() {
        let (output, reader) = sync_channel(0);
        let writer = StderrWriter::with_output(move |text| output.send(text).unwrap());
        assert!(writer.is_idle());
        writer.write("one");
        writer.write("two");
        assert!(!writer.is_idle());
        let reading = thread::spawn(move || [reader.recv().unwrap(), reader.recv().unwrap()]);
        writer.finish();
        assert_eq!(reading.join().unwrap(), ["one", "two"]);
    }

    #[test]
    fn texts_beyond_the_queue_are_dropped() {
        let (output, _reader) = sync_channel(0);
        let writer = StderrWriter::with_output(move |text| output.send(text).unwrap_or_default());
        (0..2 * QUEUE).for_each(|_| writer.write("text"));
        assert!(writer.unwritten.load(Ordering::Relaxed) <= QUEUE + 1);
    }

    #[test]
    fn a_thousand_refusals_are_two_lines() {
        let mut refusals = Refusals::new("one is refused".to_owned(), "are refused".to_owned());
        assert_eq!(refusals.line(0), None);
        let lines = (0..1000).filter_map(|number| {
            refusals.count(format!("reason {number}"));
            refusals.line(number * SECOND_NS / 1000)
        });
        assert_eq!(lines.collect::<Vec<_>>(), ["one is refused: reason 0"]);
        let last = refusals.line(SECOND_NS).unwrap();
        assert_eq!(last, "masseter: 999 are refused, the last one: reason 999");
    }
}
