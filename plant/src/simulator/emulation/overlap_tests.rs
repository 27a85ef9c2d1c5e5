//! The effects follow from the active entries alone: random overlaps against a model without state.

use masseter_model::geometry::AXIS_NAMES;
use masseter_runtime::injection::Injected;
use masseter_scenario::{
    DriveFault as OfDrive, EncoderFault, FaultConfig, FoodConfig, PlatformFault, StimulusConfig,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::*;
use crate::simulator::mechanism::axes::AxisFaults;

const MS: u64 = 1_000_000;
/// Every case ends by then, ms.
const END_MS: u64 = 20;

/// An entry of a case: what, on which axis (all when absent), how large, and from when until when, ms.
#[derive(Debug, Clone, Copy)]
struct Declared {
    kind: FaultKindConfig,
    axis: Option<usize>,
    size: f64,
    from_ms: u64,
    until_ms: u64,
}

/// The kinds of the model, with sizes in SI units of which some change nothing.
const KINDS: [(FaultKindConfig, [f64; 3], &str); 21] = [
    (FaultKindConfig::Encoder(EncoderFault::Stuck), [0.0; 3], ""),
    (FaultKindConfig::Encoder(EncoderFault::Offset), [0.0, 5e-5, -2e-4], "m"),
    (FaultKindConfig::Encoder(EncoderFault::Drift), [0.0, 0.01, -0.3], "m/s"),
    (FaultKindConfig::Encoder(EncoderFault::Steps), [1.3e-5, 3.7e-5, 1.1e-4], "m"),
    (FaultKindConfig::Encoder(EncoderFault::Sign), [0.0; 3], ""),
    (FaultKindConfig::Encoder(EncoderFault::Loses), [0.0, 0.25, 0.6], ""),
    (FaultKindConfig::Encoder(EncoderFault::Delay), [0.001, 0.002, 0.005], "s"),
    (FaultKindConfig::Drive(OfDrive::Fault), [0.0; 3], ""),
    (FaultKindConfig::Drive(OfDrive::TorqueLoss), [0.0, 0.25, 0.5], ""),
    (FaultKindConfig::Drive(OfDrive::Runaway), [0.0; 3], ""),
    (FaultKindConfig::Drive(OfDrive::Sto), [0.0; 3], ""),
    (FaultKindConfig::Drive(OfDrive::SlowEnable), [0.0, 0.1, 2.0], "s"),
    (FaultKindConfig::Drive(OfDrive::BrakeOpen), [0.0; 3], ""),
    (FaultKindConfig::Drive(OfDrive::Scale), [1.0, 1.05, 0.5], ""),
    (FaultKindConfig::Drive(OfDrive::EmcyStorm), [0.001, 0.002, 0.1], "s"),
    (FaultKindConfig::Axis(AxisFault::Jam), [0.0; 3], ""),
    (FaultKindConfig::Axis(AxisFault::Friction), [1.0, 5.0, 10.0], ""),
    (FaultKindConfig::Axis(AxisFault::Play), [0.0, 2e-4, 1e-3], "m"),
    (FaultKindConfig::Axis(AxisFault::BrokenRod), [0.0; 3], ""),
    (FaultKindConfig::Axis(AxisFault::EndStop), [0.001, 0.002, 0.05], "m"),
    (FaultKindConfig::Platform(PlatformFault::Payload), [0.0, 0.5, 2.0], "kg"),
];

impl Declared {
    /// Kinds come in clusters, so that entries of one kind meet.
    fn random(random: &mut Pcg64Mcg, first_kind: usize) -> Self {
        let (kind, sizes, _) = KINDS[(first_kind + random.random_range(0..2)) % KINDS.len()];
        let from_ms = random.random_range(1..END_MS - 1);
        let axis = [None, Some(0), Some(3), Some(3)][random.random_range(0..4)];
        // A payload is on no axis.
        let axis = axis.filter(|_| !matches!(kind, FaultKindConfig::Platform(_)));
        let until_ms = random.random_range(from_ms + 1..END_MS);
        Self { kind, axis, size: sizes[random.random_range(0..3)], from_ms, until_ms }
    }

    fn config(&self) -> FaultConfig {
        let (_, _, unit) = KINDS.iter().find(|(kind, ..)| *kind == self.kind).unwrap();
        let size = self.kind.declared().size.map(|_| format!("{} {unit}", self.size).trim().parse().unwrap());
        let axis = self.axis.map(|axis| AXIS_NAMES[axis].to_owned());
        FaultConfig { axis, size, at_s: Some(0.0), ..FaultConfig::new(self.kind) }
    }

    fn is_active(&self, ms: u64) -> bool {
        self.from_ms <= ms && ms < self.until_ms
    }
}

/// The model: pure functions from the list and a time to the effects.
struct Model<'a>(&'a [Declared]);

