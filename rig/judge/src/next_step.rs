//! What to do next about a run that did not pass: one sentence for each kind of verdict.

use masseter_can::codes;
use masseter_recording::{Ending, Manifest};
use masseter_runtime::injection::Injected;
use masseter_runtime::messages::codes::Cause;
use masseter_scenario::ExpectedVerdict::{Died, Fail, Incomplete, Interrupted, Pass, SafeStop, Untested};
use masseter_scenario::Scenario;

use crate::check::{Check, Subject};
use crate::outcome::{Outcome, clock_jump};
use crate::stop_cause::declared_cause;
use crate::{breach::Breach, checks::lag_cause, events::Code, figures::Figures};

codes! {
    /// What to do next; its name is the sentence, with `RUN` for the folder of the run and `CLOCK` for its clock.
    NextStep as u8 {
        /// FAIL of another outcome than the expected one.
        Expectation = 0 "If this outcome is right, change `expect.verdict` in the scenario (docs/requirements.md); otherwise correct the controller.",
        /// FAIL by a requirement.
        Requirement = 1 "Look at that time in `RUN/report.html`, then correct the controller, or the limit in `[[require]]` (docs/requirements.md).",
        /// FAIL by tracking.
        Tracking = 2 "Compare desired and true motion in `RUN/report.html`, then tune the controller (docs/tutorials/bring-up.md), or change `checks.tracking_max_mm`.",
        /// FAIL by a late motion or missing commands.
        Late = 3 "Look for late readings and lost frames in `RUN/report.html`; `checks.motion_lag_ms` and `controller.stale_cycles` are the limits.",
        /// FAIL by a motion whose time the controller changed.
        MotionTime = 4 "Begin the motion at the end of the lead-in, and let its time advance by one period a cycle (docs/interface.md).",
        /// FAIL by a desired pose that is no pose.
        StatedPose = 5 "Publish a finite desired pose in each cycle of the motion; `RUN/report.html` shows where it is missing (docs/interface.md).",
        /// FAIL by missed deadlines.
        Timing = 6 "Shorten the longest cycles that `RUN/report.html` lists, or lower `rate_hz` (docs/realtime.md).",
        /// FAIL by a jaw that moved after its stop.
        Standstill = 7 "Find in `RUN/report.html` which axis moved after the stop, then check its brake; `checks.standstill_axis_mm` is the limit.",
        /// FAIL by a declared fault that nothing detected in time.
        Undetected = 8 "Look up in docs/faults.md what detects this fault, then tighten that limit, such as `can.following_limit_m`.",
        /// FAIL by the end of the sequence.
        Sequence = 9 "Find in the events of `RUN/report.html` what ended the motion, then correct it, or expect it (docs/requirements.md).",
        /// FAIL by a controller that waits for ever.
        Overdue = 10 "Let the controller begin the motion once the drives are enabled, and finish after the motion (docs/interface.md), or raise `controller.overdue_s`.",
        /// FAIL by missing messages.
        Dropped = 11 "Run `masseter recording info RUN` to see what is missing, then repeat the run with less beside it, or with `recording.frames` = false.",
        /// FAIL by a late frame on a bus.
        Bus = 12 "Find the late message in `RUN/report.html` under buses, then look for other senders on that bus (docs/can.md).",
        /// SAFE STOP by a fault of the scenario.
        DeclaredFault = 13 "A fault of the scenario caused this stop; if the stop is right, set `expect.verdict` to safe_stop (docs/requirements.md).",
        /// SAFE STOP by a stimulus of the scenario.
        DeclaredStimulus = 14 "A stimulus of the scenario came before this stop; if the stop is right, set `expect.verdict` to safe_stop (docs/requirements.md).",
        /// SAFE STOP by a drive.
        Drive = 15 "Remove the cause of the drive's error, which the events in `RUN/report.html` name (docs/robot.md), then run again.",
        /// SAFE STOP by lost messages or nodes.
        Lost = 16 "Check wiring, power and bit rate of the named node; `RUN/report.html` shows axis and buses around the stop (docs/can.md).",
        /// SAFE STOP by a configuration of a drive that is not as expected.
        Configuration = 17 "Run `masseter robot inspect RUN/scenario.toml` to see every object that differs, then correct the drive or its profile (docs/robot.md).",
        /// SAFE STOP by a limit of an axis.
        Limit = 18 "Keep the motion within the axis' limits: smaller, slower or elsewhere; `RUN/report.html` shows the axis around the stop (docs/motions.md).",
        /// SAFE STOP by the distance from the path.
        OffPath = 19 "Compare true and reported position around the stop in `RUN/report.html`, then tune the controller (docs/tutorials/bring-up.md), or check the axis.",
        /// SAFE STOP by missing readings or commands.
        Stale = 20 "Find what delayed controller or plant: `masseter doctor`, then the longest cycles in `RUN/report.html` (docs/interface.md).",
        /// SAFE STOP by the controller's law or its messages.
        Law = 21 "Repeat the decisions with `masseter replay RUN`, then correct the controller at the cycle of the event (docs/interface.md).",
        /// SAFE STOP by the law or the messages of a program.
        ProgramLaw = 22 "Read the messages of the program in the terminal, then correct its command at the cycle of the event (docs/interface.md).",
        /// SAFE STOP by a pose that the mechanism cannot have.
        Pose = 23 "Compare the scenario's `mechanism` with the rig, and the motion with its reach (docs/forward-kinematics.md, docs/motions.md).",
        /// SAFE STOP by a start too far away.
        Start = 24 "Bring the jaw closer to the first pose of the motion, or raise `controller.start_tolerance_mm` (docs/robot.md).",
        /// SAFE STOP by a bite force above the limit.
        TooHard = 25 "Close more slowly, or state the stiffness of food and teeth in `force_control`; `overload` is the limit (docs/dynamics-control.md).",
        /// SAFE STOP without a cause of these.
        Stop = 26 "Read the events in `RUN/report.html` from the first fault on; docs/troubleshooting.md lists causes and remedies.",
        /// DIED: the controller.
        ControllerDied = 27 "Read the controller's own messages in the terminal, then repeat its readings under a debugger (docs/interface.md): `masseter replay RUN`.",
        /// DIED: a program.
        ProgramDied = 28 "Read the messages of the program in the terminal, then start it under a debugger: `masseter run --controller external` waits for it.",
        /// DIED: a process that a fault of the scenario killed.
        DeclaredDeath = 29 "A fault of the scenario killed the process; if the death is right, set `expect.verdict` to died (docs/requirements.md).",
        /// DIED: another process.
        ProcessDied = 30 "Run `masseter doctor` to see what the machine lacks, then repeat the run: `masseter run RUN/scenario.toml --clock CLOCK`.",
        /// INVALID by lost cycles.
        LostCycles = 31 "Run `masseter doctor` and remove what it lists, then repeat the run: `masseter run RUN/scenario.toml --clock CLOCK`.",
        /// INVALID by lost cycles, where the doctor knows the best remedy.
        Mend = 32 "Run `MEND`, then repeat the run: `masseter run RUN/scenario.toml --clock CLOCK`.",
        /// INVALID without real time.
        NoRealTime = 33 "Run `masseter doctor`, which names the missing permission and the command that gives it, then repeat the run.",
        /// INVALID by a clock that was set.
        ClockSet = 34 "Let nothing set the clock, then repeat the run: `masseter run RUN/scenario.toml --clock CLOCK`.",
        /// INCOMPLETE.
        Unwritten = 35 "Free the disk, save what was written with `masseter recording recover RUN`, then repeat the run.",
        /// INTERRUPTED by the user.
        Repeat = 36 "To judge the whole motion, repeat the run: `masseter run RUN/scenario.toml --clock CLOCK`.",
        /// INTERRUPTED by a stimulus of the scenario.
        DeclaredStop = 37 "The scenario asks for this stop; if the stop is right, set `expect.verdict` to interrupted (docs/requirements.md).",
        /// UNTESTED: a fault or stimulus did not act.
        NeverActed = 38 "Let the fault or stimulus act while the motion runs: change its time in `RUN/scenario.toml`, then run that file as before.",
        /// UNTESTED: a requirement.
        NotJudged = 39 "Choose a window, trigger or signal that this motion has, or let a fault bring it, in `RUN/scenario.toml`, then run that file as before (docs/requirements.md).",
        /// UNTESTED: anything else.
        TooLittle = 40 "Change what the reason names in `RUN/scenario.toml`, such as `duration_s` where it asks for more of the motion, then run that file as before.",
    }
}

