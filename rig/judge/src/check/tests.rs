use super::*;

mod check {
    use super::*;

    #[test]
    fn what_is_untested_has_not_failed() {
        use CheckResult::{Excused, Failed, NotJudged, Passed, Untested};
        let results = [Passed, Failed, Excused, Untested, NotJudged];
        assert_eq!(results.map(CheckResult::is_failed), [false, true, false, false, false]);
    }

    #[test]
    fn only_a_failure_is_excused() {
        let check = |passed| Check::judged("tracking", String::new(), passed);
        let cases = [(false, true, "lost"), (false, false, "FAIL"), (true, true, "ok"), (true, false, "ok")];
        for (passed, excused, mark) in cases {
            assert_eq!(check(passed).unless(excused).result.mark(), mark);
        }
    }
}

mod motion_checks {
    use masseter_scenario::{BusFault, StimulusConfig};

    use super::*;

    type Spoil = fn(&mut PoseErrors, Option<f64>);

    #[test]
    fn every_error_has_its_own_limit_and_the_closest_is_shown() {
        let limits = ChecksConfig::default();
        let good = PoseErrors {
            samples: 10,
            rms_mm: Some(0.01),
            max_mm: Some(0.02),
            incisal_rms_mm: Some(0.01),
            incisal_max_mm: Some(0.1),
            rms_deg: Some(0.01),
            max_deg: Some(0.02),
        };
        let check = tracking("tracking", &good, &limits);
        assert_eq!(
            (check.result.mark(), check.finding.as_str()),
            ("ok", "incisal point max 0.1000 mm, limit 0.5 mm; 10 samples, approach and hold included")
        );
        let rms_is_closest = PoseErrors { rms_mm: Some(0.05), incisal_max_mm: Some(0.2), ..good };
        let check = tracking("tracking", &rms_is_closest, &limits);
        assert_eq!(check.finding, "platform rms 0.0500 mm, limit 0.1 mm; 10 samples");
        let mm = |share: f64, limit: f64| Some(share * limit);
        let each: [(Spoil, f64); 6] = [
            (|errors, value| errors.rms_mm = value, limits.tracking_rms_mm),
            (|errors, value| errors.max_mm = value, limits.tracking_max_mm),
            (|errors, value| errors.incisal_rms_mm = value, limits.tracking_rms_mm),
            (|errors, value| errors.incisal_max_mm = value, limits.tracking_max_mm),
            (|errors, value| errors.rms_deg = value, limits.tracking_rms_deg),
            (|errors, value| errors.max_deg = value, limits.tracking_max_deg),
        ];
        for (spoil, limit) in each {
            for (share, mark) in [
                (0.99, "ok"),
                (1.0, "ok"),
                (1.01, "FAIL"),
                (f64::INFINITY, "FAIL"),
                (f64::NAN, "FAIL"),
                (-f64::NAN, "FAIL"),
            ] {
                let mut errors = good;
                spoil(&mut errors, mm(share, limit));
                for samples in [10, 1, 0] {
                    let check = tracking("tracking", &PoseErrors { samples, ..errors }, &limits);
                    let expected = if mark == "ok" && samples < 10 { "UNTESTED" } else { mark };
                    assert_eq!(check.result.mark(), expected, "{check:?}");
                }
            }
        }
    }

    #[test]
    fn a_motion_that_hardly_began_is_untested() {
        let still = PoseErrors::default();
        let eased = PoseErrors { max_mm: Some(0.02), ..still };
        let begun = PoseErrors { rms_mm: Some(0.01), ..eased };
        let cases = [
            (0, still, "UNTESTED", "0 samples to compare, at least 10 needed: play more of the motion"),
            (0, eased, "UNTESTED", "0 samples to compare, at least 10 needed: play more of the motion"),
            (9, begun, "UNTESTED", "9 samples to compare, at least 10 needed: play more of the motion"),
            (10, begun, "ok", "platform rms 0.0100 mm, limit 0.1 mm; 10 samples"),
        ];
        for (samples, errors, mark, finding) in cases {
            let check = tracking("tracking", &PoseErrors { samples, ..errors }, &ChecksConfig::default());
            assert_eq!((check.result.mark(), check.finding.as_str()), (mark, finding));
        }
    }

