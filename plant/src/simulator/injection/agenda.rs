//! What a scenario does to drives and mechanism, and when: the entries that begin and end, in the order of time.
//!
//! The agenda acts on nothing. It hands out each change once, and keeps what the emulation reports.

use std::collections::VecDeque;
use std::ops::Range;

use masseter_runtime::injection::{Injected, Injection};
use masseter_scenario::{
    AxisFault, DriveFault, EncoderFault, FaultConfig, FaultKindConfig, PlatformFault, Scenario,
    StimulusConfig, ToothConfig,
};
use nalgebra::Vector6;

use super::acting_ns;
use super::push::Push;
use crate::error::PlantError;
use crate::master::link::Occurrence;
use crate::simulator::mechanism::contact::food::Food;
use crate::state::state;

/// What an entry does.
#[derive(Debug, Clone, serde::Serialize)]
pub(crate) enum Effect {
    /// A fault of one axis, or of all.
    Fault { kind: PartFault, size: f64, axis: Option<usize> },
    /// A mass at the incisal point, by a fault.
    FaultyPayload { kg: f64 },
    /// A force and a torque on the platform.
    Push(Box<Push>),
    /// Another food.
    Food(Box<Food>),
    /// A mass at the incisal point.
    Payload { kg: f64 },
}

/// A fault of what belongs to an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub(crate) enum PartFault {
    Encoder(EncoderFault),
    Drive(DriveFault),
    Axis(AxisFault),
}

/// An entry begins or ends.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Change {
    /// Its place in the agenda.
    pub(crate) place: usize,
    /// Whether it begins.
    pub(crate) is_begin: bool,
}

#[derive(Debug, Clone)]
struct Entry {
    injected: Injected,
    effect: Effect,
    /// The fault that cuts its own window.
    fault: Option<FaultConfig>,
    window_ns: Range<u64>,
    is_active: bool,
    has_struck: bool,
}

state!(Entry {
    values: window_ns is_active has_struck;
    bound: effect;
    constant: injected fault;
});

/// The agenda.
#[derive(Debug, Clone)]
pub(crate) struct Agenda {
    entries: Vec<Entry>,
    /// Before then no entry begins or ends, ns.
    next_change_ns: u64,
    /// What began or ended, the oldest first.
    pub(crate) occurrences: VecDeque<Occurrence>,
}

state!(Agenda {
    values: next_change_ns occurrences;
    parts: entries;
});

impl Agenda {
    /// The entries of a scenario that drives and mechanism carry out, switched on at `now_ns`. One whose window is not known
    /// yet does not act before it is set.
    pub(crate) fn new(scenario: &Scenario, now_ns: u64) -> Result<Self, PlantError> {
        let arch = scenario.arch();
        let faults = scenario.faults.iter().enumerate().filter_map(|(place, config)| {
            Some(Entry::new(Injected::Fault(place), effect_of_fault(config)?, Some(config)))
        });
        let mut entries: Vec<_> = faults.collect();
        for (place, config) in scenario.stimulus.iter().enumerate() {
            let effect = effect_of_stimulus(config, &arch)?;
            entries.extend(effect.map(|effect| Entry::new(Injected::Stimulus(place), effect, None)));
        }
        let injection =
            Injection::new(scenario, now_ns).map_err(|error| PlantError::Scenario(error.to_string()))?;
        // An entry begins once and ends once.
        let occurrences = VecDeque::with_capacity(2 * entries.len());
        let mut agenda = Self { entries, next_change_ns: u64::MAX, occurrences };
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

    /// Sets when an entry acts.
    pub(crate) fn set_window(&mut self, injected: Injected, window_ns: &Range<u64>) {
        for entry in self.entries.iter_mut().filter(|entry| entry.injected == injected) {
            entry.window_ns = match (&entry.fault, &entry.effect) {
                (Some(fault), _) => acting_ns(fault, window_ns.clone()),
                (None, Effect::Push(push)) => push.acting_ns(window_ns),
                (None, _) => window_ns.clone(),
            };
            self.next_change_ns = 0;
        }
    }

    /// The next entry that begins or ends by `now_ns`. Ends come first, so that an entry can follow another of its kind.
    #[inline]
    pub(crate) fn next_change(&mut self, now_ns: u64) -> Option<Change> {
        if now_ns < self.next_change_ns { None } else { self.look_for_change(now_ns) }
    }

    fn look_for_change(&mut self, now_ns: u64) -> Option<Change> {
        let found = [false, true].into_iter().find_map(|is_begin| {
            let place = self.entries.iter().position(|entry| entry.changes(now_ns, is_begin))?;
            Some(Change { place, is_begin })
        });
        if let Some(Change { place, is_begin }) = found {
            self.change(place, is_begin, now_ns);
        } else {
            let times = self.entries.iter().filter_map(|entry| entry.next_change_ns(now_ns));
            self.next_change_ns = times.min().unwrap_or(u64::MAX);
        }
        found
    }

    fn change(&mut self, place: usize, is_begin: bool, now_ns: u64) {
        let entry = &mut self.entries[place];
        entry.is_active = is_begin;
        if is_begin && entry.effect.strikes_at_once() {
            self.strike(place, now_ns);
        } else if !is_begin && entry.has_struck {
            let occurrence = entry.occurrence(now_ns, true);
            self.report(occurrence);
        }
    }

    /// What the entry at that place does.
    pub(crate) fn effect(&self, place: usize) -> &Effect {
        &self.entries[place].effect
    }

    /// Whether another entry that acts is a fault of that kind on that axis.
    pub(crate) fn has_another(&self, kind: PartFault, axis: Option<usize>) -> bool {
        self.active().any(|effect| {
            matches!(effect, Effect::Fault { kind: other, axis: at, .. } if *other == kind && *at == axis)
        })
    }

    /// What acts now.
    pub(crate) fn active(&self) -> impl Iterator<Item = &Effect> {
        self.entries.iter().filter(|entry| entry.is_active).map(|entry| &entry.effect)
    }

    /// The forces (N) and torques (N m) in base axes that act at that time, and the points of the forces.
    pub(crate) fn pushes(&self, now_ns: u64) -> impl Iterator<Item = (Vector6<f64>, Option<[f64; 3]>)> {
        let active = self.entries.iter().filter(|entry| entry.is_active);
        active.filter_map(move |entry| {
            let Effect::Push(push) = &entry.effect else { return None };
            Some((push.wrench(now_ns.saturating_sub(entry.window_ns.start)), push.point_m))
        })
    }

    /// The next active fault from that place on whose strike is not reported yet.
    pub(crate) fn next_waiting(&self, from: usize) -> Option<usize> {
        let waits = |entry: &Entry| entry.is_active && !entry.has_struck;
        (from..self.entries.len()).find(|&place| waits(&self.entries[place]))
    }

    /// The entry at that place has changed something.
    pub(crate) fn strike(&mut self, place: usize, now_ns: u64) {
        let entry = &mut self.entries[place];
        entry.has_struck = true;
        let occurrence = entry.occurrence(now_ns, false);
        self.report(occurrence);
    }

    fn report(&mut self, occurrence: Occurrence) {
        // The queue keeps its room, should nobody take the occurrences: nothing is allocated in a cycle.
        if self.occurrences.len() < 2 * self.entries.len() {
            self.occurrences.push_back(occurrence);
        }
    }
}

impl Entry {
    fn new(injected: Injected, effect: Effect, fault: Option<&FaultConfig>) -> Self {
        let window_ns = u64::MAX..u64::MAX;
        Self { injected, effect, fault: fault.cloned(), window_ns, is_active: false, has_struck: false }
    }

