//! A node's port on a real wire: a raw `SocketCAN` socket that never blocks.
//!
//! Frames leave through the queue of the interface (`txqueuelen`) in the order of sending: a caller sends urgent frames
//! first. A port receives frames of other sockets on the same interface like those of other nodes. The order is that on
//! the wire, so a second port on the interface is a tap.
//!
//! # Time stamps
//! The kernel stamps a frame in wall-clock time when the frame comes from the driver. The port converts the stamp to
//! `CLOCK_MONOTONIC` when it fetches the frame. Stamps of a port never run backwards. Hardware stamps are not used,
//! because the adapter's own clock has another origin.
//!
//! # Fault confinement
//! The driver reports fault confinement by error frames, which change [`status`](Bus::status). A [tap](SocketCan::tap)
//! alone gets the error frames. They are changes of state and, with `berr-reporting on`, errors on the wire. Warnings,
//! lost arbitration and faults of the line are skipped. A port counts as error active until the first error frame. A
//! port in bus-off refuses to send until the driver reports a restart or an active controller, until a frame arrives a tenth
//! of a second later, or until the interface goes down. A warning ends no bus-off.
//!
//! # Losses
//! The kernel counts the frames lost in a full socket. The kernel does not count the frames lost in the controller, so
//! each such report means at least one frame.
//!
//! # Frames
//! Remote frames and frames in FD format are skipped.
//!
//! The port of an unplugged adapter reports [`ReceiveError::Os`](crate::ReceiveError::Os) until the port is opened
//! anew. The port of an interface that is down works again when the interface is up.

use std::io;
use std::time::{Duration, SystemTime};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::time::{ClockId, clock_gettime};
use socketcan::{
    CanDataFrame, CanFrame, CanSocket, EmbeddedFrame as _, ExtendedId, Frame as _, Id, Socket, SocketOptions,
    StandardId,
};

use crate::{
    Bus, BusStatus, CanId, ErrorKind, ErrorReport, ErrorState, Frame, ReceiveError, Received, SendError,
    Tapped, TappedFrame,
};

mod confinement;
mod details;
mod fitness;
mod interface;

use confinement::{UNDISTURBED, apply_error, apply_traffic};
pub use details::InterfaceDetails;
pub use fitness::{InterfaceNeeds, JudgedInterface, bring_up_command};
pub use interface::{Interface, OpenError, explain_errno, is_supported};
use interface::{errno, usable_transmit_capacity};

/// Most frames that one call of [`Bus::receive`] reads: error and remote frames must not delay a cycle.
const FRAMES_AT_ONCE: usize = 64;
/// Requested receive buffer, bytes; the kernel grants at most `net.core.rmem_max`.
const RECEIVE_BUFFER: i32 = 1 << 20;
/// The port of every error report: all sockets of an interface share this machine's controller.
const OWN_PORT: u8 = 0;
/// Number of 32-bit fields of `SO_MEMINFO` (`linux/sock_diag.h`).
const MEMINFO_FIELDS: usize = libc::SK_MEMINFO_DROPS as usize + 1;
/// A frame takes whole lines of the cache, of at least so many bytes. The kernel counts a frame as one byte while another
/// processor frees the frame (`sock_wfree`).
const CACHE_LINE_BYTES: u32 = 32;
/// An older stamp means that the wall clock has been set.
const MAX_AGE: Duration = Duration::from_secs(60);

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
    status: BusStatus,
    /// Bytes of memory that the kernel counts for an unsent frame; 0 until one waits.
    frame_bytes: u32,
    /// When the driver reported bus-off.
    off_since_ns: u64,
    last_ns: u64,
    /// The port has fetched frames since the last look at the drop counter.
    drained: bool,
    /// The kernel's drop counter at the last report.
    dropped: u32,
}

impl SocketCan {
    /// Opens a port on an existing interface that is up.
    ///
    /// # Errors
    /// [`OpenError`], with the remedy.
    pub fn open(interface: &str) -> Result<Self, OpenError> {
        let transmit_capacity = usable_transmit_capacity(interface)?;
        let failed = |error| OpenError::from_errno(interface, errno(&error));
        let socket = CanSocket::open(interface).map_err(failed)?;
        configure(&socket).map_err(failed)?;
        Ok(Self {
            socket,
            transmit_capacity,
            status: UNDISTURBED,
            frame_bytes: 0,
            off_since_ns: 0,
            last_ns: 0,
            drained: false,
            dropped: 0,
        })
    }

    /// Now on the clock of the time stamps, ns of `CLOCK_MONOTONIC`.
    #[allow(clippy::disallowed_methods, reason = "the port's own clock")]
    pub fn now_ns() -> u64 {
        let time = clock_gettime(ClockId::Monotonic);
        time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
    }

