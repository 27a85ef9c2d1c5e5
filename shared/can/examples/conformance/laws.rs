//! The laws of every [`Bus`], as checks of an implementation. The library's tests check its buses with this file too.
//!
//! An implementation provides a [`Pair`]: two ports of one wire and a way to let time pass. The checks fetch with
//! [`Bus::receive`] only after [`Pair::wait_for_arrivals`]. Timing and fault confinement are not checked.

use std::error::Error;
use std::fmt;

use super::{Bus, CanId, Frame, ReceiveError, Received, SendError};

/// Frames sent at once by the check for losses: more than any sensible queue holds.
const BURST: u32 = 20_000;

/// A property of every bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Law {
    /// Every frame arrives once, unchanged and in order.
    Delivery,
    /// A port does not receive its own frames.
    NoEcho,
    /// Every lost frame is reported.
    Losses,
    /// On buses that send by priority, the smaller identifier goes first.
    Arbitration,
}

impl Law {
    /// The laws of every bus, in the order of the checks.
    pub(crate) const OF_EVERY_BUS: [Self; 3] = [Self::Delivery, Self::NoEcho, Self::Losses];

    fn check_one(self, pair: &mut impl Pair) -> Result<(), Violation> {
        let observed = match self {
            Self::Delivery => frames_arrive_once_unchanged_and_in_order(pair),
            Self::NoEcho => ports_do_not_receive_their_own_frames(pair),
            Self::Losses => nothing_is_lost_silently(pair),
            Self::Arbitration => the_lowest_identifier_goes_first(pair),
        };
        observed.map_err(|observed| Violation { law: self, observed: observed.to_string() })
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
            Self::Arbitration => "of frames sent at once, the lowest identifier goes first",
        })
    }
}

/// One of the two ports.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum End {
    /// The first.
    A,
    /// The second.
    B,
}

/// Two new ports of one wire without other nodes.
pub(crate) trait Pair {
    /// Whether the ports count every lost frame. A real controller whose memory overflowed reports a loss, but
    /// not the number of frames.
    const COUNTS_LOSSES: bool = true;

    /// A port.
    fn end(&mut self, end: End) -> impl Bus;
    /// The time, ns.
    fn now_ns(&self) -> u64;
    /// Lets time pass until all frames sent have arrived or were lost.
    fn wait_for_arrivals(&mut self);
}

/// A broken law.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{law}: {observed}")]
pub(crate) struct Violation {
    /// The law.
    pub(crate) law: Law,
    /// The observation that breaks the law.
    pub(crate) observed: String,
}

/// Checks the laws of every bus, each on a pair of its own.
///
/// # Errors
/// The first [`Violation`].
pub(crate) fn check_every_law<P: Pair>(mut pair: impl FnMut() -> P) -> Result<(), Violation> {
    Law::OF_EVERY_BUS.into_iter().try_for_each(|law| law.check_one(&mut pair()))
}

/// Checks the law of buses that send by priority. A virtual CAN interface of the kernel sends in order instead.
///
/// # Errors
/// The [`Violation`].
pub(crate) fn check_arbitration<P: Pair>(mut pair: impl FnMut() -> P) -> Result<(), Violation> {
    Law::Arbitration.check_one(&mut pair())
}

/// The observation that breaks a law: an error of the port, or frames that should not be.
type Checked = Result<(), Box<dyn Error>>;

fn unless(holds: bool, observed: &impl fmt::Debug) -> Checked {
    if holds { Ok(()) } else { Err(format!("{observed:?}").into()) }
}

fn the_lowest_identifier_goes_first(pair: &mut impl Pair) -> Checked {
    for id in [0x7FF, 0x181, 0x080] {
        send(pair, frame(id, 0))?;
    }
    pair.wait_for_arrivals();
    let (received, _) = drain(pair, End::B)?;
    let ids: Vec<_> = received.iter().map(|received| received.frame.id()).collect();
    unless(ids.is_sorted() && ids.len() == 3, &ids)
}

fn frames_arrive_once_unchanged_and_in_order(pair: &mut impl Pair) -> Checked {
    let mut last_ns = 0;
    for number in 0..=u32::from(u8::MAX) {
        let sent = frame(0x100 + (number % 7) as u16, number);
        send(pair, sent)?;
        pair.wait_for_arrivals();
        let (received, lost) = drain(pair, End::B)?;
        let is_it = |received: &Received| received.frame == sent && received.time_ns >= last_ns;
        unless(received.len() == 1 && is_it(&received[0]) && lost == 0, &(sent, &received, lost))?;
        last_ns = received[0].time_ns;
    }
    Ok(())
}

fn ports_do_not_receive_their_own_frames(pair: &mut impl Pair) -> Checked {
    send(pair, frame(0x123, 0))?;
    pair.wait_for_arrivals();
    let (received, lost) = drain(pair, End::A)?;
    unless(received.is_empty() && lost == 0, &(received, lost))
}

