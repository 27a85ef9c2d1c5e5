//! What the view has seen of a run, and the figures that it shows.

use hdrhistogram::Histogram;
use masseter_can::Tapped;
use masseter_can::wire::{self, Rates};
use masseter_shared::clock::SECOND_NS;
use masseter_shared::messages::codes::ControllerState;
use masseter_shared::messages::tap;
use masseter_shared::messages::{FrameTap, Reading, State};
use nalgebra::Vector3;

use masseter_analysis::{Accumulator, MOVING};
use masseter_recording::{Recorded, Topic};

/// Upper ends of the classes of lateness, ns; what is later has a class of its own.
const CLASSES_NS: [u64; 5] = [1_000, 10_000, 100_000, 1_000_000, 10_000_000];
/// Names of the classes.
pub(super) const CLASS_NAMES: [&str; 6] = ["1 µs", "10 µs", "100 µs", "1 ms", "10 ms", "later"];
/// The longest lateness that is told from longer ones, ns.
const LATEST_NS: u64 = 10 * SECOND_NS;
/// Significant digits of a percentile.
const DIGITS: u8 = 2;

/// How late a loop woke.
#[derive(Debug)]
pub(super) struct Lateness {
    /// Since the run began, ns.
    pub of_run_ns: Histogram<u64>,
    /// By class, since the last picture.
    pub lately: [u64; CLASS_NAMES.len()],
}

impl Default for Lateness {
    fn default() -> Self {
        let of_run_ns = Histogram::new_with_max(LATEST_NS, DIGITS).expect("so many digits are allowed");
        Self { of_run_ns, lately: Default::default() }
    }
}

impl Lateness {
    fn take(&mut self, due_ns: u64, woke_ns: u64) {
        let late_ns = woke_ns.saturating_sub(due_ns);
        self.of_run_ns.saturating_record(late_ns);
        let class = CLASSES_NS.iter().position(|end_ns| late_ns < *end_ns).unwrap_or(CLASSES_NS.len());
        self.lately[class] += 1;
    }
}

/// What was seen of a run.
#[derive(Debug)]
pub(super) struct Seen {
    rates: Rates,
    pub state: State,
    pub reading: Reading,
    pub controller: Lateness,
    pub plant: Lateness,
    /// Distances of the estimated from the wanted platform while it was to be somewhere, mm.
    pub error_mm: Accumulator,
    /// Time that frames took on each bus since the last picture, ns.
    pub busy_ns: Vec<u64>,
    /// Last sequence number of each topic with one publisher.
    last: [u64; Topic::ALL.len()],
    /// Messages that the sequence numbers miss.
    pub missing: u64,
}

impl Seen {
    pub(super) fn new(rates: Rates) -> Self {
        Self {
            rates,
            state: State::default(),
            reading: Reading::default(),
            controller: Lateness::default(),
            plant: Lateness::default(),
            error_mm: Accumulator::default(),
            busy_ns: Vec::new(),
            last: [0; Topic::ALL.len()],
            missing: 0,
        }
    }

    /// Looks at a message.
    pub(super) fn take(&mut self, message: &Recorded) {
        // Several publishers number events, each its own.
        if !matches!(message, Recorded::Event(_)) {
            self.count(message.topic(), message.seq());
        }
        match message {
            Recorded::State(state) => self.state(state),
            Recorded::Reading(reading) => self.reading(reading),
            Recorded::Frame(frame) => self.frame(frame),
            _ => {}
        }
    }

    fn reading(&mut self, reading: &Reading) {
        self.plant.take(reading.due_ns, reading.woke_ns);
        self.reading = *reading;
    }

    fn state(&mut self, state: &State) {
        self.controller.take(state.due_ns, state.woke_ns);
        let is_fresh = state.reading_cycle > self.state.reading_cycle;
        self.state = *state;
        if is_fresh && self.controller_state().is_some_and(|state| MOVING.contains(&state)) {
            self.error_mm.add(self.error_now_mm());
        }
    }

    fn frame(&mut self, frame: &FrameTap) {
        if let (Ok(Tapped::Frame(received)), Ok(bus)) = (tap::decode(frame), tap::bus_of(frame)) {
            self.busy_ns.resize(self.busy_ns.len().max(bus + 1), 0);
            self.busy_ns[bus] += self.rates.duration_ns(wire::frame_bits(&received.frame));
        }
    }

    fn count(&mut self, topic: Topic, seq: u64) {
        let last = &mut self.last[topic as usize];
        self.missing += seq.saturating_sub(*last + 1);
        *last = seq;
    }

    /// Begins to count anew what is shown since the last picture.
    pub(super) fn forget_lately(&mut self) {
        self.controller.lately = Default::default();
        self.plant.lately = Default::default();
        self.busy_ns.fill(0);
    }

    /// Distance of the estimated from the wanted platform, mm.
    pub(super) fn error_now_mm(&self) -> f64 {
        let wanted = Vector3::from(self.state.desired_position_m);
        let found = Vector3::from(self.state.estimated_position_m);
        (wanted - found).norm() * 1e3
    }

    pub(super) fn controller_state(&self) -> Option<ControllerState> {
        ControllerState::try_from(self.state.controller_state).ok()
    }

    /// Cycles that either loop had to skip.
    pub(super) fn missed(&self) -> u64 {
        self.state.skipped_cycles + self.reading.skipped_cycles
    }
}
