//! Faults of an encoder: the position that it sees instead of the true one.
//!
//! Each fault changes what the faults before it left, in the order in which they began. Randomness comes from the
//! scenario's seed. A fault has struck once it shows another position than the one that is there.

use std::collections::VecDeque;

use arrayvec::ArrayVec;
use masseter_model::geometry::AXES;
use masseter_runtime::clock::SECOND_NS;
use masseter_scenario::{EncoderFault, FaultConfig, Scenario};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// The number of kinds.
const KINDS: usize = 8;

/// The faults of one encoder.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct EncoderFaults {
    faults: ArrayVec<ActingFault, KINDS>,
    random: Pcg64Mcg,
    past: Past,
}

/// Positions that a slow interface has not shown yet.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
struct Past {
    /// Times (ns) and positions (m), the oldest first.
    positions: VecDeque<(u64, f64)>,
    /// Most positions. A clone of the queue has less room than the queue.
    room: usize,
}

/// One fault that acts.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct ActingFault {
    kind: EncoderFault,
    size: f64,
    /// Time (ns) and position (m) at which it began.
    from: Option<(u64, f64)>,
    has_struck: bool,
}

impl EncoderFaults {
    /// No faults yet, with room for the past of the slowest encoder that the scenario has on each axis.
    pub(crate) fn of_axes(scenario: &Scenario) -> [Self; AXES] {
        let durations_ns = [scenario.dynamics.step_ns, scenario.period_ns()];
        std::array::from_fn(|axis| {
            let delays = scenario.faults.iter().filter(|fault| fault.kind == EncoderFault::Delay.into());
            let of_axis = delays.filter(|fault| fault.axis() == Some(axis)).map(FaultConfig::size_si);
            let past = of_axis.reduce(f64::max).map_or(0, |delay_s| past_of(delay_s, durations_ns));
            Self::new(scenario.seed, axis, past)
        })
    }

    /// None yet, with the axis' own random numbers and room for so many past positions.
    fn new(seed: u64, axis: usize, past: usize) -> Self {
        // Odd multiples keep the streams of the axes apart from each other and from those of the encoders' own noise.
        let stream = seed ^ (axis as u64 + 1).wrapping_mul(0xD1B5_4A32_D192_ED03);
        let random = Pcg64Mcg::seed_from_u64(stream);
        let past = Past { positions: VecDeque::with_capacity(past), room: past };
        Self { faults: ArrayVec::new(), random, past }
    }

    /// A fault begins. One of its kind that acts already is replaced.
    pub(crate) fn begin(&mut self, kind: EncoderFault, size: f64) {
        self.end(kind);
        assert!(!self.faults.is_full(), "no room for {kind:?}: every kind acts once");
        self.faults.push(ActingFault { kind, size, from: None, has_struck: false });
    }

    /// A fault ends: the encoder sees the true position again.
    pub(crate) fn end(&mut self, kind: EncoderFault) {
        self.faults.retain(|fault| fault.kind != kind);
        if kind == EncoderFault::Delay {
            self.past.positions.clear();
        }
    }

    /// Whether the fault of that kind has shown a wrong position.
    pub(crate) fn has_struck(&self, kind: EncoderFault) -> bool {
        self.faults.iter().any(|fault| fault.kind == kind && fault.has_struck)
    }

    /// The position that the encoder sees at that time, m.
    #[inline]
    pub(crate) fn seen_m(&mut self, now_ns: u64, position_m: f64) -> f64 {
        let Self { faults, random, past } = self;
        faults.iter_mut().fold(position_m, |position_m, fault| {
            let seen_m = fault.seen_m(now_ns, position_m, random, past);
            fault.has_struck |= seen_m.to_bits() != position_m.to_bits();
            seen_m
        })
    }
}

impl ActingFault {
    fn seen_m(&mut self, now_ns: u64, position_m: f64, random: &mut Pcg64Mcg, past: &mut Past) -> f64 {
        let size = self.size;
        let (from_ns, from_m) = *self.from.get_or_insert((now_ns, position_m));
        match self.kind {
            EncoderFault::Stuck => from_m,
            EncoderFault::Offset => position_m + size,
            EncoderFault::Drift => {
                position_m + size * now_ns.saturating_sub(from_ns) as f64 / SECOND_NS as f64
            }
            EncoderFault::Noise => {
                let noise: f64 = random.sample(StandardNormal);
                position_m + size * noise
            }
            EncoderFault::Steps => (position_m / size).round() * size,
            EncoderFault::Sign => 2.0 * from_m - position_m,
            EncoderFault::Loses => from_m + (1.0 - size) * (position_m - from_m),
            EncoderFault::Delay => past.delayed_m(now_ns, (size * SECOND_NS as f64) as u64, position_m),
        }
    }
}

