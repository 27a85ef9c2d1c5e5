use masseter_runtime::messages::Event;
use masseter_runtime::messages::codes::EventKind;

use super::*;
use crate::{SignalFigures, events::Code};
use masseter_recording::{MachineInfo, Usage};
use masseter_runtime::named::Signal;

fn run(stopped_by: Option<StoppedBy>, events: &[EventRecord]) -> Figures {
    Figures { stopped_by, events: events.to_vec(), ..Figures::default() }
}

#[test]
fn a_safe_stop_is_explained_by_what_went_wrong_first() {
    let event = |source, kind, cause| Event::new(source, kind, cause);
    let lost = event(Source::Master, EventKind::Fault, Cause::ProcessDataLost);
    let events = [
        event(Source::Wire, EventKind::Notice, Cause::FaultInjected),
        Event { axis: 0, node: 1, value: 4.0, ..lost },
        event(Source::Controller, EventKind::Fault, Cause::MasterFault),
    ];
    let (outcome, reason) =
        ending(&Ending::SafeStop, None, &run(None, &events.map(|event| EventRecord::from(&event)))).unwrap();
    assert_eq!(outcome, Outcome::Named(SafeStop));
    assert_eq!(
        reason,
        "the controller stopped the rig; first fault: master: process_data_lost \
         (axis d1 (node 1 on bus 0): process data missing for 4 cycles)"
    );
    assert_eq!(
        ending(&Ending::SafeStop, None, &Figures::default()).unwrap().1,
        "the controller stopped the rig"
    );
}

#[test]
fn what_master_and_drives_show_comes_before_what_the_controller_reports() {
    let fault = |source, cause| EventRecord::from(&Event::new(source, EventKind::Fault, cause));
    let events = [fault(Source::Controller, Cause::LawFailed), fault(Source::Master, Cause::BadMessage)];
    let shown = |stopped_by| ending(&Ending::Completed, None, &run(stopped_by, &events));
    assert_eq!(shown(None), None);
    let stopped = |reason: &str| Some((Outcome::Named(SafeStop), reason.to_owned()));
    assert_eq!(
        shown(Some(StoppedBy::Master)),
        stopped("the master stopped the drives; first fault: master: bad_message (value 0, limit 0)")
    );
    assert_eq!(
        ending(&Ending::Completed, None, &run(Some(StoppedBy::QuickStop), &events[..1])),
        stopped("the drives made a quick stop")
    );
    // The plant's own stop at the deadline is no fault.
    assert_eq!(ending(&Ending::Overdue, None, &run(Some(StoppedBy::QuickStop), &events)), None);
    assert_eq!(
        ending(&Ending::Overdue, None, &run(Some(StoppedBy::Master), &events)),
        shown(Some(StoppedBy::Master))
    );
    // The end of a process comes before both.
    let died = Ending::died("plant", "signal 9".to_owned());
    assert_eq!(ending(&died, None, &run(Some(StoppedBy::Master), &events)).unwrap().0, Outcome::Named(Died));
}

#[test]
fn a_fault_of_the_scenario_stands_before_what_followed_from_it() {
    let declared = || Some("fault encoder_stuck (l1) at 1.800 s".to_owned());
    let event = |time_ns, source, kind, cause| EventRecord {
        time_ns,
        ..EventRecord::from(&Event::new(source, kind, cause))
    };
    let began = EventRecord {
        transition: Some(["approaching".to_owned(), ControllerState::Running.name().to_owned()]),
        ..event(500_000_000, Source::Controller, EventKind::Transition, Cause::Sequence)
    };
    let found = event(2_302_000_000, Source::Master, EventKind::Fault, Cause::BadMessage);
    let events = [began, found];
    assert_eq!(
        stopped(None, declared(), &run(None, &events)),
        "fault encoder_stuck (l1) at 1.800 s → detected at 1.802 s: master: bad_message (value 0, limit 0) \
         → the controller stopped the rig"
    );
    assert_eq!(
        stopped(Some(StoppedBy::QuickStop), declared(), &Figures::default()),
        "fault encoder_stuck (l1) at 1.800 s → the drives made a quick stop"
    );
}

