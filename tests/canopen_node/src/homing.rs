//! Homing (mode 6), as a simulation of its own: methods 35 and 37 take the present place, negative methods search a
//! mechanical stop, and all others go to the home switch.

use crate::axis::Axis;
use crate::dictionary::Dictionary;

/// Home position and the way from the switch to it, of vendor FBh; others have 607Ch.
const HOME_POSITION: (u16, u8) = (0x30B0, 0);
const HOME_MOVE: (u16, u8) = (0x30B1, 0);

/// How far homing is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Homing {
    Idle,
    /// On the way to a stop in that direction, or to the switch.
    Searching {
        direction: f64,
        is_stop: bool,
    },
    /// On the way from the switch to the home position.
    Leaving {
        goal: f64,
    },
    Attained,
    Failed,
}

impl Homing {
    /// Bits 10, 12 and 13 of the statusword.
    pub(crate) const fn bits(self) -> u16 {
        match self {
            Self::Idle => 1 << 10,
            Self::Searching { .. } | Self::Leaving { .. } => 0,
            Self::Attained => 1 << 10 | 1 << 12,
            Self::Failed => 1 << 10 | 1 << 13,
        }
    }

    /// The start of a search, with the place of the home switch and the speed of the search.
    pub(crate) fn start(dictionary: &Dictionary, axis: &mut Axis, home: f64, speed: f64, sign: f64) -> Self {
        let method = dictionary.number((0x6098, 0));
        match method {
            0 => Self::Failed,
            35 | 37 => {
                axis.redefine(reading(dictionary, sign));
                Self::Attained
            }
            _ if speed <= 0.0 => Self::Failed,
            // Odd methods search upwards.
            ..0 => Self::Searching { direction: if method % 2 == 0 { -1.0 } else { 1.0 }, is_stop: true },
            _ => Self::Searching { direction: (home - axis.actual()).signum(), is_stop: false },
        }
    }

    /// Moves the axis for some time.
    pub(crate) fn step(
        self,
        dictionary: &Dictionary,
        axis: &mut Axis,
        home: f64,
        speed: f64,
        sign: f64,
        dt_s: f64,
    ) -> Self {
        match self {
            Self::Searching { direction, is_stop } => {
                let goal = if is_stop { direction * f64::INFINITY } else { home };
                axis.approach(goal, speed, dt_s);
                let is_found = if is_stop { axis.pressing() != 0.0 } else { axis.is_at(home) };
                if !is_found {
                    return self;
                }
                axis.hold();
                Self::Leaving { goal: axis.actual() - direction * dictionary.number(HOME_MOVE) as f64 }
            }
            Self::Leaving { goal } => {
                axis.approach(goal, speed, dt_s);
                if !axis.is_at(goal) {
                    return self;
                }
                axis.redefine(reading(dictionary, sign));
                Self::Attained
            }
            resting => {
                axis.hold();
                resting
            }
        }
    }
}

/// 6064h at home. Makers differ in the sign of 607Ch; by the standard's wording it is negative.
fn reading(dictionary: &Dictionary, sign: f64) -> f64 {
    if dictionary.has(HOME_POSITION) {
        return dictionary.number(HOME_POSITION) as f64;
    }
    sign * dictionary.number((0x607C, 0)) as f64
}
