//! The port: sending, receiving and waiting.

use std::io;
use std::time::{Duration, SystemTime};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use socketcan::{CanFrame, CanSocket, EmbeddedFrame as _, Socket, SocketOptions};

use super::confinement::Confinement;
use super::errno::errno;
use super::interface::{self, OpenError};
use super::{clock, conversion};
use crate::bus::{Bus, BusStatus, ErrorState, ReceiveError, Received, SendError};
use crate::error_frame::ErrorReport;
use crate::frame::Frame;
use crate::tap::{Tapped, TappedFrame};

/// Frames looked at in one call of [`Bus::receive`]: error and remote frames must not hold a cycle up.
const FRAMES_AT_ONCE: usize = 64;
/// Receive buffer asked for, bytes; the kernel grants at most `net.core.rmem_max`.
const RECEIVE_BUFFER: i32 = 1 << 20;
/// The port of every error report: the controller of this machine, which all sockets of an interface share.
const OWN_PORT: u8 = 0;
/// Fields of `SO_MEMINFO` (`linux/sock_diag.h`), 32 bits each, and which of them counts dropped frames.
const MEMINFO_FIELDS: usize = 9;
const MEMINFO_DROPS: usize = 8;

/// A port on a real wire.
///
/// # Examples
/// ```no_run
/// use masseter_can::{Bus, CanId, Frame, SocketCan};
///
/// let mut port = SocketCan::open("can0")?;
/// port.send(SocketCan::now_ns(), Frame::new(CanId::standard(0x123)?, &[1, 2])?)?;
/// while let Some(received) = port.receive(SocketCan::now_ns())? {
///     println!("{} at {} ns", received.frame, received.time_ns);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct SocketCan {
    socket: CanSocket,
    transmit_capacity: usize,
    confinement: Confinement,
    last_ns: u64,
    /// Frames were fetched since the drop counter was looked at.
    drained: bool,
    /// The kernel's drop counter as last reported.
    dropped: u32,
}

impl SocketCan {
    /// Opens a port on an interface that is there and up.
    ///
    /// # Errors
    /// [`OpenError`], with the remedy.
    pub fn open(interface: &str) -> Result<Self, OpenError> {
        let transmit_capacity = interface::check(interface)?;
        let failed = |error| OpenError::from_errno(interface, errno(&error));
        let socket = CanSocket::open(interface).map_err(failed)?;
        configure(&socket).map_err(failed)?;
        Ok(Self {
            socket,
            transmit_capacity,
            confinement: Confinement::default(),
            last_ns: 0,
            drained: false,
            dropped: 0,
        })
    }

    /// Now on the clock of the time stamps, ns of `CLOCK_MONOTONIC`.
    pub fn now_ns() -> u64 {
        clock::now_ns()
    }

    /// Blocks until one of the first `N` ports has something to fetch, or until `deadline_ns`; a signal ends the wait
    /// early.
    pub fn wait<const N: usize>(ports: &[Self], deadline_ns: u64) {
        let Some(last) = ports.last() else { return };
        let left = Duration::from_nanos(deadline_ns.saturating_sub(clock::now_ns()));
        let left = Timespec { tv_sec: left.as_secs() as i64, tv_nsec: left.subsec_nanos() as _ };
        // Fewer ports than `N` are filled up with the last one, so that nothing is allocated.
        let port = |index| ports.get(index).unwrap_or(last);
        let mut watched: [_; N] =
            std::array::from_fn(|index| PollFd::new(&port(index).socket, PollFlags::IN));
        // A failed wait ends at once: the caller looks at the ports either way.
        let _ = poll(&mut watched, Some(&left));
    }

    /// The next frame or error on the wire, for an observer; `None` when there is none.
    ///
    /// # Errors
    /// As those of [`Bus::receive`].
    pub fn tap(&mut self) -> Result<Option<Tapped>, ReceiveError> {
        self.next(Some)
    }

