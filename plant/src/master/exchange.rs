//! The times of a cycle's exchange, and the state of each bus for the master.
//!
//! The times are those of SYNC, of the process data in answer, and of the master's heartbeat. The state covers bus-off,
//! unknown nodes, and turns for SDO. This module sends nothing.

use masseter_can::canopen::{NodeId, sync};
use masseter_can::wire::{INTERFRAME_BITS, frame_bits};
use masseter_can::{BitrateError, ErrorState, SendError};
use masseter_model::geometry::AXES;
use masseter_runtime::{clock::MILLISECOND_NS, messages::Reading, realtime::Wake};
use masseter_scenario::CanConfig;

/// Times of the present cycle.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Exchange {
    /// From the first to the last bit of SYNC, at which the drives sample.
    sync_frame_ns: u64,
    heartbeat_ns: u64,
    next_heartbeat_ns: u64,
    pub(super) wake: Wake,
    /// Time of the last SYNC of each bus at the tap.
    seen_sync_ns: Vec<u64>,
    /// Arrival of the cycle's last process data.
    complete_ns: u64,
}

impl Exchange {
    /// No cycle yet; the first heartbeat is due at `now_ns`.
    pub(super) fn new(can: &CanConfig, now_ns: u64) -> Result<Self, BitrateError> {
        let bitrate = can.bitrate()?;
        Ok(Self {
            sync_frame_ns: bitrate.bits_to_ns(frame_bits(&sync::frame()))
                - bitrate.bits_to_ns(INTERFRAME_BITS),
            heartbeat_ns: u64::from(can.heartbeat_producer_ms) * MILLISECOND_NS,
            next_heartbeat_ns: now_ns,
            wake: Wake::on_time(0, 0),
            seen_sync_ns: vec![0; can.buses.len()],
            complete_ns: 0,
        })
    }

    /// Begins a cycle with SYNC.
    pub(super) fn begin_cycle(&mut self, wake: Wake) {
        (self.wake, self.complete_ns) = (wake, 0);
    }

    /// Whether the cycle ends with a heartbeat; true once.
    pub(super) fn is_heartbeat_due(&mut self) -> bool {
        let is_due = self.wake.woke_ns >= self.next_heartbeat_ns;
        if is_due {
            self.next_heartbeat_ns = self.wake.woke_ns + self.heartbeat_ns;
        }
        is_due
    }

    /// When the drives sampled, ns: at the last bit of SYNC.
    pub(super) fn sampled_ns(&self) -> u64 {
        self.wake.woke_ns + self.sync_frame_ns
    }

    /// Process data of the cycle arrived.
    pub(super) fn note_process_data(&mut self, time_ns: u64) {
        self.complete_ns = self.complete_ns.max(time_ns);
    }

    /// Notes a SYNC on a wire. Only the first SYNC of a cycle counts: a repeated SYNC has its answers already.
    pub(super) fn note_sync(&mut self, bus: usize, time_ns: u64) {
        let seen_ns = &mut self.seen_sync_ns[bus];
        if *seen_ns < self.wake.woke_ns {
            *seen_ns = time_ns;
        }
    }

    /// The time after which process data of a bus answer this cycle's SYNC. Process data of an earlier cycle may come
    /// late, even between the queueing of this SYNC and its transmission.
    pub(super) fn answered_after_ns(&self, bus: usize) -> u64 {
        self.wake.woke_ns.max(self.seen_sync_ns[bus])
    }

    /// Writes the cycle and its times.
    pub(super) fn fill_reading(&self, reading: &mut Reading) {
        let Wake { cycle, due_ns, woke_ns, skipped, account, .. } = self.wake;
        reading.sampled_ns = self.sampled_ns();
        (reading.cycle, reading.due_ns, reading.woke_ns) = (cycle, due_ns, woke_ns);
        reading.complete_ns = self.complete_ns;
        reading.skipped_cycles = skipped;
        reading.stalled_ns = account.stalled_ns;
        reading.spun_ns = account.spun_ns;
        reading.worked_ns = account.worked_ns;
        reading.overlong_ns = account.overlong_ns;
    }
}

