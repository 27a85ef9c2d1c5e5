use std::path::Path;

use masseter_recording::MachineInfo;
use masseter_runtime::messages::Event;
use masseter_runtime::messages::codes::{Cause, EventKind, Source};
use masseter_runtime::named::Declared;
use masseter_scenario::Scenario;

use super::*;
use crate::breach::earliest;
use crate::check::CheckFigures;
use crate::events::EventRecord;
use crate::played::MotionFigures;
use crate::requirements::RequirementFigures;
use crate::{Analysis, Code, FaultFigures};

const PLAYED: MotionFigures = MotionFigures {
    way_mm: Some(900.0),
    played: Some(0.999),
    rest_s: Some(0.0),
    lag_ms: Some(0.0),
    late_ns: None,
    ahead_ms: None,
    lag_causes_ms: [0.0; 2],
    missed_commands: 0,
    missed_in_a_row: 0,
    late_commands: 0,
};

/// A finished run that played its motion, with this change.
fn shortfall(change: impl FnOnce(&mut Manifest, &mut Figures)) -> Option<Shortfall> {
    let machine = MachineInfo { cpu: "any".into(), cores: 2, kernel: "Linux".into(), is_virtual: false };
    let mut manifest = Manifest::new("0.1.0", Scenario::default(), 10.0, "virtual", machine);
    manifest.controller = Some("external".to_owned());
    let mut figures = Analysis::new(&manifest.scenario, &Declared::default()).finish(false, &[]);
    figures.final_state = Some(Code::Known(ControllerState::Finished));
    (figures.running_s, figures.motion, figures.disorder) = (10.0, PLAYED, None);
    change(&mut manifest, &mut figures);
    Shortfall::of(&manifest, &figures)
}

fn stop_by_request(figures: &mut Figures) {
    let stop = Event::new(Source::Controller, EventKind::Transition, Cause::StopRequested);
    figures.events.push(EventRecord::from(&stop));
}

fn require(figures: &mut Figures, result: CheckResult, is_truth: bool) {
    figures.requirements.push(RequirementFigures {
        name: "opens".to_owned(),
        id: None,
        must: String::new(),
        result,
        finding: String::new(),
        figures: CheckFigures::default(),
        worst_ns: None,
        breach: None,
        may_be_disturbed: false,
        is_expected_event: false,
        is_truth,
        plot: None,
    });
}

fn result(of: Shortfall) -> CheckResult {
    of.check("sequence", &Figures::default()).result
}

#[test]
fn the_jaw_goes_the_way_of_the_scenarios_motion() {
    assert_eq!(shortfall(|_, _| ()), None);
    assert_eq!(shortfall(|_, figures| figures.motion.played = Some(0.95)), None);
    for share in [0.949, 0.0, -0.2] {
        let found = shortfall(|_, figures| figures.motion.played = Some(share));
        assert_eq!(found, Some(Shortfall::NotPlayed { share, way_mm: 900.0 }));
    }
    let none = shortfall(|_, figures| figures.motion.played = Some(f64::NAN)).unwrap();
    assert_eq!(result(none), CheckResult::Failed, "NaN is no share");
    let still = Shortfall::NotPlayed { share: 0.004, way_mm: 900.0 };
    assert!(
        still.to_string().starts_with("the scenario's motion was not played: 0 % of its way of 900.0 mm; ")
    );
}

#[test]
fn a_motion_that_moves_nothing_and_one_that_is_unknown_are_untested() {
    let still = |figures: &mut Figures| (figures.motion.way_mm, figures.motion.played) = (Some(0.0), None);
    assert_eq!(shortfall(|_, figures| still(figures)), Some(Shortfall::Still));
    assert_eq!(result(Shortfall::Still), CheckResult::Untested);
    let stopped = shortfall(|_, figures| {
        still(figures);
        stop_by_request(figures);
    });
    assert_eq!(stopped, None, "it was stopped before it began to move");
    let unknown = |figures: &mut Figures| (figures.motion.way_mm, figures.motion.played) = (None, None);
    assert_eq!(shortfall(|_, figures| unknown(figures)), Some(Shortfall::Unjudged));
}

