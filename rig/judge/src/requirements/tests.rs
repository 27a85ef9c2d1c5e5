//! Requirements over runs of a few samples, a millisecond apart.

use CheckResult::{Failed, Passed, Untested};
use masseter_model::geometry::AXES;
use masseter_recording::Recorded;
use masseter_runtime::messages::codes::{Cause, ControllerState, DriveState, EventKind, Source};
use masseter_runtime::messages::{Event, Reading, State};
use masseter_runtime::named::Declared;
use masseter_scenario::Scenario;

use crate::check::CheckResult;
use crate::events::EventRecord;
use crate::requirements::{RequirementFigures, Requirements, check_requirements};
use crate::signals::Timeline;

const MS: u64 = 1_000_000;

/// The requirements of a scenario, and the samples that they judge.
struct Judge {
    timeline: Timeline,
    requirements: Requirements,
}

impl Judge {
    fn new(scenario: &Scenario) -> Self {
        let requirements = Requirements::new(scenario, &Declared::default());
        Self { timeline: Timeline::default(), requirements }
    }

    fn take(&mut self, message: &Recorded) {
        self.timeline.take(message).iter().for_each(|sample| self.requirements.judge_sample(sample));
    }

    fn finish(mut self) -> Vec<RequirementFigures> {
        while let Some(sample) = self.timeline.finish() {
            self.requirements.judge_sample(&sample);
        }
        self.requirements.into_figures()
    }
}

/// A run: the force of axis l1 at each sample, N, and the controller's state.
struct Run {
    forces_n: Vec<f64>,
    states: Vec<ControllerState>,
    /// Times of the first fault's activations, ms.
    strikes_ms: Vec<f64>,
    /// Samples without a state.
    lost: Vec<usize>,
}

impl Run {
    /// The motion begins with the first sample.
    fn of(forces_n: &[f64]) -> Self {
        let states = vec![ControllerState::Running; forces_n.len()];
        Self { forces_n: forces_n.to_vec(), states, strikes_ms: Vec::new(), lost: Vec::new() }
    }

    fn stopping_at(mut self, sample: usize) -> Self {
        self.states[sample..].fill(ControllerState::SafeStop);
        self
    }

    fn struck_at(mut self, time_ms: f64) -> Self {
        self.strikes_ms.push(time_ms);
        self
    }

    fn judge(&self, requirement: &str) -> RequirementFigures {
        let text = format!(
            "[[faults]]\nkind = 'encoder_stuck'\naxis = 'l2'\nat_s = 0.0\n[[require]]\nname = 'it'\n{requirement}"
        );
        let scenario = Scenario::parse("s.toml".as_ref(), &text).unwrap();
        scenario.validate().unwrap();
        check_requirements(&scenario, None).unwrap();
        let mut requirements = Judge::new(&scenario);
        for time_ms in &self.strikes_ms {
            let event = Event::new(Source::Scenario, EventKind::Notice, Cause::FaultInjected);
            let time_ns = (1e9 + time_ms * 1e6) as u64;
            requirements.timeline.event(&EventRecord::from(&Event { time_ns, value: 1.0, ..event }));
        }
        for (place, (force_n, state)) in self.forces_n.iter().zip(&self.states).enumerate() {
            let (cycle, sampled_ns) = (place as u64 + 1, 1000 * MS + place as u64 * MS);
            if !force_n.is_nan() {
                let mut reading = Reading { cycle, sampled_ns, ..Reading::default() };
                reading.drive_state = [DriveState::OperationEnabled.code(); AXES];
                reading.force_n[3] = *force_n;
                requirements.take(&Recorded::Reading(reading));
            }
            if self.lost.contains(&place) {
                continue;
            }
            let controller_state = state.code();
            requirements.take(&Recorded::State(State {
                cycle,
                due_ns: sampled_ns,
                controller_state,
                ..State::default()
            }));
        }
        requirements.finish().swap_remove(0)
    }
}

/// Result, margin, and the moment of the smallest margin in samples.
fn found(figures: &RequirementFigures) -> (CheckResult, Option<f64>, Option<f64>) {
    let rounded = |value: f64| (value * 1e6).round() / 1e6;
    (
        figures.result,
        figures.figures.margin.map(rounded),
        figures.figures.worst_at_s.map(|at_s| rounded(at_s * 1e3)),
    )
}

