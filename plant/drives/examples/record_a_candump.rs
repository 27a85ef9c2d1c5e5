//! The traffic of two drives from power-on, as a log of candump: `cargo run --example record_a_candump > boot.log`.

use std::error::Error;
use std::fmt::Write;

use masseter_can::canopen::{Nmt, NmtCommand, NmtTarget, NodeId, sync};
use masseter_can::{Bus, candump};
use masseter_drives::{DriveSettings, Stand};

const MILLISECOND_NS: u64 = 1_000_000;

fn record() -> Result<String, Box<dyn Error>> {
    let settings = [NodeId::new(4)?, NodeId::new(5)?].map(DriveSettings::new);
    let mut stand = Stand::new(&settings)?;
    stand.advance(25 * MILLISECOND_NS);
    let start = Nmt { command: NmtCommand::Start, target: NmtTarget::All };
    stand.master().send(25 * MILLISECOND_NS, start.frame())?;
    let mut log = String::new();
    for cycle in 26..30 {
        let now_ns = cycle * MILLISECOND_NS;
        stand.master().send(now_ns, sync::frame())?;
        stand.advance(now_ns + MILLISECOND_NS);
        while let Some(tapped) = stand.tap(now_ns + MILLISECOND_NS)? {
            candump::write(&mut log, "can0", &tapped)?;
            writeln!(log)?;
        }
    }
    Ok(log)
}

fn main() -> Result<(), Box<dyn Error>> {
    print!("{}", record()?);
    Ok(())
}

#[test]
fn the_log_begins_with_the_boot_up_messages_and_has_an_answer_of_each_drive_to_each_sync() {
    let log = record().unwrap();
    let mut ids = log.lines().map(|line| line.split([' ', '#']).nth(2).unwrap());
    assert_eq!(ids.by_ref().take(3).collect::<Vec<_>>(), ["704", "705", "000"]);
    assert_eq!(ids.collect::<Vec<_>>(), ["080", "184", "185"].repeat(4));
}
