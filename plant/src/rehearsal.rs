//! A plant of the same scenario that goes through a cycle whenever the real one prepares for its next.
//!
//! A sleep costs a task the processor's knowledge of its way: caches and branch predictors serve whoever runs meanwhile.
//! What was gone through once since is fast again (ARCHITECTURE.md). Nothing of what this plant does is seen by
//! anybody. It shares nothing with the real one but the commands, lives in a time of its own, which goes faster, and
//! has none of the scenario's faults: one of them could stop it for good.

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
    /// The last that the real plant had: a cycle without one is rehearsed as if it came again.
    command: Option<Command>,
}

impl Rehearsal {
    /// A plant that is switched on at time 0; none where cycles are too long to be gone through twice.
    pub(crate) fn of(scenario: &Scenario, schedule: CycleSchedule) -> Result<Option<Self>, PlantError> {
        let period_ns = scenario.period_ns();
        if period_ns > LONGEST_PERIOD_NS {
            return Ok(None);
        }
        let faultless = Scenario { faults: Vec::new(), ..scenario.clone() };
        let plant = PlantCore::new(&faultless, 0)?;
        Ok(Some(Self { plant, schedule, period_ns, cycle: 0, command: None }))
    }

    /// Hears what the real plant is to do.
    pub(crate) fn hear(&mut self, command: &Command) {
        self.command = Some(*command);
    }

    /// Goes through its next cycle: from SYNC to the reading, which is returned, and the command's answer to it.
    pub(crate) fn play(&mut self) -> Result<Reading, PlantError> {
        let sync_ns = self.cycle * self.period_ns;
        self.cycle += 1;
        self.plant.begin_cycle(Wake::on_time(self.cycle, sync_ns))?;
        self.plant.collect(sync_ns + self.schedule.reading_by_ns)?;
        let mut reading = Reading::default();
        self.plant.fill_reading(&mut reading);
        drop(self.plant.drain_frames());
        self.plant.drain_events(&mut |_| ());
        self.plant.apply(sync_ns + self.schedule.command_by_ns, self.command.as_ref())?;
        Ok(reading)
    }
}

#[cfg(test)]
mod tests {
    use masseter_shared::config::{FaultConfig, FaultKindConfig};
    use masseter_shared::messages::codes::{DriveRequest, DriveState};

    use super::*;

    fn of(scenario: &Scenario) -> Option<Rehearsal> {
        let schedule = CycleSchedule::new(&scenario.can, scenario.period_ns()).unwrap();
        Rehearsal::of(scenario, schedule).unwrap()
    }

    fn at(rate_hz: u32) -> Option<Rehearsal> {
        of(&Scenario { rate_hz, ..Scenario::default() })
    }

    #[test]
    fn long_cycles_are_not_gone_through_twice() {
        assert!(at(500).is_some());
        assert!(at(499).is_none());
    }

    #[test]
    fn it_boots_moves_and_stays_enabled_without_new_commands_whatever_the_scenarios_faults() {
        let bus_off = FaultConfig {
            kind: FaultKindConfig::BusOff,
            bus: 0,
            from_s: 0.01,
            until_s: None,
            node: Some(1),
            id: None,
            probability: 1.0,
            count: None,
            delay_us: None,
        };
        let mut rehearsal = of(&Scenario { faults: vec![bus_off], ..Scenario::default() }).unwrap();
        let first = rehearsal.play().unwrap();
        let mut reading = first;
        for cycle in 1..500 {
            let target_m = reading.position_m.map(|position_m| position_m + 1e-5);
            let request = DriveRequest::Enable.code();
            rehearsal.hear(&Command { cycle, target_m, request, ..Command::default() });
            reading = rehearsal.play().unwrap();
        }
        assert!(reading.position_m.iter().zip(first.position_m).all(|(now_m, first_m)| *now_m > first_m));
        for _ in 0..500 {
            reading = rehearsal.play().unwrap();
        }
        assert_eq!(reading.drive_state, [DriveState::OperationEnabled.code(); 6]);
        assert_eq!((reading.fresh_axes, reading.master_fault), (0b11_1111, 0));
    }
}