impl Past {
    /// The newest position that is as old as the delay; the oldest one before that.
    fn delayed_m(&mut self, now_ns: u64, delay_ns: u64, position_m: f64) -> f64 {
        let Self { positions, room } = self;
        if positions.len() < *room {
            positions.push_back((now_ns, position_m));
        }
        let is_old = |(time_ns, _): &(u64, f64)| time_ns.saturating_add(delay_ns) <= now_ns;
        while positions.len() > 1 && positions.get(1).is_some_and(is_old) {
            positions.pop_front();
        }
        positions.front().map_or(position_m, |(_, position_m)| *position_m)
    }
}

/// Room for the past of a delay of that many seconds, with steps and SYNCs of these durations, ns.
fn past_of(delay_s: f64, [step_ns, period_ns]: [u64; 2]) -> usize {
    let delay_ns = (delay_s * SECOND_NS as f64) as u64;
    // Jitter may bring SYNCs together.
    (delay_ns / step_ns + 2 * (delay_ns / period_ns) + 8) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// What an encoder sees of a shaft that moves from 100 mm on by 1 mm a millisecond, in µm.
    fn seen_um(kind: EncoderFault, size: f64) -> [i64; 4] {
        let mut faults = EncoderFaults::new(1, 0, 100);
        faults.begin(kind, size);
        [0, 1, 2, 3].map(|ms| {
            let seen_m = faults.seen_m(5 * MS + ms * MS, 0.1 + ms as f64 * 1e-3);
            (seen_m * 1e6).round() as i64
        })
    }

    #[test]
    fn each_kind_shows_what_its_name_says() {
        let table = [
            (EncoderFault::Stuck, 0.0, [100_000, 100_000, 100_000, 100_000]),
            (EncoderFault::Offset, 0.002, [102_000, 103_000, 104_000, 105_000]),
            (EncoderFault::Drift, -0.5, [100_000, 100_500, 101_000, 101_500]),
            (EncoderFault::Steps, 0.002, [100_000, 102_000, 102_000, 104_000]),
            (EncoderFault::Sign, 0.0, [100_000, 99_000, 98_000, 97_000]),
            (EncoderFault::Loses, 0.25, [100_000, 100_750, 101_500, 102_250]),
            (EncoderFault::Delay, 0.002, [100_000, 100_000, 100_000, 101_000]),
        ];
        for (kind, size, expected) in table {
            assert_eq!(seen_um(kind, size), expected, "{kind:?}");
        }
    }

    #[test]
    fn noise_has_the_declared_spread_and_the_seed_decides_it() {
        let noise = |seed, axis| {
            let mut faults = EncoderFaults::new(seed, axis, 0);
            faults.begin(EncoderFault::Noise, 1e-4);
            (0..10_000).map(|step| faults.seen_m(step, 0.0)).collect::<Vec<f64>>()
        };
        let errors_m = noise(3, 0);
        let variance = errors_m.iter().map(|m| m * m).sum::<f64>() / errors_m.len() as f64;
        assert!((variance.sqrt() / 1e-4 - 1.0).abs() < 0.03, "{}", variance.sqrt());
        assert_eq!(errors_m, noise(3, 0));
        assert_ne!(errors_m, noise(3, 1));
        assert_ne!(errors_m, noise(4, 0));
    }

    #[test]
    fn a_fault_strikes_once_it_shows_a_wrong_position_and_ends_with_the_true_one() {
        let mut faults = EncoderFaults::new(1, 0, 0);
        faults.begin(EncoderFault::Sign, 0.0);
        faults.seen_m(0, 0.1);
        assert!(!faults.has_struck(EncoderFault::Sign), "it stands");
        faults.seen_m(1, 0.101);
        assert!(faults.has_struck(EncoderFault::Sign));
        faults.end(EncoderFault::Sign);
        assert_eq!(faults.seen_m(2, 0.102).to_bits(), 0.102_f64.to_bits());
    }

    #[test]
    fn faults_add_up_in_the_order_in_which_they_began() {
        let mut faults = EncoderFaults::new(1, 0, 0);
        faults.begin(EncoderFault::Offset, 0.0004);
        faults.begin(EncoderFault::Steps, 0.001);
        assert!((faults.seen_m(0, 0.1002) - 0.101).abs() < 1e-12);
    }
}
