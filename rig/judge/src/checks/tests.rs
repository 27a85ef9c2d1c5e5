use super::*;

mod checks {
    use super::*;

    #[test]
    fn no_gap_in_a_part_of_a_recording_says_nothing_of_the_rest() {
        let cases = [
            (Ending::Completed, false, false, 0, "ok"),
            (Ending::Completed, false, false, 1, "FAIL"),
            (Ending::Completed, true, false, 0, "skip"),
            (Ending::Completed, false, true, 0, "skip"),
            (Ending::RecordingFailed, false, false, 0, "skip"),
            (Ending::RecordingFailed, true, true, 1, "FAIL"),
        ];
        for (ending, is_cut_short, is_damaged, missing, mark) in cases {
            let check = dropped_messages(missing, &ending, is_cut_short, is_damaged);
            assert_eq!(check.result.mark(), mark, "{ending:?} {check:?}");
        }
    }

    fn response(max_ns: u64, unbounded: Option<&str>) -> BusResponse {
        let sync = ResponseFigures {
            bus: 1,
            message: "SYNC".to_owned(),
            frames: 1,
            max_ns: Some(max_ns),
            bound_ns: unbounded.is_none().then_some(190_000),
        };
        BusResponse { messages: vec![sync], off_time_frames: 0, unbounded: unbounded.map(str::to_owned) }
    }

    #[test]
    fn a_message_beyond_its_bound_fails_unless_the_bound_does_not_hold() {
        let cases =
            [(190_000, None, "ok"), (191_000, None, "FAIL"), (191_000, Some("bus 0 had 1 errors"), "skip")];
        for (max_ns, unbounded, mark) in cases {
            let check = bus_response(&response(max_ns, unbounded), &SkipFigures::default());
            assert_eq!(check.result.mark(), mark, "{check:?}");
        }
        let failed = bus_response(&response(191_000, None), &SkipFigures::default());
        assert_eq!(failed.finding, "SYNC on bus 1 took 191 µs, bound 190 µs");
        let off_time = BusResponse { off_time_frames: 7, ..response(150_000, None) };
        let check = bus_response(&off_time, &SkipFigures::default());
        assert_eq!(check.result.mark(), "ok");
        assert!(check.finding.ends_with("; 7 frames beside a stall not judged"), "{check:?}");
    }

    #[test]
    fn a_message_beyond_its_bound_by_no_more_than_the_plant_stalled_is_not_judged() {
        for (stalled_ns, overlong_ns, mark) in [(999, 0, "FAIL"), (1000, 0, "skip"), (500, 500, "skip")] {
            let plant = SkipFigures { stalled_ns, overlong_ns, ..SkipFigures::default() };
            let check = bus_response(&response(191_000, None), &plant);
            assert_eq!(check.result.mark(), mark, "{check:?}");
        }
    }
}

mod shortfall {
    use std::path::Path;

    use masseter_recording::MachineInfo;
    use masseter_runtime::messages::Event;
    use masseter_runtime::messages::codes::{EventKind, Source};
    use masseter_runtime::named::Declared;
    use masseter_scenario::Scenario;

