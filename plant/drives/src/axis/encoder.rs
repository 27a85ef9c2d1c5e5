//! The drive's inputs from its axis: the encoder's counts, the dictionary's zero in them, and the switches (60FDh).
//!
//! There are three zeros. The encoder counts from its own. An incremental drive counts from its place at switch-on. The
//! dictionary's positions count from the zero of homing.
//!
//! The limit switches close 1 mm before the ends of the stroke and stay closed beyond. The home switch is closed from 1 mm
//! below to 1 mm above the middle of the stroke. The mechanism's stops are 2 mm beyond the stroke.

/// Counts from one reference mark to the next; count 0 has a mark.
const MARK_PITCH: i32 = 2000;

/// The reference mark passed between two counts: a mark at `to` counts, one at `from` does not. Of several marks, the
/// nearest to `to`.
pub(super) fn mark_between(from: i32, to: i32) -> Option<i32> {
    let below = |count: i32| count.div_euclid(MARK_PITCH);
    // The next mark at or above; a count is never so near to the end of its range.
    let above = |count: i32| below(count.saturating_add(MARK_PITCH - 1));
    if below(to) > below(from) {
        Some(below(to) * MARK_PITCH)
    } else if above(to) < above(from) {
        Some(above(to) * MARK_PITCH)
    } else {
        None
    }
}

/// The output of an encoder at a position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// The shown position, m.
    pub shown_m: f64,
    /// The shown position without its noise, m. The distance to the shaft is an error that does not affect the brake.
    pub seen_m: f64,
}

impl Look {
    /// The output of an encoder without noise and error.
    pub fn exact(at_m: f64) -> Self {
        Self { shown_m: at_m, seen_m: at_m }
    }
}

/// The encoder with its last count.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Coordinates {
    increment_m: f64,
    pub(super) counts: i32,
    /// Whether the encoder counts from where it is at power-on.
    is_incremental: bool,
    /// The count at which an incremental encoder was switched on; 0 for an absolute one.
    start_counts: i32,
    /// Position of the encoder's zero in the dictionary.
    origin_increments: i32,
    /// Whether positions of the dictionary mean places of the machine.
    pub(super) is_referenced: bool,
}

impl Coordinates {
    /// An encoder with that increment (m) that is switched on at a position.
    pub(super) fn new(increment_m: f64, position_m: f64, is_incremental: bool) -> Self {
        let (counts, start_counts, origin_increments, is_referenced) = (0, 0, 0, false);
        let mut coordinates =
            Self { increment_m, counts, is_incremental, start_counts, origin_increments, is_referenced };
        coordinates.read(position_m);
        coordinates.restart();
        coordinates
    }

    /// Forgets the home position, as a restart does.
    pub(super) fn restart(&mut self) {
        self.start_counts = if self.is_incremental { self.counts } else { 0 };
        self.origin_increments = 0_i32.saturating_sub(self.start_counts);
        self.is_referenced = !self.is_incremental;
    }

    /// Reads the encoder; returns the count before and the new one.
    pub(super) fn read(&mut self, shown_m: f64) -> [i32; 2] {
        let counts = self.nearest(shown_m);
        [std::mem::replace(&mut self.counts, counts), counts]
    }

    /// The count nearest to a position (m), or the end of the counter's range; or the increments per second nearest to a
    /// velocity (m/s).
    pub(super) fn nearest(&self, position_m: f64) -> i32 {
        (position_m / self.increment_m).round() as i32
    }

    /// The position of the last count, m.
    pub(super) fn counted_m(&self) -> f64 {
        f64::from(self.counts) * self.increment_m
    }

    /// The last count as the drive shows it (6063h).
    pub(super) fn shown_counts(&self) -> i32 {
        self.counts.saturating_sub(self.start_counts)
    }

    /// Position actual value (6064h).
    pub(super) fn actual(&self) -> i32 {
        self.counts.saturating_add(self.origin_increments)
    }

    /// That count of the encoder is at that position of the dictionary from now on.
    pub(super) fn set_home(&mut self, counts: i32, position: i32) {
        self.origin_increments = 0_i32.saturating_sub(counts).saturating_add(position);
        self.is_referenced = true;
    }

