//! Standard error as the logger writes to it: from a thread of its own. A terminal that is stopped and a reader that
//! pauses hold up whoever writes, and the logger would lose messages meanwhile.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::thread;
use std::time::Duration;

use masseter_shared::clock;
use rustix::termios::tcgetwinsize;

use masseter_terminal::warn;

/// How often it is looked whether everything is written, and how many times before nobody seems to read.
const LOOK: Duration = Duration::from_millis(10);
const LOOKS: usize = 200;

/// Standard error.
#[derive(Debug)]
pub(super) struct Screen {
    texts: Sender<String>,
    unwritten: Arc<AtomicUsize>,
}

impl Screen {
    pub(super) fn start() -> Self {
        Self::writing(|text| warn(&text))
    }

    fn writing(mut write: impl FnMut(String) + Send + 'static) -> Self {
        let (texts, said) = channel();
        let unwritten = Arc::new(AtomicUsize::new(0));
        let written = Arc::clone(&unwritten);
        thread::spawn(move || {
            for text in said {
                write(text);
                written.fetch_sub(1, Ordering::Relaxed);
            }
        });
        Self { texts, unwritten }
    }

    /// Whether everything said is written: what is soon out of date is worth saying only then.
    pub(super) fn is_free(&self) -> bool {
        self.unwritten.load(Ordering::Relaxed) == 0
    }

    /// Has a text written behind all others. Never waits.
    pub(super) fn say(&self, text: String) {
        self.unwritten.fetch_add(1, Ordering::Relaxed);
        // The thread takes texts as long as there is a screen to say them.
        let _ = self.texts.send(text);
    }

    /// Waits until everything said is written, unless nobody reads.
    pub(super) fn end(self) {
        for _ in 0..LOOKS {
            if self.is_free() {
                return;
            }
            clock::sleep(LOOK);
        }
    }
}

/// Rows of the terminal, if it tells.
pub(super) fn rows() -> Option<usize> {
    let size = tcgetwinsize(io::stderr()).ok()?;
    (size.ws_row > 0).then_some(usize::from(size.ws_row))
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::sync_channel;

    use super::*;

    #[test]
    fn a_reader_that_pauses_holds_nobody_up_and_gets_everything_in_its_order() {
        let (read, reader) = sync_channel(0);
        let screen = Screen::writing(move |text| read.send(text).unwrap());
        assert!(screen.is_free());
        screen.say("one".to_owned());
        screen.say("two".to_owned());
        assert!(!screen.is_free());
        let reading = thread::spawn(move || [reader.recv().unwrap(), reader.recv().unwrap()]);
        screen.end();
        assert_eq!(reading.join().unwrap(), ["one", "two"]);
    }
}
