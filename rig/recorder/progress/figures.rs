//! The figures of a run's progress, from the messages that the recorder receives.

use hdrhistogram::Histogram;
use masseter_analysis::{Accumulator, MOVING};
use masseter_can::{Bitrate, Tapped, wire};
use masseter_recording::{Recorded, Topic};
use masseter_shared::clock::SECOND_NS;
use masseter_shared::messages::codes::ControllerState;
use masseter_shared::messages::tap;
use masseter_shared::messages::{FrameTap, Reading, State};
use nalgebra::Vector3;

/// The largest wake-up latency of the histograms, ns; longer ones count as this.
const MAX_LATE_NS: u64 = 10 * SECOND_NS;
/// Significant digits of a percentile.
const DIGITS: u8 = 2;

#[derive(Debug)]
pub(super) struct ProgressFigures {
    bitrate: Bitrate,
    /// The newest state and reading.
    pub state: State,
    pub reading: Reading,
    /// Wake-up latencies of both loops, ns.
    pub controller_late_ns: Histogram<u64>,
    pub plant_late_ns: Histogram<u64>,
    /// Distances between desired and estimated position in moving states, mm.
    pub tracking_errors_mm: Accumulator,
    /// Time that frames took on each bus in the current interval, ns.
    pub busy_ns: Vec<u64>,
    /// Last sequence number of each topic with one publisher.
    last_seq: [u64; Topic::ALL.len()],
    /// Gaps in the sequence numbers.
    pub missing: u64,
}

impl ProgressFigures {
    pub(super) fn new(bitrate: Bitrate) -> Self {
        let histogram = || Histogram::new_with_max(MAX_LATE_NS, DIGITS).expect("the digits are in range");
        Self {
            bitrate,
            state: State::default(),
            reading: Reading::default(),
            controller_late_ns: histogram(),
            plant_late_ns: histogram(),
            tracking_errors_mm: Accumulator::default(),
            busy_ns: Vec::new(),
            last_seq: [0; Topic::ALL.len()],
            missing: 0,
        }
    }

    pub(super) fn add(&mut self, message: &Recorded) {
        // Events have several publishers, each with numbers of its own.
        if !matches!(message, Recorded::Event(_)) {
            self.count_missing(message.topic(), message.seq());
        }
        match message {
            Recorded::State(state) => self.add_state(state),
            Recorded::Reading(reading) => {
                self.plant_late_ns.saturating_record(reading.woke_ns.saturating_sub(reading.due_ns));
                self.reading = *reading;
            }
            Recorded::Frame(frame) => self.add_frame(frame),
            _ => {}
        }
    }

    fn add_state(&mut self, state: &State) {
        self.controller_late_ns.saturating_record(state.woke_ns.saturating_sub(state.due_ns));
        let is_fresh = state.reading_cycle > self.state.reading_cycle;
        self.state = *state;
        if is_fresh && self.controller_state().is_some_and(|state| MOVING.contains(&state)) {
            self.tracking_errors_mm.add(self.tracking_error_mm());
        }
    }

    fn add_frame(&mut self, frame: &FrameTap) {
        if let (Ok(Tapped::Frame(received)), Ok(bus)) = (tap::decode(frame), tap::bus_of(frame)) {
            self.busy_ns.resize(self.busy_ns.len().max(bus + 1), 0);
            self.busy_ns[bus] += self.bitrate.bits_to_ns(wire::frame_bits(&received.frame));
        }
    }

    fn count_missing(&mut self, topic: Topic, seq: u64) {
        let last = &mut self.last_seq[topic as usize];
        self.missing += seq.saturating_sub(*last + 1);
        *last = seq;
    }

    /// Begins a new interval for the load of the buses.
    pub(super) fn start_interval(&mut self) {
        self.busy_ns.fill(0);
    }

    /// Distance between desired and estimated position of the platform in the newest state, mm.
    pub(super) fn tracking_error_mm(&self) -> f64 {
        let desired = Vector3::from(self.state.desired_position_m);
        let estimated = Vector3::from(self.state.estimated_position_m);
        (desired - estimated).norm() * 1e3
    }

    pub(super) fn controller_state(&self) -> Option<ControllerState> {
        ControllerState::try_from(self.state.controller_state).ok()
    }

    /// Deadlines that either loop skipped.
    pub(super) fn missed_cycles(&self) -> u64 {
        self.state.skipped_cycles + self.reading.skipped_cycles
    }
}
