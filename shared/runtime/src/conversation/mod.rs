//! A peer on a socket, without blocking. One deadline and one byte budget hold for the whole exchange.
//!
//! Every server of the rig accepts its peers through [`Newcomers`]. The module does not decide on admission. Time is an
//! argument, except for clients that wait for an answer.

mod newcomers;

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::{io, path::Path, time::Duration};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::io::{Errno, read};
use rustix::net::{
    AddressFamily, SendFlags, Shutdown, SocketAddrUnix, SocketFlags, SocketType, connect, send, shutdown,
    socket_with,
};
use serde::{Serialize, de::DeserializeOwned};

use crate::clock::{self, MILLISECOND_NS, SECOND_NS};

pub use newcomers::{Look, Newcomers};

/// Bytes of one read.
const READ_BYTES: usize = 16_384;
/// Most bytes waiting in either direction.
const MOST_WAITING: usize = 1 << 20;
/// Time between two attempts at a server with a full queue of connections.
const RETRY: Duration = Duration::from_millis(5);

/// The limits of a peer.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Time until its first byte, ns.
    pub first_byte_ns: u64,
    /// Time for everything, ns.
    pub whole_ns: u64,
    /// Most bytes from the peer.
    pub bytes: usize,
}

impl Limits {
    /// The limits of a new peer: the first byte comes within 200 ms, the whole request within 2 s.
    pub const fn newcomer(bytes: usize) -> Self {
        Self { first_byte_ns: 200 * MILLISECOND_NS, whole_ns: 2 * SECOND_NS, bytes }
    }

    /// The limits of a server, which answers within this time.
    pub const fn answer(whole_ns: u64, bytes: usize) -> Self {
        Self { first_byte_ns: whole_ns, whole_ns, bytes }
    }

    /// The limits of an admitted peer, which may stay silent.
    pub const fn admitted(bytes: usize) -> Self {
        Self::answer(u64::MAX, bytes)
    }
}

/// The reason for the removal of a peer.
#[derive(Debug, thiserror::Error)]
pub enum Left {
    /// The peer has closed the connection.
    #[error("it closed the connection")]
    Closed,
    /// The peer is connected and sends nothing.
    #[error("it sent nothing within {} ms", .0 / MILLISECOND_NS)]
    Silent(u64),
    /// The peer takes too long.
    #[error("it did not finish within {} ms", .0 / MILLISECOND_NS)]
    Late(u64),
    /// The peer sends too much.
    #[error("it sent more than {0} bytes")]
    TooLong(usize),
    /// The peer does not read.
    #[error("it reads too slowly: {0} bytes are unread")]
    Unread(usize),
    /// Newer peers need the place.
    #[error("newer peers take its place, since it has not asked for anything yet")]
    Displaced,
    /// The system refuses the connection.
    #[error("the connection failed: {0}")]
    Failed(#[from] io::Error),
}

/// One peer, with its bytes that nobody has consumed, and the bytes that the peer has not read.
///
/// ```
/// use std::io::Write;
/// use std::os::unix::net::UnixStream;
///
/// use masseter_runtime::conversation::{Conversation, Limits};
///
/// let (mut peer, own) = UnixStream::pair()?;
/// let mut conversation = Conversation::begin(own.into(), Limits::newcomer(80), 0)?;
/// peer.write_all(b"hel")?;
/// conversation.hear();
/// assert_eq!(conversation.next_line(), None);
/// peer.write_all(b"lo\n")?;
/// conversation.hear();
/// assert_eq!(conversation.next_line().as_deref(), Some("hello"));
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Debug)]
pub struct Conversation {
    connection: OwnedFd,
    limits: Limits,
    began_ns: u64,
    heard: Vec<u8>,
    /// Searched bytes at the beginning of `heard`, without an end of a line.
    searched: usize,
    /// All bytes received so far.
    received: usize,
    unsent: Vec<u8>,
    end: Option<Left>,
}

impl Conversation {
    /// Begins with a connected peer. `now_ns` is the beginning of its time.
    ///
    /// # Errors
    /// When the system refuses a connection that does not block.
    pub fn begin(connection: OwnedFd, limits: Limits, now_ns: u64) -> io::Result<Self> {
        set_blocking(&connection, false)?;
        Ok(Self {
            connection,
            limits,
            began_ns: now_ns,
            heard: Vec::new(),
            searched: 0,
            received: 0,
            unsent: Vec::new(),
            end: None,
        })
    }

