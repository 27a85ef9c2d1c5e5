//! Controllers of the drives that report what did not happen. The facts decide: the scenario's motion, the true jaw, master and
//! drives. Each plays in lockstep, and honest ones pass.

use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicU32, Ordering};

use masseter_controller::kinematics::ForwardTracker;
use masseter_controller::trajectory::Trajectory;
use masseter_model::geometry::{AXES, Actuators, Mechanism, Pose};
use masseter_runtime::control::{Outcome, Session, Waited};
use masseter_runtime::lifecycle::attach::{self, socket};
use masseter_runtime::messages::codes::{ControllerState, DriveRequest, DriveState, drive_state};
use masseter_runtime::messages::{Command, Reading, State, pose_fields};
use masseter_runtime::named::{Declared, Parameter, PlayedMotion};
use masseter_runtime::transport::Domain;
use serde_json::Value;

use crate::common::{Workspace, stderr, stdout, wait_until};

const PERIOD_S: f64 = 1e-3;
/// A command is reached so many cycles after its sample.
const LEAD_S: f64 = 2.0 * PERIOD_S;
/// Cycles of the move to the first pose.
const EASE_CYCLES: u32 = 500;

/// A cycle of the motion.
struct Moment<'a> {
    motion: &'a Trajectory,
    mechanism: &'a Mechanism,
    /// Since the motion began, s.
    at_s: f64,
    estimated: Pose,
}

impl Moment<'_> {
    fn targets(&self, asked: &Pose) -> [f64; AXES] {
        self.mechanism.inverse(asked).unwrap().actuators.to_axes()
    }

    /// Plays the scenario's motion, and says so.
    fn honest(&self) -> Answer {
        Answer {
            target_m: self.targets(&self.motion.pose(self.at_s + LEAD_S)),
            request: DriveRequest::Enable,
            desired: self.motion.pose(self.at_s),
            motion_time_s: self.motion.motion_time_s(self.at_s),
        }
    }

    /// Asks for this pose, and says that the one found is the desired one.
    fn dishonest(&self, asked: &Pose) -> Answer {
        Answer { target_m: self.targets(asked), desired: self.estimated, ..self.honest() }
    }

    /// The same cycle at another time of the motion.
    fn at(&self, at_s: f64) -> Self {
        Self { at_s, ..*self }
    }

    /// Holds still at the first pose. The motion's time is at its beginning, then nowhere, and then at its end.
    fn without_time(&self) -> Answer {
        let held = Answer { desired: self.first(), ..self.dishonest(&self.first()) };
        if self.at_s < 0.01 {
            Answer { motion_time_s: 0.0, ..held }
        } else if self.at_s < 1.59 {
            Answer { motion_time_s: f64::NAN, ..held }
        } else {
            let (motion_time_s, desired) = (self.motion.motion_time_s(9.0), self.motion.pose(9.0));
            Answer { desired, motion_time_s, ..held }
        }
    }

    fn first(&self) -> Pose {
        self.motion.pose(0.0)
    }

    /// A share of the motion's way.
    fn scaled(&self, share: f64) -> Pose {
        self.first().lerp_slerp(&self.motion.pose(self.at_s + LEAD_S), share)
    }

    /// The incisal point goes up and down by 2 mm, beside the scenario's motion.
    fn own(&self, at_s: f64) -> Pose {
        let mut pose = self.first();
        let wave = 1.0 - (2.0 * std::f64::consts::PI * at_s).cos();
        pose.translation.z -= 1e-3 * wave * (at_s / 0.2).min(1.0);
        pose
    }
}

/// What a controller commands and reports in a cycle.
struct Answer {
    target_m: [f64; AXES],
    request: DriveRequest,
    desired: Pose,
    motion_time_s: f64,
}

/// The answer to a moment of the motion; none once the motion is over.
type Play = fn(&Moment) -> Option<Answer>;

fn until(end_s: f64, moment: &Moment, answer: Answer) -> Option<Answer> {
    (moment.at_s < end_s).then_some(answer)
}

