//! Controllers that delay the motion, play early, or report out of order. Each row has the verdict and its first cause.

use super::*;
use ControllerState::{Easing, Enabling, Finished, Running};

/// Limits of the path so wide that only time and order count.
const WIDE: &str = "[checks]\ntracking_rms_mm = 50.0\ntracking_max_mm = 50.0\ntracking_rms_deg = 50.0\ntracking_max_deg = 50.0\n";

/// Who, how it behaves and plays, the verdict, and the beginning or a part of the cause.
type Row = (&'static str, Conduct, Play, &'static str, &'static str);

const PLAYS: Play = |m| until(1.6, m, m.honest());
const STAYS: Play = |m| until(1.6, m, m.dishonest(&m.first()));

fn told(tell: fn(&mut State, u32)) -> Conduct {
    Conduct { tell, ..HONEST }
}

fn own(parameter: &'static str, value: f64) -> Conduct {
    Conduct { parameter: Some((parameter, value)), ..HONEST }
}

/// Says that it still brings the drives to operation.
fn enables(state: &mut State, _: u32) {
    rename(state, Easing, Enabling);
    rename(state, Running, Enabling);
}

fn is_running(state: &State) -> bool {
    state.controller_state == Running.code()
}

/// The reason of the verdict, or the finding of a check that did not pass, says the cause.
fn check(scenario: &str, rows: &[Row]) {
    for (who, conduct, play, word, cause) in rows {
        let judged = judge_conduct(scenario, PlayedMotion::Scenario, *play, *conduct, Outcome::Finished);
        let said = format!("{who}: {}: {}\n{}", judged.word, judged.reason, judged.findings);
        println!("{said}");
        assert_eq!(judged.word, *word, "{said}");
        assert!(judged.reason.contains(cause) || judged.findings.contains(cause), "{said}");
    }
}

#[test]
fn who_begins_in_time_and_reports_in_order_passes() {
    let passed = "every check passed";
    check(
        "",
        &[
            ("eases for the whole lead-in", Conduct { ease_cycles: 1000, ..HONEST }, PLAYS, "PASS", passed),
            (
                "begins a little late",
                Conduct { ease_cycles: 1018, ..HONEST },
                PLAYS,
                "PASS",
                "every check passed; motion delayed by ",
            ),
            ("has the parameter of the motion", own("motion_amplitude", 1.0), PLAYS, "PASS", passed),
            ("plays the whole motion", own("motion_amplitude", 0.0), PLAYS, "PASS", passed),
            (
                "does not say that it eases",
                told(|state, _| rename(state, Easing, Enabling)),
                PLAYS,
                "PASS",
                passed,
            ),
        ],
    );
}

#[test]
fn who_delays_the_motion_or_plays_early_fails() {
    let never = "the controller never began the motion: it was never in the state running";
    let early: Play = |m| {
        let ahead_s = 0.03 * (m.at_s / 0.2).min(1.0);
        let target_m = m.targets(&m.motion.pose(m.at_s + LEAD_S + ahead_s));
        until(1.6, m, Answer { target_m, ..m.honest() })
    };
    check(
        WIDE,
        &[
            (
                "leaves enabled drives waiting",
                Conduct { wait_cycles: 900, ..HONEST },
                PLAYS,
                "FAIL",
                "; the controller began the motion ",
            ),
            (
                "eases for too long",
                Conduct { ease_cycles: 1500, ..HONEST },
                PLAYS,
                "FAIL",
                " ms after its lead-in",
            ),
            ("stays in enabling", told(enables), PLAYS, "FAIL", never),
            ("stays in enabling, and holds still", told(enables), STAYS, "FAIL", never),
            ("stays in easing", told(|state, _| rename(state, Running, Easing)), PLAYS, "FAIL", never),
            (
                "says nothing in every second cycle",
                Conduct { is_silent: |cycle| cycle % 2 == 0, ..HONEST },
                PLAYS,
                "FAIL",
                "motion lag",
            ),
            ("plays early", HONEST, early, "FAIL", " ms ahead of the motion"),
            ("has no amplitude of its own", own("motion_amplitude", 0.0), STAYS, "FAIL", "not played: 0 %"),
            ("has no rate of its own", own("motion_rate", 0.0), STAYS, "FAIL", "not played: 0 %"),
        ],
    );
}

/// The check of the lead needs half a second. The distance of the jaw from its path needs a cycle.
#[test]
fn who_plays_early_for_a_moment_fails_by_tracking() {
    let early: Play = |m| {
        let ahead_s = match (m.at_s - 0.5) / 0.3 {
            part if (0.0..1.0).contains(&part) => 0.03 * (std::f64::consts::PI * part).sin().powi(2),
            _ => 0.0,
        };
        let target_m = m.targets(&m.motion.pose(m.at_s + LEAD_S + ahead_s));
        until(1.6, m, Answer { target_m, ..m.honest() })
    };
    check("", &[("plays early for 0.3 s", HONEST, early, "FAIL", "failed: tracking, estimated tracking")]);
}

#[test]
fn who_waits_for_ever_fails_at_a_deadline() {
    let not_begun = "the controller did not begin the motion within 4.7 s of the first SYNC";
    check(
        "[controller]\nstart_timeout_s = 1.0\nease_s = 0.5\noverdue_s = 0.2\n[can]\nready_timeout_ms = 500\n",
        &[
            ("never eases", Conduct { wait_cycles: u32::MAX, ..HONEST }, PLAYS, "FAIL", not_begun),
            ("eases for ever", Conduct { ease_cycles: u32::MAX, ..HONEST }, PLAYS, "FAIL", not_begun),
            (
                "says that it eases",
                told(|state, _| rename(state, Running, Easing)),
                |m| Some(m.honest()),
                "FAIL",
                not_begun,
            ),
            (
                "never ends",
                HONEST,
                |m| Some(m.honest()),
                "FAIL",
                "the controller did not end within 3.2 s of the motion's beginning",
            ),
        ],
    );
}

#[test]
fn who_reports_out_of_order_fails() {
    let eases: fn(&mut State, u32) = |state, cycles| {
        if cycles == 300 {
            rename(state, Running, Easing);
        }
    };
    let finishes: fn(&mut State, u32) = |state, cycles| {
        if cycles == 300 {
            rename(state, Running, Finished);
        }
    };
    let runs_back: fn(&mut State, u32) = |state, _| {
        if state.motion_time_s > 0.5 {
            state.motion_time_s = 1.0 - state.motion_time_s;
        }
    };
    let stands_still: fn(&mut State, u32) = |state, _| state.motion_time_s = state.motion_time_s.min(0.5);
    check(
        WIDE,
        &[
            (
                "begins without the drives",
                told(|state, _| rename(state, Enabling, Running)),
                PLAYS,
                "FAIL",
                "the controller began the motion before all drives were enabled",
            ),
            (
                "eases in the motion",
                told(eases),
                PLAYS,
                "FAIL",
                "the controller went back from the state running to easing",
            ),
            (
                "has finished, and goes on",
                told(finishes),
                PLAYS,
                "FAIL",
                "the controller went back from the state finished to running",
            ),
            (
                "has a time that runs back",
                told(runs_back),
                PLAYS,
                "FAIL",
                "failed: motion lag; the controller's motion time ran back by ",
            ),
            ("has a time that stands still", told(stands_still), PLAYS, "FAIL", "failed: motion lag"),
        ],
    );
}

#[test]
fn who_states_no_numbers_or_compares_nothing_does_not_pass() {
    let once: fn(&mut State, u32) = |state, cycles| {
        if is_running(state) && cycles == 300 {
            state.desired_position_m[1] = f64::NAN;
        }
    };
    let always: fn(&mut State, u32) = |state, _| {
        if is_running(state) {
            state.desired_quaternion_wxyz = [f64::NAN; 4];
        }
    };
    let nothing: fn(&mut State, u32) = |state, _| {
        if is_running(state) {
            state.reading_cycle = 0;
        }
    };
    let cause = " of the motion in which the controller stated no finite pose as the desired one";
    check(
        "",
        &[
            ("states NaN once", told(once), PLAYS, "FAIL", "stated pose: 1 sample of the motion"),
            ("states NaN always", told(always), PLAYS, "FAIL", cause),
            (
                "compares nothing",
                told(nothing),
                PLAYS,
                "UNTESTED",
                "estimated tracking: 0 samples to compare",
            ),
        ],
    );
}