impl NextStep {
    /// After a run with this outcome; none after a pass.
    pub(crate) fn of(
        outcome: Outcome,
        manifest: &Manifest,
        figures: &Figures,
        checks: &[Check],
        first_breach: Option<&Breach>,
    ) -> Option<Self> {
        let is_kill = |name: &str| name.ends_with("_kill");
        let mut faults = manifest.scenario.faults.iter().zip(&figures.faults);
        let mut was_killed =
            || faults.any(|(declared, found)| found.struck_ns.is_some() && is_kill(declared.kind.name()));
        let is_of_program = manifest.is_of_program();
        Some(match (outcome, &manifest.ending) {
            (Outcome::Named(Pass), _) => return None,
            (Outcome::Named(Fail) | Outcome::ChecksFailed, _) => {
                Self::of_failure(manifest, figures, checks, first_breach)
            }
            (Outcome::Named(SafeStop), _) => Self::of_stop(manifest, figures),
            (Outcome::Named(Died), _) if was_killed() => Self::DeclaredDeath,
            (Outcome::Named(Died), Ending::Died { process, .. }) if process == "controller" => {
                if is_of_program {
                    Self::ProgramDied
                } else {
                    Self::ControllerDied
                }
            }
            (Outcome::Named(Died), _) => Self::ProcessDied,
            (Outcome::Named(Incomplete), _) => Self::Unwritten,
            (Outcome::Named(Interrupted), Ending::Interrupted) => Self::Repeat,
            (Outcome::Named(Interrupted), _) => Self::DeclaredStop,
            (Outcome::Named(Untested), _) => Self::of_untested(checks),
            (Outcome::Invalid, Ending::NotStarted) => Self::NoRealTime,
            (Outcome::Invalid, _) if clock_jump(&manifest.usage, &manifest.scenario.can).is_some() => {
                Self::ClockSet
            }
            (Outcome::Invalid, _) if manifest.refusal().is_some() => Self::NoRealTime,
            (Outcome::Invalid, _) if manifest.mending_command.is_some() => Self::Mend,
            (Outcome::Invalid, _) => Self::LostCycles,
        })
    }

