//! The dead man's switch: an axis moves only while input arrives on standard input, such as the lines of a held Enter key.

use std::io::Read;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;

use masseter_plant::bringup::Wish;
use masseter_runtime::clock::{MILLISECOND_NS, SECOND_NS};

/// For how long a byte permits motion: longer than the time between two repeats of a key, ns.
const HELD_NS: u64 = 300 * MILLISECOND_NS;
/// A silence after which the drive is switched off, ns.
const RELEASED_NS: u64 = 3 * SECOND_NS;
/// How long the first byte may take, ns.
const FIRST_NS: u64 = 60 * SECOND_NS;

/// What came on standard input.
#[derive(Debug, Default)]
struct Input {
    bytes: AtomicU64,
    is_over: AtomicBool,
}

/// The switch.
#[derive(Debug)]
pub(super) struct Hold {
    input: Arc<Input>,
    taken: u64,
    /// When the newest byte was seen, ns.
    held_ns: Option<u64>,
    /// When the switch was asked first, ns.
    asked_ns: Option<u64>,
}

impl Hold {
    /// Reads standard input from now on.
    pub(super) fn of_stdin() -> Self {
        let input = Arc::new(Input::default());
        let reader = Arc::clone(&input);
        thread::spawn(move || {
            let mut bytes = [0; 64];
            while let Ok(count @ 1..) = std::io::stdin().read(&mut bytes) {
                reader.bytes.fetch_add(count as u64, Ordering::Relaxed);
            }
            reader.is_over.store(true, Ordering::Relaxed);
        });
        Self::of_input(input)
    }

    fn of_input(input: Arc<Input>) -> Self {
        Self { input, taken: 0, held_ns: None, asked_ns: None }
    }

    /// What the person wants at that time.
    pub(super) fn wish(&mut self, now_ns: u64) -> Wish {
        let asked_ns = *self.asked_ns.get_or_insert(now_ns);
        let bytes = self.input.bytes.load(Ordering::Relaxed);
        if bytes != self.taken {
            (self.taken, self.held_ns) = (bytes, Some(now_ns));
        }
        if self.input.is_over.load(Ordering::Relaxed) {
            return Wish::Stop;
        }
        match self.held_ns {
            Some(held_ns) if now_ns - held_ns < HELD_NS => Wish::Move,
            Some(held_ns) if now_ns - held_ns >= RELEASED_NS => Wish::Stop,
            None if now_ns - asked_ns >= FIRST_NS => Wish::Stop,
            _ => Wish::Halt,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_permits_motion_for_a_while_and_the_end_of_input_none() {
        let input = Arc::new(Input::default());
        let mut hold = Hold::of_input(Arc::clone(&input));
        let mut wish = |now_ms: u64| hold.wish(now_ms * MILLISECOND_NS);
        assert_eq!((wish(0), wish(59_000)), (Wish::Halt, Wish::Halt), "nobody has touched the key");
        input.bytes.fetch_add(1, Ordering::Relaxed);
        assert_eq!((wish(59_500), wish(59_799), wish(59_800)), (Wish::Move, Wish::Move, Wish::Halt));
        input.bytes.fetch_add(1, Ordering::Relaxed);
        assert_eq!((wish(60_000), wish(62_999), wish(63_000)), (Wish::Move, Wish::Halt, Wish::Stop));
        input.bytes.fetch_add(1, Ordering::Relaxed);
        input.is_over.store(true, Ordering::Relaxed);
        assert_eq!(wish(63_001), Wish::Stop);
        assert_eq!(Hold::of_input(Arc::default()).wish(0), Wish::Halt);
    }
}