#[test]
fn bounds_have_the_smallest_margin_and_its_moment() {
    let run = Run::of(&[1.0, 4.0, 3.0, -2.0]);
    for (bounds, expected) in [
        ("max = '5 N'", (Passed, Some(1.0), Some(1.0))),
        ("max = '4 N'", (Passed, Some(0.0), Some(1.0))),
        ("max = '3.5 N'", (Failed, Some(-0.5), Some(1.0))),
        ("min = '-3 N'\nmax = '5 N'", (Passed, Some(1.0), Some(1.0))),
        ("min = '-2.5 N'\nmax = '5 N'", (Passed, Some(0.5), Some(3.0))),
        ("statistic = 'abs'\nmax = '4.5 N'", (Passed, Some(0.5), Some(1.0))),
        ("statistic = 'mean'\nmax = '2 N'", (Passed, Some(0.5), None)),
        ("statistic = 'rms'\nmax = '2 N'", (Failed, Some(-0.738_613), None)),
        ("statistic = 'peak_to_peak'\nmax = '5 N'", (Failed, Some(-1.0), None)),
        ("statistic = 'percentile'\npercentile = 50\nmax = '2 N'", (Passed, Some(1.0), None)),
        ("max = '5 N'\nduring = { from_s = 0.002, to_s = 0.003 }", (Passed, Some(2.0), Some(2.0))),
        ("max = '0.005 kN'", (Passed, Some(1.0), Some(1.0))),
    ] {
        let figures = run.judge(&format!("signal = 'l1.force'\n{bounds}"));
        assert_eq!(found(&figures), expected, "{bounds}: {figures:?}");
    }
    let sum = run.judge("expression = 'abs({l1.force}) * 2'\nunit = 'N'\nmax = '9 N'");
    assert_eq!(found(&sum), (Passed, Some(1.0), Some(1.0)));
}

#[test]
fn a_plot_shows_what_was_judged() {
    let of_run = |forces_n: &[f64], bounds: &str| {
        let plot = Run::of(forces_n).judge(&format!("signal = 'l1.force'\n{bounds}")).plot.unwrap();
        (plot.limits, plot.found)
    };
    let signed = [3.0, -4.0, 4.0, -3.0];
    assert_eq!(of_run(&signed, "max = '5 N'"), (vec![5.0], None));
    assert_eq!(of_run(&signed, "statistic = 'abs'\nmax = '5 N'"), (vec![5.0, -5.0], None));
    assert_eq!(of_run(&[3.0, 4.0], "statistic = 'abs'\nmax = '5 N'"), (vec![5.0], None));
    let (limits, found) = of_run(&[4.0, -4.0, 4.0], "statistic = 'rms'\nmax = '5 N'");
    assert_eq!((limits, found), (vec![5.0, -5.0], Some(("rms", vec![4.0, -4.0]))));
    // No level of the curve is the limit of a range.
    let (limits, found) = of_run(&signed, "statistic = 'peak_to_peak'\nmax = '5 N'");
    assert_eq!((limits, found), (Vec::new(), Some(("range", vec![-4.0, 4.0]))));
}