    /// The next observation that `select` accepts.
    fn next<T>(&mut self, select: impl Fn(Tapped) -> Option<T>) -> Result<Option<T>, ReceiveError> {
        for _ in 0..FRAMES_AT_ONCE {
            match self.socket.read_frame_with_timestamps() {
                Ok((frame, stamps)) => {
                    let tapped = self.take(&frame, stamps.socket)?;
                    if let Some(selected) = tapped.and_then(&select) {
                        return Ok(Some(selected));
                    }
                }
                Err(error) => return self.receive_failed(&error).map(|()| None),
            }
        }
        Ok(None)
    }

    /// Converts a fetched frame: a frame or an error on the wire, a loss, or nothing.
    fn take(&mut self, frame: &CanFrame, stamp: Option<SystemTime>) -> Result<Option<Tapped>, ReceiveError> {
        self.drained = true;
        let time_ns = stamp.map_or_else(clock::now_ns, clock::monotonic_ns).max(self.last_ns);
        self.last_ns = time_ns;
        let tapped = |frame| Tapped::Frame(Received { frame, time_ns }.into());
        match frame {
            CanFrame::Data(data) => Ok(conversion::from_kernel(data).map(tapped)),
            CanFrame::Error(error) => {
                let kind = self.confinement.take(error.error_bits(), error.data())?;
                let report = |kind| ErrorReport::new(time_ns, OWN_PORT, kind, self.confinement.status());
                Ok(kind.map(report).map(Tapped::Error))
            }
            CanFrame::Remote(_) => Ok(None),
        }
    }

    /// Reports the frames dropped since the last time that the socket was empty.
    fn empty(&mut self) -> Result<(), ReceiveError> {
        if !std::mem::take(&mut self.drained) {
            return Ok(());
        }
        let dropped = self.count_dropped().map_err(|error| ReceiveError::Os { errno: errno(&error) })?;
        match dropped.wrapping_sub(std::mem::replace(&mut self.dropped, dropped)) {
            0 => Ok(()),
            lost => Err(ReceiveError::Overrun { lost: u64::from(lost) }),
        }
    }

    /// Frames that the kernel dropped since the socket was opened.
    fn count_dropped(&self) -> io::Result<u32> {
        let mut fields = [0; MEMINFO_FIELDS * size_of::<u32>()];
        self.socket.get_socket_option_bytes(libc::SOL_SOCKET, libc::SO_MEMINFO, &mut fields)?;
        let (fields, _) = fields.as_chunks();
        Ok(u32::from_ne_bytes(fields[MEMINFO_DROPS]))
    }

    fn receive_failed(&mut self, error: &io::Error) -> Result<(), ReceiveError> {
        match error.kind() {
            io::ErrorKind::WouldBlock => self.empty(),
            io::ErrorKind::Interrupted => Ok(()),
            _ => {
                let errno = errno(error);
                if matches!(errno, libc::ENETDOWN | libc::ENODEV | libc::ENXIO) {
                    self.confinement = Confinement::default();
                }
                Err(ReceiveError::Os { errno })
            }
        }
    }
}

impl Bus for SocketCan {
    fn send(&mut self, _: u64, frame: Frame) -> Result<(), SendError> {
        let BusStatus { state, tec, .. } = self.confinement.status();
        if state == ErrorState::BusOff {
            return Err(SendError::BusOff { tec });
        }
        self.socket.write_frame(&conversion::to_kernel(&frame)).map_err(|error| match errno(&error) {
            // ENOBUFS: the interface's queue; EAGAIN: the socket's own share of it.
            libc::ENOBUFS | libc::EAGAIN => SendError::QueueFull { capacity: self.transmit_capacity },
            errno => SendError::Os { errno },
        })
    }

    fn receive(&mut self, _: u64) -> Result<Option<Received>, ReceiveError> {
        self.next(|tapped| {
            tapped.frame().map(|&TappedFrame { frame, time_ns, .. }| Received { frame, time_ns })
        })
    }

    fn status(&self) -> BusStatus {
        self.confinement.status()
    }
}

fn configure(socket: &CanSocket) -> io::Result<()> {
    socket.set_nonblocking(true)?;
    socket.set_recv_own_msgs(false)?;
    socket.set_error_filter_accept_all()?;
    socket.set_recv_timestamp(true)?;
    socket.set_socket_option_int(libc::SOL_SOCKET, libc::SO_RCVBUF, RECEIVE_BUFFER)
}
