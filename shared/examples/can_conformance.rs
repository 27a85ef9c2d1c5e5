//! Checks that two CAN interfaces on one wire keep the laws of the bus.
//!
//! `cargo run --release --example can_conformance -p masseter-shared -- can0 can1`. Nobody else may use the
//! wire meanwhile. Two ports of one virtual interface of the kernel do as well: `-- vcan0 vcan0`.

use std::error::Error;
use std::time::Duration;

use masseter_shared::can::conformance::{self, End, Pair};
use masseter_shared::can::{Bus, BusStatus, Frame, OpenError, ReceiveError, Received, SendError, SocketCan};
use masseter_shared::clock;

/// How often is looked whether all frames have arrived.
const LOOK: Duration = Duration::from_millis(1);
/// A frame that has not arrived after so many looks without any progress was lost.
const PATIENCE: u32 = 500;

/// Two ports, and two more to know when everything sent has left the one side and reached the other.
struct SocketPair {
    ends: [SocketCan; 2],
    sent: u64,
    watches: [Watch; 2],
}

/// Counts the frames that pass an interface.
struct Watch {
    port: SocketCan,
    seen: u64,
}

/// A port whose accepted frames are counted.
struct Counting<'a> {
    port: &'a mut SocketCan,
    sent: &'a mut u64,
}

impl SocketPair {
    fn open([a, b]: [&str; 2]) -> Result<Self, OpenError> {
        Ok(Self {
            ends: [SocketCan::open(a)?, SocketCan::open(b)?],
            sent: 0,
            watches: [Watch::open(a)?, Watch::open(b)?],
        })
    }
}

impl Watch {
    fn open(interface: &str) -> Result<Self, OpenError> {
        Ok(Self { port: SocketCan::open(interface)?, seen: 0 })
    }

    fn look(&mut self) -> u64 {
        loop {
            match self.port.receive(clock::now_ns()) {
                Ok(Some(_)) => self.seen += 1,
                Err(ReceiveError::Overrun { lost }) => self.seen += lost,
                Ok(None) | Err(_) => return self.seen,
            }
        }
    }
}

impl Bus for Counting<'_> {
    fn send(&mut self, now_ns: u64, frame: Frame) -> Result<(), SendError> {
        let result = self.port.send(now_ns, frame);
        *self.sent += u64::from(result.is_ok());
        result
    }

    fn receive(&mut self, now_ns: u64) -> Result<Option<Received>, ReceiveError> {
        self.port.receive(now_ns)
    }

    fn status(&self) -> BusStatus {
        self.port.status()
    }
}

impl Pair for SocketPair {
    const COUNTS_LOSSES: bool = false;

    fn end(&mut self, end: End) -> impl Bus {
        Counting { port: &mut self.ends[end as usize], sent: &mut self.sent }
    }

    fn now_ns(&self) -> u64 {
        clock::now_ns()
    }

    fn settle(&mut self) {
        let (mut before, mut idle_looks) = ([0; 2], 0);
        while before != [self.sent; 2] && idle_looks < PATIENCE {
            clock::sleep(LOOK);
            let seen = self.watches.each_mut().map(Watch::look);
            idle_looks = if seen == before { idle_looks + 1 } else { 0 };
            before = seen;
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let [a, b] = &arguments[..] else { return Err("usage: can_conformance INTERFACE INTERFACE".into()) };
    let pair = || SocketPair::open([a, b]).expect("interfaces that could be opened before");
    SocketPair::open([a, b])?;
    conformance::check(pair)?;
    println!("{a} and {b} keep the laws of the bus");
    Ok(())
}
