//! Which reading the controller received in each recorded cycle.
//!
//! A state names the last complete reading that was used, and when the wait for a reading ended. A reading that moved the
//! former on was received. A complete one that did not was late, unless the controller refused it, which stops the jaw.
//! One that lacks an axis was received if it was published before the wait ended.

use std::collections::VecDeque;

use masseter_model::geometry::AXES;
use masseter_runtime::messages::codes::ControllerState;
use masseter_runtime::messages::{Reading, State};

use super::error::ReplayError;

/// Bits of a reading whose axes are all fresh.
const ALL_AXES: u32 = (1 << AXES) - 1;

/// The readings that the controller has not received yet.
#[derive(Debug, Default)]
pub(super) struct Deliveries {
    waiting: VecDeque<Reading>,
    published_ns: u64,
    /// The cycle of the last complete reading.
    used: u64,
}

impl Deliveries {
    /// Takes the next reading of the recording.
    pub(super) fn push(&mut self, reading: &Reading) {
        self.published_ns = reading.published_ns;
        self.waiting.push_back(*reading);
    }

    /// Whether every reading that was published until then is here.
    pub(super) fn know_all_until(&self, time_ns: u64) -> bool {
        self.published_ns > time_ns
    }

    /// The reading that the controller received in the cycle of this state; none if it received none.
    pub(super) fn take(&mut self, state: &State) -> Result<Option<Reading>, ReplayError> {
        let until = if state.reading_cycle > self.used {
            self.used = state.reading_cycle;
            let place = self.waiting.iter().position(|reading| reading.cycle == state.reading_cycle);
            let lost = ReplayError::NoReading { cycle: state.cycle, reading: state.reading_cycle };
            place.ok_or(lost)? + 1
        } else {
            let in_time = self.waiting.iter().take_while(|reading| reading.published_ns <= state.received_ns);
            let in_time = in_time.count();
            let is_refused = state.controller_state == ControllerState::SafeStop.code();
            let newest = in_time.checked_sub(1).map(|place| &self.waiting[place]);
            if newest.is_none_or(|newest| newest.fresh_axes == ALL_AXES && !is_refused) {
                return Ok(None);
            }
            in_time
        };
        Ok(self.waiting.drain(..until).next_back())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reading(cycle: u64, fresh_axes: u32) -> Reading {
        Reading { cycle, fresh_axes, published_ns: 1000 * cycle, ..Reading::default() }
    }

    fn state(cycle: u64, reading_cycle: u64, received_ns: u64) -> State {
        State { cycle, reading_cycle, received_ns, ..State::default() }
    }

    fn received(deliveries: &mut Deliveries, state: &State) -> Option<u64> {
        deliveries.take(state).unwrap().map(|reading| reading.cycle)
    }

    #[test]
    fn the_reading_that_a_state_used_was_received_and_those_before_it_were_not() {
        let mut deliveries = Deliveries::default();
        (1..=4).for_each(|cycle| deliveries.push(&reading(cycle, ALL_AXES)));
        assert_eq!(received(&mut deliveries, &state(1, 1, 1500)), Some(1));
        assert_eq!(received(&mut deliveries, &state(4, 4, 4500)), Some(4));
        assert!(deliveries.take(&state(5, 5, 5500)).is_err(), "it is not recorded");
    }

    #[test]
    fn a_complete_reading_that_was_not_used_was_late_unless_it_led_to_a_stop() {
        let mut deliveries = Deliveries::default();
        (1..=3).for_each(|cycle| deliveries.push(&reading(cycle, ALL_AXES)));
        assert_eq!(received(&mut deliveries, &state(1, 1, 1500)), Some(1));
        assert_eq!(received(&mut deliveries, &state(2, 1, 2000)), None);
        let stop = State { controller_state: ControllerState::SafeStop.code(), ..state(3, 1, 3500) };
        assert_eq!(received(&mut deliveries, &stop), Some(3));
    }

    #[test]
    fn a_reading_without_an_axis_was_received_if_it_was_published_in_time() {
        let mut deliveries = Deliveries::default();
        deliveries.push(&reading(1, 0b01_1111));
        assert_eq!(received(&mut deliveries, &state(1, 0, 999)), None);
        assert_eq!(received(&mut deliveries, &state(2, 0, 1000)), Some(1));
        assert_eq!(received(&mut deliveries, &state(3, 0, 3000)), None, "each is received once");
    }
}