#[test]
fn bounds_without_a_sample_are_untested_and_missing_samples_are_counted() {
    let gap = Run::of(&[1.0, f64::NAN, 3.0]);
    let figures = gap.judge("signal = 'l1.force'\nmax = '5 N'");
    assert_eq!(
        (figures.result, figures.finding.as_str()),
        (Untested, "3 N in 2 samples, 1 missing in between")
    );
    let failed = gap.judge("signal = 'l1.force'\nmax = '2 N'");
    assert_eq!(failed.result, Failed);
    let never = gap.judge("never = 'l1.force > 5 N'");
    assert_eq!(
        (never.result, never.finding.as_str()),
        (Untested, "never in 2 samples, 1 missing in between")
    );
    let mut begins = Run::of(&[f64::NAN, 1.0, 3.0]);
    let figures = begins.judge("signal = 'l1.force'\nmax = '5 N'");
    let why = "3 N in 2 samples, 1 missing at the motion's start";
    assert_eq!((figures.result, figures.finding.as_str()), (Untested, why));
    begins.states[0] = ControllerState::Easing;
    let figures = begins.judge("signal = 'l1.force'\nmax = '5 N'");
    assert_eq!((figures.result, figures.finding.as_str()), (Passed, "3 N in 2 samples, 1 missing"));
    let vanishes = Run::of(&[1.0, 3.0, f64::NAN]).judge("signal = 'l1.force'\nmax = '5 N'");
    let why = "3 N in 2 samples, 1 missing at the motion's end";
    assert_eq!((vanishes.result, vanishes.finding.as_str()), (Untested, why));
    let lost = Run::of(&[f64::NAN; 3]).judge("signal = 'l1.force'\nmax = '5 N'");
    assert_eq!(found(&lost), (Untested, None, None), "{lost:?}");
    let never = gap.judge("signal = 'l1.force'\nmax = '5 N'\nduring = 'safe_stop'");
    assert_eq!(
        (never.result, never.finding.as_str()),
        (Untested, "no sample while controller.state == safe_stop")
    );
    let never = gap.judge("signal = 'l1.force'\nmax = '5 N'\nduring = { after = 'fault.encoder_stuck' }");
    assert_eq!(never.result, Untested);
}

#[test]
fn a_window_after_an_occurrence_begins_with_the_next_sample() {
    let run = Run::of(&[9.0, 9.0, 1.0, 2.0, 9.0]).struck_at(1.5);
    let figures = run.judge(
        "signal = 'l1.force'\nmax = '3 N'\nduring = { after = 'fault.encoder_stuck', for_s = 0.0015 }",
    );
    assert_eq!(found(&figures), (Passed, Some(1.0), Some(3.0)), "{figures:?}");
}

#[test]
fn a_response_has_a_latency_and_the_time_left_as_its_margin() {
    let run = Run::of(&[0.0; 12]).struck_at(1.5).stopping_at(6);
    let respond = "when = 'fault.encoder_stuck'\nthen = 'controller.state == safe_stop'";
    // The fault is between two samples, the stop is at sample 6.
    for (within, expected) in [
        ("within = '5 ms'", (Passed, Some(0.5), Some(1.5))),
        ("within = '4.5 ms'", (Passed, Some(0.0), Some(1.5))),
        ("within = '4.499 ms'", (Failed, Some(-0.001), Some(1.5))),
        ("within = '4 ms'", (Failed, Some(-0.5), Some(1.5))),
        ("within = '4.5 ms'\nstays_for = '5 ms'", (Passed, Some(0.0), Some(1.5))),
        ("within = '5 ms'\nstays_for = '100 ms'", (Passed, Some(0.5), Some(1.5))),
        ("within = '9 ms'\ndelay = '5 ms'", (Passed, Some(3.5), Some(1.5))),
    ] {
        let figures = run.judge(&format!("{respond}\n{within}"));
        assert_eq!(found(&figures), expected, "{within}: {figures:?}");
        let latency_ms = if within.contains("delay") { 5.5 } else { 4.5 };
        assert!((figures.figures.latency_ms.unwrap() - latency_ms).abs() < 1e-9, "{figures:?}");
    }
    let idle = Run::of(&[0.0; 4]).judge(&format!("{respond}\nwithin = '5 ms'"));
    assert_eq!((idle.result, idle.finding.as_str()), (Untested, "fault.encoder_stuck never came"));
    let never = Run::of(&[0.0; 12]).struck_at(1.5).judge(&format!("{respond}\nwithin = '5 ms'"));
    assert_eq!((never.result, never.figures.margin, never.figures.latency_ms), (Failed, None, None));
}

#[test]
fn a_condition_that_held_before_its_trigger_is_said() {
    let respond = "when = 'fault.encoder_stuck'\nthen = 'controller.state == safe_stop'\nwithin = '5 ms'";
    let finding = |stop| Run::of(&[0.0; 12]).struck_at(4.5).stopping_at(stop).judge(respond).finding;
    assert_eq!(
        finding(2),
        "1 of 1 trigger answered; longest latency 0.500 ms; the condition held already before 1 trigger"
    );
    assert_eq!(finding(6), "1 of 1 trigger answered; longest latency 1.500 ms");
}