/// How a controller behaves beside its motion; by default honest.
#[derive(Clone, Copy)]
struct Conduct {
    /// Cycles for which it leaves enabled drives waiting.
    wait_cycles: u32,
    ease_cycles: u32,
    /// Changes what it states, by the cycles in the state.
    tell: fn(&mut State, u32),
    /// Whether it says nothing in this cycle of the motion.
    is_silent: fn(u64) -> bool,
    /// A parameter of its own, and its value.
    parameter: Option<(&'static str, f64)>,
}

const HONEST: Conduct = Conduct {
    wait_cycles: 0,
    ease_cycles: EASE_CYCLES,
    tell: |_, _| (),
    is_silent: |_| false,
    parameter: None,
};

/// Says this state instead of that one.
fn rename(state: &mut State, from: ControllerState, to: ControllerState) {
    if state.controller_state == from.code() {
        state.controller_state = to.code();
    }
}

/// A controller that enables the drives, eases to the first pose, plays, switches off, and says that it has finished.
struct Player {
    mechanism: Mechanism,
    motion: Trajectory,
    tracker: ForwardTracker,
    play: Play,
    conduct: Conduct,
    end: Outcome,
    state: ControllerState,
    cycles_in_state: u32,
    start_m: [f64; AXES],
}

impl Player {
    fn answer(&mut self, reading: &Reading, command: &mut Command, state: &mut State) {
        let estimated = self.tracker.update(&Actuators::from_axes(reading.position_m)).unwrap().pose;
        let moment = Moment {
            motion: &self.motion,
            mechanism: &self.mechanism,
            at_s: f64::from(self.cycles_in_state) * PERIOD_S,
            estimated,
        };
        let first_m = moment.targets(&moment.first());
        let idle = |target_m, request| Answer { target_m, request, desired: estimated, motion_time_s: -1.0 };
        let share = f64::from(self.cycles_in_state) / f64::from(self.conduct.ease_cycles);
        let smooth = share.powi(3) * (10.0 - 15.0 * share + 6.0 * share * share);
        let eased_m: [f64; AXES] =
            std::array::from_fn(|axis| self.start_m[axis] + smooth * (first_m[axis] - self.start_m[axis]));
        let answer = match self.state {
            ControllerState::Easing => Some(idle(eased_m, DriveRequest::Enable)),
            ControllerState::Running => (self.play)(&moment),
            ControllerState::Enabling => {
                self.start_m = reading.position_m;
                Some(idle(self.start_m, DriveRequest::Enable))
            }
            _ => Some(idle(reading.position_m, DriveRequest::Off)),
        };
        let is_over = answer.is_none();
        let answer = answer.unwrap_or_else(|| idle(reading.position_m, DriveRequest::Off));
        (command.target_m, command.request) = (answer.target_m, answer.request.code());
        (state.desired_position_m, state.desired_quaternion_wxyz) = pose_fields(&answer.desired);
        (state.estimated_position_m, state.estimated_quaternion_wxyz) = pose_fields(&estimated);
        state.motion_time_s = answer.motion_time_s;
        self.follow(reading, is_over);
    }

    fn follow(&mut self, reading: &Reading, is_over: bool) {
        let is_in = |state: DriveState| reading.drive_state.iter().all(|code| *code == state.code());
        let is_off =
            |code: &u32| drive_state(*code).is_ok_and(|state| state.is_some_and(|state| !state.is_powered()));
        let next = match self.state {
            // Until then the drives are not enabled.
            ControllerState::Enabling if !is_in(DriveState::OperationEnabled) => return,
            ControllerState::Enabling if self.cycles_in_state == self.conduct.wait_cycles => {
                ControllerState::Easing
            }
            ControllerState::Easing if self.cycles_in_state == self.conduct.ease_cycles => {
                ControllerState::Running
            }
            ControllerState::Running if is_over => ControllerState::Disabling,
            ControllerState::Disabling if reading.drive_state.iter().all(is_off) => self.last_state(),
            _ => {
                self.cycles_in_state += 1;
                return;
            }
        };
        (self.state, self.cycles_in_state) = (next, 0);
    }

    fn last_state(&self) -> ControllerState {
        match self.end {
            Outcome::Finished => ControllerState::Finished,
            Outcome::SafeStop => ControllerState::SafeStop,
        }
    }

