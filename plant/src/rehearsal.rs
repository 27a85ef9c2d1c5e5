//! A plant of the same scenario that goes through every cycle shortly before the real one does.
//!
//! A sleep costs a task the processor's knowledge of its way: caches and branch predictors serve whoever runs meanwhile.
//! What was gone through once since is fast again (docs/realtime.md). Nothing of what this plant does is seen by
//! anybody, and it shares nothing with the real one.

use masseter_shared::config::Scenario;
use masseter_shared::messages::{Command, Reading};
use masseter_shared::realtime::Wake;
use masseter_shared::schedule::CycleSchedule;

use crate::core::{PlantCore, PlantError};

/// A longer cycle holds so many steps of the drives that going through it takes longer than it can save, ns.
const LONGEST_PERIOD_NS: u64 = 2_000_000;

/// The plant and its own time, in which every cycle comes when it is due.
#[derive(Debug)]
pub(crate) struct Rehearsal {
    plant: PlantCore,
    schedule: CycleSchedule,
    period_ns: u64,
    cycle: u64,
}

impl Rehearsal {
    /// A plant that is switched on at time 0; none where cycles are too long to be gone through twice.
    pub(crate) fn of(scenario: &Scenario, schedule: CycleSchedule) -> Result<Option<Self>, PlantError> {
        let period_ns = scenario.period_ns();
        if period_ns > LONGEST_PERIOD_NS {
            return Ok(None);
        }
        Ok(Some(Self { plant: PlantCore::new(scenario, 0)?, schedule, period_ns, cycle: 0 }))
    }

    /// Goes through its next cycle: from SYNC to the reading, which is returned, and `command` in answer to it.
    pub(crate) fn play(&mut self, command: Option<&Command>) -> Result<Reading, PlantError> {
        let sync_ns = self.cycle * self.period_ns;
        self.cycle += 1;
        self.plant.begin_cycle(Wake {
            cycle: self.cycle,
            due_ns: sync_ns,
            woke_ns: sync_ns,
            skipped: 0,
            stalled_ns: 0,
        })?;
        self.plant.collect(sync_ns + self.schedule.reading_by_ns)?;
        let mut reading = Reading::default();
        self.plant.fill_reading(&mut reading);
        self.plant.drain_frames(|_| ());
        self.plant.drain_events(&mut |_| ());
        self.plant.apply(sync_ns + self.schedule.command_by_ns, command)?;
        Ok(reading)
    }
}

#[cfg(test)]
mod tests {
    use masseter_shared::messages::codes::{DriveCondition, DriveRequest};

    use super::*;

    fn at(rate_hz: u32) -> Option<Rehearsal> {
        let scenario = Scenario { rate_hz, ..Scenario::default() };
        let schedule = CycleSchedule::new(&scenario.can, scenario.period_ns()).unwrap();
        Rehearsal::of(&scenario, schedule).unwrap()
    }

    #[test]
    fn long_cycles_are_not_gone_through_twice() {
        assert!(at(500).is_some());
        assert!(at(499).is_none());
    }

    #[test]
    fn it_goes_the_way_of_the_real_one_from_boot_to_motion() {
        let mut rehearsal = at(1000).unwrap();
        let mut reading = rehearsal.play(None).unwrap();
        for cycle in 1..500 {
            let command = Command {
                cycle,
                target_m: reading.position_m,
                request: DriveRequest::Enable.code(),
                ..Command::default()
            };
            reading = rehearsal.play(Some(&command)).unwrap();
        }
        assert_eq!(reading.drive_state, [DriveCondition::OperationEnabled.code(); 6]);
        assert_eq!((reading.fresh_axes, reading.master_fault), (0b11_1111, 0));
    }
}
