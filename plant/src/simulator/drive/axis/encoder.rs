//! The encoder of an axis, where the dictionary's zero lies in its counts, and the switches (60FDh).
//!
//! There are three zeros. The encoder counts from its own. An incremental drive counts from where it was switched on.
//! The dictionary's positions count from the zero that homing has set.
//!
//! The limit switches close 1 mm before the ends of the stroke and stay closed beyond. The home switch is closed from 1 mm
//! below to 1 mm above the middle of the stroke. The mechanism's stops are 2 mm beyond the stroke.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

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

/// One axis' encoder.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct Encoder {
    resolution_m: f64,
    noise_m: f64,
    random: Pcg64Mcg,
}

impl Encoder {
    /// An encoder with its own stream of random numbers.
    pub(crate) fn new(resolution_m: f64, noise_m: f64, seed: u64, axis: usize) -> Self {
        // Odd multiples of the golden ratio keep the streams of neighbouring axes apart.
        let stream = seed ^ (axis as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        Self { resolution_m, noise_m, random: Pcg64Mcg::seed_from_u64(stream) }
    }

    /// The counts read at a true position; beyond the counter's range, its end.
    pub(crate) fn read(&mut self, position_m: f64) -> i32 {
        let noise: f64 = self.random.sample(StandardNormal);
        self.nearest(position_m + self.noise_m * noise)
    }

    /// The count nearest to a position (m); or the increments per second nearest to a velocity (m/s).
    pub(crate) fn nearest(&self, position_m: f64) -> i32 {
        (position_m / self.resolution_m).round() as i32
    }

    /// The position of a count, m.
    pub(crate) fn metres(&self, increments: i32) -> f64 {
        f64::from(increments) * self.resolution_m
    }
}

/// The encoder with its last count.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Coordinates {
    pub(super) encoder: Encoder,
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
    /// An encoder that is switched on at a position.
    pub(super) fn new(encoder: Encoder, position_m: f64, is_incremental: bool) -> Self {
        let counts = encoder.nearest(position_m);
        let mut coordinates = Self {
            encoder,
            counts,
            is_incremental,
            start_counts: 0,
            origin_increments: 0,
            is_referenced: false,
        };
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
    pub(super) fn read(&mut self, seen_m: f64) -> [i32; 2] {
        let before = std::mem::replace(&mut self.counts, self.encoder.read(seen_m));
        [before, self.counts]
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
        self.encoder.metres(increments.saturating_sub(self.origin_increments))
    }

    /// A position in the encoder's metres as the dictionary has it.
    pub(super) fn increments(&self, position_m: f64) -> i32 {
        self.encoder.nearest(position_m).saturating_add(self.origin_increments)
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

    /// The axis is at a position now.
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
    fn noise_has_the_declared_spread_and_no_bias() {
        let mut encoder = Encoder::new(1e-9, 1e-6, 3, 0);
        let errors: Vec<f64> = (0..20_000)
            .map(|_| {
                let counts = encoder.read(0.27);
                encoder.metres(counts) - 0.27
            })
            .collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let variance = errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / errors.len() as f64;
        assert!(mean.abs() < 3e-8, "{mean}");
        assert!((variance.sqrt() - 1e-6).abs() < 3e-8, "{}", variance.sqrt());
    }

    #[test]
    fn without_noise_a_position_is_off_by_half_an_increment_at_most() {
        let mut encoder = Encoder::new(1e-6, 0.0, 1, 0);
        for step in 0..1000 {
            let position_m = 0.27 + f64::from(step) * 1.37e-7;
            let counts = encoder.read(position_m);
            assert!((encoder.metres(counts) - position_m).abs() <= 0.5e-6 + 1e-15);
        }
    }

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

    #[test]
    fn axes_do_not_share_their_noise() {
        let read = |axis| {
            let mut encoder = Encoder::new(1e-9, 1e-6, 3, axis);
            [(); 8].map(|()| encoder.read(0.0))
        };
        assert_ne!(read(0), read(1));
        assert_eq!(read(1), read(1));
    }
}

#[cfg(test)]
mod coordinates_tests {
    use super::*;

    fn coordinates(is_incremental: bool) -> Coordinates {
        Coordinates::new(Encoder::new(1e-6, 0.0, 1, 0), 0.27, is_incremental)
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