    /// A position of the dictionary in the encoder's metres.
    pub(super) fn metres(&self, increments: i32) -> f64 {
        f64::from(increments.saturating_sub(self.origin_increments)) * self.increment_m
    }

    /// A position in the encoder's metres as the dictionary has it.
    pub(super) fn increments(&self, position_m: f64) -> i32 {
        self.nearest(position_m).saturating_add(self.origin_increments)
    }
}

/// From a limit switch to the end of the stroke, m.
const BEFORE_END_M: f64 = 1e-3;
/// From the middle of the stroke to the ends of the home switch's range, m.
const ABOUT_MIDDLE_M: f64 = 1e-3;

/// The switches of an axis.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(super) struct Switches {
    stroke_m: [f64; 2],
    /// Which limit switches are closed: the negative one, the positive one.
    pub(super) limits: [bool; 2],
    is_home: bool,
}

impl Switches {
    /// The switches of an axis with that stroke, which stands at a position.
    pub(super) fn new(stroke_m: [f64; 2], position_m: f64) -> Self {
        let mut switches = Self { stroke_m, limits: [false; 2], is_home: false };
        switches.look(position_m);
        switches
    }

    /// Takes the present position of the axis.
    pub(super) fn look(&mut self, position_m: f64) {
        let [low_m, high_m] = self.stroke_m;
        self.limits = [position_m <= low_m + BEFORE_END_M, position_m >= high_m - BEFORE_END_M];
        self.is_home = (position_m - f64::midpoint(low_m, high_m)).abs() <= ABOUT_MIDDLE_M;
    }

    /// Digital inputs (60FDh): bit 0 negative limit switch, bit 1 positive limit switch, bit 2 home switch.
    pub(super) fn inputs(&self) -> u32 {
        let [negative, positive] = self.limits.map(u32::from);
        negative | positive << 1 | u32::from(self.is_home) << 2
    }
}

#[cfg(test)]
mod encoder_tests {
    use super::*;

    #[test]
    fn a_mark_is_passed_in_either_direction_and_not_left_behind_twice() {
        let table = [
            (1999, 2000, Some(2000)),
            (1990, 2010, Some(2000)),
            (2000, 2010, None),
            (2010, 2000, Some(2000)),
            (2000, 1990, None),
            (-1, 1, Some(0)),
            (1, -1, Some(0)),
            (5, 5, None),
            (-2001, -1999, Some(-2000)),
        ];
        for (from, to, mark) in table {
            assert_eq!(mark_between(from, to), mark, "from {from} to {to}");
        }
    }
}

#[cfg(test)]
mod coordinates_tests {
    use super::*;

    fn coordinates(is_incremental: bool) -> Coordinates {
        Coordinates::new(1e-6, 0.27, is_incremental)
    }

    #[test]
    fn an_absolute_encoder_counts_from_its_own_zero_and_an_incremental_one_from_power_on() {
        for (is_incremental, expected) in [(false, 271_000), (true, 1000)] {
            let mut coordinates = coordinates(is_incremental);
            coordinates.read(0.271);
            assert_eq!([coordinates.actual(), coordinates.shown_counts()], [expected; 2]);
            assert_eq!(coordinates.is_referenced, !is_incremental);
            assert!((coordinates.metres(expected) - 0.271).abs() < 1e-9);
        }
    }

    #[test]
    fn a_position_is_off_by_half_an_increment_at_most() {
        let mut coordinates = coordinates(false);
        for step in 0..1000 {
            let position_m = 0.27 + f64::from(step) * 1.37e-7;
            coordinates.read(position_m);
            assert!((coordinates.counted_m() - position_m).abs() <= 0.5e-6 + 1e-15);
        }
    }

    #[test]
    fn home_gets_its_position_until_a_restart() {
        let mut coordinates = coordinates(true);
        coordinates.set_home(269_000, -50);
        assert_eq!((coordinates.actual(), coordinates.shown_counts()), (950, 0));
        assert!(coordinates.is_referenced);
        coordinates.restart();
        assert_eq!(coordinates.actual(), 0);
        assert!(!coordinates.is_referenced);
    }
}

#[cfg(test)]
mod switches_tests {
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