impl Model<'_> {
    fn active(&self, kind: impl Into<FaultKindConfig>, axis: usize, ms: u64) -> Vec<Declared> {
        let kind = kind.into();
        let is_meant = |entry: &&Declared| {
            entry.kind == kind && entry.axis.is_none_or(|on| on == axis) && entry.is_active(ms)
        };
        self.0.iter().filter(is_meant).copied().collect()
    }

    fn any(&self, kind: impl Into<FaultKindConfig>, axis: usize, ms: u64) -> bool {
        !self.active(kind, axis, ms).is_empty()
    }

    fn sum(&self, kind: impl Into<FaultKindConfig>, axis: usize, ms: u64) -> Option<f64> {
        let active = self.active(kind, axis, ms);
        (!active.is_empty()).then(|| active.iter().map(|entry| entry.size).sum())
    }

    fn latest(&self, kind: impl Into<FaultKindConfig>, axis: usize, ms: u64) -> Option<f64> {
        let mut active = self.active(kind, axis, ms);
        active.sort_by_key(|entry| entry.from_ms);
        active.last().map(|entry| entry.size)
    }

    /// When the state began in which at least one of a kind is active without a break, ms.
    fn since(&self, kind: EncoderFault, axis: usize, ms: u64) -> u64 {
        let goes_on = |at: u64| self.active(kind, axis, at).iter().any(|entry| entry.is_active(at - 1));
        (1..=ms).rev().find(|at| !goes_on(*at)).unwrap()
    }

    fn of_drive(&self, kind: OfDrive, axis: usize, ms: u64) -> Option<f64> {
        match kind {
            OfDrive::TorqueLoss => self.sum(kind, axis, ms),
            OfDrive::SlowEnable | OfDrive::Scale | OfDrive::EmcyStorm => self.latest(kind, axis, ms),
            _ => self.any(kind, axis, ms).then_some(0.0),
        }
    }

    fn of_axis(&self, axis: usize, at_m: f64, ms: u64) -> AxisFaults {
        let way_m = self
            .active(AxisFault::EndStop, axis, ms)
            .iter()
            .map(|stop| stop.size)
            .fold(f64::INFINITY, f64::min);
        let play_m = self.sum(AxisFault::Play, axis, ms);
        AxisFaults {
            is_jammed: self.any(AxisFault::Jam, axis, ms),
            friction: self.latest(AxisFault::Friction, axis, ms).unwrap_or(1.0),
            play_m: if self.any(AxisFault::BrokenRod, axis, ms) { Some(f64::INFINITY) } else { play_m },
            free_m: [at_m - way_m, at_m + way_m],
        }
    }

    /// The position that an encoder without noise shows, unless it is stuck, m.
    fn loose_m(&self, axis: usize, ms: u64) -> f64 {
        use EncoderFault::{Delay, Drift, Loses, Offset, Sign, Steps};
        let at_m = position_m(ms);
        let sum = |kind: EncoderFault, error_m: &dyn Fn(Declared) -> f64| -> f64 {
            self.active(kind, axis, ms).into_iter().map(error_m).sum()
        };
        let mut shown_m = at_m
            + sum(Offset, &|entry| entry.size)
            + sum(Drift, &|entry| entry.size * (ms - entry.from_ms) as f64 * 1e-3)
            + sum(Loses, &|entry| entry.size * (position_m(entry.from_ms) - at_m))
            + sum(Delay, &|entry| {
                let old_ms = ms.saturating_sub((entry.size * 1e3).round() as u64);
                position_m(old_ms.max(entry.from_ms)) - at_m
            });
        if self.any(Sign, axis, ms) {
            shown_m += 2.0 * (position_m(self.since(Sign, axis, ms)) - at_m);
        }
        self.latest(Steps, axis, ms).map_or(shown_m, |step_m| (shown_m / step_m).round() * step_m)
    }

    fn shown_m(&self, axis: usize, ms: u64) -> f64 {
        let is_stuck = self.any(EncoderFault::Stuck, axis, ms);
        self.loose_m(axis, if is_stuck { self.since(EncoderFault::Stuck, axis, ms) } else { ms })
    }
}

/// Where an axis is, m.
fn position_m(ms: u64) -> f64 {
    0.1 + 1e-3 * (0.7 * ms as f64).sin()
}

fn quiet() -> Scenario {
    let mut scenario = Scenario::default();
    (scenario.drives.slide.encoder_noise_m, scenario.drives.leg.encoder_noise_m) = (0.0, 0.0);
    scenario
}

