//! The suite accepts a bus that keeps the laws and catches each way of breaking one.

use std::collections::VecDeque;

use super::*;
use crate::bus::{BusStatus, ErrorState};

const CAPACITY: usize = 100;

/// What is wrong with a bus.
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

    fn settle(&mut self) {
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
}

#[test]
fn a_bus_without_flaw_passes() {
    assert_eq!(check(|| FlawedPair::new(Flaw::None)), Ok(()));
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
        assert_eq!(check(|| FlawedPair::new(flaw)).unwrap_err().law, law);
    }
    let violation = check_arbitration(|| FlawedPair::new(Flaw::SendsInOrderOfQueueing)).unwrap_err();
    assert!(violation.to_string().starts_with("of frames sent at once, the lowest identifier goes first: "));
}