    use super::*;
    use crate::breach::earliest;
    use crate::{Analysis, Code, FaultFigures, StoppedBy};

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
            margin: None,
            margin_unit: "mm",
            relative_margin: None,
            worst_at_s: None,
            worst_ns: None,
            latency_ms: None,
            breach: None,
            may_be_disturbed: false,
            is_expected_event: false,
            is_truth,
            plot: None,
        });
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
        assert_eq!(none.result(), CheckResult::Failed, "NaN is no share");
        let still = Shortfall::NotPlayed { share: 0.004, way_mm: 900.0 };
        assert!(
            still
                .to_string()
                .starts_with("the scenario's motion was not played: 0 % of its way of 900.0 mm; ")
        );
    }

    #[test]
    fn a_motion_that_moves_nothing_and_one_that_is_unknown_are_untested() {
        let still =
            |figures: &mut Figures| (figures.motion.way_mm, figures.motion.played) = (Some(0.0), None);
        assert_eq!(shortfall(|_, figures| still(figures)), Some(Shortfall::Still));
        assert_eq!(Shortfall::Still.result(), CheckResult::Untested);
        let stopped = shortfall(|_, figures| {
            still(figures);
            stop_by_request(figures);
        });
        assert_eq!(stopped, None, "it was stopped before it began to move");
        let unknown = |figures: &mut Figures| (figures.motion.way_mm, figures.motion.played) = (None, None);
        assert_eq!(shortfall(|_, figures| unknown(figures)), Some(Shortfall::Unjudged));
    }

    #[test]
    fn a_late_motion_and_missed_commands_have_limits() {
        let motion = |lag_ms| MotionFigures { lag_ms, ..PLAYED };
        let found = [Some(11.0), Some(20.0), Some(20.1), Some(f64::NAN), None]
            .map(|lag_ms| motion_lag(&motion(lag_ms), 20.0).map(|check| check.result.mark()));
        assert_eq!(found, [Some("ok"), Some("ok"), Some("FAIL"), Some("FAIL"), None]);
        assert_eq!(motion_lag(&MotionFigures { way_mm: None, ..PLAYED }, 20.0), None, "an own motion");
        for (change, finding) in [
            (
                (Some(31.0), 0.0, [0.0; 2]),
                "0.0 ms, limit 20 ms; the true jaw was 31.0 ms ahead of the motion",
            ),
            (
                (None, 30.0, [25.0, 0.0]),
                "30.0 ms, limit 20 ms; the controller began the motion 25.0 ms after its lead-in",
            ),
            (
                (None, 30.0, [15.0, 28.0]),
                "30.0 ms, limit 20 ms; the controller's motion time ran back by 28.0 ms",
            ),
            ((None, 30.0, [15.0, 15.0]), "30.0 ms, limit 20 ms"),
        ] {
            let (ahead_ms, lag_ms, lag_causes_ms) = change;
            let motion = MotionFigures { ahead_ms, lag_causes_ms, ..motion(Some(lag_ms)) };
            let check = motion_lag(&motion, 20.0).unwrap();
            assert_eq!((check.result.mark(), check.finding.as_str()), ("FAIL", finding));
        }
    }

    #[test]
    fn states_out_of_order_fail_and_a_stop_by_request_excuses_a_motion_that_never_began() {
        let never = |change: fn(&mut Manifest, &mut Figures)| {
            shortfall(|manifest, figures| {
                (manifest.ending, figures.disorder) = (Ending::Completed, Some(Disorder::NeverBegan));
                change(manifest, figures);
            })
        };
        let found = Some(Shortfall::OutOfOrder(Disorder::NeverBegan));
        assert_eq!(never(|_, _| ()), found);
        let enabling = Some(Code::Known(ControllerState::Enabling));
        assert_eq!(
            never(|_, figures| figures.final_state = Some(Code::Known(ControllerState::Enabling))),
            found
        );
        assert_eq!(never(|_, figures| stop_by_request(figures)), None);
        let died = shortfall(|_, figures| {
            (figures.final_state, figures.disorder) = (enabling, Some(Disorder::NeverBegan));
        });
        assert_eq!(died, None, "the supervisor has not entered an end");
        let back = Disorder::Back { from: ControllerState::Running, to: ControllerState::Easing };
        let found = shortfall(|_, figures| figures.disorder = Some(back)).unwrap();
        assert_eq!(found.result(), CheckResult::Failed);
        assert_eq!(found.to_string(), "the controller went back from the state running to easing");
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
            short.and_then(|short| short.breach(&run)).map(|breach| {
                let motion_ns = run.path_breach.motion_ns.map(|[began_ns, _]| began_ns);
                earliest([breach.of("sequence".into())].into_iter(), motion_ns).unwrap().to_string()
            })
        };
        let early = |manifest: &mut Manifest, figures: &mut Figures| {
            (manifest.declared.motion, figures.running_s) = (PlayedMotion::Own, 4.0);
        };
        let back = |_: &mut Manifest, figures: &mut Figures| {
            let back = Disorder::Back { from: ControllerState::Running, to: ControllerState::Easing };
            (figures.disorder, figures.disorder_ns) = (Some(back), Some(3_500_000_000));
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
        let found =
            TrackingFigures { without_pose: 2, without_pose_ns: Some(4_000_000_000), ..Default::default() };
        let stated = stated_pose(&found).unwrap().breach;
        let stated = earliest(stated.into_iter(), Some(2_000_000_000)).unwrap().to_string();
        assert_eq!(stated, "stated pose: without a finite pose 2 samples, limit 0, at 2.000 s of the motion");
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
        assert_eq!(Shortfall::OnlyStated.result(), CheckResult::Untested);
        assert_eq!(stopped("", |_| ()), None, "such a stop is no pass anyway");
    }

    fn strike(figures: &mut Figures, struck_ns: Option<u64>) {
        let [deviation_mm, deviation_deg] = [0.0; 2];
        figures.faults.push(FaultFigures {
            number: 1,
            struck_ns,
            deviation_mm,
            deviation_deg,
            detection: None,
        });
    }
}
