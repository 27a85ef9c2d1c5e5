//! The encoder of an axis: its noise, and the effect of faults on its position.
//!
//! A fault of the signal makes an error of the true position; the errors and the encoder's own noise add up. The
//! interface comes after the signal: coarser steps, or a repeated last position. A fault has struck once the fault
//! alone gives a position other than the true one. Randomness comes from the scenario's seed.

use std::collections::VecDeque;

use masseter_drives::Look;
use masseter_model::geometry::AXES;
use masseter_runtime::clock::SECOND_NS;
use masseter_scenario::{EncoderFault, FaultConfig, FaultKindConfig, Overlap, Scenario};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// One encoder.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Encoder {
    /// Standard deviation of its noise, m.
    noise_m: f64,
    noise: Pcg64Mcg,
    /// Those that the scenario has on this axis, whether they act or not.
    faults: Vec<Fault>,
    random: Pcg64Mcg,
}

/// A fault.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
struct Fault {
    /// Its place in the scenario's list.
    place: usize,
    kind: EncoderFault,
    size: f64,
    /// Which of all beginnings was its own, while it acts.
    begun: Option<u64>,
    /// Time (ns) and position (m) at which it began.
    from: Option<(u64, f64)>,
    has_struck: bool,
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

impl Encoder {
    /// The encoders of a scenario, whose faults do not act yet.
    pub(super) fn of_axes(scenario: &Scenario) -> [Self; AXES] {
        let durations_ns = [scenario.dynamics.step_ns, scenario.period_ns()];
        std::array::from_fn(|axis| {
            let noise_m = scenario.drives.of_axis(axis).encoder_noise_m;
            let faults = scenario.faults.iter().enumerate();
            let faults = faults.filter(|(_, config)| config.axis().is_none_or(|on| on == axis));
            let faults = faults.filter_map(|(place, config)| Fault::new(place, config, durations_ns));
            Self::new(scenario.seed, axis, noise_m, faults.collect())
        })
    }

    fn new(seed: u64, axis: usize, noise_m: f64, faults: Vec<Fault>) -> Self {
        // Odd multiples of the golden ratio, and of another number, keep the streams apart from each other.
        let random = |multiple: u64| Pcg64Mcg::seed_from_u64(seed ^ (axis as u64 + 1).wrapping_mul(multiple));
        let (noise, random) = (random(0x9E37_79B9_7F4A_7C15), random(0xD1B5_4A32_D192_ED03));
        Self { noise_m, noise, faults, random }
    }

    /// The fault at that place of the list begins, as the `begun`-th of all that begin, or ends.
    pub(super) fn set(&mut self, place: usize, begun: Option<u64>) {
        let Some(index) = self.faults.iter().position(|fault| fault.place == place) else { return };
        let kind = self.faults[index].kind;
        let acts_once = FaultKindConfig::from(kind).declared().overlap == Overlap::Once;
        // An encoder that is stuck, or that counts the other way, goes on as it is.
        let before = self.faults.iter().find(|fault| fault.kind == kind && fault.begun.is_some());
        let from = before.filter(|_| acts_once).and_then(|fault| fault.from);
        let fault = &mut self.faults[index];
        (fault.begun, fault.from, fault.has_struck) = (begun, from, fault.has_struck && begun.is_none());
        fault.past.positions.clear();
    }

    /// Whether the fault at that place of the list has shown a wrong position.
    pub(super) fn has_struck(&self, place: usize) -> bool {
        self.faults.iter().any(|fault| fault.place == place && fault.has_struck)
    }

    /// The output of the encoder at that time.
    #[inline]
    pub(super) fn look(&mut self, now_ns: u64, at_m: f64) -> Look {
        let noise: f64 = self.noise.sample(StandardNormal);
        let noise_m = self.noise_m * noise;
        if self.faults.is_empty() {
            return Look { shown_m: at_m + noise_m, seen_m: at_m };
        }
        let seen_m = self.seen_m(now_ns, at_m);
        let signal_m = seen_m + noise_m;
        let shown_m = self.read_m(now_ns, signal_m);
        let is_as_seen = shown_m.to_bits() == signal_m.to_bits();
        Look { shown_m, seen_m: if is_as_seen { seen_m } else { shown_m } }
    }

