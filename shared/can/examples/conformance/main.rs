//! Checks that two CAN interfaces on one wire keep the laws of the bus, through every wrapper of a port.
//!
//! `cargo run --release --example conformance -p masseter-can -- can0 can1`. No other program may use the wire at the
//! same time. Two ports of one virtual interface of the kernel work too: `-- vcan0 vcan0`.

use std::error::Error;
use std::time::Duration;

use laws::{End, Pair};
use masseter_can::{
    Bus, BusStatus, CanId, Frame, OpenError, PortFaults, ReceiveError, Received, SendError, SocketCan,
};
// For the tests of the laws.
#[cfg(test)]
use masseter_can::ErrorState;

#[allow(dead_code, reason = "two real interfaces may send by priority or in order")]
mod laws;

/// Interval of the checks whether all frames have arrived.
const LOOK: Duration = Duration::from_millis(1);
/// A frame is lost if it has not arrived after so many checks without progress.
const IDLE_LIMIT: u32 = 500;

/// Two ports under all wrappers, and two more that count the frames sent and arrived.
struct SocketPair {
    ends: [WrappedEnd; 2],
    watches: [Watch; 2],
}

/// A port under the fault injector, and the number of frames sent on it.
struct WrappedEnd {
    port: SocketCan,
    sent: u64,
    faults: PortFaults,
}

/// Counts the frames that a port takes.
struct Counted<'a, B> {
    bus: B,
    sent: &'a mut u64,
}

impl<B: Bus> Bus for Counted<'_, B> {
    fn send(&mut self, now_ns: u64, frame: Frame) -> Result<(), SendError> {
        self.bus.send(now_ns, frame).inspect(|()| *self.sent += 1)
    }

    fn receive(&mut self, now_ns: u64) -> Result<Option<Received>, ReceiveError> {
        self.bus.receive(now_ns)
    }

    fn status(&self) -> BusStatus {
        self.bus.status()
    }

    fn unsent(&self) -> usize {
        self.bus.unsent()
    }
}

/// Counts the frames that pass an interface.
struct Watch {
    port: SocketCan,
    seen: u64,
}

impl SocketPair {
    fn open([a, b]: [&str; 2]) -> Result<Self, OpenError> {
        Ok(Self {
            ends: [WrappedEnd::open(a)?, WrappedEnd::open(b)?],
            watches: [Watch::open(a)?, Watch::open(b)?],
        })
    }
}

impl WrappedEnd {
    fn open(interface: &str) -> Result<Self, OpenError> {
        Ok(Self {
            port: SocketCan::open(interface)?,
            sent: 0,
            faults: PortFaults::new(Vec::new(), 0, 1, None).expect("no fault needs a simulated wire"),
        })
    }

    fn wrapped(&mut self) -> impl Bus {
        Counted { bus: self.faults.over(&mut self.port), sent: &mut self.sent }
    }
}

impl Watch {
    fn open(interface: &str) -> Result<Self, OpenError> {
        Ok(Self { port: SocketCan::open(interface)?, seen: 0 })
    }

    fn look(&mut self) -> u64 {
        loop {
            match self.port.receive(SocketCan::now_ns()) {
                Ok(Some(_)) => self.seen += 1,
                Err(ReceiveError::Overrun { lost }) => self.seen += lost,
                Ok(None) | Err(_) => return self.seen,
            }
        }
    }
}

impl Pair for SocketPair {
    const COUNTS_LOSSES: bool = false;

    fn end(&mut self, end: End) -> impl Bus {
        self.ends[end as usize].wrapped()
    }

    fn now_ns(&self) -> u64 {
        SocketCan::now_ns()
    }

    fn wait_for_arrivals(&mut self) {
        let sent: u64 = self.ends.iter().map(|end| end.sent).sum();
        let (mut before, mut idle_looks) = ([0; 2], 0);
        while before != [sent; 2] && idle_looks < IDLE_LIMIT {
            std::thread::sleep(LOOK);
            let seen = self.watches.each_mut().map(Watch::look);
            idle_looks = if seen == before { idle_looks + 1 } else { 0 };
            before = seen;
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let arguments: Vec<_> = arguments.iter().map(String::as_str).collect();
    let [a, b] = arguments[..] else { return Err("usage: conformance INTERFACE INTERFACE".into()) };
    let pair = || SocketPair::open([a, b]).expect("interfaces that could be opened before");
    SocketPair::open([a, b])?;
    laws::check_every_law(pair)?;
    println!("{a} and {b} keep the laws of the bus:");
    for law in laws::Law::OF_EVERY_BUS {
        println!("  {law}");
    }
    Ok(())
}