    fn changes(&self, now_ns: u64, is_begin: bool) -> bool {
        self.is_active != is_begin && self.window_ns.contains(&now_ns) == is_begin
    }

    fn next_change_ns(&self, now_ns: u64) -> Option<u64> {
        let Range { start, end } = self.window_ns;
        [start, end].into_iter().find(|&time_ns| time_ns > now_ns)
    }

    fn occurrence(&self, time_ns: u64, has_ended: bool) -> Occurrence {
        Occurrence { injected: self.injected, time_ns, axis: self.effect.axis(), has_ended }
    }
}

impl Effect {
    fn axis(&self) -> Option<usize> {
        match self {
            Self::Fault { axis, .. } => *axis,
            _ => None,
        }
    }

    /// Whether it changes something as soon as it begins. Faults of a drive, an encoder or an axis report that
    /// themselves.
    fn strikes_at_once(&self) -> bool {
        match self {
            Self::Fault { .. } => false,
            Self::FaultyPayload { kg } => *kg > 0.0,
            Self::Push(_) | Self::Food(_) | Self::Payload { .. } => true,
        }
    }
}

/// What a fault does to drives and mechanism; none where it acts elsewhere.
fn effect_of_fault(config: &FaultConfig) -> Option<Effect> {
    let size = config.size_si();
    let kind = match config.kind {
        FaultKindConfig::Encoder(kind) => PartFault::Encoder(kind),
        FaultKindConfig::Drive(kind) => PartFault::Drive(kind),
        FaultKindConfig::Axis(kind) => PartFault::Axis(kind),
        FaultKindConfig::Platform(PlatformFault::Payload) => return Some(Effect::FaultyPayload { kg: size }),
        FaultKindConfig::Bus(_) | FaultKindConfig::Command(_) | FaultKindConfig::Process(_) => return None,
    };
    Some(Effect::Fault { kind, size, axis: config.axis() })
}

fn effect_of_stimulus(config: &StimulusConfig, arch: &[ToothConfig]) -> Result<Option<Effect>, PlantError> {
    let push = Push::new(config)?.map(|push| Effect::Push(Box::new(push)));
    let food = || config.food.as_ref().map(|food| Effect::Food(Box::new(Food::new(food, arch))));
    let payload = || config.payload.map(|payload| Effect::Payload { kg: payload.si() });
    Ok(push.or_else(food).or_else(payload))
}

#[cfg(test)]
mod tests {
    use masseter_scenario::Shape;

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
        let mut changes = |now_ns| {
            let changes = std::iter::from_fn(|| agenda.next_change(now_ns));
            changes.map(|change| (change.place, change.is_begin)).collect::<Vec<_>>()
        };
        assert_eq!(changes(99), []);
        assert_eq!(changes(120), [(0, true)]);
        assert_eq!(changes(199), []);
        assert_eq!(changes(210), [(0, false), (1, true)]);
        assert_eq!(changes(300), [(1, false)]);
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
        assert!(agenda.next_change(1_000_050_000).is_some());
        let (wrench, point_m) = agenda.pushes(1_050_000_000).next().unwrap();
        assert!(
            (wrench[2] + 2.0).abs() < 1e-9 && (wrench[3] - 0.1).abs() < 1e-9 && point_m.is_none(),
            "{wrench}"
        );
        assert_eq!(agenda.occurrences.pop_front().map(|told| told.has_ended), Some(false));
        assert!(agenda.next_change(1_200_000_000).is_some());
        assert_eq!(agenda.occurrences.pop_front().map(|told| told.has_ended), Some(true));
        assert!(agenda.pushes(1_200_000_000).next().is_none());
    }
}