    /// Plays its part in a run of this rig.
    fn run(rig: &str, motion: PlayedMotion, play: Play, conduct: Conduct, end: Outcome) {
        let parameters = conduct.parameter.map(|(name, value)| Parameter::new(name, value));
        let declared =
            Declared { motion, parameters: parameters.into_iter().collect(), ..Declared::default() };
        let mut session = Session::start(attach::attach(Some(rig)).unwrap(), declared).unwrap();
        let scenario = session.context().scenario.clone();
        let mechanism = Mechanism::new(&scenario.mechanism).unwrap();
        let motion =
            Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism, scenario.duration_s).unwrap();
        let mut player = Self {
            tracker: ForwardTracker::new(mechanism.clone()),
            mechanism,
            motion,
            play,
            conduct,
            end,
            state: ControllerState::Enabling,
            cycles_in_state: 0,
            start_m: [0.0; AXES],
        };
        while player.state != player.last_state() {
            let Waited::Cycle { tick, reading } = session.wait(None).unwrap() else { continue };
            if session.is_stop_requested() {
                // The rig has given it up.
                return;
            }
            if player.state == ControllerState::Running && (conduct.is_silent)(tick.cycle) {
                continue;
            }
            let code = player.state.code();
            let mut command = Command { cycle: tick.cycle, controller_state: code, ..Command::default() };
            let mut state = State { cycle: tick.cycle, controller_state: code, ..State::default() };
            if let Some(reading) = reading.filter(|reading| reading.fresh_axes == (1 << AXES) - 1) {
                (command.reading_cycle, state.reading_cycle) = (reading.cycle, reading.cycle);
                state.sampled_ns = reading.sampled_ns;
                player.answer(&reading, &mut command, &mut state);
                state.controller_state = player.state.code();
            }
            (conduct.tell)(&mut state, player.cycles_in_state);
            command.controller_state = state.controller_state;
            session.publish(&command, &state).unwrap();
        }
        session.finish(end).unwrap();
    }
}

/// The verdict on a run, which its exit code repeats, with what the documents say.
struct Judged {
    word: String,
    reason: String,
    sequence: String,
    /// The findings of all checks that did not pass, each with its name.
    findings: String,
    documents: [String; 3],
}

fn judge(scenario: &str, motion: PlayedMotion, play: Play) -> Judged {
    judge_end(scenario, motion, play, Outcome::Finished)
}

fn judge_end(scenario: &str, motion: PlayedMotion, play: Play, end: Outcome) -> Judged {
    judge_conduct(scenario, motion, play, HONEST, end)
}

fn judge_conduct(scenario: &str, motion: PlayedMotion, play: Play, conduct: Conduct, end: Outcome) -> Judged {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let workspace = Workspace::new(&format!("duration_s = 1.5\n{scenario}"));
    let name = format!("liar-{}-{}", std::process::id(), NUMBER.fetch_add(1, Ordering::Relaxed));
    let rig = workspace.start_lockstep(&["--controller", "external", "--name", &name]);
    let socket = socket(&Domain::named(&name).unwrap());
    wait_until("the rig waits", || UnixStream::connect(&socket).is_ok());
    Player::run(&name, motion, play, conduct, end);
    let output = rig.wait_with_output().unwrap();
    let summary = workspace.summary();
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let verdict = &summary["verdict"];
    assert_eq!(output.status.code(), verdict["exit_code"].as_i64().map(|code| code as i32));
    let checks = verdict["checks"].as_array().unwrap();
    let sequence = checks.iter().find(|check| check["name"] == "sequence").unwrap();
    let is_bad = |check: &&Value| check["result"] == "failed" || check["result"] == "untested";
    let bad = checks.iter().filter(is_bad);
    let findings = bad.map(|check| format!("{}: {}\n", text(&check["name"]), text(&check["finding"])));
    let document = |name: &str| std::fs::read_to_string(workspace.run_folder().join(name)).unwrap();
    Judged {
        word: text(&verdict["word"]),
        reason: text(&verdict["reason"]),
        sequence: text(&sequence["finding"]),
        findings: findings.collect(),
        documents: [stdout(&output) + &stderr(&output), document("report.html"), document("junit.xml")],
    }
}

#[test]
fn who_plays_the_scenarios_motion_passes() {
    let judged = judge("", PlayedMotion::Scenario, |moment| until(1.6, moment, moment.honest()));
    assert_eq!((judged.word.as_str(), judged.sequence.as_str()), ("PASS", "ended in state finished"));
}