/// Memory of a bus.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct BusMonitor {
    /// Whether the master's controller is in bus-off.
    pub(super) is_off: bool,
    /// Whether frames wait that are older than two cycles: new ones behind them would go out in a burst. Frames of the last
    /// cycle may wait, since an adapter on USB reports its sent frames late.
    pub(super) is_stuck: bool,
    /// Frames handed over since the last SYNC, that one included, and in the cycle before.
    handed_over: [u32; 2],
    /// Whether any drive was ever received.
    pub(super) has_drives: bool,
    /// The axis whose SDO request was sent last.
    pub(super) last_served: usize,
    /// Nodes reported as unknown, bit i for node i.
    unknown_nodes: u128,
}

impl BusMonitor {
    /// Takes the error state of the master's controller; returns whether the bus is off, once after a change.
    pub(super) fn set_error_state(&mut self, state: ErrorState) -> Option<bool> {
        let is_off = state == ErrorState::BusOff;
        (std::mem::replace(&mut self.is_off, is_off) != is_off).then_some(is_off)
    }

    /// Takes before a SYNC how many frames wait; returns whether the bus gets stuck. A stuck bus gets no frames until all
    /// old ones are sent.
    pub(super) fn note_unsent(&mut self, unsent: usize) -> bool {
        let was_stuck = self.is_stuck;
        let [last, before] = self.handed_over;
        self.is_stuck = unsent > if was_stuck { 0 } else { (last + before) as usize };
        self.handed_over = [0, last];
        self.is_stuck && !was_stuck
    }

    /// Notes a frame that the bus took.
    pub(super) fn note_handed_over(&mut self) {
        self.handed_over[0] += 1;
    }

    /// The axes in the order of their turns for SDO.
    pub(super) fn turns(self) -> impl Iterator<Item = usize> {
        (1..=AXES).map(move |step| (self.last_served + step) % AXES)
    }

    /// Whether an unknown node is received for the first time.
    pub(super) fn is_new_unknown(&mut self, id: NodeId) -> bool {
        let bit = 1 << id.get();
        let is_new = self.unknown_nodes & bit == 0;
        self.unknown_nodes |= bit;
        is_new
    }

    /// Whether a refusal to send needs a report. Bus-off has its own report. Before the power-on of the drives nobody
    /// acknowledges, so the queue fills up.
    pub(super) fn is_unexplained(self, refusal: &SendError) -> bool {
        match refusal {
            SendError::BusOff { .. } => false,
            SendError::QueueFull { .. } => self.has_drives,
            SendError::Os { .. } => true,
        }
    }
}

#[cfg(test)]
mod exchange_tests {
    use masseter_scenario::Scenario;

    use super::*;

    #[test]
    fn process_data_answer_the_first_sync_that_is_seen_in_a_cycle() {
        let can = Scenario::default().can;
        let mut exchange = Exchange::new(&can, 1000).unwrap();
        exchange.begin_cycle(Wake::on_time(1, 999));
        assert!(!exchange.is_heartbeat_due(), "the first heartbeat is due at 1000");
        exchange.begin_cycle(Wake::on_time(2, 1000));
        assert!(exchange.is_heartbeat_due() && !exchange.is_heartbeat_due());
        assert_eq!([0, 1].map(|bus| exchange.answered_after_ns(bus)), [1000, 1000]);
        exchange.note_sync(1, 1200);
        exchange.note_sync(1, 1700);
        assert_eq!([0, 1].map(|bus| exchange.answered_after_ns(bus)), [1000, 1200]);
        let next_ns = 1000 + u64::from(can.heartbeat_producer_ms) * MILLISECOND_NS;
        exchange.begin_cycle(Wake::on_time(3, next_ns - 1));
        assert!(!exchange.is_heartbeat_due());
        exchange.begin_cycle(Wake::on_time(4, next_ns));
        assert!(exchange.is_heartbeat_due());
        assert_eq!((exchange.wake.cycle, exchange.wake.woke_ns), (4, next_ns));
        // A SYNC seen at the very time it was sent is this cycle's.
        exchange.note_sync(0, next_ns);
        exchange.note_sync(0, next_ns + 5);
        assert_eq!(exchange.answered_after_ns(0), next_ns);
    }