    /// Connects to the server at `path`, with attempts while its queue of connections is full.
    ///
    /// # Errors
    /// Without a listener, or with a full queue for the time of the limits.
    pub fn connect(path: &Path, limits: Limits) -> io::Result<Self> {
        let now_ns = clock::now_ns();
        let address = SocketAddrUnix::new(path)?;
        let flags = SocketFlags::NONBLOCK | SocketFlags::CLOEXEC;
        let connection = socket_with(AddressFamily::UNIX, SocketType::STREAM, flags, None)?;
        loop {
            match connect(&connection, &address) {
                Ok(()) => return Self::begin(connection, limits, now_ns),
                Err(Errno::AGAIN | Errno::INTR)
                    if clock::now_ns() < now_ns.saturating_add(limits.whole_ns) =>
                {
                    clock::sleep(RETRY);
                }
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// Sets other limits; bytes count anew.
    pub fn renew(&mut self, limits: Limits, now_ns: u64) {
        (self.limits, self.began_ns, self.received) = (limits, now_ns, self.heard.len());
    }

    /// Reads the received bytes, and sends the waiting bytes. Never blocks.
    pub fn hear(&mut self) {
        self.send_unsent();
        let before = self.heard.len();
        let budget = self.limits.bytes.saturating_sub(self.received);
        // One byte more shows that the budget is exceeded.
        let room = budget.min(MOST_WAITING.saturating_sub(before)).saturating_add(1);
        self.heard.resize(before + room.min(READ_BYTES), 0);
        let count =
            if self.end.is_some() { Ok(0) } else { read(&self.connection, &mut self.heard[before..]) };
        self.heard.truncate(before + count.unwrap_or(0));
        match count {
            Ok(0) => drop(self.end.get_or_insert(Left::Closed)),
            Ok(count) => self.received += count,
            Err(Errno::AGAIN | Errno::INTR) => {}
            // A connection ends so when the peer has not read everything.
            Err(Errno::CONNRESET) => self.end = Some(Left::Closed),
            Err(error) => self.end = Some(Left::Failed(error.into())),
        }
    }

    /// Received bytes that are not consumed.
    pub fn heard(&self) -> &[u8] {
        &self.heard
    }

    /// Consumes `count` bytes from the beginning.
    pub fn consume(&mut self, count: usize) -> Vec<u8> {
        self.searched = 0;
        self.heard.drain(..count).collect()
    }

    /// Takes a complete line, without its end. Replaces bytes that are no UTF-8.
    pub fn next_line(&mut self) -> Option<String> {
        let Some(end) = self.heard[self.searched..].iter().position(|byte| *byte == b'\n') else {
            self.searched = self.heard.len();
            return None;
        };
        let line = self.consume(self.searched + end + 1);
        Some(String::from_utf8_lossy(&line[..line.len() - 1]).into_owned())
    }

    /// The reason for the removal of the peer at this time; none while the peer may go on. Received bytes stay
    /// available.
    pub fn left(&mut self, now_ns: u64) -> Option<Left> {
        if let Some(end) = self.end.take() {
            self.end = Some(Left::Closed);
            return Some(end);
        }
        let Self { limits, received, unsent, .. } = self;
        let taken_ns = now_ns.saturating_sub(self.began_ns);
        if *received > limits.bytes {
            Some(Left::TooLong(limits.bytes))
        } else if unsent.len() > MOST_WAITING {
            Some(Left::Unread(unsent.len()))
        } else if *received == 0 && taken_ns > limits.first_byte_ns {
            Some(Left::Silent(limits.first_byte_ns))
        } else {
            (taken_ns > limits.whole_ns).then_some(Left::Late(limits.whole_ns))
        }
    }

    /// Sends bytes behind the waiting bytes, as far as the peer has room. Never blocks, and raises no SIGPIPE.
    pub fn say(&mut self, bytes: &[u8]) {
        self.unsent.extend_from_slice(bytes);
        self.send_unsent();
    }

    fn send_unsent(&mut self) {
        let mut sent = 0;
        while sent < self.unsent.len() && self.end.is_none() {
            match send(&self.connection, &self.unsent[sent..], SendFlags::NOSIGNAL) {
                Ok(count) => sent += count,
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) => break,
                // Bytes sent before the peer's end are still readable.
                Err(Errno::PIPE | Errno::CONNRESET) => sent = self.unsent.len(),
                Err(error) => self.end = Some(Left::Failed(error.into())),
            }
        }
        self.unsent.drain(..sent);
    }

    /// Sends the waiting bytes until `by_ns`, and gives the rest up. Blocks.
    pub fn send_rest(&mut self, by_ns: u64) {
        while !self.is_sent() && self.end.is_none() && clock::now_ns() < by_ns {
            let events = &mut [PollFd::new(&self.connection, PollFlags::OUT)];
            let _ = poll(events, Some(&Timespec { tv_sec: 0, tv_nsec: 100_000_000 }));
            self.send_unsent();
        }
    }

    /// Whether all bytes have gone out.
    pub fn is_sent(&self) -> bool {
        self.unsent.is_empty()
    }

    /// Waits for received bytes or for room to send, for at most `timeout`.
    pub fn wait(&self, timeout: Duration) {
        wait_for_peers([self], None, timeout);
    }

    /// Waits for a line, within the limits of the conversation. For clients without other work.
    ///
    /// # Errors
    /// [`Left`] without a line.
    pub fn await_line(&mut self) -> Result<String, Left> {
        loop {
            self.hear();
            if let Some(line) = self.next_line() {
                return Ok(line);
            }
            let now_ns = clock::now_ns();
            if let Some(left) = self.left(now_ns) {
                return Err(left);
            }
            let left_ns = self.limits.whole_ns.saturating_sub(now_ns.saturating_sub(self.began_ns));
            // At the end of the wait, the end of the time has passed.
            self.wait(Duration::from_nanos(left_ns.min(SECOND_NS)) + Duration::from_millis(1));
        }
    }

    /// Asks a server, and waits for its answer. Both are a line of JSON.
    ///
    /// # Errors
    /// [`Left`] without an answer, or for a line that is no answer.
    pub fn ask<A: DeserializeOwned>(&mut self, request: &impl Serialize) -> Result<A, Left> {
        self.say(line(request).as_bytes());
        serde_json::from_str(&self.await_line()?).map_err(|error| Left::Failed(error.into()))
    }

    /// Ends the connection in both directions.
    pub fn close(&self) {
        // A connection that the peer has closed fails here.
        let _ = shutdown(&self.connection, Shutdown::Both);
    }

    /// The connection, which blocks again. Bytes that are not consumed are lost.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn into_connection(self) -> io::Result<OwnedFd> {
        set_blocking(&self.connection, true)?;
        Ok(self.connection)
    }
}

impl AsFd for Conversation {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.connection.as_fd()
    }
}

