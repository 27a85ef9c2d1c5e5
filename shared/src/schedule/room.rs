//! The highest cycle rate that a CAN link allows. The reason why a rate does not fit is part of [`super::Misfit`].

use std::fmt;

/// The cycle rate that a link has room for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Room {
    /// The highest rate for which there is a time table, Hz; none where no rate is low enough.
    pub max_rate_hz: Option<u32>,
    /// The part of every cycle that the drives take to answer SYNC, ns.
    pub answer_ns: u64,
}

impl fmt::Display for Room {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.max_rate_hz {
            Some(rate_hz) => write!(f, "the highest rate_hz that fits is {rate_hz}")?,
            None => write!(f, "no rate_hz fits")?,
        }
        match self.answer_ns {
            0 => Ok(()),
            _ => write!(f, ", since can.answer_us takes {} µs of every cycle", self.answer_ns / 1000),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::SECOND_NS;
    use crate::config::{CanConfig, RATES_HZ};
    use crate::schedule::CycleSchedule;

    #[test]
    fn the_highest_rate_is_one_that_fits_and_the_next_does_not() {
        let one_bus = vec![vec![0, 1, 2, 3, 4, 5]];
        for can in [
            CanConfig::default(),
            CanConfig { answer_us: 10, ..Default::default() },
            CanConfig { buses: one_bus, ..Default::default() },
        ] {
            let highest_hz = Room::for_link(&can).unwrap().max_rate_hz.unwrap();
            let fits = |rate_hz: u32| CycleSchedule::new(&can, SECOND_NS / u64::from(rate_hz)).is_ok();
            assert!(fits(highest_hz) && !fits(highest_hz + 1), "{highest_hz} Hz: {can:?}");
        }
        let ideal = CanConfig { ideal: true, ..Default::default() };
        assert_eq!(Room::for_link(&ideal).unwrap().max_rate_hz, Some(*RATES_HZ.end()));
    }

    #[test]
    fn a_refusal_names_the_highest_rate_and_the_answer_time_of_slow_drives() {
        let slow = CanConfig { answer_us: 10, ..Default::default() };
        let refusal = |can, period_ns| CycleSchedule::new(can, period_ns).unwrap_err().to_string();
        let said = refusal(&slow, 1_000_000);
        assert!(
            said.ends_with(
                "the highest rate_hz that fits is 956, since can.answer_us takes 75 µs of every cycle"
            ),
            "{said}"
        );
        let said = refusal(&CanConfig::default(), 800_000);
        assert!(said.ends_with("the highest rate_hz that fits is 1030"), "{said}");
    }
}