    /// By the check with the first breach; without one by the first check that the scenario does not expect to fail.
    fn of_failure(
        manifest: &Manifest,
        figures: &Figures,
        checks: &[Check],
        first_breach: Option<&Breach>,
    ) -> Self {
        let Scenario { expect, checks: limits, .. } = &manifest.scenario;
        let is_first = |check: &&Check| first_breach.is_none_or(|breach| breach.check == check.name);
        let is_unexpected = |check: &&Check| check.result.is_failed() && !check.must_fail(expect.as_ref());
        let mut failed = checks.iter().filter(is_unexpected);
        let Some(check) = failed.find(is_first) else { return Self::Expectation };
        let has_own_time = || lag_cause(&figures.motion, limits.motion_lag_ms).is_some();
        match (check.subject, check.name.as_ref()) {
            (Subject::Requirement | Subject::ExpectedEvent, _) => Self::Requirement,
            (Subject::Faults { .. }, _) => Self::Undetected,
            (Subject::Sequence, _) if manifest.ending == Ending::Overdue => Self::Overdue,
            (Subject::Sequence, _) => Self::Sequence,
            (_, "stated pose") => Self::StatedPose,
            (_, "motion lag") if has_own_time() => Self::MotionTime,
            (_, "motion lag" | "commands missed") => Self::Late,
            (_, "timing") => Self::Timing,
            (_, "standstill") => Self::Standstill,
            (_, "dropped messages") => Self::Dropped,
            (_, "bus response") => Self::Bus,
            _ => Self::Tracking,
        }
    }

