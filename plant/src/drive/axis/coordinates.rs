//! The encoder of an axis, and where the dictionary's zero lies in its counts.
//!
//! Three zeros differ. The encoder counts from its own; an incremental drive counts from where it was switched on; the
//! dictionary's positions count from the zero that homing has set.

use super::encoder::Encoder;

/// The encoder with its last count.
#[derive(Debug, Clone)]
pub(super) struct Coordinates {
    encoder: Encoder,
    counts: i32,
    /// Whether the encoder counts from where it is at power-on.
    is_incremental: bool,
    /// The count at which an incremental encoder was switched on; 0 for an absolute one.
    start_counts: i32,
    /// Position of the encoder's zero in the dictionary.
    origin_increments: i32,
    /// Whether positions of the dictionary mean places of the machine.
    is_referenced: bool,
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

    /// The encoder's last count.
    pub(super) fn counts(&self) -> i32 {
        self.counts
    }

    /// The last count as the drive shows it (6063h).
    pub(super) fn shown_counts(&self) -> i32 {
        self.counts.saturating_sub(self.start_counts)
    }

    /// Whether positions of the dictionary mean places of the machine: not before the homing of an incremental encoder.
    pub(super) fn is_referenced(&self) -> bool {
        self.is_referenced
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

    /// The last count in the encoder's metres.
    pub(super) fn read_m(&self) -> f64 {
        self.encoder.metres(self.counts)
    }

    /// A position of the dictionary in the encoder's metres.
    pub(super) fn metres(&self, increments: i32) -> f64 {
        self.encoder.metres(increments.saturating_sub(self.origin_increments))
    }

    /// A position in the encoder's metres as the dictionary has it.
    pub(super) fn increments(&self, position_m: f64) -> i32 {
        self.encoder.nearest(position_m).saturating_add(self.origin_increments)
    }

    /// A difference of positions, or a velocity, in increments.
    pub(super) fn difference(&self, difference_m: f64) -> i32 {
        self.encoder.nearest(difference_m)
    }
}

#[cfg(test)]
mod tests {
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
            assert_eq!(coordinates.is_referenced(), !is_incremental);
            assert!((coordinates.metres(expected) - 0.271).abs() < 1e-9);
        }
    }

    #[test]
    fn home_gets_its_position_until_a_restart() {
        let mut coordinates = coordinates(true);
        coordinates.set_home(269_000, -50);
        assert_eq!((coordinates.actual(), coordinates.shown_counts()), (950, 0));
        assert!(coordinates.is_referenced());
        coordinates.restart();
        assert_eq!(coordinates.actual(), 0);
        assert!(!coordinates.is_referenced());
    }
}