#[test]
fn a_response_that_does_not_stay_fails() {
    let mut run = Run::of(&[0.0; 12]).struck_at(0.0).stopping_at(2);
    run.states[5..].fill(ControllerState::Running);
    let respond = "when = 'fault.encoder_stuck'\nthen = 'safe_stop'\nwithin = '9 ms'";
    let respond = respond.replace("'safe_stop'", "'controller.state == safe_stop'");
    assert_eq!(run.judge(&format!("{respond}\nstays_for = '2 ms'")).result, Passed);
    assert_eq!(run.judge(&format!("{respond}\nstays_for = '3 ms'")).result, Failed);
}

/// A controller that has ended gives no more values: that cuts a window and answers nothing. A value that vanishes while the
/// motion runs does not hold.
#[test]
fn a_condition_has_values_as_long_as_the_motion_runs() {
    use ControllerState::{Finished, Running, SafeStop};
    let lost = f64::NAN;
    let then = "when = 'fault.encoder_stuck'\nthen = 'l1.force < 5 N'";
    let judge_until = |last: ControllerState, forces_n: &[f64], struck_ms: f64, times: &str| {
        let mut run = Run::of(forces_n).struck_at(struck_ms);
        run.states[3..].fill(last);
        run.judge(&format!("{then}\n{times}")).result
    };
    let judge = |forces_n: &[f64], struck_ms, times| judge_until(Finished, forces_n, struck_ms, times);
    let stays = "within = '1 ms'\nstays_for = '9 ms'";
    assert_eq!(judge(&[0.0, 0.0, 0.0, lost, lost], 1.0, stays), Passed);
    assert_eq!(judge(&[0.0, 0.0, 9.0, lost, lost], 1.0, stays), Failed);
    assert_eq!(judge(&[0.0, 0.0, 0.0, lost, 0.0], 1.0, stays), Failed, "it is missing in between");
    assert_eq!(judge_until(Running, &[0.0, 0.0, 0.0, lost, lost], 1.0, stays), Failed, "it vanishes");
    assert_eq!(judge_until(SafeStop, &[0.0, 0.0, 0.0, lost, lost], 1.0, stays), Passed, "a stop excuses it");
    assert_eq!(judge(&[0.0, 0.0, lost, lost, lost], 2.0, "within = '1 ms'"), Failed, "nothing answers");
}

/// The largest, over the answers in time, of the smallest robustness while it must stay: by the definition.
fn robustness(forces_n: &[f64], trigger: usize, within: usize, stays_for: usize, limit_n: f64) -> f64 {
    let end = forces_n.len() - 1;
    let smallest = |at: usize| {
        (at..=(at + stays_for).min(end)).map(|i| limit_n - forces_n[i]).fold(f64::INFINITY, f64::min)
    };
    (trigger..=(trigger + within).min(end)).map(smallest).fold(f64::NEG_INFINITY, f64::max)
}

#[test]
fn the_margin_of_a_response_of_a_signal_is_the_robustness_of_temporal_logic() {
    let mut seed = 7_u64;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 40) as f64 / (1_u64 << 24) as f64
    };
    for _ in 0..200 {
        let forces_n: Vec<f64> = (0..30).map(|_| random() * 10.0).collect();
        let (trigger, within, stays_for) =
            ((random() * 29.0) as usize, (random() * 12.0) as usize, (random() * 6.0) as usize);
        let run = Run::of(&forces_n).struck_at(trigger as f64);
        let figures = run.judge(&format!(
            "when = 'fault.encoder_stuck'\nthen = 'l1.force < 5 N'\nwithin = '{within} ms'\nstays_for = '{stays_for} ms'"
        ));
        let expected = robustness(&forces_n, trigger, within, stays_for, 5.0);
        assert!(
            (figures.figures.margin.unwrap() - expected).abs() < 1e-9,
            "{trigger} {within} {stays_for}: {figures:?}"
        );
        assert_eq!(figures.result == Passed, expected >= 0.0, "{figures:?}");
    }
}