    /// Blocks until one of the first `N` ports has a frame, or until `deadline_ns`. A signal ends the wait early.
    pub fn wait<const N: usize>(ports: &[Self], deadline_ns: u64) {
        let Some(last) = ports.last() else { return };
        let left = Duration::from_nanos(deadline_ns.saturating_sub(Self::now_ns()));
        let left = Timespec { tv_sec: left.as_secs() as i64, tv_nsec: left.subsec_nanos() as _ };
        // The last port fills an array of fewer than `N` ports, so that the wait allocates nothing.
        let port = |index| ports.get(index).unwrap_or(last);
        let mut watched: [_; N] =
            std::array::from_fn(|index| PollFd::new(&port(index).socket, PollFlags::IN));
        // A failed wait ends at once; the caller looks at the ports in any case.
        let _ = poll(&mut watched, Some(&left));
    }

    /// The next frame or error on the wire, for an observer; `None` for none.
    ///
    /// # Errors
    /// As those of [`Bus::receive`].
    pub fn tap(&mut self) -> Result<Option<Tapped>, ReceiveError> {
        self.next_observation(Some)
    }

    /// The next observation that `select` accepts.
    fn next_observation<T>(
        &mut self,
        select: impl Fn(Tapped) -> Option<T>,
    ) -> Result<Option<T>, ReceiveError> {
        for _ in 0..FRAMES_AT_ONCE {
            match self.socket.read_frame_with_timestamps() {
                Ok((frame, stamps)) => {
                    let tapped = self.observe(&frame, stamps.socket)?;
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
    fn observe(
        &mut self,
        frame: &CanFrame,
        stamp: Option<SystemTime>,
    ) -> Result<Option<Tapped>, ReceiveError> {
        self.drained = true;
        let time_ns = stamp.map_or_else(Self::now_ns, monotonic_ns).max(self.last_ns);
        self.last_ns = time_ns;
        let tapped = |frame| Tapped::Frame(Received { frame, time_ns }.into());
        match frame {
            CanFrame::Data(data) => {
                apply_traffic(&mut self.status, time_ns.saturating_sub(self.off_since_ns));
                Ok(from_kernel(data).map(tapped))
            }
            CanFrame::Error(error) => {
                let kind = apply_error(&mut self.status, error.error_bits(), error.data())?;
                if kind == Some(ErrorKind::State(ErrorState::BusOff)) {
                    self.off_since_ns = time_ns;
                }
                let report = |kind| ErrorReport::new(time_ns, OWN_PORT, kind, self.status);
                Ok(kind.map(report).map(Tapped::Error))
            }
            CanFrame::Remote(_) => Ok(None),
        }
    }

    /// Reports the frames dropped since the socket was last empty.
    fn report_dropped(&mut self) -> Result<(), ReceiveError> {
        if !std::mem::take(&mut self.drained) {
            return Ok(());
        }
        let dropped = self
            .memory_info(libc::SK_MEMINFO_DROPS)
            .map_err(|error| ReceiveError::Os { errno: errno(&error) })?;
        match dropped.wrapping_sub(std::mem::replace(&mut self.dropped, dropped)) {
            0 => Ok(()),
            lost => Err(ReceiveError::Overrun { lost: u64::from(lost) }),
        }
    }

    /// A figure of the socket: the frames dropped since its opening, or the bytes of those that wait in the interface's
    /// queue; of older kernels, also of those in the controller.
    fn memory_info(&self, field: i32) -> io::Result<u32> {
        let mut fields = [0; MEMINFO_FIELDS * size_of::<u32>()];
        self.socket.get_socket_option_bytes(libc::SOL_SOCKET, libc::SO_MEMINFO, &mut fields)?;
        let (fields, _) = fields.as_chunks();
        Ok(u32::from_ne_bytes(fields[field as usize]))
    }

    fn receive_failed(&mut self, error: &io::Error) -> Result<(), ReceiveError> {
        match error.kind() {
            io::ErrorKind::WouldBlock => self.report_dropped(),
            io::ErrorKind::Interrupted => Ok(()),
            _ => {
                let errno = errno(error);
                if matches!(errno, libc::ENETDOWN | libc::ENODEV | libc::ENXIO) {
                    self.status = UNDISTURBED;
                }
                Err(ReceiveError::Os { errno })
            }
        }
    }
}

impl Bus for SocketCan {
    fn send(&mut self, _: u64, frame: Frame) -> Result<(), SendError> {
        let BusStatus { state, tec, .. } = self.status;
        if state == ErrorState::BusOff {
            return Err(SendError::BusOff { tec });
        }
        self.socket.write_frame(&to_kernel(&frame)).map_err(|error| match errno(&error) {
            // ENOBUFS: the interface's queue; EAGAIN: the socket's own share of it.
            libc::ENOBUFS | libc::EAGAIN => SendError::QueueFull { capacity: self.transmit_capacity },
            errno => SendError::Os { errno },
        })?;
        if self.frame_bytes == 0 {
            // The first frame that waits is alone. A virtual interface has sent it already, and keeps none.
            self.frame_bytes = self.memory_info(libc::SK_MEMINFO_WMEM_ALLOC).map_or(0, whole_frames);
        }
        Ok(())
    }

    fn receive(&mut self, _: u64) -> Result<Option<Received>, ReceiveError> {
        self.next_observation(|tapped| {
            tapped.frame().map(|&TappedFrame { frame, time_ns, .. }| Received { frame, time_ns })
        })
    }

    fn status(&self) -> BusStatus {
        self.status
    }

    fn unsent(&self) -> usize {
        let bytes = self.memory_info(libc::SK_MEMINFO_WMEM_ALLOC).unwrap_or(0);
        bytes.checked_div(self.frame_bytes).unwrap_or(0) as usize
    }
}

/// The bytes of a socket's unsent frames, without those that are being freed.
fn whole_frames(bytes: u32) -> u32 {
    bytes - bytes % CACHE_LINE_BYTES
}

fn configure(socket: &CanSocket) -> io::Result<()> {
    socket.set_nonblocking(true)?;
    socket.set_recv_own_msgs(false)?;
    socket.set_error_filter_accept_all()?;
    socket.set_recv_timestamp(true)?;
    socket.set_socket_option_int(libc::SOL_SOCKET, libc::SO_RCVBUF, RECEIVE_BUFFER)
}

/// The kernel's form of a frame.
fn to_kernel(frame: &Frame) -> CanDataFrame {
    let number = frame.id().number();
    let id = if frame.id().is_extended() {
        ExtendedId::new(number).map(Id::Extended)
    } else {
        StandardId::new(number as u16).map(Id::Standard)
    };
    let kernels = id.and_then(|id| CanDataFrame::new(id, frame.data()));
    kernels.expect("an identifier of 11 or 29 bits, and at most 8 bytes")
}

/// The frame of the kernel's form; `None` for an invalid frame.
fn from_kernel(frame: &CanDataFrame) -> Option<Frame> {
    Frame::new(CanId::from_flagged(frame.id_word()).ok()?, frame.data()).ok()
}

/// The instant of `CLOCK_MONOTONIC` for the wall-clock time `stamp`, ns. A stamp in the future or more than a minute
/// old gives the present, because the wall clock has been set in between. The result is never before the true instant,
/// unless the wall clock is set.
#[allow(
    clippy::disallowed_methods,
    reason = "stamps must be comparable with the times that a user passes in"
)]
fn monotonic_ns(stamp: SystemTime) -> u64 {
    // With this order, time between the two readings makes the result later, but never later than now.
    let wall = SystemTime::now();
    let now_ns = SocketCan::now_ns();
    match wall.duration_since(stamp) {
        Ok(age) if age < MAX_AGE => now_ns.saturating_sub(age.as_nanos() as u64),
        _ => now_ns,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods, reason = "stamps are compared with the clocks themselves")]

    use std::time::UNIX_EPOCH;

    use proptest::prelude::*;

    use super::*;
    use crate::frame::tests::any_frame;

    /// A frame that counts as one byte is sent: were it the measure, each frame in the queue would count as hundreds.
    #[test]
    fn a_frame_that_another_processor_frees_is_no_measure() {
        assert_eq!([0, 1, 2, 768, 769, 1536].map(whole_frames), [0, 0, 0, 768, 768, 1536]);
    }

    proptest! {
        #[test]
        fn every_frame_survives_the_form_of_the_kernel(frame in any_frame()) {
            prop_assert_eq!(from_kernel(&to_kernel(&frame)), Some(frame));
        }
    }

    #[test]
    fn a_stamp_of_the_wall_clock_lies_between_the_monotonic_readings_around_it() {
        let before_ns = SocketCan::now_ns();
        let stamp = SystemTime::now();
        let after_ns = SocketCan::now_ns();
        assert!(monotonic_ns(stamp) >= before_ns);
        assert!(monotonic_ns(SystemTime::now()) >= after_ns, "a later stamp lies later");
    }

    #[test]
    fn an_old_stamp_is_converted_by_its_age() {
        let stamp = SystemTime::now() - Duration::from_secs(30);
        let found_ns = monotonic_ns(stamp);
        assert!(found_ns + 20_000_000_000 < SocketCan::now_ns(), "{found_ns}");
    }

    #[test]
    fn a_stamp_of_a_clock_that_was_set_meanwhile_counts_as_now() {
        for stamp in [UNIX_EPOCH, SystemTime::now() + Duration::from_secs(3600)] {
            let before_ns = SocketCan::now_ns();
            assert!(monotonic_ns(stamp) >= before_ns);
        }
    }
}
