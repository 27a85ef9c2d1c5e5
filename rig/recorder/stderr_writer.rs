//! Standard error, written from a thread of its own.
//!
//! A stopped terminal or a paused reader blocks whoever writes; the recorder must not wait, since it would lose messages.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::thread;
use std::time::Duration;

use masseter_shared::clock;
use masseter_terminal::warn;

/// How long [`StderrWriter::finish`] waits, in polls.
const POLL: Duration = Duration::from_millis(10);
const POLLS: usize = 200;

/// Queues texts for standard error and never waits.
#[derive(Debug)]
pub(super) struct StderrWriter {
    texts: Sender<String>,
    unwritten: Arc<AtomicUsize>,
}

impl StderrWriter {
    pub(super) fn start() -> Self {
        Self::with_output(|text| warn(&text))
    }

    fn with_output(mut write: impl FnMut(String) + Send + 'static) -> Self {
        let (texts, queued) = channel();
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
    pub(super) fn is_idle(&self) -> bool {
        self.unwritten.load(Ordering::Relaxed) == 0
    }

    /// Queues a text behind all others.
    pub(super) fn write(&self, text: String) {
        self.unwritten.fetch_add(1, Ordering::Relaxed);
        // The thread receives for as long as this sender exists.
        let _ = self.texts.send(text);
    }

    /// Waits until everything is written, at most 2 s.
    pub(super) fn finish(self) {
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
    use std::sync::mpsc::sync_channel;

    use super::*;

    #[test]
    fn a_paused_reader_blocks_no_writer_and_gets_every_text_in_order() {
        let (output, reader) = sync_channel(0);
        let writer = StderrWriter::with_output(move |text| output.send(text).unwrap());
        assert!(writer.is_idle());
        writer.write("one".to_owned());
        writer.write("two".to_owned());
        assert!(!writer.is_idle());
        let reading = thread::spawn(move || [reader.recv().unwrap(), reader.recv().unwrap()]);
        writer.finish();
        assert_eq!(reading.join().unwrap(), ["one", "two"]);
    }
}