#[test]
fn a_condition_as_trigger_counts_when_it_begins() {
    let run = Run::of(&[0.0, 6.0, 6.0, 1.0, 6.0, 6.0, 6.0, 1.0]);
    let figures = run.judge("when = 'l1.force > 5 N'\nthen = 'l1.force < 2 N'\nwithin = '2 ms'");
    assert_eq!(
        (figures.result, figures.finding.as_str()),
        (Failed, "1 of 2 triggers answered; longest latency 3.000 ms")
    );
    assert_eq!(figures.figures.worst_at_s, Some(0.004));
}

#[test]
fn what_must_never_hold_has_its_first_moment() {
    let run = Run::of(&[1.0, 6.0, 7.0, 2.0]).struck_at(2.0);
    let figures = run.judge("never = 'l1.force > 5 N'");
    assert_eq!(
        (found(&figures), figures.finding.as_str()),
        ((Failed, Some(-2.0), Some(1.0)), "in 2 of 4 samples")
    );
    let figures = run.judge("never = 'l1.force > 8 N'");
    assert_eq!(found(&figures), (Passed, Some(1.0), Some(2.0)));
    assert_eq!(run.judge("never = 'fault.encoder_stuck'").result, Failed);
    assert_eq!(run.judge("never = 'master.following_error'").result, Passed);
    assert_eq!(run.judge("never = 'safe_stop'").result, Passed);
}

#[test]
fn occurrences_are_counted_and_ordered() {
    let run = Run::of(&[0.0; 12]).struck_at(1.0).struck_at(3.0).stopping_at(6);
    for (requirement, result) in [
        ("event = 'fault.encoder_stuck'\nat_least = 2", Passed),
        ("event = 'fault.encoder_stuck'\nat_least = 3", Failed),
        ("event = 'fault.encoder_stuck'\nat_most = 1", Failed),
        ("event = 'fault.encoder_stuck'\nat_most = 1\nduring = { from_s = 0.002 }", Passed),
        ("order = ['fault.encoder_stuck', 'controller.safe_stop']", Passed),
        ("order = ['controller.safe_stop', 'fault.encoder_stuck']", Failed),
        ("order = ['controller.running', 'controller.holding']", Failed),
        ("order = ['controller.holding', 'controller.running']", Untested),
    ] {
        assert_eq!(run.judge(requirement).result, result, "{requirement}");
    }
}

#[test]
fn a_lost_state_is_no_new_entry_into_it() {
    let mut run = Run::of(&[0.0; 12]);
    run.lost = vec![4, 5, 9];
    assert_eq!(run.judge("event = 'controller.running'\nat_least = 1\nat_most = 1").result, Passed);
    let window = "signal = 'l1.force'\nmax = '1 N'\nduring = { after = 'controller.running', for_s = 0.003 }";
    assert!(run.judge(window).finding.contains("in 3 samples"), "{:?}", run.judge(window));
}

#[test]
fn what_occurs_after_the_last_sample_counts() {
    let run = Run::of(&[0.0; 4]).struck_at(50.0);
    assert_eq!(run.judge("event = 'fault.encoder_stuck'\nat_least = 1").result, Passed);
    assert_eq!(run.judge("never = 'fault.encoder_stuck'").result, Failed);
    let respond = "when = 'fault.encoder_stuck'\nthen = 'controller.state == safe_stop'\nwithin = '5 ms'";
    let figures = run.judge(respond);
    let why = "no sample lies within the time after fault.encoder_stuck";
    assert_eq!((figures.result, figures.finding.as_str()), (Untested, why));
}

#[test]
fn a_trigger_between_two_samples_without_one_in_its_time_leaves_the_response_untested() {
    let respond = |then: &str| format!("when = 'fault.encoder_stuck'\nthen = '{then}'\nwithin = '0.3 ms'");
    let [holds, fails] = ["l1.force < 1 N", "l1.force > 1 N"].map(respond);
    let run = |at_ms| Run::of(&[0.0; 12]).struck_at(1.9).struck_at(at_ms);
    assert_eq!(run(3.8).judge(&holds).result, Passed);
    let unseen = run(3.2).judge(&holds);
    let why = "1 trigger between two samples not judged: make within longer than a cycle";
    assert!(unseen.result == Untested && unseen.finding.contains(why), "{unseen:?}");
    assert_eq!(run(3.2).judge(&fails).result, Failed);
}

