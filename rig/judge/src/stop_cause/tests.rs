use masseter_recording::MachineInfo;
use masseter_runtime::messages::Event;
use masseter_runtime::messages::codes::{EventKind, Source};
use masseter_scenario::{
    AxisFault, BusFault, DriveFault, FaultConfig, FaultKindConfig, PlatformFault, StimulusConfig,
};

use super::*;
use crate::FaultFigures;

const MS: u64 = 1_000_000;
/// The master stops the rig for the sake of axis l2, at 1.5 s.
const STOPPED_NS: u64 = 1500 * MS;

/// An entry of the scenario with the time of its strike, ms.
enum Entry {
    Axis(FaultKindConfig, &'static str, u64),
    Bus(usize, u64),
    Platform(u64),
    Push(u64),
    Stop(u64),
}
use Entry::{Axis, Bus, Platform, Push, Stop};

fn event(time_ns: u64, source: Source, kind: EventKind, cause: Cause) -> Event {
    Event { time_ns, ..Event::new(source, kind, cause) }
}

/// The emergency message of axis d1.
fn emergency(time_ns: u64, register: u8) -> Event {
    let limit = f64::from(register);
    Event {
        axis: 0,
        value: 65_280.0,
        limit,
        ..event(time_ns, Source::Drive, EventKind::Fault, Cause::Emergency)
    }
}

fn run(entries: &[Entry], emergencies: &[Event], ended: &[(usize, u64)]) -> (Manifest, Figures) {
    let machine = MachineInfo { cpu: "any".into(), cores: 2, kernel: "Linux".into(), is_virtual: false };
    let mut scenario = Scenario::default();
    let mut figures = Figures::default();
    let following = event(STOPPED_NS, Source::Master, EventKind::Fault, Cause::FollowingError);
    let mut events = vec![Event { axis: 4, ..following }];
    events.extend_from_slice(emergencies);
    let of_fault = |number: &usize, ms: u64, cause| Event {
        value: *number as f64,
        ..event(ms * MS, Source::Wire, EventKind::Notice, cause)
    };
    events.extend(ended.iter().map(|(number, ms)| of_fault(number, *ms, Cause::FaultEnded)));
    for entry in entries {
        let (fault, at_ms) = match entry {
            Axis(kind, axis, at_ms) => {
                (FaultConfig { axis: Some((*axis).to_owned()), ..FaultConfig::new(*kind) }, at_ms)
            }
            Bus(bus, at_ms) => (FaultConfig { bus: Some(*bus), ..FaultConfig::new(BusFault::Lose) }, at_ms),
            Platform(at_ms) => (FaultConfig::new(PlatformFault::Payload), at_ms),
            Push(at_ms) | Stop(at_ms) => {
                let stop = matches!(entry, Stop(_));
                scenario.stimulus.push(StimulusConfig { stop, ..StimulusConfig::at(1.0) });
                events.push(of_fault(&scenario.stimulus.len(), *at_ms, Cause::StimulusBegan));
                continue;
            }
        };
        scenario.faults.push(fault);
        let (number, struck_ns) = (scenario.faults.len(), Some(at_ms * MS));
        figures.faults.push(FaultFigures { number, struck_ns, ..FaultFigures::default() });
    }
    events.sort_by_key(|event| event.time_ns);
    figures.events = events.iter().map(EventRecord::from).collect();
    (Manifest::new("0.1.0", scenario, 10.0, "virtual", machine), figures)
}

#[test]
fn the_likeliest_entry_of_several_explains_the_stop() {
    let storm: FaultKindConfig = DriveFault::EmcyStorm.into();
    let jam: FaultKindConfig = AxisFault::Jam.into();
    let friction: FaultKindConfig = AxisFault::Friction.into();
    let fault = |place| Some(Injected::Fault(place));
    let stimulus = |place| Some(Injected::Stimulus(place));
    let rows: [(&str, Vec<Entry>, Option<Injected>); 12] = [
        ("nothing", vec![], None),
        ("the last of those that have acted for long", vec![Platform(300), Platform(900)], fault(1)),
        (
            "a fault behind one that the rig tolerates",
            vec![Axis(storm, "d1", 500), Axis(jam, "l2", 1495)],
            fault(1),
        ),
        (
            "a fault of the axis, before another one",
            vec![Axis(jam, "l2", 1490), Axis(storm, "d1", 1493)],
            fault(0),
        ),
        (
            "a fresh fault anywhere, behind an old one of the axis",
            vec![Axis(friction, "l2", 500), Platform(1480)],
            fault(1),
        ),
        (
            "an old fault of the axis, beside a fresh one elsewhere",
            vec![Axis(friction, "l2", 500), Axis(storm, "d1", 1480)],
            fault(0),
        ),
        ("an old fault of the axis", vec![Axis(friction, "l2", 500), Axis(friction, "d1", 900)], fault(0)),
        ("a fault of the bus of the axis", vec![Bus(1, 1490), Axis(jam, "d1", 1493)], fault(0)),
        ("a fault of another bus is none of the axis", vec![Platform(1490), Bus(0, 1493)], fault(0)),
        (
            "a push beside a fault that the rig tolerates",
            vec![Axis(friction, "d1", 500), Push(1495)],
            stimulus(0),
        ),
        ("a push is on no axis", vec![Axis(jam, "l2", 1490), Push(1495)], fault(0)),
        ("an operator's stop, and a strike after the stop", vec![Stop(1490), Platform(1501)], None),
    ];
    for (what, entries, expected) in rows {
        let (manifest, figures) = run(&entries, &[], &[]);
        assert_eq!(declared_cause(&manifest, &figures).map(|cause| cause.injected), expected, "{what}");
    }
}

#[test]
fn no_stimulus_explains_that_the_law_of_a_program_failed() {
    let (mut manifest, mut figures) = run(&[Push(1495)], &[], &[]);
    let failed = event(1499 * MS, Source::Controller, EventKind::Fault, Cause::LawFailed);
    figures.events.insert(0, EventRecord::from(&failed));
    assert!(declared_cause(&manifest, &figures).is_some(), "the rig's own law is tested by the push");
    manifest.controller = Some("python3 law.py".to_owned());
    assert_eq!(declared_cause(&manifest, &figures), None);
    assert!(!acted_before(&manifest, &figures, STOPPED_NS));
}

#[test]
fn an_entry_that_ended_long_before_explains_nothing() {
    for (ended_ms, expected) in [(999, None), (1000, Some(Injected::Fault(0)))] {
        let (manifest, figures) = run(&[Platform(300)], &[], &[(1, ended_ms)]);
        assert_eq!(declared_cause(&manifest, &figures).map(|cause| cause.injected), expected, "{ended_ms}");
    }
}

/// A program that switches the drives off reports nothing.
#[test]
fn a_stop_without_a_report_is_explained_by_what_acted_before_it() {
    for (struck_ms, ended_ms, is_cause) in [(100, 1499, true), (100, 900, false), (1501, 1600, false)] {
        let (manifest, mut figures) = run(&[Platform(struck_ms)], &[], &[(1, ended_ms)]);
        figures.events.retain(|event| event.kind != EventKind::Fault);
        figures.stop_without_event_ns = Some(STOPPED_NS);
        assert_eq!(
            declared_cause(&manifest, &figures).is_some(),
            is_cause,
            "from {struck_ms} to {ended_ms} ms"
        );
    }
}

#[test]
fn an_operators_stop_is_a_cause_of_the_programs_answer_and_explains_no_other_stop() {
    let (manifest, figures) = run(&[Stop(1490)], &[], &[]);
    assert_eq!(declared_cause(&manifest, &figures), None);
    assert!(acted_before(&manifest, &figures, STOPPED_NS));
}

#[test]
fn an_emergency_without_an_error_or_long_before_the_stop_is_no_report_of_it() {
    for (emergencies, expected_ns) in [
        (vec![emergency(500 * MS, 0), emergency(1499 * MS, 0)], STOPPED_NS),
        (vec![emergency(999 * MS, 0x05)], STOPPED_NS),
        (vec![emergency(1499 * MS, 0x05)], 1499 * MS),
    ] {
        let (_, figures) = run(&[], &emergencies, &[]);
        assert_eq!(figures.first_fault().map(|event| event.time_ns), Some(expected_ns), "{emergencies:?}");
    }
}