    fn fault() -> FaultConfig {
        FaultConfig {
            bus: Some(1),
            from_s: Some(2.5),
            node: Some(4),
            id: Some(0x204),
            ..FaultConfig::new(BusFault::Lose)
        }
    }

    fn with(faults: Vec<FaultConfig>) -> Scenario {
        Scenario { faults, ..Scenario::default() }
    }

    fn figures(number: usize, struck_ns: Option<u64>, deviation_mm: f64) -> FaultFigures {
        FaultFigures {
            number,
            struck_ns,
            deviation_mm,
            deviation_deg: 0.1,
            led_off_path: true,
            detection: None,
        }
    }

    #[test]
    fn a_declared_fault_that_never_acted_tested_nothing() {
        let what_to_do = ": raise its probability, or let the fault act earlier or longer";
        let cases = [
            (0, None),
            (1, Some(("ok", "1 of 1 declared faults acted".to_owned()))),
            (2, Some(("UNTESTED", format!("1 of 2 declared faults acted, number 2 never{what_to_do}")))),
            (3, Some(("UNTESTED", format!("1 of 3 declared faults acted, number 2, 3 never{what_to_do}")))),
        ];
        for (declared, expected) in cases {
            let found: Vec<_> =
                (1..=declared).map(|number| figures(number, (number == 1).then_some(5), 0.0)).collect();
            let check = faults(&with(vec![fault(); declared]), &found, None, [None; 2]);
            assert_eq!(check.map(|check| (check.result.mark(), check.finding)), expected);
        }
        let found = [figures(1, None, 0.0), figures(2, Some(5), 0.6)];
        let check = faults(&with(vec![fault(), fault()]), &found, None, [None; 2]).unwrap();
        assert_eq!(check.result.mark(), "FAIL", "one fault led the jaw too far: {check:?}");
    }

    #[test]
    fn a_fault_that_is_to_begin_after_the_runs_end_is_told_the_end() {
        let finding = |fault: FaultConfig| {
            let lasted_s = [Some(9.8104), Some(11.3)];
            let found = [figures(1, None, 0.0)];
            faults(&with(vec![fault]), &found, None, lasted_s).unwrap().finding
        };
        let never = "0 of 1 declared faults acted, number 1 never: ";
        let late = "0 of 1 declared faults acted, number 1 at 12 s, after the run's end at ";
        let at = |at_s| FaultConfig { at_s, from_s: None, ..fault() };
        let of_motion = format!("{late}9.810 s: let the fault begin earlier, or play longer");
        assert_eq!(finding(at(Some(12.0))), of_motion);
        assert!(finding(at(Some(9.0))).starts_with(never), "it had its time");
        let waits = FaultConfig { after: Some("fault.jam".to_owned()), ..at(Some(12.0)) };
        assert!(finding(waits).starts_with(never), "nobody knows when the other one comes");
        let of_switch = format!("{late}11.300 s: let the fault begin earlier, or play longer");
        assert_eq!(finding(FaultConfig { from_s: Some(12.0), ..fault() }), of_switch);
        assert!(finding(FaultConfig { from_s: Some(11.0), ..fault() }).starts_with(never));
    }

    #[test]
    fn a_fault_that_strikes_after_the_stop_tested_nothing_unless_it_waits_for_it() {
        let stopped = |struck_ns, after: Option<&str>| {
            let fault = FaultConfig { after: after.map(str::to_owned), ..fault() };
            let chain = Scenario { stimulus: chain(), ..with(vec![fault]) };
            let check = faults(&chain, &[figures(1, Some(struck_ns), 0.0)], Some(5), [None; 2]);
            check.map(|check| (check.result.mark(), check.finding)).unwrap()
        };
        assert_eq!(stopped(5, None).0, "ok", "it began the stop");
        let late = "0 of 1 declared faults acted, number 1 only after the rig had stopped";
        assert_eq!(stopped(6, None), ("UNTESTED", late.to_owned()));
        assert_eq!(stopped(6, Some("stimulus.knock")).0, "UNTESTED");
        assert_eq!(stopped(6, Some("stimulus.early")).0, "UNTESTED");
        for after in ["controller.safe_stop", "controller.disabling", "stimulus.stop", "stimulus.behind"] {
            assert_eq!(stopped(6, Some(after)).0, "ok", "{after}");
        }
    }