#[test]
fn an_answer_that_the_end_of_the_run_cuts_is_said_to_be() {
    let run = Run::of(&[0.0; 12]).struck_at(1.0).stopping_at(6);
    let respond =
        "when = 'fault.encoder_stuck'\nthen = 'controller.state == safe_stop'\nstays_for = '100 ms'";
    let figures = run.judge(respond);
    assert!(figures.finding.ends_with("the run ended after 5 ms of 100 ms"), "{figures:?}");
}

#[test]
fn what_is_computed_to_no_number_fails() {
    let run = Run::of(&[1.0, -1.0, 2.0]);
    for expression in
        ["'ln(signum({l1.force}))'\nunit = ''\nmax = 5", "'{l1.force} / 0'\nunit = 'N'\nmin = '-1 N'"]
    {
        let figures = run.judge(&format!("expression = {expression}"));
        assert_eq!((figures.result, figures.figures.margin), (Failed, None), "{figures:?}");
    }
}

#[test]
fn a_percentile_is_the_nearest_rank() {
    let forces_n: Vec<f64> = (1..=100).map(f64::from).collect();
    let rank = |percentile: f64| {
        let bounds = format!(
            "signal = 'l1.force'\nstatistic = 'percentile'\npercentile = {percentile}\nmax = '200 N'"
        );
        (200.0 - Run::of(&forces_n).judge(&bounds).figures.margin.unwrap()).round() as u32
    };
    assert_eq!([6.5, 7.0, 7.5, 50.0, 100.0, 0.0].map(rank), [7, 7, 8, 50, 100, 1]);
}

#[test]
fn wrong_requirements_are_refused_with_what_to_write() {
    for (requirement, expected) in [
        (
            "signal = 'l1.forse'\nmax = '1 N'",
            "there is no signal 'l1.forse'; masseter signals lists them; did you mean 'l1.force'?",
        ),
        (
            "signal = 'l1.force'\nmax = '1 mm'",
            "require.max: require 'it': 1 mm: give a number with one of the units N, mN, kN",
        ),
        ("signal = 'l1.force'", "give min, max or both"),
        (
            "signal = 'l1.force'\nmax = '1 N'\nwithin = '1 ms'",
            "require.within: require 'it': it has no effect with signal",
        ),
        ("signal = 'l1.force'\nnever = 'safe_stop'\nmax = '1 N'", "give exactly one of signal"),
        ("signal = 'controller.state'\nmax = 3", "controller.state is a state, which has no bounds"),
        ("signal = 'l1.force'\nmax = '1 N'\nduring = 'runing'", "'runing' is no condition"),
        ("never = 'l1.force == 1 N'", "a measured value is never exactly a number"),
        ("never = 'controller.state == stopped'", "'stopped' is no state: use wait_readings"),
        ("never = 'controller.state < running'", "states have no order"),
        (
            "when = 'fault.encoder_stock'\nthen = 'controller.state == safe_stop'",
            "did you mean 'fault.encoder_stuck'?",
        ),
        ("when = 'fault.encoder_stuck'", "give when and then"),
        ("event = 'fault.encoder_stuck'", "give at_least, at_most or both"),
        ("never = 'controller.following_error'", "'controller.following_error' is no occurrence"),
        (
            "when = 'fault.encoder_stuck'\nthen = 'controller.state == safe_stop'\nwithin = '-5 ms'",
            "require.within: require 'it': use a time not below 0",
        ),
        (
            "signal = 'l1.force'\nmax = '1 N'\nduring = { after = 'fault.encoder_stuck', for_s = -1.0 }",
            "for_s: use a finite number above 0",
        ),
        ("event = 'fault.encoder_stuck'\nat_least = 5\nat_most = 2", "at_least is above at_most"),
        ("expression = '5'\nunit = 'N'\nmax = '1 N'", "write signals in braces"),
        ("expression = '{controller.state}'\nunit = ''\nmax = 1", "controller.state is a state, no number"),
        ("order = ['fault.encoder_stuck']", "give at least two occurrences"),
        (
            "order = ['controller.running', 'fault.encoder_stuck', 'controller.running']",
            "controller.running occurs twice, but its first occurrence alone counts",
        ),
        (
            "expression = '{l1.force} +'\nunit = 'N'\nmax = '1 N'",
            "require.expression: require 'it': '{l1.force} +': ",
        ),
        (
            "expression = '{l1.force}'\nunit = 'stone'\nmax = '1 N'",
            "require.unit: require 'it': 'stone': the unit is unknown",
        ),
    ] {
        let text = format!(
            "[[faults]]\nkind = 'encoder_stuck'\naxis = 'l2'\nat_s = 0.0\n[[require]]\nname = 'it'\n{requirement}"
        );
        let scenario = Scenario::parse("s.toml".as_ref(), &text).unwrap();
        let error = check_requirements(&scenario, None).unwrap_err();
        let said = format!("{}: {error}", error.key);
        assert!(said.contains("require 'it': ") && said.contains(expected), "{requirement}: {said}");
        assert_eq!(error.entry, Some(0));
    }
}

