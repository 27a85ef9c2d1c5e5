//! Signals that wake a sleeping process: datagrams of one byte in the domain's root folder. iceoryx2's events need
//! longer paths than sockets allow.

use std::{io::ErrorKind, os::unix::net::UnixDatagram, path::PathBuf, thread, time::Duration};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::net::{RecvFlags, recv};

use masseter_domain::{DomainError, Node, file_error};

use crate::clock;

/// Longest wait for room in the receiver's queue. The queue has more room than the processes need.
const SEND_TIMEOUT: Duration = Duration::from_secs(1);

/// Longest wait that yields the core instead of sleeping, ns. The other loop's turn is usually shorter. To wake a
/// sleeping process on an idle core takes longer than a turn.
const YIELD_NS: u64 = 50_000;
/// Longest yield without other work on the core, ns.
const TAKEN_NS: u64 = 500_000;
/// Waits that sleep at once after a longer yield, the fewest and the most. Other work gives the core back late.
const SLEEPS: [u32; 2] = [64, 4096];

/// Receives the signals to this process.
#[derive(Debug)]
pub struct SignalReceiver {
    socket: UnixDatagram,
    path: PathBuf,
    /// Number of next waits that sleep at once.
    sleeps: u32,
    /// That number after the next long yield. A long yield doubles the number; each signal during a yield reduces the
    /// number.
    next_sleeps: u32,
}

/// Sends signals to one process.
#[derive(Debug)]
pub struct SignalSender {
    socket: UnixDatagram,
    path: PathBuf,
}

impl SignalReceiver {
    /// The receiver of this name. A wait lasts at most `timeout`.
    ///
    /// # Errors
    /// When the socket cannot be made.
    pub fn open(node: &Node, name: &str, timeout: Duration) -> Result<Self, DomainError> {
        let path = node.domain().root().join(name);
        let socket = UnixDatagram::bind(&path).map_err(file_error("receive at", &path))?;
        socket.set_read_timeout(Some(timeout)).map_err(file_error("receive at", &path))?;
        Ok(Self { socket, path, sleeps: 0, next_sleeps: SLEEPS[0] })
    }

    /// The next signal; none after the timeout, or when the kernel interrupts the wait.
    ///
    /// # Errors
    /// When the socket fails.
    pub fn receive(&mut self) -> Result<Option<u8>, DomainError> {
        if let Some(signal) = self.receive_by_yielding() {
            return Ok(Some(signal));
        }
        let mut signal = [0];
        match self.socket.recv(&mut signal) {
            Ok(_) => Ok(Some(signal[0])),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(None),
            Err(error) => Err(file_error("receive at", &self.path)(error)),
        }
    }

    /// The next signal within this time, if any. A time of zero only looks.
    ///
    /// # Errors
    /// When the socket fails.
    pub fn receive_within(&mut self, timeout: Duration) -> Result<Option<u8>, DomainError> {
        let timeout =
            Timespec { tv_sec: timeout.as_secs() as i64, tv_nsec: i64::from(timeout.subsec_nanos()) };
        let arrived = poll(&mut [PollFd::new(&self.socket, PollFlags::IN)], Some(&timeout));
        match arrived {
            Ok(0) | Err(Errno::INTR) => Ok(None),
            Ok(_) => self.receive(),
            Err(error) => Err(file_error("receive at", &self.path)(error.into())),
        }
    }

    /// The next signal, if it comes soon. The following wait reports errors.
    fn receive_by_yielding(&mut self) -> Option<u8> {
        if self.sleeps > 0 {
            self.sleeps -= 1;
            return None;
        }
        let from_ns = clock::now_ns();
        let mut now_ns = from_ns;
        while now_ns - from_ns < YIELD_NS {
            let mut signal = [0];
            if recv(&self.socket, &mut signal, RecvFlags::DONTWAIT).is_ok() {
                self.next_sleeps = (self.next_sleeps - 1).max(SLEEPS[0]);
                return Some(signal[0]);
            }
            let before_ns = now_ns;
            thread::yield_now();
            now_ns = clock::now_ns();
            if now_ns - before_ns > TAKEN_NS {
                self.sleeps = self.next_sleeps;
                self.next_sleeps = (2 * self.next_sleeps).min(SLEEPS[1]);
            }
        }
        None
    }
}

impl SignalSender {
    /// A sender to the receiver of this name. The receiver may open later.
    ///
    /// # Errors
    /// When the socket cannot be made.
    pub fn open(node: &Node, receiver: &str) -> Result<Self, DomainError> {
        let path = node.domain().root().join(receiver);
        let socket = UnixDatagram::unbound().map_err(file_error("send to", &path))?;
        socket.set_write_timeout(Some(SEND_TIMEOUT)).map_err(file_error("send to", &path))?;
        Ok(Self { socket, path })
    }

    /// Sends a signal. Without a receiver the signal is lost: that process has ended, and its supervisor notices the
    /// end.
    ///
    /// # Errors
    /// When the socket fails.
    pub fn send(&self, signal: u8) -> Result<(), DomainError> {
        match self.socket.send_to(&[signal], &self.path) {
            Ok(_) => Ok(()),
            Err(error) => match error.kind() {
                ErrorKind::ConnectionRefused | ErrorKind::NotFound => Ok(()),
                _ => Err(file_error("send to", &self.path)(error)),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::ScratchDomain;

    #[test]
    fn signals_wait_for_their_receiver_in_order_and_are_lost_without_one() {
        let domain = ScratchDomain::claim("test-of-signals-longname").unwrap();
        let node = Node::join(&domain).unwrap();
        let timeout = Duration::from_millis(1);
        let [mut receiver, mut other] =
            ["controller", "plant"].map(|name| SignalReceiver::open(&node, name, timeout).unwrap());
        let sender = SignalSender::open(&node, "controller").unwrap();
        for signal in [7, 5, 5] {
            sender.send(signal).unwrap();
        }
        let mut received = || receiver.receive().unwrap();
        assert_eq!([received(), received(), received(), received()], [Some(7), Some(5), Some(5), None]);
        assert_eq!(other.receive().unwrap(), None);
        drop(receiver);
        sender.send(1).unwrap();
    }
}
