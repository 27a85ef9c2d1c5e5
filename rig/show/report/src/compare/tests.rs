use super::*;

mod compare {
    use serde_json::json;

    use super::*;

    fn side(path: &str, p50_ns: f64, seed: u64) -> ComparedRun {
        let figures = json!({
            "cycles": 5,
            "intervals": [{"name": "control", "p50_ns": p50_ns, "p50_noise_ns": 1.0, "max_ns": p50_ns}],
        });
        let verdict = json!({"word": "PASS", "reason": "every check passed", "warnings": ["a row jumps"]});
        let summary = json!({"form": SUMMARY_FORM, "verdict": verdict, "figures": figures});
        ComparedRun::new(path, &summary, &json!({"clock": "rt", "scenario": {"seed": seed}})).unwrap()
    }

    fn comparison() -> Comparison {
        let (a, b) = (side("A", 5000.0, 1), side("B", 6000.0, 2));
        let differs = differences(&a.circumstances, &b.circumstances);
        let changes = changes(&a.figures, &b.figures);
        Comparison { form: FORM, a, b, differs, changes }
    }

    #[test]
    fn verdicts_come_first_then_what_differs_then_what_changed_most_surely() {
        let text = comparison().in_words().unwrap();
        let places = [
            "A: A\n   PASS: every check passed\n   warning: a row jumps\nB: B\n",
            "warning: these were not runs of the same",
            "scenario.seed                                      1                        2",
            "intervals.control.p50_ns                                     5000           6000   +20.0 %  beyond spread",
            "intervals.control.max_ns ",
            "1 figures are the same",
        ]
        .map(|part| text.find(part).unwrap_or_else(|| panic!("{part} is missing in {text}")));
        assert!(places.is_sorted(), "{text}");
    }

    #[test]
    fn json_has_every_figure_and_the_verdicts() {
        let json = serde_json::to_value(comparison()).unwrap();
        assert_eq!(
            json["a"],
            json!({"path": "A", "verdict": {
                "word": "PASS", "reason": "every check passed", "warnings": ["a row jumps"],
            }})
        );
        assert_eq!(json["differs"], json!([{"key": "scenario.seed", "a": "1", "b": "2"}]));
        assert_eq!(json["changes"].as_array().unwrap().len(), 3);
        assert_eq!(json["changes"][0]["judgement"], "same");
    }
}

mod compared_run {
    use serde_json::json;

    use super::*;

    #[test]
    fn what_is_no_summary_of_this_form_is_refused() {
        let verdict = json!({"word": "PASS", "reason": "every check passed"});
        for (summary, why) in [
            (json!({"form": SUMMARY_FORM, "verdict": verdict, "figures": {}}), None),
            (json!({"form": 9, "verdict": verdict, "figures": {}}), Some("it has form 9")),
            (json!({"form": SUMMARY_FORM, "verdict": verdict, "figures": []}), Some("it has no figures")),
            (json!({"form": SUMMARY_FORM, "figures": {}}), Some("it has no verdict")),
            (json!([]), Some("it has form null")),
        ] {
            let refusal = ComparedRun::new("A", &summary, &json!({})).err().map(|error| error.to_string());
            match (&refusal, why) {
                (Some(refusal), Some(why)) => assert!(refusal.contains(why), "{refusal}"),
                _ => assert_eq!((refusal.as_deref(), why), (None, None)),
            }
        }
    }
}

mod changes {
    use serde_json::json;

    use super::*;

    #[test]
    fn changes_are_held_against_the_spread_of_both_runs() {
        let run = |p50: f64, max: f64, rms: f64| {
            flatten(&json!({
                "tracking": {"rms_mm": rms, "rms_noise_mm": 0.01},
                "intervals": [{"name": "control", "p50_ns": p50, "p50_noise_ns": 3.0, "max_ns": max, "max_at_ns": 7}],
            }))
        };
        let changes = changes(&run(100.0, 900.0, 0.5), &run(110.0, 800.0, 0.52));
        let judged: Vec<_> =
            changes.iter().map(|change| (change.figure.as_str(), change.judgement)).collect();
        assert_eq!(
            judged,
            [
                ("intervals.control.max_ns", ChangeJudgement::SpreadUnknown),
                ("intervals.control.p50_ns", ChangeJudgement::WithinSpread),
                ("tracking.rms_mm", ChangeJudgement::WithinSpread),
            ]
        );
        assert_eq!(judge_change(Some(30.0), Some(10.0), Some(4.0)), ChangeJudgement::BeyondSpread);
        assert_eq!(judge_change(Some(10.0), Some(10.0), None), ChangeJudgement::Same);
    }

    #[test]
    fn messages_are_compared_by_bus_and_name_and_missing_ones_are_listed() {
        let message =
            |bus: u64, message: &str, max_ns: u64| json!({"bus": bus, "message": message, "max_ns": max_ns});
        let run = |messages: [Value; 3], cycle: u64| {
            let longest = json!({"cycle": cycle});
            flatten(&json!({"bus_response": {"messages": messages}, "worst_cycles": [longest]}))
        };
        let a = run([message(0, "SYNC", 48), message(0, "TPDO1 1", 190), message(1, "SYNC", 50)], 7);
        let b = run([message(0, "SYNC", 49), message(1, "SYNC", 50), message(1, "TPDO1 4", 200)], 9);
        let changes = changes(&a, &b);
        let told: Vec<_> = changes
            .iter()
            .map(|change| {
                let message = change.figure.strip_prefix("bus_response.messages.").unwrap();
                (message, change.a, change.b, change.judgement)
            })
            .collect();
        assert_eq!(
            told,
            [
                ("can0 SYNC.max_ns", Some(48.0), Some(49.0), ChangeJudgement::SpreadUnknown),
                ("can0 TPDO1 1.max_ns", Some(190.0), None, ChangeJudgement::OnlyInA),
                ("can1 SYNC.max_ns", Some(50.0), Some(50.0), ChangeJudgement::Same),
                ("can1 TPDO1 4.max_ns", None, Some(200.0), ChangeJudgement::OnlyInB),
            ]
        );
    }

    #[test]
    fn a_nanosecond_is_no_change_however_well_the_seconds_agree() {
        let run = |p50: f64| {
            flatten(&json!({"intervals": [{"name": "control", "p50_ns": p50, "p50_noise_ns": 0.0}]}))
        };
        let judged = |a, b| changes(&run(a), &run(b))[0].judgement;
        assert_eq!(judged(16.0, 17.0), ChangeJudgement::WithinSpread);
        assert_eq!(judged(16.0, 24.0), ChangeJudgement::BeyondSpread);
        assert_eq!(judged(400_000.0, 400_400.0), ChangeJudgement::WithinSpread);
    }
}
