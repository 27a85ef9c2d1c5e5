//! A scenario's faults and stimuli for drives and mechanism: entries that begin and end, in the order of time.
//!
//! The agenda acts on nothing. It hands out each change once, derives the present effects from the active entries, and
//! keeps the emulation's reports on each entry.

use std::{collections::VecDeque, ops::Range};

use masseter_model::geometry::AXES;
use masseter_runtime::injection::{Injected, Injection};
use masseter_scenario::{
    AxisFault, FaultConfig, FaultKindConfig, Overlap, PlatformFault, Scenario, StimulusConfig,
};
use nalgebra::Vector6;

use super::{jaw, push::Push};
use crate::error::PlantError;
use crate::master::link::Occurrence;
use crate::simulator::mechanism::axes::AxisFaults;
use crate::simulator::mechanism::contact::food::Food;

/// The action of an entry.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) enum Effect {
    /// A fault of one axis, or of all.
    Fault { kind: FaultKindConfig, size: f64, axis: Option<usize> },
    /// A force and a torque on the platform.
    Push(Box<Push>),
    /// Another food.
    Food(Box<Food>),
    /// A mass at the incisal point.
    Payload { kg: f64 },
}

#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
struct Entry {
    injected: Injected,
    effect: Effect,
    /// Most time of it: of a table its length, of some kinds of faults their size, ns.
    longest_ns: u64,
    window_ns: Range<u64>,
    /// Number of its beginning among all, while active.
    begun: Option<u64>,
    /// Positions of the axes at that time, m.
    began_m: [f64; AXES],
    has_struck: bool,
}

/// The agenda.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct Agenda {
    entries: Vec<Entry>,
    /// No entry begins or ends before this time, ns.
    next_change_ns: u64,
    begun: u64,
    /// Beginnings and ends, the oldest first.
    pub(crate) occurrences: VecDeque<Occurrence>,
}

impl Agenda {
    /// The entries of a scenario for drives and mechanism, switched on at `now_ns`. An entry with an unknown window
    /// does not act before its window is set.
    pub(crate) fn new(scenario: &Scenario, now_ns: u64) -> Result<Self, PlantError> {
        let faults = scenario.faults.iter().enumerate().filter_map(|(place, config)| {
            let longest_ns = config.acting_ns(0..u64::MAX).end;
            Some(Entry::new(Injected::Fault(place), effect_of_fault(config)?, longest_ns))
        });
        let mut entries: Vec<_> = faults.collect();
        for (place, config) in scenario.stimulus.iter().enumerate() {
            let effect = effect_of_stimulus(config, scenario)?;
            entries.extend(
                effect.map(|(effect, longest_ns)| Entry::new(Injected::Stimulus(place), effect, longest_ns)),
            );
        }
        let injection =
            Injection::new(scenario, now_ns).map_err(|error| PlantError::Scenario(error.to_string()))?;
        // An entry begins once and ends once.
        let occurrences = VecDeque::with_capacity(2 * entries.len());
        let mut agenda = Self { entries, next_change_ns: u64::MAX, begun: 0, occurrences };
        for injected in agenda.entries.iter().map(|entry| entry.injected).collect::<Vec<_>>() {
            if let Some(window_ns) = injection.window_ns(injected) {
                agenda.set_window(injected, &window_ns);
            }
        }
        Ok(agenda)
    }

    /// Whether there are no entries.
    pub(crate) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Takes the rows of the pushes' tables from another agenda of the scenario; false if the pushes are others.
    pub(crate) fn take_tables_of(&mut self, other: &Self) -> bool {
        self.entries.len() == other.entries.len()
            && self.entries.iter_mut().zip(&other.entries).all(|(entry, other)| {
                match (&mut entry.effect, &other.effect) {
                    (Effect::Push(push), Effect::Push(other)) => push.take_rows_of(other),
                    (Effect::Push(_), _) | (_, Effect::Push(_)) => false,
                    _ => true,
                }
            })
    }

    /// Sets the window of an entry.
    pub(crate) fn set_window(&mut self, injected: Injected, window_ns: &Range<u64>) {
        for entry in self.entries.iter_mut().filter(|entry| entry.injected == injected) {
            let Range { start, end } = *window_ns;
            entry.window_ns = start..end.min(start.saturating_add(entry.longest_ns));
            self.next_change_ns = 0;
        }
    }