#[test]
fn a_death_has_its_time_in_the_motion() {
    let mut figures = Figures { last_cycle_ns: 2_500_000_000, ..Figures::default() };
    assert_eq!(when_died(&figures), "before the motion");
    figures.path_breach.motion_ns = Some([1_000_000_000, 3_000_000_000]);
    for (state, when) in [
        (ControllerState::Running, "1.500 s after the motion began"),
        (ControllerState::SafeStop, "1.500 s after the motion began"),
        (ControllerState::Finished, "after the motion"),
    ] {
        figures.final_state = Some(Code::Known(state));
        assert_eq!(when_died(&figures), when);
    }
}

#[test]
fn a_process_that_hardly_sleeps_is_named_with_what_to_do() {
    let usage = |cpu_s| {
        let plant = Usage { observed_s: 2.0, cpu_s, ..Usage::default() };
        RunUsage { processes: [("plant".to_owned(), plant)].into(), ..RunUsage::default() }
    };
    assert_eq!(overload(&usage(1.0), 20_000), None);
    let said = overload(&usage(1.9), 20_000).unwrap();
    assert!(said.contains("plant kept its core busy for 95 %") && said.contains("below 20000"), "{said}");
}

#[test]
fn a_jump_of_the_clock_excuses_runs_on_real_interfaces_alone() {
    let simulated = CanConfig::default();
    let real = CanConfig { interfaces: vec!["can0".to_owned()], ..simulated.clone() };
    let jump = |clock_jump_s, can| clock_jump(&RunUsage { clock_jump_s, ..RunUsage::default() }, can);
    assert_eq!(jump(0.0, &real), None);
    assert_eq!(jump(-3.5, &simulated), None);
    let (outcome, reason) = jump(-3.5, &real).unwrap();
    assert_eq!(outcome, Outcome::Invalid);
    assert!(reason.contains("jumped by -3.500 s"), "{reason}");
}

#[test]
fn the_exit_codes_of_scenarios_are_those_of_the_program() {
    for expected in ExpectedVerdict::ALL {
        assert_eq!(Outcome::Named(expected).word_and_exit().1 as u8, expected.exit_code(), "{expected:?}");
    }
    assert_eq!((Outcome::Invalid.named(), Outcome::ChecksFailed.named()), (None, Some(Fail)));
}

#[test]
fn a_pass_says_what_of_the_bite_force_never_was() {
    let machine = MachineInfo { cpu: "any".into(), cores: 2, kernel: "Linux".into(), is_virtual: false };
    let manifest = Manifest::new("0.1.0", Scenario::default(), 10.0, "virtual", machine);
    let signal = |(name, values, max): &(&str, u64, f64)| {
        let (name, unit, about) = ((*name).to_owned(), String::new(), String::new());
        let max = (*values > 0).then_some(*max);
        let (signal, not_finite) = (Signal { name, unit, about }, 0);
        SignalFigures { signal, values: *values, not_finite, min: max, mean: max, max, last: max }
    };
    let passes = |signals: &[(&str, u64, f64)]| {
        let signals = signals.iter().map(signal).collect();
        passed(&manifest, &Figures { signals, ..Figures::default() })
    };
    let [estimate, bite] = [("bite_force_n", 9, 20.0), ("force_phase", 9, 1.0)];
    let all = [estimate, bite, ("probed_stiffness_n_per_m", 9, 4e3)];
    assert_eq!(passes(&[]), "every check passed");
    assert_eq!(passes(&all), "every check passed");
    for (signals, said) in [
        (vec![("bite_force_n", 0, 0.0), ("force_phase", 9, 0.0)], "the bite force was never estimated: "),
        (vec![estimate, ("force_phase", 9, 0.0)], "the bite force was never controlled: "),
        (
            vec![estimate, bite, ("probed_stiffness_n_per_m", 9, 0.0)],
            "no probe of the stiffness came to its end: ",
        ),
    ] {
        let found = passes(&signals);
        assert!(found.starts_with(&format!("every check passed; {said}")), "{found}");
    }
    let signals = vec![signal(&("force_phase", 9, 0.0))];
    let figures = Figures { signals, ..Figures::default() };
    let of_law = Manifest { controller: Some("python3 law.py".to_owned()), ..manifest };
    assert_eq!(passed(&of_law, &figures), "every check passed", "a law of a user controls in another way");
}