    /// The position with the errors of all faults of the signal.
    fn seen_m(&mut self, now_ns: u64, at_m: f64) -> f64 {
        let (mut seen_m, mut is_turned) = (at_m, false);
        let is_of_signal =
            |fault: &&mut Fault| !matches!(fault.kind, EncoderFault::Stuck | EncoderFault::Steps);
        for fault in self.faults.iter_mut().filter(|fault| fault.begun.is_some()).filter(is_of_signal) {
            let alone_m = fault.alone_m(now_ns, at_m, &mut self.random);
            fault.has_struck |= alone_m.to_bits() != at_m.to_bits();
            if fault.kind == EncoderFault::Sign && std::mem::replace(&mut is_turned, true) {
                continue;
            }
            let is_first = seen_m.to_bits() == at_m.to_bits();
            seen_m = if is_first { alone_m } else { seen_m + (alone_m - at_m) };
        }
        seen_m
    }

    /// The output of the interface for a signal.
    fn read_m(&mut self, now_ns: u64, signal_m: f64) -> f64 {
        let mut shown_m = signal_m;
        let steps = self.faults.iter_mut().filter(|fault| fault.kind == EncoderFault::Steps);
        if let Some(fault) = steps.filter(|fault| fault.begun.is_some()).max_by_key(|fault| fault.begun) {
            shown_m = (signal_m / fault.size).round() * fault.size;
            fault.has_struck |= shown_m.to_bits() != signal_m.to_bits();
        }
        let mut held_m = None;
        let stuck = self.faults.iter_mut().filter(|fault| fault.kind == EncoderFault::Stuck);
        for fault in stuck.filter(|fault| fault.begun.is_some()) {
            let (_, at_m) = *fault.from.get_or_insert((now_ns, shown_m));
            fault.has_struck |= at_m.to_bits() != shown_m.to_bits();
            held_m = Some(at_m);
        }
        held_m.unwrap_or(shown_m)
    }
}

impl Fault {
    /// The fault of an encoder at a place of the scenario's list, for steps and SYNCs of these durations, ns.
    fn new(place: usize, config: &FaultConfig, durations_ns: [u64; 2]) -> Option<Self> {
        let FaultKindConfig::Encoder(kind) = config.kind else { return None };
        let size = config.size_si();
        let room = if kind == EncoderFault::Delay { past_of(size, durations_ns) } else { 0 };
        let past = Past { positions: VecDeque::with_capacity(room), room };
        Some(Self { place, kind, size, begun: None, from: None, has_struck: false, past })
    }