    /// The place of the next entry that begins or ends by `now_ns`, with the axes in these positions, m. Ends come first,
    /// then what begins in the order of time.
    #[inline]
    pub(crate) fn next_change(&mut self, now_ns: u64, axes_m: impl FnOnce() -> [f64; AXES]) -> Option<usize> {
        if now_ns < self.next_change_ns { None } else { self.look_for_change(now_ns, axes_m()) }
    }

    fn look_for_change(&mut self, now_ns: u64, axes_m: [f64; AXES]) -> Option<usize> {
        let found = [false, true].into_iter().find_map(|is_begin| {
            let changing = (0..self.entries.len()).filter(|&at| self.entries[at].changes(now_ns, is_begin));
            let place =
                changing.min_by_key(|&at| if is_begin { self.entries[at].window_ns.start } else { 0 })?;
            Some((place, is_begin))
        });
        let Some((place, is_begin)) = found else {
            let times = self.entries.iter().filter_map(|entry| entry.next_change_ns(now_ns));
            self.next_change_ns = times.min().unwrap_or(u64::MAX);
            return None;
        };
        self.entries[place].began_m = axes_m;
        self.change(place, is_begin, now_ns);
        Some(place)
    }

    fn change(&mut self, place: usize, is_begin: bool, now_ns: u64) {
        self.begun += u64::from(is_begin);
        let entry = &mut self.entries[place];
        entry.begun = is_begin.then_some(self.begun);
        if is_begin && entry.strikes_at_once() {
            self.strike(place, now_ns);
        } else if !is_begin && entry.has_struck {
            let occurrence = entry.occurrence(now_ns, true);
            self.report(occurrence);
        }
    }

    /// The action of the entry at that place.
    pub(crate) fn effect(&self, place: usize) -> &Effect {
        &self.entries[place].effect
    }

    /// Number of the beginning of the entry at that place, while active.
    pub(crate) fn begun(&self, place: usize) -> Option<u64> {
        self.entries[place].begun
    }

    /// The number of its fault in the scenario's list; that of a stimulus where the entry is one.
    pub(crate) fn number(&self, place: usize) -> usize {
        let (Injected::Fault(number) | Injected::Stimulus(number)) = self.entries[place].injected;
        number
    }

    fn active(&self) -> impl Iterator<Item = &Entry> {
        self.entries.iter().filter(|entry| entry.begun.is_some())
    }

    /// The active entries of a fault on an axis, with their sizes.
    fn active_faults(&self, kind: FaultKindConfig, on: usize) -> impl Iterator<Item = (&Entry, f64)> {
        self.active().filter_map(move |entry| match entry.effect {
            Effect::Fault { kind: of, size, axis } if of == kind && axis.is_none_or(|axis| axis == on) => {
                Some((entry, size))
            }
            _ => None,
        })
    }

    /// The size of a fault on an axis, by the rule of its kind; none without an active entry.
    pub(crate) fn size(&self, kind: impl Into<FaultKindConfig>, axis: usize) -> Option<f64> {
        let kind = kind.into();
        let mut active = self.active_faults(kind, axis);
        match kind.declared().overlap {
            Overlap::Adds => active.map(|(_, size)| size).reduce(|sum, size| sum + size),
            Overlap::Latest => active.max_by_key(|(entry, _)| entry.begun).map(|(_, size)| size),
            Overlap::Once | Overlap::Each => active.next().map(|(_, size)| size),
        }
    }

    /// Whether the fault at that place itself acts on the axis: another fault may have begun later, or be as large.
    pub(crate) fn acts(&self, place: usize, axis: usize) -> bool {
        let (entry, Effect::Fault { kind, size, .. }) = (&self.entries[place], &self.entries[place].effect)
        else {
            return false;
        };
        match kind.declared().overlap {
            Overlap::Adds => *size != 0.0,
            Overlap::Latest => self.active_faults(*kind, axis).all(|(other, _)| other.begun <= entry.begun),
            Overlap::Once | Overlap::Each => true,
        }
    }