    #[test]
    fn a_reading_has_the_times_of_its_cycle() {
        let mut exchange = Exchange::new(&Scenario::default().can, 0).unwrap();
        let mut wake = Wake::on_time(7, 5000);
        (wake.due_ns, wake.skipped) = (4000, 3);
        exchange.begin_cycle(wake);
        exchange.note_process_data(9000);
        exchange.note_process_data(8000);
        let mut reading = Reading::default();
        exchange.fill_reading(&mut reading);
        let Reading { cycle, due_ns, woke_ns, skipped_cycles, complete_ns, .. } = reading;
        assert_eq!((cycle, due_ns, woke_ns, skipped_cycles, complete_ns), (7, 4000, 5000, 3, 9000));
        // SYNC without data at 1 Mbit/s: 44 bits and 4 stuff bits, at whose last the drives sample.
        assert_eq!(reading.sampled_ns - 5000, 48_000);
        exchange.begin_cycle(Wake::on_time(8, 6000));
        exchange.fill_reading(&mut reading);
        assert_eq!(reading.complete_ns, 0);
    }
}

#[cfg(test)]
mod bus_monitor_tests {
    use super::*;

    #[test]
    fn a_bus_reports_each_change_once_and_each_stranger_once() {
        let mut bus = BusMonitor::default();
        let states = [
            (ErrorState::Active, None, false),
            (ErrorState::Passive, None, false),
            (ErrorState::BusOff, Some(true), true),
            (ErrorState::BusOff, None, true),
            (ErrorState::Passive, Some(false), false),
            (ErrorState::Active, None, false),
        ];
        for (state, change, is_off) in states {
            assert_eq!(bus.set_error_state(state), change, "{state:?}");
            assert_eq!(bus.is_off, is_off);
        }
        let strangers = [1, 2, 127, 1, 127, 1, 3, 2].map(|id| bus.is_new_unknown(NodeId::new(id).unwrap()));
        assert_eq!(strangers, [true, true, true, false, false, false, true, false]);
    }

    /// Four frames a cycle, and how many of them wait at each SYNC.
    #[test]
    fn a_bus_is_stuck_while_frames_wait_that_are_older_than_two_cycles() {
        let states = |unsent: &[usize]| {
            let mut bus = BusMonitor::default();
            let mut state = |&unsent: &usize| {
                let begins = bus.note_unsent(unsent);
                if !bus.is_stuck {
                    (0..4).for_each(|_| bus.note_handed_over());
                }
                (begins, bus.is_stuck)
            };
            unsent.iter().map(&mut state).collect::<Vec<_>>()
        };
        assert_eq!(
            states(&[0, 3, 4, 7, 8, 8, 0]),
            [(false, false); 7],
            "an adapter that tells late what it has sent"
        );
        let (free, begins, stuck) = ((false, false), (true, true), (false, true));
        assert_eq!(states(&[0, 3, 7, 11, 11, 2, 0, 4]), [free, free, free, begins, stuck, stuck, free, free]);
    }

    #[test]
    fn a_refusal_to_send_is_explained_by_bus_off_or_by_drives_that_are_not_there_yet() {
        let mut bus = BusMonitor::default();
        let refusals = [
            SendError::BusOff { tec: 256 },
            SendError::QueueFull { capacity: 9 },
            SendError::Os { errno: 100 },
        ];
        assert_eq!(refusals.each_ref().map(|refusal| bus.is_unexplained(refusal)), [false, false, true]);
        bus.has_drives = true;
        assert_eq!(refusals.each_ref().map(|refusal| bus.is_unexplained(refusal)), [false, true, true]);
    }

    #[test]
    fn the_axis_served_last_is_the_last_to_be_served_again() {
        let bus = BusMonitor { last_served: 3, ..BusMonitor::default() };
        assert_eq!(bus.turns().collect::<Vec<_>>(), [4, 5, 0, 1, 2, 3]);
    }
}