fn nothing_is_lost_silently<P: Pair>(pair: &mut P) -> Checked {
    let mut accepted = 0;
    for number in 0..BURST {
        match send(pair, frame(0x123, number)) {
            Ok(()) => accepted += 1,
            Err(SendError::QueueFull { .. }) => break,
            Err(other) => return Err(other.into()),
        }
    }
    pair.wait_for_arrivals();
    let (received, lost) = drain(pair, End::B)?;
    let received = received.len() as u64;
    let is_accounted_for = is_accounted_for(P::COUNTS_LOSSES, accepted, received, lost);
    unless(is_accounted_for, &(accepted, received, lost))
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

/// All received frames of a port, and the reported number of lost frames.
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

#[cfg(test)]
mod tests {
    //! The suite accepts a bus that keeps the laws and catches each way of breaking one.

    use std::collections::VecDeque;

    use super::*;
    use crate::{BusStatus, ErrorState};

    const CAPACITY: usize = 100;

    /// A defect of a bus.
    #[derive(Clone, Copy, PartialEq)]
    enum Flaw {
        None,
        Echoes,
        Duplicates,
        AltersData,
        TurnsTimeBack,
        DropsSilently,
        SendsInOrderOfQueueing,
    }

    /// Two ports that hand frames over at once; only end A sends.
    struct FlawedPair {
        flaw: Flaw,
        arrived: [VecDeque<Received>; 2],
        now_ns: u64,
    }

    struct FlawedPort<'a> {
        pair: &'a mut FlawedPair,
        end: End,
    }

    impl FlawedPair {
        fn new(flaw: Flaw) -> Self {
            Self { flaw, arrived: Default::default(), now_ns: 1000 }
        }

        fn hand_over(&mut self, frame: Frame) {
            let data = match self.flaw {
                Flaw::AltersData => &[0xFF],
                _ => frame.data(),
            };
            let frame = Frame::new(frame.id(), data).unwrap();
            let time_ns = if self.flaw == Flaw::TurnsTimeBack { u64::MAX - self.now_ns } else { self.now_ns };
            let [own, other] = &mut self.arrived;
            other.push_back(Received { frame, time_ns });
            if self.flaw == Flaw::Duplicates {
                other.push_back(Received { frame, time_ns });
            }
            if self.flaw == Flaw::Echoes {
                own.push_back(Received { frame, time_ns });
            }
            if self.flaw != Flaw::SendsInOrderOfQueueing {
                other.make_contiguous().sort_by_key(|received| received.frame.id());
            }
        }
    }

    impl Pair for FlawedPair {
        fn end(&mut self, end: End) -> impl Bus {
            FlawedPort { pair: self, end }
        }

        fn now_ns(&self) -> u64 {
            self.now_ns
        }

        fn wait_for_arrivals(&mut self) {
            self.now_ns += 1000;
        }
    }

    impl Bus for FlawedPort<'_> {
        fn send(&mut self, _: u64, frame: Frame) -> Result<(), SendError> {
            if self.pair.arrived[1].len() < CAPACITY {
                self.pair.hand_over(frame);
                return Ok(());
            }
            if self.pair.flaw == Flaw::DropsSilently {
                Ok(())
            } else {
                Err(SendError::QueueFull { capacity: CAPACITY })
            }
        }

        fn receive(&mut self, _: u64) -> Result<Option<Received>, ReceiveError> {
            Ok(self.pair.arrived[self.end as usize].pop_front())
        }

        fn status(&self) -> BusStatus {
            BusStatus { state: ErrorState::Active, tec: 0, rec: 0 }
        }

        fn unsent(&self) -> usize {
            self.pair.arrived[1].len()
        }
    }

    #[test]
    fn a_bus_without_flaw_passes() {
        assert_eq!(check_every_law(|| FlawedPair::new(Flaw::None)), Ok(()));
        assert_eq!(check_arbitration(|| FlawedPair::new(Flaw::None)), Ok(()));
    }

    #[test]
    fn a_controller_may_report_several_losses_as_one_but_not_none() {
        for (received, lost, real, counting) in [
            (12, 0, true, true),
            (10, 2, true, true),
            (10, 1, true, false),
            (10, 0, false, false),
            (13, 1, false, false),
        ] {
            assert_eq!(is_accounted_for(false, 12, received, lost), real, "{received} {lost}");
            assert_eq!(is_accounted_for(true, 12, received, lost), counting, "{received} {lost}");
        }
    }

    #[test]
    fn every_flaw_is_caught_by_the_law_it_breaks() {
        let table = [
            (Flaw::Echoes, Law::NoEcho),
            (Flaw::Duplicates, Law::Delivery),
            (Flaw::AltersData, Law::Delivery),
            (Flaw::TurnsTimeBack, Law::Delivery),
            (Flaw::DropsSilently, Law::Losses),
        ];
        for (flaw, law) in table {
            assert_eq!(check_every_law(|| FlawedPair::new(flaw)).unwrap_err().law, law);
        }
        let violation = check_arbitration(|| FlawedPair::new(Flaw::SendsInOrderOfQueueing)).unwrap_err();
        assert!(
            violation.to_string().starts_with("of frames sent at once, the lowest identifier goes first: ")
        );
    }
}
