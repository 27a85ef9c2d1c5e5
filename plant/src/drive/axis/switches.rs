//! Limit switches and home switch of an axis, as the digital inputs show them (60FDh).
//!
//! The limit switches close 1 mm before the ends of the stroke and stay closed beyond. The home switch is closed from 1 mm
//! below to 1 mm above the middle of the stroke. The mechanism's stops are 2 mm beyond the stroke.

/// From a limit switch to the end of the stroke, m.
const BEFORE_END_M: f64 = 1e-3;
/// From the middle of the stroke to the ends of the home switch's range, m.
const ABOUT_MIDDLE_M: f64 = 1e-3;

/// The switches of an axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Switches {
    stroke_m: [f64; 2],
    /// Which limit switches are closed: the negative one, the positive one.
    limits: [bool; 2],
    is_home: bool,
}

impl Switches {
    /// The switches of an axis with that stroke, which stands at a position.
    pub(super) fn new(stroke_m: [f64; 2], position_m: f64) -> Self {
        let mut switches = Self { stroke_m, limits: [false; 2], is_home: false };
        switches.look(position_m);
        switches
    }

    /// The axis is at a position now.
    pub(super) fn look(&mut self, position_m: f64) {
        let [low_m, high_m] = self.stroke_m;
        self.limits = [position_m <= low_m + BEFORE_END_M, position_m >= high_m - BEFORE_END_M];
        self.is_home = (position_m - f64::midpoint(low_m, high_m)).abs() <= ABOUT_MIDDLE_M;
    }

    /// Which limit switches are closed: the negative one, the positive one.
    pub(super) fn limits(&self) -> [bool; 2] {
        self.limits
    }

    /// Digital inputs (60FDh): bit 0 negative limit switch, bit 1 positive limit switch, bit 2 home switch.
    pub(super) fn inputs(&self) -> u32 {
        let [negative, positive] = self.limits.map(u32::from);
        negative | positive << 1 | u32::from(self.is_home) << 2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_switch_has_its_bit_and_its_place() {
        let mut switches = Switches::new([0.22, 0.36], 0.27);
        let table = [(0.2211, 0), (0.2209, 1), (0.21, 1), (0.3589, 0), (0.3591, 2), (0.2889, 0), (0.2895, 4)];
        for (position_m, inputs) in table {
            switches.look(position_m);
            assert_eq!(switches.inputs(), inputs, "{position_m} m");
        }
    }
}