    /// The present faults of an axis of the mechanism.
    pub(crate) fn axis_faults(&self, axis: usize) -> AxisFaults {
        let is_broken = self.size(AxisFault::BrokenRod, axis).is_some();
        let stops = self.active_faults(AxisFault::EndStop.into(), axis).map(|(entry, _)| entry.stops_m(axis));
        let free =
            |[low_m, high_m]: [f64; 2], stops_m: [f64; 2]| [low_m.max(stops_m[0]), high_m.min(stops_m[1])];
        AxisFaults {
            is_jammed: self.size(AxisFault::Jam, axis).is_some(),
            friction: self.size(AxisFault::Friction, axis).unwrap_or(1.0),
            play_m: if is_broken { Some(f64::INFINITY) } else { self.size(AxisFault::Play, axis) },
            free_m: stops.fold([f64::NEG_INFINITY, f64::INFINITY], free),
        }
    }

    /// Which of the nearest hard stops of an axis are those of the fault at that place: the lower one, the upper one.
    pub(crate) fn nearest_stops(&self, place: usize, axis: usize) -> [bool; 2] {
        let (own_m, free_m) = (self.entries[place].stops_m(axis), self.axis_faults(axis).free_m);
        [0, 1].map(|side| own_m[side].to_bits() == free_m[side].to_bits())
    }

    /// The mass at the incisal point, kg.
    pub(crate) fn payload_kg(&self) -> f64 {
        let payloads_kg = self.active().filter_map(|entry| match entry.effect {
            Effect::Payload { kg } => Some(kg),
            _ => None,
        });
        payloads_kg.sum()
    }

    /// The last served active food, with the number of its beginning.
    pub(crate) fn food(&self) -> Option<(u64, &Food)> {
        let foods = self.active().filter_map(|entry| match &entry.effect {
            Effect::Food(food) => Some((entry.begun?, &**food)),
            _ => None,
        });
        foods.max_by_key(|(begun, _)| *begun)
    }

    /// The forces (N) and torques (N m) in base axes that act at that time, and the points of the forces.
    pub(crate) fn pushes(&self, now_ns: u64) -> impl Iterator<Item = (Vector6<f64>, Option<[f64; 3]>)> {
        self.active().filter_map(move |entry| {
            let Effect::Push(push) = &entry.effect else { return None };
            Some((push.wrench(now_ns.saturating_sub(entry.window_ns.start)), push.point_m))
        })
    }

    /// The next active fault from that place on whose strike is not reported yet.
    pub(crate) fn next_waiting(&self, from: usize) -> Option<usize> {
        let waits = |entry: &Entry| entry.begun.is_some() && !entry.has_struck;
        (from..self.entries.len()).find(|&place| waits(&self.entries[place]))
    }

    /// Notes that the entry at that place has struck.
    pub(crate) fn strike(&mut self, place: usize, now_ns: u64) {
        let entry = &mut self.entries[place];
        entry.has_struck = true;
        let occurrence = entry.occurrence(now_ns, false);
        self.report(occurrence);
    }

    fn report(&mut self, occurrence: Occurrence) {
        // The queue keeps its room when nobody takes the occurrences, so that a cycle allocates nothing.
        if self.occurrences.len() < 2 * self.entries.len() {
            self.occurrences.push_back(occurrence);
        }
    }
}

impl Entry {
    fn new(injected: Injected, effect: Effect, longest_ns: u64) -> Self {
        let window_ns = u64::MAX..u64::MAX;
        let (begun, began_m, has_struck) = (None, [0.0; AXES], false);
        Self { injected, effect, longest_ns, window_ns, begun, began_m, has_struck }
    }

    fn changes(&self, now_ns: u64, is_begin: bool) -> bool {
        self.begun.is_some() != is_begin && self.window_ns.contains(&now_ns) == is_begin
    }

    fn next_change_ns(&self, now_ns: u64) -> Option<u64> {
        let Range { start, end } = self.window_ns;
        [start, end].into_iter().find(|&time_ns| time_ns > now_ns)
    }

    fn occurrence(&self, time_ns: u64, has_ended: bool) -> Occurrence {
        let axis = if let Effect::Fault { axis, .. } = self.effect { axis } else { None };
        Occurrence { injected: self.injected, time_ns, axis, has_ended }
    }

    /// Whether the entry strikes at its beginning. Faults of a drive, an encoder or an axis report their own strike.
    fn strikes_at_once(&self) -> bool {
        match self.effect {
            Effect::Fault { .. } => false,
            Effect::Payload { kg } => kg > 0.0 || matches!(self.injected, Injected::Stimulus(_)),
            Effect::Push(_) | Effect::Food(_) => true,
        }
    }