    /// The effect of the fault alone on a position, for a fault of the signal.
    fn alone_m(&mut self, now_ns: u64, at_m: f64, random: &mut Pcg64Mcg) -> f64 {
        let size = self.size;
        let (from_ns, from_m) = *self.from.get_or_insert((now_ns, at_m));
        match self.kind {
            EncoderFault::Stuck | EncoderFault::Steps => at_m,
            EncoderFault::Offset => at_m + size,
            EncoderFault::Drift => at_m + size * now_ns.saturating_sub(from_ns) as f64 / SECOND_NS as f64,
            EncoderFault::Noise => {
                let noise: f64 = random.sample(StandardNormal);
                at_m + size * noise
            }
            EncoderFault::Sign => 2.0 * from_m - at_m,
            EncoderFault::Loses => from_m + (1.0 - size) * (at_m - from_m),
            EncoderFault::Delay => self.past.delayed_m(now_ns, (size * SECOND_NS as f64) as u64, at_m),
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

    /// An encoder of the axis d1 with faults of these sizes, none of which acts yet.
    fn encoder(noise_m: f64, faults: &[(EncoderFault, &str)]) -> Encoder {
        let fault = |(place, (kind, size)): (usize, &(EncoderFault, &str))| {
            let size = (!size.is_empty()).then(|| size.parse().unwrap());
            Fault::new(place, &FaultConfig { size, ..FaultConfig::new(*kind) }, [MS / 8, MS])
        };
        Encoder::new(1, 0, noise_m, faults.iter().enumerate().filter_map(fault).collect())
    }

    /// The encoder's positions for a shaft that moves from 100 mm on by 1 mm a millisecond, in µm.
    fn shown_um(encoder: &mut Encoder, ms: u64) -> i64 {
        (encoder.look(5 * MS + ms * MS, 0.1 + ms as f64 * 1e-3).shown_m * 1e6).round() as i64
    }

    #[test]
    fn each_kind_shows_what_its_name_says() {
        let table = [
            (EncoderFault::Stuck, "", [100_000, 100_000, 100_000, 100_000]),
            (EncoderFault::Offset, "2 mm", [102_000, 103_000, 104_000, 105_000]),
            (EncoderFault::Drift, "-500 mm/s", [100_000, 100_500, 101_000, 101_500]),
            (EncoderFault::Steps, "2 mm", [100_000, 102_000, 102_000, 104_000]),
            (EncoderFault::Sign, "", [100_000, 99_000, 98_000, 97_000]),
            (EncoderFault::Loses, "25 %", [100_000, 100_750, 101_500, 102_250]),
            (EncoderFault::Delay, "2 ms", [100_000, 100_000, 100_000, 101_000]),
        ];
        for (kind, size, expected) in table {
            let mut encoder = encoder(0.0, &[(kind, size)]);
            encoder.set(0, Some(1));
            assert_eq!([0, 1, 2, 3].map(|ms| shown_um(&mut encoder, ms)), expected, "{kind:?}");
        }
    }

    /// The spread of the last sample's errors, m, and the samples.
    fn samples_m(encoder: &mut Encoder) -> (f64, Vec<f64>) {
        let errors_m: Vec<_> = (0..20_000).map(|step| encoder.look(step, 0.0).shown_m).collect();
        let mean_m = errors_m.iter().sum::<f64>() / errors_m.len() as f64;
        let squares = errors_m.iter().map(|m| (m - mean_m).powi(2)).sum::<f64>();
        assert!(mean_m.abs() < 0.03 * (squares / errors_m.len() as f64).sqrt(), "{mean_m}");
        ((squares / errors_m.len() as f64).sqrt(), errors_m)
    }

    #[test]
    fn noise_has_the_declared_spread_and_seed_and_axis_decide_it() {
        let (own_m, samples) = samples_m(&mut encoder(1e-6, &[]));
        assert!((own_m / 1e-6 - 1.0).abs() < 0.03, "{own_m}");
        for (seed, axis, is_same) in [(1, 0, true), (1, 1, false), (2, 0, false)] {
            assert_eq!(samples_m(&mut Encoder::new(seed, axis, 1e-6, vec![])).1 == samples, is_same);
        }
        let mut twice = encoder(0.0, &[(EncoderFault::Noise, "30 um"), (EncoderFault::Noise, "40 um")]);
        (0..2).for_each(|place| twice.set(place, Some(place as u64)));
        let (both_m, _) = samples_m(&mut twice);
        assert!((both_m / 50e-6 - 1.0).abs() < 0.03, "independent: {both_m}");
    }

    #[test]
    fn a_fault_strikes_once_it_shows_a_wrong_position_and_ends_with_the_true_one() {
        let mut encoder = encoder(0.0, &[(EncoderFault::Sign, "")]);
        encoder.set(0, Some(1));
        encoder.look(0, 0.1);
        assert!(!encoder.has_struck(0), "it stands");
        encoder.look(1, 0.101);
        assert!(encoder.has_struck(0));
        encoder.set(0, None);
        assert_eq!(encoder.look(2, 0.102), Look { shown_m: 0.102, seen_m: 0.102 });
    }

    #[test]
    fn a_stuck_encoder_shows_one_position_and_one_with_steps_shows_multiples_whatever_the_noise() {
        let mut stuck = encoder(1e-6, &[(EncoderFault::Stuck, ""), (EncoderFault::Noise, "50 um")]);
        (0..2).for_each(|place| stuck.set(place, Some(place as u64)));
        let first = stuck.look(0, 0.1).shown_m;
        assert!((1..1000).all(|step| stuck.look(step, 0.1).shown_m.to_bits() == first.to_bits()));
        let mut stepped = encoder(1e-6, &[(EncoderFault::Steps, "20 um")]);
        stepped.set(0, Some(0));
        for step in 0..1000 {
            let steps = stepped.look(step, 0.1 + 1e-7 * step as f64).shown_m / 20e-6;
            assert!((steps - steps.round()).abs() < 1e-9, "{steps}");
        }
    }

    #[test]
    fn an_inner_fault_ends_without_a_trace() {
        let stuck = [(EncoderFault::Stuck, ""), (EncoderFault::Stuck, "")];
        let offset = [(EncoderFault::Offset, "1 mm"), (EncoderFault::Offset, "2 mm")];
        for (faults, expected) in
            [(stuck, [100_000, 101_000, 101_000, 101_000]), (offset, [100_000, 102_000, 105_000, 104_000])]
        {
            let mut encoder = encoder(0.0, &faults);
            let mut shown = vec![shown_um(&mut encoder, 0)];
            encoder.set(0, Some(1));
            shown.push(shown_um(&mut encoder, 1));
            encoder.set(1, Some(2));
            shown.push(shown_um(&mut encoder, 2));
            encoder.set(1, None);
            shown.push(shown_um(&mut encoder, 3));
            assert_eq!(shown, expected);
        }
    }
}
