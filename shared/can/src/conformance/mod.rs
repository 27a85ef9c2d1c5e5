//! The laws of every [`Bus`], as checks of an implementation.
//!
//! An implementation provides a [`Pair`]: two ports of one wire and a way to let time pass. The checks fetch with
//! [`Bus::receive`] only after [`Pair::settle`]. Timing and fault confinement are not checked.

#[cfg(test)]
mod tests;

use std::fmt;

use super::bus::{Bus, ReceiveError, Received, SendError};
use super::frame::{Frame, FrameFormat};
use super::id::CanId;

/// Frames sent at once by the check for losses: more than any sensible queue holds.
const BURST: u32 = 20_000;

/// A property of every bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Law {
    /// Every frame arrives once, unchanged and in order.
    Delivery,
    /// A port does not receive its own frames.
    NoEcho,
    /// Every lost frame is reported.
    Losses,
    /// Frames in FD format arrive unchanged, or are refused.
    Fd,
    /// On buses that send by priority, the smaller identifier goes first.
    Arbitration,
}

impl Law {
    /// The laws of every bus, in the order of the checks.
    pub const OF_EVERY_BUS: [Self; 4] = [Self::Delivery, Self::NoEcho, Self::Losses, Self::Fd];

    fn broken(self, observed: &impl fmt::Debug) -> Violation {
        Violation { law: self, observed: format!("{observed:?}") }
    }
}

impl fmt::Display for Law {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Delivery => {
                "a frame is received once, with its identifier and data, at a time not before its predecessor's"
            }
            Self::NoEcho => "a port does not receive its own frames",
            Self::Losses => "a frame is refused because the queue is full, or received, or reported as lost",
            Self::Fd => {
                "a frame in FD format arrives unchanged where the ports speak FD, and is refused where they do not"
            }
            Self::Arbitration => "of frames sent at once, the lowest identifier goes first",
        })
    }
}

/// One of the two ports.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// The first.
    A,
    /// The second.
    B,
}

/// Two new ports of one wire without other nodes.
pub trait Pair {
    /// Whether the ports count every lost frame. A real controller whose memory overflowed reports a loss, but
    /// not the number of frames.
    const COUNTS_LOSSES: bool = true;

    /// A port.
    fn end(&mut self, end: End) -> impl Bus;
    /// The format in which the ports send.
    fn format(&self) -> FrameFormat;
    /// The time, ns.
    fn now_ns(&self) -> u64;
    /// Lets time pass until all frames sent have arrived or were lost.
    fn settle(&mut self);
}

/// A broken law.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{law}: {observed}")]
pub struct Violation {
    /// The law.
    pub law: Law,
    /// The observation that breaks the law.
    pub observed: String,
}

/// Checks the laws of every bus, each on a pair of its own.
///
/// # Examples
/// ```
/// use masseter_can::conformance::{End, Pair, check};
/// use masseter_can::{Bitrate, Bus, FrameFormat, Rates, VirtualWire, WireConfig};
///
/// struct TwoPorts {
///     wire: VirtualWire,
///     now_ns: u64,
/// }
///
/// impl Pair for TwoPorts {
///     fn end(&mut self, end: End) -> impl Bus {
///         self.wire.port(end as usize)
///     }
///
///     fn format(&self) -> FrameFormat {
///         FrameFormat::Classical
///     }
///
///     fn now_ns(&self) -> u64 {
///         self.now_ns
///     }
///
///     fn settle(&mut self) {
///         while let Some(event_ns) = self.wire.next_event_ns() {
///             self.wire.advance(event_ns);
///             self.now_ns = event_ns;
///         }
///     }
/// }
///
/// let config = WireConfig {
///     rates: Rates::classical(Bitrate::MAX),
///     format: FrameFormat::Classical,
///     ports: 2,
///     transmit_capacity: 8,
///     receive_capacity: 8,
///     restart_after_ns: None,
/// };
/// check(|| TwoPorts { wire: VirtualWire::new(&config), now_ns: 0 })?;
/// # Ok::<(), masseter_can::conformance::Violation>(())
/// ```
///
/// # Errors
/// The first [`Violation`].
pub fn check<P: Pair>(mut pair: impl FnMut() -> P) -> Result<(), Violation> {
    frames_arrive_once_unchanged_and_in_order(&mut pair())?;
    ports_do_not_receive_their_own_frames(&mut pair())?;
    nothing_is_lost_silently(&mut pair())?;
    fd_frames_arrive_or_are_refused(&mut pair())
}

