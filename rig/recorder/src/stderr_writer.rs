//! Standard error, written from a thread of its own.
//!
//! A stopped terminal or a paused reader blocks whoever writes. The recorder must not wait, since it would lose messages,
//! nor the server of the simulated buses, whose drives go on.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

use masseter_runtime::clock;
use masseter_terminal::{control, escaped};

/// Most texts that wait; more are dropped.
const QUEUE: usize = 1000;
/// How long [`StderrWriter::finish`] waits, in polls.
const POLL: Duration = Duration::from_millis(10);
const POLLS: usize = 200;

/// Queues texts for standard error and never waits.
#[derive(Debug)]
pub struct StderrWriter {
    texts: SyncSender<String>,
    unwritten: Arc<AtomicUsize>,
}

impl StderrWriter {
    /// Starts the thread.
    pub fn start() -> Self {
        Self::with_output(|text| control(&text))
    }

    fn with_output(mut write: impl FnMut(String) + Send + 'static) -> Self {
        let (texts, queued) = sync_channel(QUEUE);
        let unwritten = Arc::new(AtomicUsize::new(0));
        let remaining = Arc::clone(&unwritten);
        thread::spawn(move || {
            for text in queued {
                write(text);
                remaining.fetch_sub(1, Ordering::Relaxed);
            }
        });
        Self { texts, unwritten }
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
        for _ in 0..POLLS {
            if self.is_idle() {
                return;
            }
            clock::sleep(POLL);
        }
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
}