    /// By the first fault that anybody reports, unless a fault or stimulus of the scenario came before.
    fn of_stop(manifest: &Manifest, figures: &Figures) -> Self {
        use Cause::{
            AccelerationLimit, BadMessage, BootTimeout, BusOff, BusRefused, CommandLost, DriveFault,
            DuplicateNode, Emergency, EnableTimeout, EndStopHit, FaultAtStart, FaultFound, FollowingError,
            ForceLimit, ForeignCommand, ForwardKinematics, HeartbeatLost, HomeOffset, InverseKinematics,
            LawFailed, MotionLate, NodeRestarted, NodeStopped, NotAccepted, NotEnabled, NotKept, NotReady,
            OrientationLost, ProcessDataLost, SdoAborted, SdoTimeout, SecondMaster, StaleReading,
            StartTooFar, StillPowered, StrokeLimit, TrackingLost, UnknownNode, VelocityLimit, WrongIdentity,
            WrongLength, WrongObject, WrongPdo, WrongUnit,
        };
        match declared_cause(manifest, figures).map(|cause| cause.injected) {
            Some(Injected::Fault(_)) => return Self::DeclaredFault,
            Some(Injected::Stimulus(_)) => return Self::DeclaredStimulus,
            None => {}
        }
        let is_of_program = manifest.is_of_program();
        let Some(Code::Known(cause)) = figures.first_fault().map(|event| event.cause) else {
            return Self::Stop;
        };
        match cause {
            DriveFault | Emergency | EnableTimeout | FaultAtStart | FaultFound | NotReady | NotEnabled
            | StillPowered => Self::Drive,
            HeartbeatLost | ProcessDataLost | BusRefused | BootTimeout | SdoTimeout | DuplicateNode
            | NodeRestarted | NodeStopped | WrongLength | UnknownNode | SecondMaster | BusOff => Self::Lost,
            WrongIdentity | WrongPdo | NotAccepted | SdoAborted | HomeOffset | WrongObject | WrongUnit
            | NotKept => Self::Configuration,
            StrokeLimit | VelocityLimit | AccelerationLimit | EndStopHit => Self::Limit,
            TrackingLost | OrientationLost | FollowingError => Self::OffPath,
            StaleReading | CommandLost | MotionLate => Self::Stale,
            LawFailed | BadMessage | ForeignCommand if is_of_program => Self::ProgramLaw,
            LawFailed | BadMessage | ForeignCommand => Self::Law,
            ForwardKinematics | InverseKinematics => Self::Pose,
            StartTooFar => Self::Start,
            ForceLimit => Self::TooHard,
            _ => Self::Stop,
        }
    }

    fn of_untested(checks: &[Check]) -> Self {
        let untested = checks.iter().find(|check| check.is_untested());
        match untested.map(|check| check.subject) {
            Some(Subject::Faults { .. } | Subject::Stimuli) => Self::NeverActed,
            Some(Subject::Requirement | Subject::ExpectedEvent) => Self::NotJudged,
            _ => Self::TooLittle,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_step_is_one_sentence_of_at_most_25_words() {
        for step in NextStep::ALL {
            let sentence = step.name();
            assert!(sentence.split_whitespace().count() <= 25, "{step:?}: {sentence}");
            assert!(sentence.ends_with('.') && !sentence.contains(". "), "{step:?}: {sentence}");
        }
    }
}
