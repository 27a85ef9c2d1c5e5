//! The time from SYNC to the process data of one drive, which is off: `can.answer_us` of a scenario.

use masseter_can::canopen::NmtCommand;
use masseter_runtime::clock::MILLISECOND_NS;

use super::line::Line;
use super::line_error::LineError;

/// How many SYNCs a drive answers.
const SYNCS: usize = 50;
/// Time that a node takes to become operational, ns.
const START_NS: u64 = 50 * MILLISECOND_NS;

/// The longest time from the end of a SYNC until the drive began to transmit its process data, ns; none where it left a
/// SYNC without an answer. The drive is operational meanwhile, and pre-operational before and after.
///
/// # Errors
/// [`LineError`] except those of transfers.
pub(super) fn longest_ns(line: &mut Line, axis: usize) -> Result<Option<u64>, LineError> {
    line.command(axis, NmtCommand::Start)?;
    line.listen(START_NS)?;
    let answers = (0..SYNCS).map(|_| line.sync_answer_ns(axis)).collect::<Result<Option<Vec<_>>, _>>();
    line.command(axis, NmtCommand::EnterPreOperational)?;
    Ok(answers?.and_then(|answers| answers.into_iter().max()))
}

#[cfg(test)]
mod tests {
    use masseter_can::canopen::ObjectAddress;
    use masseter_scenario::Scenario;

    use super::*;
    use crate::bringup::test_log::Log;

    #[test]
    fn a_drive_answers_every_sync_and_gets_no_controlword() {
        let log = Log::default();
        let mut line = Line::open(&Scenario::default(), Box::new(log.clone())).unwrap();
        line.listen(100 * MILLISECOND_NS).unwrap();
        let found_ns = longest_ns(&mut line, 3).unwrap().unwrap();
        assert!(found_ns < 10_000, "emulated drives answer at once: {found_ns} ns");
        line.write(3, ObjectAddress::new(0x1800, 1), 0xC000_0184, 4).unwrap();
        assert_eq!(longest_ns(&mut line, 3).unwrap(), None, "TPDO1 is off");
        assert_eq!(log.controlwords(), []);
        let log = log.text();
        assert_eq!(
            (log.matches(" can1 184#").count(), log.matches(" can0 080#").count()),
            (SYNCS, 0),
            "{log}"
        );
    }
}