#[test]
fn states_out_of_order_fail_and_a_stop_by_request_excuses_a_motion_that_never_began() {
    let never = |change: fn(&mut Manifest, &mut Figures)| {
        shortfall(|manifest, figures| {
            (manifest.ending, figures.disorder) = (Ending::Completed, Some((Disorder::NeverBegan, None)));
            change(manifest, figures);
        })
    };
    let found = Some(Shortfall::OutOfOrder(Disorder::NeverBegan));
    assert_eq!(never(|_, _| ()), found);
    let enabling = Some(Code::Known(ControllerState::Enabling));
    assert_eq!(never(|_, figures| figures.final_state = Some(Code::Known(ControllerState::Enabling))), found);
    assert_eq!(never(|_, figures| stop_by_request(figures)), None);
    let died = shortfall(|_, figures| {
        (figures.final_state, figures.disorder) = (enabling, Some((Disorder::NeverBegan, None)));
    });
    assert_eq!(died, None, "the supervisor has not entered an end");
    let back = Disorder::Back { from: ControllerState::Running, to: ControllerState::Easing };
    let found = shortfall(|_, figures| figures.disorder = Some((back, None))).unwrap();
    assert_eq!(result(found), CheckResult::Failed);
    assert_eq!(found.to_string(), "the controller went back from the state running to easing");
}

#[test]
fn a_controller_that_waited_for_ever_did_not_begin_or_did_not_end() {
    let overdue = |state, has_begun, disorder: Option<Disorder>| {
        shortfall(|manifest, figures| {
            (manifest.ending, figures.disorder) =
                (Ending::Overdue, disorder.map(|disorder| (disorder, None)));
            (figures.final_state, figures.has_begun) = (Some(Code::Known(state)), has_begun);
            // What the plant did at the deadline.
            figures.stopped_by = Some(StoppedBy::QuickStop);
        })
    };
    let never = Some(Disorder::NeverBegan);
    let back = Some(Disorder::Back { from: ControllerState::Easing, to: ControllerState::Enabling });
    for (state, has_begun, disorder, finding) in [
        (ControllerState::Enabling, false, never, "did not begin the motion within "),
        (ControllerState::Enabling, false, back, "did not begin the motion within "),
        (ControllerState::Easing, true, back, "did not end within "),
        (ControllerState::Running, true, None, "did not end within "),
        (ControllerState::Finished, true, never, "did not end within "),
    ] {
        let found = overdue(state, has_begun, disorder).unwrap();
        assert_eq!(result(found), CheckResult::Failed);
        assert!(found.to_string().starts_with(&format!("the controller {finding}")), "{found}");
    }
}

#[test]
fn what_falls_short_has_a_value_a_limit_and_a_time() {
    type Change = fn(&mut Manifest, &mut Figures);
    let breach = |change: Change| {
        let mut run = Figures::default();
        let short = shortfall(|manifest, figures| {
            figures.path_breach.motion_ns = Some([2_000_000_000, 12_000_000_000]);
            change(manifest, figures);
            run = figures.clone();
        });
        short.and_then(|short| short.check("sequence", &run).breach).map(|breach| {
            let motion_ns = run.path_breach.motion_ns.map(|[began_ns, _]| began_ns);
            earliest([breach].into_iter(), motion_ns).unwrap().to_string()
        })
    };
    let early = |manifest: &mut Manifest, figures: &mut Figures| {
        (manifest.declared.motion, figures.running_s) = (PlayedMotion::Own, 4.0);
    };
    let back = |_: &mut Manifest, figures: &mut Figures| {
        let back = Disorder::Back { from: ControllerState::Running, to: ControllerState::Easing };
        figures.disorder = Some((back, Some(3_500_000_000)));
    };
    let cases: [(Change, Option<&str>); 4] = [
        (
            |_, figures| figures.motion.played = Some(0.5),
            Some(
                "sequence: played part of the motion 50 %, limit 95 %, from 0.000 s to 10.000 s of the motion",
            ),
        ),
        (early, Some("sequence: the motion ran for 4.00 s, limit 9.90 s, at 10.000 s of the motion")),
        (back, Some("sequence: state easing, limit not after running, at 1.500 s of the motion")),
        (|_, figures| figures.motion.played = None, None),
    ];
    for (change, expected) in cases {
        assert_eq!(breach(change).as_deref(), expected);
    }
}

#[test]
fn a_stop_and_an_end_in_another_state_are_told_otherwise() {
    let never_moved = |figures: &mut Figures| figures.motion.played = Some(0.0);
    let stopped = shortfall(|_, figures| {
        never_moved(figures);
        figures.stopped_by = Some(StoppedBy::Master);
    });
    let unfinished = shortfall(|_, figures| {
        never_moved(figures);
        figures.final_state = Some(Code::Known(ControllerState::Running));
    });
    assert_eq!([stopped, unfinished], [None, None]);
}

