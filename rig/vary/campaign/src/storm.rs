//! The draw of storms: random faults, stimuli and parameters of the mechanism from one seed.
//!
//! The same base, seed and number always give the same storm. This file plays and judges nothing.

use masseter_model::geometry::AXIS_NAMES;
use masseter_scenario::{
    BusFault, DriveFault, FaultConfig, FaultKindConfig, Quantity, Scenario, Shape, StimulusConfig,
};
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// How long a storm lasts whose base says nothing of it, s.
const LASTS_S: f64 = 10.0;
/// Faults and stimuli begin within this share of the storm.
const BEGINNINGS: f64 = 0.8;
/// How long a fault or stimulus acts that ends, s.
const FOR_S: [f64; 2] = [1e-3, 2.0];
/// The most faults and the most stimuli of a storm.
const MOST_FAULTS: usize = 3;
const MOST_STIMULI: usize = 2;
/// A size lies between the example of its kind divided and multiplied by this.
const SIZES: f64 = 5.0;
/// The share by which parameters of the mechanism differ from those of the base.
const SPREAD: f64 = 0.3;
/// The largest push, N.
const MOST_PUSH_N: f64 = 30.0;
/// The largest payload of a stimulus, kg.
const MOST_PAYLOAD_KG: f64 = 0.5;
/// Draws of a storm until one is a valid scenario.
const DRAWS: usize = 100;

/// Draws the storms of a seed over a base scenario.
#[derive(Debug, Clone)]
pub struct Storms {
    base: Scenario,
    seed: u64,
}

impl Storms {
    /// The storms of a seed. The base keeps its own faults and stimuli; a storm adds to them.
    pub fn new(base: &Scenario, seed: u64) -> Self {
        Self { base: Scenario { duration_s: base.duration_s.or(Some(LASTS_S)), ..base.clone() }, seed }
    }

    /// The storm of this number. None where the base leaves no valid one.
    pub fn draw(&self, number: u64) -> Option<Scenario> {
        // The streams of neighbouring numbers resemble each other at first; seeds taken from them do not.
        let mut random = Pcg64::seed_from_u64(Pcg64::new(self.seed.into(), number.into()).random());
        let mut drawn = (0..DRAWS).map(|_| self.drawn(&mut random, number));
        drawn.find(|scenario| scenario.validate().is_ok())
    }

    fn drawn(&self, random: &mut Pcg64, number: u64) -> Scenario {
        let mut storm = Scenario { seed: random.random::<u32>().into(), ..self.base.clone() };
        storm.name = format!("storm-{}-{number}", self.seed);
        let dynamics = &mut storm.dynamics;
        for value in [
            &mut dynamics.carriage_mass_kg,
            &mut dynamics.cylinder_mass_kg,
            &mut dynamics.rod_mass_kg,
            &mut dynamics.platform_mass_kg,
            &mut dynamics.slide_friction_n,
            &mut dynamics.viscous_friction_n_s_per_m,
        ] {
            *value *= random.random_range(1.0 - SPREAD..1.0 + SPREAD);
        }
        let last_s = storm.duration_s.unwrap_or(LASTS_S) * BEGINNINGS;
        let [faults, stimuli] = [MOST_FAULTS, MOST_STIMULI].map(|most| random.random_range(0..=most));
        // A storm without either is a calm.
        for _ in 0..faults.max(usize::from(stimuli == 0)) {
            let fault = fault(&storm, last_s, random);
            storm.faults.push(fault);
        }
        storm.stimulus.extend((0..stimuli).map(|_| stimulus(last_s, random)));
        storm
    }
}

