//! The times of a cycle's exchange: SYNC, the process data that answer it, and the master's heartbeat.
//!
//! The exchange sends nothing. It computes what is due, and the time after which process data are an answer.

use masseter_can::BitrateError;
use masseter_can::canopen::sync;
use masseter_can::wire::{INTERFRAME_BITS, frame_bits};
use masseter_runtime::clock::MILLISECOND_NS;
use masseter_runtime::messages::Reading;
use masseter_runtime::realtime::Wake;
use masseter_scenario::CanConfig;

/// Times of the present cycle.
#[derive(Debug, Clone)]
pub(super) struct Exchange {
    /// From the first to the last bit of SYNC, at which the drives sample.
    sync_frame_ns: u64,
    heartbeat_ns: u64,
    next_heartbeat_ns: u64,
    wake: Wake,
    /// When the tap saw the last SYNC of each bus.
    seen_sync_ns: Vec<u64>,
    /// When the last process data of the cycle arrived.
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

    /// Begins a cycle with SYNC; returns whether the heartbeat is due too.
    pub(super) fn begin_cycle(&mut self, wake: Wake) -> bool {
        (self.wake, self.complete_ns) = (wake, 0);
        let is_due = wake.woke_ns >= self.next_heartbeat_ns;
        if is_due {
            self.next_heartbeat_ns = wake.woke_ns + self.heartbeat_ns;
        }
        is_due
    }

    /// The number of the cycle.
    pub(super) fn cycle(&self) -> u64 {
        self.wake.cycle
    }

    /// When the cycle began, ns.
    pub(super) fn woke_ns(&self) -> u64 {
        self.wake.woke_ns
    }

    /// When the drives sampled, ns: at the last bit of SYNC.
    pub(super) fn sampled_ns(&self) -> u64 {
        self.wake.woke_ns + self.sync_frame_ns
    }

    /// Process data of the cycle arrived.
    pub(super) fn note_process_data(&mut self, time_ns: u64) {
        self.complete_ns = self.complete_ns.max(time_ns);
    }

    /// A SYNC was seen on a wire. Only the first one of a cycle counts: a repeated one has its answers already.
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

#[cfg(test)]
mod tests {
    use masseter_scenario::Scenario;

    use super::*;

    #[test]
    fn process_data_answer_the_first_sync_that_is_seen_in_a_cycle() {
        let can = Scenario::default().can;
        let mut exchange = Exchange::new(&can, 1000).unwrap();
        assert!(!exchange.begin_cycle(Wake::on_time(1, 999)), "the first heartbeat is due at 1000");
        assert!(exchange.begin_cycle(Wake::on_time(2, 1000)));
        assert_eq!([0, 1].map(|bus| exchange.answered_after_ns(bus)), [1000, 1000]);
        exchange.note_sync(1, 1200);
        exchange.note_sync(1, 1700);
        assert_eq!([0, 1].map(|bus| exchange.answered_after_ns(bus)), [1000, 1200]);
        let next_ns = 1000 + u64::from(can.heartbeat_producer_ms) * MILLISECOND_NS;
        assert!(!exchange.begin_cycle(Wake::on_time(3, next_ns - 1)));
        assert!(exchange.begin_cycle(Wake::on_time(4, next_ns)));
        assert_eq!((exchange.cycle(), exchange.woke_ns()), (4, next_ns));
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