    /// An early push, an operator's stop, and a push behind it.
    fn chain() -> Vec<StimulusConfig> {
        let push = |name: &str, after: Option<&str>| StimulusConfig {
            name: Some(name.to_owned()),
            after: after.map(str::to_owned),
            push_n: Some([0.0, 0.0, 1.0]),
            ..StimulusConfig::at(0.1)
        };
        let stop = StimulusConfig { stop: true, ..StimulusConfig::at(0.2) };
        vec![push("early", None), stop, push("behind", Some("stimulus.stop"))]
    }

    #[test]
    fn a_stimulus_that_never_began_began_too_late_or_changes_nothing_tested_nothing() {
        let stopped = |stimulus: Vec<StimulusConfig>, began_ns: &[Option<u64>]| {
            let check = stimuli(&Scenario { stimulus, ..Scenario::default() }, began_ns, Some(5)).unwrap();
            (check.result.mark(), check.finding)
        };
        assert_eq!(stopped(chain(), &[Some(4), Some(5), Some(6)]), ("ok", "3 of 3 stimuli began".to_owned()));
        let found = [
            (
                stopped(chain(), &[Some(6), Some(5), None]),
                "2 of 3 stimuli began, number 3 never: let the stimulus begin earlier, or play longer, number 1 only after the rig had stopped",
            ),
            (
                stopped(
                    vec![StimulusConfig { push_n: Some([0.0; 3]), ..StimulusConfig::at(0.1) }],
                    &[Some(1)],
                ),
                "1 of 1 stimuli began, number 1 without a force or a mass",
            ),
            (
                stopped(
                    vec![StimulusConfig {
                        payload: Some("0 kg".parse().unwrap()),
                        ..StimulusConfig::at(0.1)
                    }],
                    &[Some(1)],
                ),
                "1 of 1 stimuli began, number 1 without a force or a mass",
            ),
        ];
        for (found, expected) in found {
            assert_eq!(found, ("UNTESTED", expected.to_owned()));
        }
        assert!(stimuli(&Scenario::default(), &[], Some(5)).is_none());
    }

    #[test]
    fn a_fault_that_leads_the_jaw_beyond_the_limit_fails_the_run_with_its_name() {
        for (deviation_mm, mark) in [(0.5, "ok"), (0.51, "FAIL")] {
            let found = [figures(1, Some(5), deviation_mm)];
            let check = faults(&with(vec![fault()]), &found, None, [None; 2]).unwrap();
            assert_eq!(check.result.mark(), mark, "{check:?}");
            let named = "number 1, lose (bus 1, node 4, id 204h), moved the jaw 0.510 mm and 0.100° from its path \
                         undetected, limit 0.5 mm and 0.5°";
            assert_eq!(check.finding.contains(named), mark == "FAIL", "{check:?}");
        }
        let other = FaultFigures { led_off_path: false, ..figures(2, Some(7), 9.0) };
        let found = [figures(1, Some(5), 9.0), other];
        let both = faults(&with(vec![fault(), fault()]), &found, None, [None; 2]).unwrap();
        assert!(both.finding.contains("number 1, ") && !both.finding.contains("number 2, "), "{both:?}");
        let turned = FaultFigures { deviation_deg: 0.5, ..figures(1, Some(5), 0.1) };
        let check = faults(&with(vec![fault()]), &[turned], None, [None; 2]).unwrap();
        assert_eq!(check.result.mark(), "ok", "{check:?}");
        for deviation_deg in [0.51, f64::INFINITY, f64::NAN] {
            let turned = FaultFigures { deviation_deg, ..figures(1, Some(5), 0.1) };
            let shifted = FaultFigures { deviation_mm: deviation_deg, ..figures(1, Some(5), 0.1) };
            for found in [turned, shifted] {
                let check = faults(&with(vec![fault()]), &[found], None, [None; 2]).unwrap();
                assert_eq!(check.result.mark(), "FAIL", "{check:?}");
            }
        }
    }
}