/// A fault of any kind but those of processes, which do not exist under virtual time.
fn fault(scenario: &Scenario, last_s: f64, random: &mut impl Rng) -> FaultConfig {
    let kinds: Vec<_> = FaultKindConfig::ALL.iter().filter(|kind| !kind.is_of_process()).collect();
    let kind = *kinds[random.random_range(0..kinds.len())];
    let declared = kind.declared();
    let axis = random.random_range(0..AXIS_NAMES.len());
    let has = |key: &str, random: &mut dyn Rng| {
        declared.needs.contains(&key) || (declared.takes.contains(&key) && random.random_bool(0.5))
    };
    let bus_of_axis = scenario.can.buses.iter().position(|axes| axes.contains(&axis));
    // Only at the beginning of a run is a drive enabled.
    let is_at_boot = kind == DriveFault::SlowEnable.into();
    let ends = random.random_bool(0.75);
    let size = declared.size.and_then(|size| {
        let example: Quantity = size.example.parse().ok()?;
        let factor = between([1.0 / SIZES, SIZES], random);
        let sign = if size.min < 0.0 && random.random_bool(0.5) { -1.0 } else { 1.0 };
        let unit = example.unit();
        let si = (example.si() * factor * sign).clamp(size.min, size.max);
        Some(Quantity::new(rounded(si / unit.si), unit))
    });
    let is_of_frames = declared.takes.contains(&"probability");
    FaultConfig {
        at_s: (!is_at_boot).then(|| rounded(random.random_range(0.0..last_s))),
        from_s: is_at_boot.then_some(0.0),
        for_s: (!is_at_boot && ends).then(|| rounded(between(FOR_S, random))),
        bus: has("bus", random).then_some(bus_of_axis).flatten(),
        node: has("node", random).then(|| scenario.can.node_ids[axis]),
        axis: has("axis", random).then(|| AXIS_NAMES[axis].to_owned()),
        size,
        probability: if is_of_frames && random.random_bool(0.5) {
            rounded(between([1e-3, 1.0], random))
        } else {
            1.0
        },
        count: (declared.takes.contains(&"count")
            && kind != BusFault::BusOff.into()
            && random.random_bool(0.3))
        .then(|| random.random_range(1..100)),
        ..FaultConfig::new(kind)
    }
}

/// A push, a payload or, seldom, an operator who stops the rig.
fn stimulus(last_s: f64, random: &mut impl Rng) -> StimulusConfig {
    let at = StimulusConfig::at(rounded(random.random_range(0.0..last_s)));
    let for_s = Some(rounded(between(FOR_S, random)));
    match random.random_range(0..10) {
        0 => StimulusConfig { stop: true, ..at },
        1..4 => {
            let kg = rounded(random.random_range(0.0..MOST_PAYLOAD_KG));
            StimulusConfig { payload: format!("{kg} kg").parse().ok(), for_s, ..at }
        }
        _ => {
            let shapes = [Shape::Step, Shape::Ramp, Shape::HalfSine, Shape::Sine];
            let shape = shapes[random.random_range(0..shapes.len())];
            let direction: [f64; 3] = std::array::from_fn(|_| random.random_range(-1.0..1.0));
            let size_n = between([0.1, MOST_PUSH_N], random);
            StimulusConfig {
                push_n: Some(direction.map(|share| rounded(share * size_n))),
                shape,
                frequency_hz: (shape == Shape::Sine).then(|| rounded(between([0.5, 100.0], random))),
                for_s,
                ..at
            }
        }
    }
}

/// A number between two, evenly over their logarithms.
fn between([least, most]: [f64; 2], random: &mut impl Rng) -> f64 {
    (random.random_range(least.ln()..most.ln())).exp()
}

/// The number with four digits, so that scenarios can be read.
fn rounded(number: f64) -> f64 {
    format!("{number:.3e}").parse().unwrap_or(number)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn a_storm_is_that_of_its_seed_and_number_and_reads_back() {
        let [storms, same, other] = [1, 1, 2].map(|seed| Storms::new(&Scenario::default(), seed));
        for number in 0..200 {
            let storm = storms.draw(number).unwrap();
            assert_eq!(same.draw(number).as_ref(), Some(&storm));
            assert_ne!(other.draw(number).as_ref(), Some(&storm));
            let read = Scenario::parse("storm.toml".as_ref(), &storm.to_toml()).unwrap();
            assert_eq!(read, storm, "{number}");
            assert!(!storm.faults.is_empty() || !storm.stimulus.is_empty(), "{number}");
        }
    }

    #[test]
    fn a_thousand_storms_have_every_kind_of_fault_and_stimulus() {
        let storms = Storms::new(&Scenario::default(), 1);
        let drawn: Vec<_> = (0..1000).map(|number| storms.draw(number).unwrap()).collect();
        let kinds: BTreeSet<_> =
            drawn.iter().flat_map(|storm| storm.faults.iter().map(|fault| fault.kind)).collect();
        let expected = FaultKindConfig::ALL.iter().filter(|kind| !kind.is_of_process()).count();
        assert_eq!(kinds.len(), expected);
        let stimuli: BTreeSet<_> =
            drawn.iter().flat_map(|storm| storm.stimulus.iter().map(ToString::to_string)).collect();
        assert_eq!(stimuli.len(), 3, "{stimuli:?}");
    }
}