#[test]
fn signals_of_a_controller_are_checked_once_it_has_declared_them() {
    use masseter_runtime::named::Signal;
    let text = "[[require]]\nname = 'grip'\nsignal = 'signal.grip'\nmax = '3 N'";
    let scenario = Scenario::parse("s.toml".as_ref(), text).unwrap();
    check_requirements(&scenario, None).unwrap();
    let refusal = check_requirements(&scenario, Some(&Declared::default())).unwrap_err().to_string();
    assert!(refusal.contains("'signal.grip'"), "{refusal}");
    let signal = Signal { name: "grip".into(), unit: "N".into(), about: String::new() };
    let declared = Declared { signals: vec![signal], ..Declared::default() };
    check_requirements(&scenario, Some(&declared)).unwrap();
    let found = Judge::new(&scenario).finish();
    assert_eq!(found[0].result, Untested, "the controller has no such signal");
}

/// What the controller may yet declare is a name, and nothing else of a requirement.
#[test]
fn what_is_wrong_whatever_the_controller_declares_is_refused_before_it_starts() {
    for (requirement, key) in [
        ("when = 'controller.running'\nthen = 'signal.foo 5 N'", "require.then"),
        ("when = 'controller.running'\nthen = 'signal.foo > 5 Q'", "require.then"),
        ("never = 'signal.foo'", "require.never"),
        ("event = 'parameter.foo'\nat_most = 1", "require.event"),
        ("expression = '{signal.foo} +'\nunit = 'N'\nmax = '1 N'", "require.expression"),
        ("signal = 'signals.foo'\nmax = 1", "require.signal"),
    ] {
        let text = format!("[[require]]\nname = 'it'\n{requirement}");
        let scenario = Scenario::parse("s.toml".as_ref(), &text).unwrap();
        let refusal = check_requirements(&scenario, None).unwrap_err();
        assert_eq!(refusal.key, key, "{requirement}: {refusal}");
    }
}

#[test]
fn an_expression_is_short_and_flat_and_a_refusal_quotes_little_of_it() {
    let refusal = |expression: &str| {
        let text = format!("[[require]]\nname = 'it'\nexpression = '{expression}'\nunit = 'N'\nmax = '1 N'");
        let scenario = Scenario::parse("s.toml".as_ref(), &text).unwrap();
        check_requirements(&scenario, None).map_err(|error| error.to_string())
    };
    let nested = |levels: usize| format!("{}{{l1.force}}{}", "abs(".repeat(levels), ")".repeat(levels));
    assert_eq!(refusal(&nested(64)), Ok(()));
    let sum = |terms: usize| format!("{{l1.force}}{}", " + {l1.force}".repeat(terms));
    assert_eq!(refusal(&sum(300)), Ok(()));
    for (expression, limit) in [
        (nested(65), "use at most 64 levels"),
        (nested(10_000), "write at most 4096"),
        (sum(1000), "write at most 4096"),
        ("x".repeat(100_000), "write at most 4096"),
        (format!("{{{}}}", "x".repeat(4000)), "there is no signal"),
        (format!("{{l1.force}} {}", "§".repeat(2000)), "'{l1.force} §"),
    ] {
        let said = refusal(&expression).unwrap_err();
        assert!(said.contains(limit) && said.chars().count() < 400, "{said}");
    }
}

