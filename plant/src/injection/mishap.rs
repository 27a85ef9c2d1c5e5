//! What happens to the emulated mechanism without a fault of the scenario, and the event that reports it.

use masseter_runtime::messages::Event;
use masseter_runtime::messages::codes::{Cause, EventKind, Source};

/// A piece of food that broke between the teeth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FoodBreak {
    /// FDI number of the first of the teeth on which the piece lay.
    pub tooth: u8,
    /// The piece's elastic force before, N.
    pub force_n: f64,
    /// Its strength, N.
    pub strength_n: f64,
}

/// A mishap of the mechanism.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mishap {
    /// Food broke.
    FoodBreak(FoodBreak),
    /// An axis ran into an end stop.
    EndStopHit {
        /// The axis.
        axis: usize,
        /// Its speed, m/s.
        speed_m_s: f64,
    },
}

impl Mishap {
    /// The event that reports it, at that time.
    pub(super) fn event(&self, time_ns: u64, cycle: u64) -> Event {
        let notice =
            |cause| Event { time_ns, cycle, ..Event::new(Source::Scenario, EventKind::Notice, cause) };
        match *self {
            Self::FoodBreak(FoodBreak { tooth, force_n, strength_n }) => {
                let event = notice(Cause::FoodBroke);
                Event { object: tooth.into(), value: force_n, limit: strength_n, ..event }
            }
            Self::EndStopHit { axis, speed_m_s } => {
                Event { axis: axis as u32, value: speed_m_s, ..notice(Cause::EndStopHit) }
            }
        }
    }
}
