//! The latest arrivals on a scenario's buses by the queue of the master's interface, with emergencies and SDO.
//!
//! The master queues SYNC at the begin of a cycle. RPDO1, an SDO request and the heartbeat follow in this order, at the latest
//! when the command is due. Drives send by priority. Two assumptions have no enforcement: answers of an SDO server
//! are at least a cycle apart, and emergencies of a drive [`EMERGENCIES_APART_NS`]. The plan has no NMT, and one booting drive at most. Runs are accepted by [`plans`](super::plans()) alone.

use std::collections::BTreeMap;
use std::fmt;

use masseter_can::canopen::{Cob, NodeId};
use masseter_can::{CanId, PeriodicMessage, Queue, QueuedMessage, Queueing, latest_arrivals};
use masseter_scenario::{CanConfig, MASTER_NODE, Scenario};
use serde::Serialize;

use super::{CycleSchedule, Drives, ScheduleError, messages_of};

/// The least time between two emergencies of a drive, ns. This is an assumption: no inhibit time (1015h) is set.
pub const EMERGENCIES_APART_NS: u64 = 100_000_000;
/// Data bytes of an emergency.
const EMERGENCY_LENGTH: u32 = 8;

/// The latest arrivals on one bus.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct QueuedPlan {
    /// Index of the bus in its link.
    pub bus: usize,
    /// The queue of the master's interface.
    pub queue: Queue,
    /// The messages, the most urgent first.
    pub rows: Vec<QueuedRow>,
}

/// The latest arrivals of one message, ns: cyclic messages from the begin of the cycle, others from their queueing. `None`
/// without a bound, or if the situation has no such message.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct QueuedRow {
    /// Its name in tables.
    pub name: String,
    /// Its identifier.
    pub id: String,
    /// The latest time at which it is of use, as in [`plans`](super::plans()); `None` for emergencies.
    pub deadline_ns: Option<u64>,
    /// With a queue by priority.
    pub priority_ns: Option<u64>,
    /// With a queue in order.
    pub fifo_ns: Option<u64>,
    /// By priority, with an emergency of every drive.
    pub priority_with_emergencies_ns: Option<u64>,
    /// In order, with an emergency of every drive.
    pub fifo_with_emergencies_ns: Option<u64>,
}

impl QueuedRow {
    /// Whether the message may miss its deadline behind a FIFO, without emergencies.
    pub fn is_late_in_fifo(&self) -> bool {
        self.deadline_ns.is_some_and(|deadline_ns| self.fifo_ns.is_none_or(|ns| ns > deadline_ns))
    }
}

/// The queue of the master's interface: a simulated wire takes the most urgent frame, the kernel the oldest.
pub fn master_queue(can: &CanConfig) -> Queue {
    if can.is_virtual() { Queue::Priority } else { Queue::Fifo }
}

/// The latest arrivals on every bus: with all drives running, and of SDO beside a booting drive.
///
/// # Errors
/// [`ScheduleError`] for a scenario without a schedule.
pub fn queued_plans(scenario: &Scenario) -> Result<Vec<QueuedPlan>, ScheduleError> {
    let command_by_ns = CycleSchedule::new(scenario)?.command_by_ns;
    let [running, booting] =
        [Drives::AllRun, Drives::OneBoots].map(|drives| messages_of(scenario, scenario.period_ns(), drives));
    let both = running?.into_iter().zip(booting?).enumerate();
    let plan = |(bus, (running, booting)): (usize, (Vec<_>, Vec<_>))| {
        // A message of both situations counts in that of all running drives.
        let column =
            |queue, has_emergencies| -> Result<BTreeMap<CanId, (String, Option<u64>)>, ScheduleError> {
                let mut column = BTreeMap::new();
                for messages in [&booting, &running] {
                    let messages = with_queueing(messages, command_by_ns, has_emergencies);
                    let bitrate = scenario.can.bitrate()?;
                    let latest = latest_arrivals(bitrate, scenario.period_ns(), &[queue], &messages)?;
                    column.extend(
                        latest.into_iter().map(|row| (row.message.id, (row.message.name, row.latest_ns))),
                    );
                }
                Ok(column)
            };
        let [priority, fifo] = [column(Queue::Priority, false)?, column(Queue::Fifo, false)?];
        let [priority_with, fifo_with] = [column(Queue::Priority, true)?, column(Queue::Fifo, true)?];
        let all = || running.iter().chain(&booting);
        let deadline_ns = |id| all().find(|message| message.id == id).map(|message| message.deadline_ns);
        let row = |(id, (name, priority_with_emergencies_ns)): (CanId, (String, Option<u64>))| {
            let of = |column: &BTreeMap<_, (String, Option<u64>)>| column.get(&id).and_then(|&(_, ns)| ns);
            QueuedRow {
                name,
                id: id.to_string(),
                deadline_ns: deadline_ns(id),
                priority_ns: of(&priority),
                fifo_ns: of(&fifo),
                priority_with_emergencies_ns,
                fifo_with_emergencies_ns: of(&fifo_with),
            }
        };
        let rows = priority_with.into_iter().map(row).collect();
        Ok(QueuedPlan { bus, queue: master_queue(&scenario.can), rows })
    };
    both.map(plan).collect()
}