#[test]
fn what_has_no_end_has_no_occurrence_of_it() {
    let check = |kind: &str| {
        let fault = format!("[[faults]]\nkind = '{kind}'\nname = 'it'\nat_s = 1.0\n");
        let text = format!("{fault}[[require]]\nname = 'it'\nnever = 'fault.it.ended'");
        check_requirements(&Scenario::parse("s.toml".as_ref(), &text).unwrap(), None)
    };
    assert!(check("plant_kill").unwrap_err().to_string().contains("'fault.it.ended' is no occurrence"));
    assert_eq!(check("plant_stall"), Ok(()));
}

#[test]
fn a_window_that_the_runs_end_cuts_says_what_was_judged_and_a_whole_one_is_untested() {
    let run = Run::of(&[1.0; 10]).struck_at(5.0).stopping_at(6);
    for (requirement, part) in [
        (
            "signal = 'l1.force'\nmax = '2 N'\nduring = { from_s = 0.002, to_s = 5.0 }",
            "judged to 0.009 s of 5 s",
        ),
        ("never = 'l1.force > 2 N'\nduring = { to_s = 5.0 }", "judged to 0.009 s of 5 s"),
        (
            "signal = 'l1.force'\nmax = '2 N'\nduring = { after = 'fault.encoder_stuck', for_s = 0.01 }",
            "judged for 0.004 s of 0.01 s",
        ),
        ("event = 'fault.encoder_stuck'\nat_most = 1\nduring = { to_s = 5.0 }", "judged to 0.009 s of 5 s"),
        (
            "when = 'fault.encoder_stuck'\nthen = 'controller.state == safe_stop'\nstays_for = '10 s'",
            "the run ended after 3 ms of 10000 ms",
        ),
    ] {
        let cut = run.judge(requirement);
        assert!(cut.result == Passed && cut.finding.ends_with(part), "{cut:?}");
        let whole = run.judge(&format!("{requirement}\nwhole = true"));
        assert!(whole.result == Untested && whole.finding.ends_with(part), "{whole:?}");
    }
    let within = run.judge("signal = 'l1.force'\nmax = '2 N'\nduring = { to_s = 0.005 }\nwhole = true");
    assert_eq!((within.result, within.finding.as_str()), (Passed, "1 N in 6 samples"));
}

/// A controller's own statements count as nothing where it plays a motion of its own.
#[test]
fn a_requirement_on_the_truth_is_told_from_one_on_what_the_controller_states() {
    let is_truth = |tables: &str, keys: &str| {
        let text = format!("{tables}\n[[require]]\nname = 'it'\n{keys}\n");
        let scenario = Scenario::parse("s.toml".as_ref(), &text).unwrap();
        check_requirements(&scenario, None).unwrap();
        Judge::new(&scenario).finish()[0].is_truth
    };
    for keys in [
        "signal = 'jaw.opening'\nmax = '40 mm'",
        "signal = 'l1.true_position'\nmax = '1 m'",
        "expression = '2 * {incisal.z}'\nunit = 'mm'\nmax = '1 m'",
        "never = 'l1.velocity > 1 m/s'",
        "when = 'controller.running'\nthen = 'incisal.z < 1 m'",
    ] {
        assert!(is_truth("", keys), "{keys}");
    }
    for keys in [
        "signal = 'incisal.error'\nmax = '1 mm'",
        "signal = 'l1.position'\nmax = '1 m'",
        "expression = '{incisal.z} - {incisal.desired.z}'\nunit = 'mm'\nmax = '1 m'",
        // Without teeth and food there is no force.
        "never = 'bite.force > 100 N'",
        "never = 'fk.residual > 1 mm'",
        "when = 'incisal.z < 1 m'\nthen = 'controller.state == running'",
        "event = 'controller.stop_requested'\nat_most = 1",
    ] {
        assert!(!is_truth("", keys), "{keys}");
    }
    assert!(is_truth("[food]", "never = 'bite.force > 100 N'"));
    // On the robot the controller estimates the pose; the encoders are the drives'.
    let robot = "[can]\ninterfaces = ['a', 'b']";
    assert!(is_truth(robot, "signal = 'l1.position'\nmax = '1 m'"));
    assert!(!is_truth(robot, "signal = 'incisal.z'\nmax = '1 m'"));
}