#[test]
fn a_motion_that_was_not_played_is_no_pass_whatever_the_controller_reports() {
    let cases: [(&str, Play, &str); 10] = [
        ("holds still for a moment", |m| until(0.2, m, m.dishonest(&m.first())), "0 %"),
        ("holds still for as long", |m| until(1.6, m, m.dishonest(&m.first())), "0 %"),
        (
            "holds still in a motion without time",
            |m| until(1.6, m, Answer { motion_time_s: 0.0, ..m.dishonest(&m.first()) }),
            "0 %",
        ),
        (
            "holds still, and says that it is at the end",
            |m| {
                let (end_s, closed) = (m.motion.motion_time_s(9.0), m.motion.pose(9.0));
                let answer = Answer { motion_time_s: end_s, desired: closed, ..m.dishonest(&m.first()) };
                until(1.6, m, answer)
            },
            "0 %",
        ),
        ("moves a little", |m| until(1.6, m, m.dishonest(&m.scaled(0.01))), "1 %"),
        ("moves half the way", |m| until(1.6, m, m.dishonest(&m.scaled(0.5))), ""),
        (
            "moves otherwise",
            |m| until(1.6, m, Answer { desired: m.own(m.at_s), ..m.dishonest(&m.own(m.at_s + LEAD_S)) }),
            "",
        ),
        ("plays half of the motion", |m| until(0.75, m, m.honest()), ""),
        ("holds still, and has no time in between", |m| until(1.6, m, m.without_time()), "0 %"),
        ("plays at twice the speed, and holds", |m| until(1.6, m, m.at(2.0 * m.at_s).honest()), ""),
    ];
    for (liar, play, share) in cases {
        let judged = judge("", PlayedMotion::Scenario, play);
        let wanted = format!("the scenario's motion was not played: {share}");
        assert_eq!(judged.word, "FAIL", "{liar}: {}", judged.reason);
        assert!(
            judged.reason.contains(&wanted) && judged.sequence.contains(&wanted),
            "{liar}: {}",
            judged.reason
        );
        for document in judged.documents {
            assert!(document.contains("s motion was not played"), "{liar}: {document}");
        }
    }
}

/// Nobody's word is the reference: the jaw plays the motion, whatever the desired pose of the state is.
#[test]
fn who_plays_the_motion_passes_with_any_desired_pose() {
    let judged =
        judge("", PlayedMotion::Scenario, |m| until(1.6, m, Answer { desired: m.estimated, ..m.honest() }));
    assert_eq!(judged.word, "PASS", "{}", judged.reason);
}

#[test]
fn a_desired_pose_that_the_jaw_never_takes_fails() {
    let judged = judge("", PlayedMotion::Scenario, |moment| {
        until(1.6, moment, Answer { target_m: moment.targets(&moment.first()), ..moment.honest() })
    });
    let reason = "failed: sequence, tracking, estimated tracking; the scenario's motion was not played: 0 %";
    assert_eq!(judged.word, "FAIL");
    assert!(judged.reason.starts_with(reason), "{}", judged.reason);
}

/// At 0.5 s of the motion.
fn spoilt(moment: &Moment, spoil: fn(&mut Answer)) -> Option<Answer> {
    let mut answer = moment.honest();
    if (0.5..0.5 + PERIOD_S / 2.0).contains(&moment.at_s) {
        spoil(&mut answer);
    }
    until(1.6, moment, answer)
}

#[test]
fn a_stop_of_master_or_drives_is_one_whatever_the_controller_reports() {
    let cases: [(Play, &str); 4] = [
        (
            |m| spoilt(m, |answer| answer.target_m[2] = f64::NAN),
            "the master stopped the drives; first fault: master d3: bad_message",
        ),
        (
            |m| spoilt(m, |answer| answer.target_m[3] *= 1e3),
            "the master stopped the drives; first fault: master l1: stroke_limit",
        ),
        (
            |m| spoilt(m, |answer| answer.target_m.swap(0, 3)),
            "the master stopped the drives; first fault: master d1: stroke_limit",
        ),
        (|m| spoilt(m, |answer| answer.request = DriveRequest::QuickStop), "the drives made a quick stop"),
    ];
    for (play, reason) in cases {
        let judged = judge("", PlayedMotion::Scenario, play);
        assert_eq!(judged.word, "SAFE STOP", "{}", judged.reason);
        assert!(judged.reason.starts_with(reason), "{}", judged.reason);
        for document in judged.documents {
            assert!(document.contains(reason), "{reason}: {document}");
        }
        // A quick stop is what the controller asks for: by itself that proves nothing.
        let word = if reason.starts_with("the master") { "PASS" } else { "UNTESTED" };
        let expected = judge("expect.verdict = 'safe_stop'\n", PlayedMotion::Scenario, play);
        assert_eq!(expected.word, word, "{}", expected.reason);
        let is_said = expected.reason.starts_with("SAFE STOP, as expected: ");
        assert_eq!(is_said, word == "PASS", "{}", expected.reason);
    }
}

