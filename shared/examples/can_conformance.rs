//! Checks that two CAN interfaces on one wire keep the laws of the bus.
//!
//! `cargo run --release --example can_conformance -p masseter-shared -- can0 can1`. Nobody else may use the
//! wire meanwhile. Two ports of one virtual interface of the kernel do as well: `-- vcan0 vcan0`.

use std::error::Error;
use std::time::Duration;

use masseter_shared::can::conformance::{self, End, Pair};
use masseter_shared::can::{Bus, OpenError, ReceiveError, SocketCan};
use masseter_shared::clock;

/// A wire that was quiet for so long has nothing left to send.
const QUIET: Duration = Duration::from_millis(10);

/// Two ports, and a third that hears what the first has sent.
struct SocketPair {
    ends: [SocketCan; 2],
    echo: SocketCan,
}

impl SocketPair {
    fn open([a, b]: [&str; 2]) -> Result<Self, OpenError> {
        Ok(Self { ends: [SocketCan::open(a)?, SocketCan::open(b)?], echo: SocketCan::open(a)? })
    }
}

impl Pair for SocketPair {
    const COUNTS_LOSSES: bool = false;

    fn end(&mut self, end: End) -> impl Bus {
        &mut self.ends[end as usize]
    }

    fn now_ns(&self) -> u64 {
        clock::now_ns()
    }

    fn settle(&mut self) {
        let mut is_quiet = false;
        while !is_quiet {
            clock::sleep(QUIET);
            is_quiet = true;
            while matches!(
                self.echo.receive(clock::now_ns()),
                Ok(Some(_)) | Err(ReceiveError::Overrun { .. })
            ) {
                is_quiet = false;
            }
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