#[test]
fn an_own_motion_lasts_as_long_as_the_scenario_says_and_is_judged_by_a_requirement() {
    let own = |change: fn(&mut Manifest, &mut Figures)| {
        shortfall(|manifest, figures| {
            manifest.declared.motion = PlayedMotion::Own;
            // Nothing that the scenario's motion would have to be.
            (figures.motion.way_mm, figures.motion.played) = (None, None);
            change(manifest, figures);
        })
    };
    assert_eq!(own(|_, _| ()), Some(Shortfall::Unjudged));
    assert_eq!(own(|manifest, _| manifest.controller = Some("hold".to_owned())), None);
    for (result, is_truth, expected) in [
        (CheckResult::Passed, true, None),
        (CheckResult::Failed, true, None),
        (CheckResult::Untested, true, Some(Shortfall::Unjudged)),
        (CheckResult::Passed, false, Some(Shortfall::Unjudged)),
    ] {
        let found = shortfall(|manifest, figures| {
            manifest.declared.motion = PlayedMotion::Own;
            require(figures, result, is_truth);
        });
        assert_eq!(found, expected, "{result:?}");
    }
    let early = Shortfall::Early { running_s: 4.3, duration_s: 10.0, least_s: 9.9 };
    assert_eq!(own(|_, figures| figures.running_s = 4.3), Some(early));
    // The scenario's motion may be faster than written, and be over sooner.
    assert_eq!(shortfall(|_, figures| figures.running_s = 4.3), None);
    assert_eq!(shortfall(|_, figures| figures.motion.rest_s = Some(0.11)), None);
    let cut = Shortfall::Early { running_s: 9.8, duration_s: 10.0, least_s: 9.88 };
    assert_eq!(shortfall(|_, figures| figures.motion.rest_s = Some(0.2)), Some(cut));
    let interrupted = own(|_, figures| {
        figures.running_s = 4.3;
        stop_by_request(figures);
    });
    assert_eq!(interrupted, Some(Shortfall::Unjudged), "a stop by request excuses the time alone");
}

#[test]
fn an_expected_safe_stop_needs_more_than_the_controllers_word() {
    type Case = (fn(&mut Figures), Option<Shortfall>);
    let stopped = |expect: &str, change: fn(&mut Figures)| {
        shortfall(|manifest, figures| {
            manifest.scenario = Scenario::parse(Path::new("stop.toml"), expect).unwrap();
            figures.final_state = Some(Code::Known(ControllerState::SafeStop));
            figures.stop_without_event_ns = Some(100);
            change(figures);
        })
    };
    let expect = "expect.verdict = 'safe_stop'\n";
    let cases: [Case; 7] = [
        (|_| (), Some(Shortfall::OnlyStated)),
        (|figures| require(figures, CheckResult::Passed, false), Some(Shortfall::OnlyStated)),
        (|figures| require(figures, CheckResult::Passed, true), None),
        (|figures| figures.stopped_by = Some(StoppedBy::Master), None),
        (|figures| strike(figures, Some(1)), None),
        (|figures| strike(figures, None), Some(Shortfall::OnlyStated)),
        (|figures| strike(figures, Some(101)), Some(Shortfall::OnlyStated)),
    ];
    for (number, (change, expected)) in cases.into_iter().enumerate() {
        assert_eq!(stopped(expect, change), expected, "case {number}");
    }
    let long_over = |figures: &mut Figures| {
        strike(figures, Some(1));
        figures.stop_without_event_ns = Some(800_000_000);
        let ended = Event::new(Source::Wire, EventKind::Notice, Cause::FaultEnded);
        let ended = Event { time_ns: 100_000_000, value: 1.0, ..ended };
        figures.events.push(EventRecord::from(&ended));
    };
    assert_eq!(stopped(expect, long_over), Some(Shortfall::OnlyStated), "the fault had ended long before");
    assert_eq!(result(Shortfall::OnlyStated), CheckResult::Untested);
    assert_eq!(stopped("", |_| ()), None, "such a stop is no pass anyway");
}

fn strike(figures: &mut Figures, struck_ns: Option<u64>) {
    figures.faults.push(FaultFigures { number: 1, struck_ns, ..FaultFigures::default() });
}