/// The drives are off, and nothing went wrong: a program that stops whenever it likes proves nothing.
#[test]
fn a_safe_stop_that_the_controller_alone_causes_is_expected_in_vain() {
    let expect = "expect.verdict = 'safe_stop'\n";
    let fault = "[[faults]]\nkind = 'encoder_noise'\naxis = 'l1'\nat_s = 0.2\nsize = '20 um'\n";
    let required = "[[require]]\nname = 'opens'\nsignal = 'incisal.z'\nmax = '1 m'\n";
    for motion in [PlayedMotion::Scenario, PlayedMotion::Own] {
        for (cause, word) in [("", "UNTESTED"), (fault, "PASS"), (required, "PASS")] {
            let scenario = format!("{expect}{cause}");
            let states: Play = |moment| until(0.4, moment, moment.honest());
            let asks: Play = |m| spoilt(m, |answer| answer.request = DriveRequest::QuickStop);
            for (play, end) in [(states, Outcome::SafeStop), (asks, Outcome::Finished)] {
                let judged = judge_end(&scenario, motion, play, end);
                assert_eq!(judged.word, word, "{cause}: {}", judged.reason);
                let wanted = "the controller alone caused the safe stop";
                assert_eq!(judged.sequence.contains(wanted), word == "UNTESTED", "{}", judged.sequence);
            }
        }
    }
}

#[test]
fn drives_that_the_controller_switches_off_are_no_expected_safe_stop() {
    for motion in [PlayedMotion::Scenario, PlayedMotion::Own] {
        let judged = judge("expect.verdict = 'safe_stop'\n", motion, |moment| {
            let mut answer = moment.honest();
            if moment.at_s > 0.5 {
                answer.request = DriveRequest::Off;
            }
            until(1.6, moment, answer)
        });
        assert_ne!(judged.word, "PASS", "{}", judged.reason);
        let wanted = "the controller alone caused the safe stop";
        assert!(judged.sequence.contains(wanted), "{}", judged.sequence);
    }
}

#[test]
fn drives_that_leave_operation_in_a_pause_of_the_motion_are_no_pass() {
    let judged = judge("", PlayedMotion::Scenario, |moment| {
        let mut answer = moment.at((moment.at_s - 0.5).max(0.0)).honest();
        if (0.1..0.15).contains(&moment.at_s) {
            answer.request = DriveRequest::Off;
        }
        until(2.1, moment, answer)
    });
    let why = "a drive left operation while the motion ran";
    assert_ne!(judged.word, "PASS", "{}", judged.reason);
    assert!(judged.sequence.contains(why), "{}: {}", judged.reason, judged.sequence);
    for document in judged.documents {
        assert!(document.contains(why), "{document}");
    }
}

#[test]
fn an_own_motion_is_declared_lasts_as_long_as_the_scenario_says_and_something_is_required_of_it() {
    let required = "[[require]]\nname = 'opens'\nsignal = 'incisal.z'\nduring = 'running'\nmax = '1 m'\n";
    let of_its_word = "[[require]]\nname = 'follows'\nsignal = 'incisal.estimated_error'\nduring = 'running'\nmax = '1 m'\n";
    let cases: [(&str, f64, &str, &str); 4] = [
        (required, 1.6, "PASS", "ended in state finished, own motion of the controller"),
        ("", 1.6, "UNTESTED", "nothing judged the motion, which is not the scenario's: "),
        (of_its_word, 1.6, "UNTESTED", "nothing judged the motion, which is not the scenario's: "),
        (required, 0.4, "FAIL", "the controller's motion ended early: "),
    ];
    for (scenario, end_s, word, finding) in cases {
        let play: Play = if end_s > 1.0 {
            |m| until(1.6, m, Answer { desired: m.own(m.at_s), ..m.dishonest(&m.own(m.at_s + LEAD_S)) })
        } else {
            |m| until(0.4, m, Answer { desired: m.own(m.at_s), ..m.dishonest(&m.own(m.at_s + LEAD_S)) })
        };
        let judged = judge(scenario, PlayedMotion::Own, play);
        assert_eq!(judged.word, word, "{}", judged.reason);
        assert!(judged.sequence.starts_with(finding), "{}", judged.sequence);
    }
}

mod conduct;