/// A message as its line.
///
/// # Panics
/// Never: messages are plain data.
pub fn line(message: &impl Serialize) -> String {
    serde_json::to_string(message).expect("plain data") + "\n"
}

fn wait_for_peers<'a>(
    conversations: impl IntoIterator<Item = &'a Conversation>,
    listener: Option<&OwnedFd>,
    timeout: Duration,
) {
    let of_one = |conversation: &'a Conversation| {
        let room = if conversation.is_sent() { PollFlags::empty() } else { PollFlags::OUT };
        PollFd::new(conversation, PollFlags::IN | room)
    };
    let mut events: Vec<_> = conversations.into_iter().map(of_one).collect();
    events.extend(listener.map(|listener| PollFd::new(listener, PollFlags::IN)));
    let timeout = Timespec::try_from(timeout).unwrap_or(Timespec { tv_sec: i64::MAX, tv_nsec: 0 });
    // An interrupted wait is a short one.
    let _ = poll(&mut events, Some(&timeout));
}

fn set_blocking(connection: &OwnedFd, is_blocking: bool) -> io::Result<()> {
    let flags = fcntl_getfl(connection)?;
    let wanted = if is_blocking { flags - OFlags::NONBLOCK } else { flags | OFlags::NONBLOCK };
    if wanted != flags {
        fcntl_setfl(connection, wanted)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::os::unix::net::{UnixListener, UnixStream};

    use rustix::net::listen;

    use super::*;

    const LIMITS: Limits = Limits { first_byte_ns: 200, whole_ns: 2000, bytes: 8 };

    fn conversation() -> (UnixStream, Conversation) {
        let (peer, own) = UnixStream::pair().unwrap();
        (peer, Conversation::begin(own.into(), LIMITS, 1000).unwrap())
    }

    fn left_at(conversation: &mut Conversation, now_ns: u64) -> Option<String> {
        conversation.hear();
        conversation.left(now_ns).map(|left| left.to_string())
    }

    #[test]
    fn a_silent_peer_is_out_before_a_slow_one_and_bytes_buy_no_time() {
        let (mut peer, mut conversation) = conversation();
        assert!(left_at(&mut conversation, 1200).is_none());
        assert!(matches!(conversation.left(1201), Some(Left::Silent(200))));
        for now_ns in [1300, 2000, 3000] {
            peer.write_all(b"x").unwrap();
            assert!(left_at(&mut conversation, now_ns).is_none());
        }
        peer.write_all(b"x").unwrap();
        conversation.hear();
        assert!(matches!(conversation.left(3001), Some(Left::Late(2000))));
    }

    #[test]
    fn a_budget_holds_for_all_bytes_also_those_that_are_consumed() {
        let (mut peer, mut conversation) = conversation();
        peer.write_all(b"12345678").unwrap();
        assert!(left_at(&mut conversation, 1000).is_none());
        assert_eq!(conversation.consume(8), b"12345678");
        peer.write_all(b"9").unwrap();
        conversation.hear();
        assert!(matches!(conversation.left(1000), Some(Left::TooLong(8))));
    }

    #[test]
    fn what_a_peer_sent_before_it_left_is_heard() {
        let (mut peer, mut conversation) = conversation();
        peer.write_all(b"one\ntwo").unwrap();
        drop(peer);
        conversation.hear();
        assert_eq!(conversation.next_line().as_deref(), Some("one"));
        assert_eq!(conversation.next_line(), None);
        conversation.hear();
        assert!(matches!(conversation.left(1000), Some(Left::Closed)));
    }

    #[test]
    fn a_peer_that_does_not_read_blocks_nobody_and_is_out() {
        let (mut peer, mut conversation) = conversation();
        let mut sent = 0;
        while conversation.left(1000).is_none() {
            conversation.say(&vec![7; 65_536]);
            sent += 65_536;
            assert!(sent < 8 * MOST_WAITING);
        }
        assert!(matches!(conversation.left(1000), Some(Left::Unread(_))));
        let mut first = vec![0; 65_536];
        peer.read_exact(&mut first).unwrap();
        assert!(first.iter().all(|byte| *byte == 7));
    }

    #[test]
    fn an_answer_is_awaited_until_one_deadline_however_it_drips() {
        let (mut peer, own) = UnixStream::pair().unwrap();
        let limits = Limits::answer(100 * MILLISECOND_NS, 1000);
        let began_ns = clock::now_ns();
        let mut conversation = Conversation::begin(own.into(), limits, began_ns).unwrap();
        let dripping = std::thread::spawn(move || {
            while clock::now_ns() - began_ns < 10 * SECOND_NS && peer.write_all(b"x").is_ok() {
                clock::sleep(Duration::from_millis(5));
            }
        });
        assert!(matches!(conversation.await_line(), Err(Left::Late(_))));
        drop(conversation);
        dripping.join().unwrap();
    }

    #[test]
    fn a_client_waits_for_a_full_queue_of_connections_until_its_deadline() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("socket");
        let listener = UnixListener::bind(&path).unwrap();
        listen(&listener, 1).unwrap();
        let limits = Limits::answer(50 * MILLISECOND_NS, 10);
        let began_ns = clock::now_ns();
        let connected: Vec<_> = (0..10).map_while(|_| Conversation::connect(&path, limits).ok()).collect();
        assert!(connected.len() < 10, "the queue is never full");
        assert!(clock::now_ns() - began_ns >= limits.whole_ns, "nobody waited");
        assert!(Conversation::connect(&folder.path().join("none"), limits).is_err());
    }
}