/// A scenario's entries in an emulation that is there already.
fn declare(
    emulation: &mut Emulation,
    scenario: &Scenario,
    windows: impl Iterator<Item = (Injected, Range<u64>)>,
) {
    emulation.agenda = Agenda::new(scenario, 0).unwrap();
    emulation.encoders = Encoder::of_axes(scenario);
    for (injected, window_ms) in windows {
        emulation.agenda.set_window(injected, &(window_ms.start * MS..window_ms.end * MS));
    }
}

fn compare(emulation: &mut Emulation, entries: &[Declared], ms: u64) {
    let model = Model(entries);
    for axis in [0, 3, 4] {
        let place = || format!("axis {axis} at {ms} ms: {entries:#?}");
        for (kind, ..) in KINDS {
            let FaultKindConfig::Drive(kind) = kind else { continue };
            let found = emulation.drives[axis].faults().size(drive_fault(kind));
            assert_eq!(found, model.of_drive(kind, axis, ms), "{kind:?} on {}", place());
        }
        let at_m = emulation.dynamics.state.positions_m()[axis];
        assert_eq!(emulation.dynamics.axes.each[axis].faults, model.of_axis(axis, at_m, ms), "{}", place());
        let shown_m = emulation.encoders[axis].look(ms * MS, position_m(ms)).shown_m;
        let expected_m = model.shown_m(axis, ms);
        assert!((shown_m - expected_m).abs() < 1e-12, "{shown_m} m, not {expected_m} m: {}", place());
    }
    let payload_kg = model.sum(PlatformFault::Payload, 0, ms).unwrap_or(0.0);
    assert!((emulation.dynamics.load.payload_kg - payload_kg).abs() < 1e-12, "{ms} ms: {entries:#?}");
    for (place, entry) in entries.iter().enumerate() {
        if entry.kind == EncoderFault::Offset.into() {
            let has_struck = entry.size != 0.0 && entry.from_ms <= ms;
            let on = entry.axis.unwrap_or(0);
            assert_eq!(emulation.encoders[on].has_struck(place), has_struck, "{ms} ms: {entries:#?}");
        }
    }
}

#[test]
fn what_acts_in_random_overlaps_is_what_the_model_says() {
    let mut random = Pcg64Mcg::seed_from_u64(1);
    let mut emulation = Emulation::new(&quiet(), 0).unwrap();
    for case in 0..2000 {
        let entries: Vec<_> = (0..random.random_range(2..6))
            .map(|_| Declared::random(&mut random, case % KINDS.len()))
            .collect();
        let faults = entries.iter().map(Declared::config).collect();
        let windows = entries.iter().enumerate();
        let windows = windows.map(|(place, entry)| (Injected::Fault(place), entry.from_ms..entry.until_ms));
        declare(&mut emulation, &Scenario { faults, ..quiet() }, windows);
        for ms in 0..=END_MS {
            emulation.follow_agenda(ms * MS);
            compare(&mut emulation, &entries, ms);
        }
        assert!(emulation.dynamics.axes.each.iter().all(|axis| axis.faults == AxisFaults::NONE));
        assert!(emulation.drives.iter().all(|drive| drive.faults().is_empty()));
    }
}

#[test]
fn the_food_that_was_served_last_is_there_whatever_the_order_of_the_list() {
    let mut random = Pcg64Mcg::seed_from_u64(2);
    let food = |strength_n: usize| FoodConfig { strength_n: strength_n as f64, ..FoodConfig::default() };
    let own = Scenario { food: Some(food(1000)), ..quiet() };
    let mut emulation = Emulation::new(&own, 0).unwrap();
    for _ in 0..200 {
        let windows: Vec<_> = (0..random.random_range(1..5))
            .map(|_| {
                let from_ms = random.random_range(1..END_MS - 1);
                from_ms..random.random_range(from_ms + 1..END_MS)
            })
            .collect();
        let stimulus = (0..windows.len())
            .map(|place| StimulusConfig { food: Some(food(place + 1)), ..StimulusConfig::at(0.0) })
            .collect();
        let of_stimuli = windows.iter().cloned().enumerate();
        let of_stimuli = of_stimuli.map(|(place, window_ms)| (Injected::Stimulus(place), window_ms));
        declare(&mut emulation, &Scenario { stimulus, ..own.clone() }, of_stimuli);
        for ms in 0..=END_MS {
            emulation.follow_agenda(ms * MS);
            let there = (0..windows.len()).filter(|place| windows[*place].contains(&ms));
            let last = there.max_by_key(|place| windows[*place].start).map_or(1000, |place| place + 1);
            let served = emulation.dynamics.occlusion.food.as_ref().unwrap();
            assert_eq!(served.config.strength_n as usize, last, "{ms} ms: {windows:?}");
        }
    }
}