/// Checks the law of buses that send by priority. A virtual CAN interface of the kernel sends in order instead.
///
/// # Errors
/// The [`Violation`].
pub fn check_arbitration<P: Pair>(mut pair: impl FnMut() -> P) -> Result<(), Violation> {
    let mut pair = pair();
    let frames = [0x7FF, 0x181, 0x080].map(|id| frame(id, 0));
    frames
        .iter()
        .try_for_each(|&frame| send(&mut pair, frame))
        .map_err(|error| Law::Arbitration.broken(&error))?;
    pair.settle();
    let (received, _) = drain(&mut pair, End::B).map_err(|error| Law::Arbitration.broken(&error))?;
    let ids: Vec<_> = received.iter().map(|received| received.frame.id()).collect();
    if ids.is_sorted() && ids.len() == frames.len() { Ok(()) } else { Err(Law::Arbitration.broken(&ids)) }
}

fn frames_arrive_once_unchanged_and_in_order(pair: &mut impl Pair) -> Result<(), Violation> {
    let (format, mut last_ns) = (pair.format(), 0);
    for number in 0..=u32::from(u8::MAX) {
        let sent = frame(0x100 + (number % 7) as u16, number);
        send(pair, sent).map_err(|error| Law::Delivery.broken(&error))?;
        pair.settle();
        let (received, lost) = drain(pair, End::B).map_err(|error| Law::Delivery.broken(&error))?;
        match received[..] {
            [Received { frame, time_ns }]
                if frame == sent.promoted(format) && time_ns >= last_ns && lost == 0 =>
            {
                last_ns = time_ns;
            }
            _ => return Err(Law::Delivery.broken(&(sent, received, lost))),
        }
    }
    Ok(())
}

fn ports_do_not_receive_their_own_frames(pair: &mut impl Pair) -> Result<(), Violation> {
    send(pair, frame(0x123, 0)).map_err(|error| Law::NoEcho.broken(&error))?;
    pair.settle();
    match drain(pair, End::A) {
        Ok((received, 0)) if received.is_empty() => Ok(()),
        other => Err(Law::NoEcho.broken(&other)),
    }
}

fn nothing_is_lost_silently<P: Pair>(pair: &mut P) -> Result<(), Violation> {
    let mut accepted = 0;
    for number in 0..BURST {
        match send(pair, frame(0x123, number)) {
            Ok(()) => accepted += 1,
            Err(SendError::QueueFull { .. }) => break,
            Err(other) => return Err(Law::Losses.broken(&other)),
        }
    }
    pair.settle();
    let (received, lost) = drain(pair, End::B).map_err(|error| Law::Losses.broken(&error))?;
    if is_accounted_for(P::COUNTS_LOSSES, accepted, received.len() as u64, lost) {
        Ok(())
    } else {
        Err(Law::Losses.broken(&(accepted, received.len(), lost)))
    }
}

fn fd_frames_arrive_or_are_refused(pair: &mut impl Pair) -> Result<(), Violation> {
    for sent in fd_frames() {
        match send(pair, sent) {
            Ok(()) if pair.format().is_fd() => {}
            Err(SendError::NotFd { .. }) if !pair.format().is_fd() => continue,
            other => return Err(Law::Fd.broken(&(sent, other))),
        }
        pair.settle();
        let received = drain(pair, End::B).map_err(|error| Law::Fd.broken(&error))?;
        let is_it = matches!(&received, (frames, 0) if frames.len() == 1 && frames[0].frame == sent);
        if !is_it {
            return Err(Law::Fd.broken(&(sent, received)));
        }
    }
    Ok(())
}

/// Every length in both formats.
fn fd_frames() -> impl Iterator<Item = Frame> {
    let data: [u8; Frame::MAX_DATA] = std::array::from_fn(|index| index as u8);
    let id = CanId::standard(0x123).expect("an 11-bit identifier");
    [FrameFormat::Fd, FrameFormat::FdBitRateSwitch].into_iter().flat_map(move |format| {
        (0..=data.len()).filter_map(move |length| Frame::with_format(id, format, &data[..length]).ok())
    })
}

fn is_accounted_for(counts_losses: bool, accepted: u64, received: u64, lost: u64) -> bool {
    let accounted = received + lost;
    accounted == accepted || !counts_losses && lost > 0 && accounted < accepted
}

fn frame(id: u16, number: u32) -> Frame {
    let id = CanId::standard(id).expect("the checks use 11-bit identifiers");
    Frame::fixed(id, number.to_be_bytes())
}

fn send(pair: &mut impl Pair, frame: Frame) -> Result<(), SendError> {
    let now_ns = pair.now_ns();
    pair.end(End::A).send(now_ns, frame)
}

/// All frames that a port has received, and how many it reports as lost.
fn drain(pair: &mut impl Pair, end: End) -> Result<(Vec<Received>, u64), ReceiveError> {
    let now_ns = pair.now_ns();
    let mut port = pair.end(end);
    let (mut frames, mut lost_in_all) = (Vec::new(), 0);
    loop {
        match port.receive(now_ns) {
            Ok(Some(received)) => frames.push(received),
            Ok(None) => return Ok((frames, lost_in_all)),
            Err(ReceiveError::Overrun { lost }) => lost_in_all += lost,
            Err(other) => return Err(other),
        }
    }
}
