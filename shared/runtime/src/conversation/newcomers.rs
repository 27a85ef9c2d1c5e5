//! The peers of a server without a whole request. Their number is bounded, and each has a small buffer.

use std::{collections::VecDeque, io, os::fd::OwnedFd, time::Duration};

use rustix::net::{SocketFlags, accept_with, listen};

use super::{Conversation, Left, Limits, set_blocking, wait_for_peers};

/// Most connections that one look accepts, so that a look takes a bounded time.
const MOST_ACCEPTED: usize = 64;
/// Most connections in the kernel's queue, so that no peer waits behind thousands.
const BACKLOG: i32 = 128;

/// The result of a look at the newcomers.
#[derive(Debug, Default)]
pub struct Look {
    /// Peers with a whole request.
    pub asking: Vec<Conversation>,
    /// Reasons for the removal of other peers.
    pub out: Vec<Left>,
}

/// The peers of a server without a whole request. Their number is limited; a new peer replaces the oldest.
#[derive(Debug)]
pub struct Newcomers {
    listener: OwnedFd,
    limits: Limits,
    most: usize,
    greeting: &'static [u8],
    waiting: VecDeque<Conversation>,
}

impl Newcomers {
    /// The peers at `listener`; at most `most` of them wait.
    ///
    /// # Errors
    /// When the system refuses a listener that does not block.
    pub fn at(listener: OwnedFd, most: usize, limits: Limits) -> io::Result<Self> {
        set_blocking(&listener, false)?;
        listen(&listener, BACKLOG)?;
        Ok(Self { listener, limits, most, greeting: &[], waiting: VecDeque::new() })
    }

    /// Greets each peer with these bytes.
    #[must_use]
    pub fn greeted_with(self, greeting: &'static [u8]) -> Self {
        Self { greeting, ..self }
    }

    /// Reads from the waiting peers, and accepts a bounded number of new peers. `is_whole` recognises a whole request.
    /// Never blocks.
    pub fn look(&mut self, now_ns: u64, is_whole: impl Fn(&[u8]) -> bool) -> Look {
        let mut look = Look::default();
        for conversation in std::mem::take(&mut self.waiting) {
            self.sort_peer(conversation, now_ns, &is_whole, &mut look);
        }
        for _ in 0..MOST_ACCEPTED {
            let flags = SocketFlags::NONBLOCK | SocketFlags::CLOEXEC;
            // The peer has left meanwhile, or the machine has no descriptors: the next look tries again.
            let Ok(connection) = accept_with(&self.listener, flags) else { break };
            match Conversation::begin(connection, self.limits, now_ns) {
                Ok(mut conversation) => {
                    conversation.say(self.greeting);
                    self.sort_peer(conversation, now_ns, &is_whole, &mut look);
                }
                Err(error) => look.out.push(error.into()),
            }
        }
        look
    }

    fn sort_peer(
        &mut self,
        mut conversation: Conversation,
        now_ns: u64,
        is_whole: impl Fn(&[u8]) -> bool,
        look: &mut Look,
    ) {
        conversation.hear();
        if is_whole(conversation.heard()) {
            look.asking.push(conversation);
            return;
        }
        if let Some(left) = conversation.left(now_ns) {
            look.out.push(left);
            return;
        }
        if self.waiting.len() == self.most {
            self.waiting.pop_front();
            look.out.push(Left::Displaced);
        }
        self.waiting.push_back(conversation);
    }

    /// Waits for a new peer, for bytes of a waiting peer, or for the end of a peer's time; at most `timeout`.
    pub fn wait(&self, timeout: Duration) {
        let first_byte = Duration::from_nanos(self.limits.first_byte_ns);
        let timeout = if self.waiting.is_empty() { timeout } else { timeout.min(first_byte) };
        wait_for_peers(&self.waiting, Some(&self.listener), timeout);
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::os::unix::net::{UnixListener, UnixStream};

    use super::*;

    const LIMITS: Limits = Limits { first_byte_ns: 200, whole_ns: 2000, bytes: 8 };

    /// A server with room for three newcomers, at a path of its own.
    fn newcomers() -> (tempfile::TempDir, std::path::PathBuf, Newcomers) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("socket");
        let listener = UnixListener::bind(&path).unwrap();
        (folder, path, Newcomers::at(listener.into(), 3, LIMITS).unwrap())
    }

    fn is_line(bytes: &[u8]) -> bool {
        bytes.contains(&b'\n')
    }

    #[test]
    fn a_whole_request_is_found_behind_silent_peers_and_the_oldest_of_these_goes() {
        let (_folder, path, mut newcomers) = newcomers();
        let silent: Vec<_> = (0..5).map(|_| UnixStream::connect(&path).unwrap()).collect();
        UnixStream::connect(&path).unwrap().write_all(b"hello\n").unwrap();
        let mut look = newcomers.look(1000, is_line);
        assert_eq!(look.asking.len(), 1);
        assert_eq!(look.asking[0].next_line().as_deref(), Some("hello"));
        assert!(matches!(look.out[..], [Left::Displaced, Left::Displaced]));
        // Their time is over: a silent peer holds no place.
        let look = newcomers.look(1300, is_line);
        assert!(look.asking.is_empty() && look.out.len() == 3);
        drop(silent);
    }

    #[test]
    fn a_peer_that_sends_a_part_and_leaves_is_noticed_at_once() {
        let (_folder, path, mut newcomers) = newcomers();
        for _ in 0..100 {
            UnixStream::connect(&path).unwrap().write_all(b"G").unwrap();
            newcomers.look(1000, is_line);
        }
        newcomers.look(1000, is_line);
        assert!(newcomers.waiting.is_empty());
    }

    #[test]
    fn a_look_accepts_a_bounded_number() {
        let (_folder, path, mut newcomers) = newcomers();
        let _peers: Vec<_> = (0..=MOST_ACCEPTED).map(|_| UnixStream::connect(&path).unwrap()).collect();
        assert_eq!(newcomers.look(1000, is_line).out.len(), MOST_ACCEPTED - 3);
        assert_eq!(newcomers.look(1000, is_line).out.len(), 1);
    }
}