    /// The hard stops on both sides of where the axis was when it began, m.
    fn stops_m(&self, axis: usize) -> [f64; 2] {
        let way_m = if let Effect::Fault { size, .. } = self.effect { size } else { f64::INFINITY };
        [self.began_m[axis] - way_m, self.began_m[axis] + way_m]
    }
}

/// The effect of a fault on drives and mechanism; none for a fault elsewhere.
fn effect_of_fault(config: &FaultConfig) -> Option<Effect> {
    let size = config.size_si();
    match config.kind {
        FaultKindConfig::Encoder(_) | FaultKindConfig::Drive(_) | FaultKindConfig::Axis(_) => {
            Some(Effect::Fault { kind: config.kind, size, axis: config.axis() })
        }
        FaultKindConfig::Platform(PlatformFault::Payload) => Some(Effect::Payload { kg: size }),
        FaultKindConfig::Bus(_) | FaultKindConfig::Command(_) | FaultKindConfig::Process(_) => None,
    }
}

/// The effect of a stimulus on the mechanism and its most time, ns; none for a stimulus elsewhere.
fn effect_of_stimulus(
    config: &StimulusConfig,
    scenario: &Scenario,
) -> Result<Option<(Effect, u64)>, PlantError> {
    if let Some(push) = Push::new(config)? {
        let longest_ns = push.longest_ns();
        return Ok(Some((Effect::Push(Box::new(push)), longest_ns)));
    }
    let food = config.food.as_ref().map(|food| Effect::Food(Box::new(jaw::food(food, scenario))));
    let payload = || config.payload.map(|payload| Effect::Payload { kg: payload.si() });
    Ok(food.or_else(payload).map(|effect| (effect, u64::MAX)))
}

#[cfg(test)]
mod tests {
    use masseter_scenario::{EncoderFault, Shape};

    use super::*;

    fn agenda(scenario: &Scenario) -> Agenda {
        Agenda::new(scenario, 0).unwrap()
    }

    #[test]
    fn entries_begin_and_end_once_and_end_before_others_begin() {
        let stuck = |size: &str| FaultConfig {
            axis: Some("l1".to_owned()),
            size: Some(size.parse().unwrap()),
            at_s: Some(0.0),
            ..FaultConfig::new(EncoderFault::Offset)
        };
        let faults = vec![stuck("1 mm"), stuck("2 mm")];
        let mut agenda = agenda(&Scenario { faults, ..Scenario::default() });
        agenda.set_window(Injected::Fault(1), &(200..300));
        agenda.set_window(Injected::Fault(0), &(100..200));
        let mut changes =
            |now_ns| std::iter::from_fn(|| agenda.next_change(now_ns, || [0.0; AXES])).collect::<Vec<_>>();
        assert_eq!(changes(99), [0; 0]);
        assert_eq!(changes(120), [0]);
        assert_eq!(changes(199), [0; 0]);
        assert_eq!(changes(210), [0, 1]);
        assert_eq!(changes(300), [1]);
        assert_eq!(agenda.next_change_ns, u64::MAX);
        assert_eq!(agenda.occurrences.pop_front(), None, "they changed nothing");
    }

    #[test]
    fn a_push_has_its_shape_from_the_beginning_of_its_window() {
        let push = StimulusConfig {
            push_n: Some([0.0, 0.0, -8.0]),
            torque_n_m: Some([0.4, 0.0, 0.0]),
            shape: Shape::Ramp,
            for_s: Some(0.2),
            ..StimulusConfig::at(1.0)
        };
        let mut agenda = agenda(&Scenario { stimulus: vec![push], ..Scenario::default() });
        agenda.set_window(Injected::Stimulus(0), &(1_000_000_000..1_200_000_000));
        assert!(agenda.next_change(1_000_050_000, || [0.0; AXES]).is_some());
        let (wrench, point_m) = agenda.pushes(1_050_000_000).next().unwrap();
        assert!(
            (wrench[2] + 2.0).abs() < 1e-9 && (wrench[3] - 0.1).abs() < 1e-9 && point_m.is_none(),
            "{wrench}"
        );
        assert_eq!(agenda.occurrences.pop_front().map(|told| told.has_ended), Some(false));
        assert!(agenda.next_change(1_200_000_000, || [0.0; AXES]).is_some());
        assert_eq!(agenda.occurrences.pop_front().map(|told| told.has_ended), Some(true));
        assert!(agenda.pushes(1_200_000_000).next().is_none());
    }
}