/// The messages with their nodes, 0 for the master, and an emergency of each drive.
fn with_queueing(
    messages: &[PeriodicMessage],
    command_by_ns: u64,
    has_emergencies: bool,
) -> Vec<QueuedMessage> {
    let node = |node: NodeId| usize::from(node.get());
    let mut queued = Vec::new();
    for message in messages {
        let PeriodicMessage { name, id, data_length, period_ns, release, .. } = message.clone();
        let (node, queueing) = match Cob::try_from(id) {
            Ok(Cob::Sync) => (0, Queueing::By(0)),
            Ok(Cob::Rpdo1(_) | Cob::SdoRequest(_) | Cob::Heartbeat(MASTER_NODE)) => {
                (0, Queueing::By(command_by_ns))
            }
            Ok(
                Cob::Tpdo1(drive) | Cob::SdoResponse(drive) | Cob::Heartbeat(drive) | Cob::Emergency(drive),
            ) => (node(drive), release.map_or(Queueing::Apart(period_ns), Queueing::After)),
            Ok(Cob::Nmt) | Err(_) => continue,
        };
        if let Ok(Cob::Heartbeat(drive)) = Cob::try_from(id)
            && drive != MASTER_NODE
            && has_emergencies
        {
            let (name, id) = (format!("EMCY {}", drive.get()), Cob::Emergency(drive).into());
            let queueing = Queueing::Apart(EMERGENCIES_APART_NS);
            queued.push(QueuedMessage { name, id, data_length: EMERGENCY_LENGTH, node, queueing });
        }
        queued.push(QueuedMessage { name, id, data_length, node, queueing });
    }
    queued
}

impl fmt::Display for QueuedPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { bus, queue, rows } = self;
        writeln!(f, "bus {bus}: latest arrivals, µs; the queue of the master's interface is {queue}")?;
        writeln!(f, "  {:<19} {:>21} {:>21}", "", "without emergencies", "with emergencies")?;
        let (priority, fifo) = ("priority", "FIFO");
        write!(f, "  {:<14} {:>4} {priority:>11} {fifo:>9} {priority:>11} {fifo:>9}", "message", "id")?;
        let us = |ns: Option<u64>| ns.map_or_else(|| "-".to_owned(), |ns| format!("{:.1}", ns as f64 / 1e3));
        for row in rows {
            let [priority, fifo] = [row.priority_ns, row.fifo_ns].map(us);
            let with_emergencies = [row.priority_with_emergencies_ns, row.fifo_with_emergencies_ns].map(us);
            let [priority_with, fifo_with] = with_emergencies;
            let QueuedRow { name, id, .. } = row;
            write!(f, "\n  {name:<14} {id:>4} {priority:>11} {fifo:>9} {priority_with:>11} {fifo_with:>9}")?;
            if row.is_late_in_fifo() {
                write!(f, "  too late in a FIFO")?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schedule::Room;

    fn bus(rate_hz: u32) -> QueuedPlan {
        let scenario = Scenario { rate_hz, ..Scenario::default() };
        queued_plans(&scenario).unwrap().swap_remove(0)
    }

    fn fifo_us(plan: &QueuedPlan, name: &str) -> u64 {
        plan.rows.iter().find(|row| row.name == name).unwrap().fifo_ns.unwrap() / 1000
    }

    #[test]
    fn the_default_buses_hold_a_kilohertz_behind_a_fifo_too() {
        let plan = bus(1000);
        assert!(!plan.rows.iter().any(QueuedRow::is_late_in_fifo), "{plan}");
        // The command of the last cycle comes at the last moment, and all nodes send their heartbeats then.
        assert_eq!(fifo_us(&plan, "SYNC"), 590 + 3 * 115 + 4 * 65 - 1000 + 55);
        assert_eq!(fifo_us(&plan, "RPDO1 3"), 590 + 65 + 3 * 115);
    }

    /// Their schedule has room for one heartbeat.
    #[test]
    fn at_the_highest_rate_only_heartbeats_that_meet_delay_a_command_beyond_its_cycle() {
        let highest_hz = Room::for_link(&Scenario::default()).unwrap().max_rate_hz.unwrap();
        let plan = bus(highest_hz);
        let late: Vec<_> =
            plan.rows.iter().filter(|row| row.is_late_in_fifo()).map(|row| &row.name[..]).collect();
        assert_eq!(late, ["RPDO1 3"], "{plan}");
        assert!(fifo_us(&plan, "RPDO1 3") - 65 < 1_000_000 / u64::from(highest_hz), "{plan}");
        let shown = plan.to_string();
        assert_eq!(shown.matches("too late in a FIFO").count(), 1, "{shown}");
    }

    #[test]
    fn emergencies_and_sdo_have_bounds_and_delay_the_others() {
        let plan = bus(1000);
        let names: Vec<_> = plan.rows.iter().map(|row| &row.name[..]).collect();
        assert_eq!(names[..4], ["SYNC", "EMCY 1", "EMCY 2", "EMCY 3"]);
        for name in ["SDO request 1", "SDO response 1"] {
            assert!(names.contains(&name), "{names:?}");
        }
        for row in &plan.rows {
            let (fifo_ns, with_ns) = (row.fifo_ns, row.fifo_with_emergencies_ns.unwrap());
            assert_eq!(fifo_ns.is_none(), row.name.starts_with("EMCY"), "{row:?}");
            assert!(fifo_ns.is_none_or(|ns| ns < with_ns), "{row:?}");
        }
    }

    #[test]
    fn a_simulated_wire_has_a_queue_by_priority_and_the_kernel_one_in_order() {
        let mut can = CanConfig::default();
        assert_eq!(master_queue(&can), Queue::Priority);
        can.interfaces = vec!["can0".to_owned(), "can1".to_owned()];
        assert_eq!(master_queue(&can), Queue::Fifo);
    }
}
