//! The permission of the drives to move: the duration of a stop, and the way to "operation enabled".
//!
//! Other parts find the causes of a stop; [`Supervision`] keeps their consequence, and the master sends the request. No
//! drive is switched on before all are ready. All are [enabled](Enabling) within a time, or none stays on.

use masseter_model::geometry::AXES;
use masseter_runtime::clock::MILLISECOND_NS;
use masseter_runtime::messages::codes::{Cause, DriveRequest, DriveState, drive_state_code};
use masseter_scenario::CanConfig;

use super::events::Failure;

/// The duration of a stop.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
enum Stop {
    #[default]
    None,
    /// Until every drive is verified again and the controller has switched them off.
    UntilRestored,
    Permanent,
}

/// The supervision of all drives.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Supervision {
    stop: Stop,
    /// Whether the drives stop for the end of the run.
    pub(super) is_ending: bool,
    /// Whether a refused command has stopped the drives.
    has_refused: bool,
}

impl Supervision {
    /// Whether a fault stops the drives.
    pub(super) fn is_stopped(self) -> bool {
        self.stop != Stop::None
    }

    /// Whether the stop ends once the drives are restored.
    pub(super) fn awaits_restoration(self) -> bool {
        self.stop == Stop::UntilRestored
    }

    /// Whether the drives may move: neither a fault nor the end stops them.
    pub(super) fn may_move(self) -> bool {
        !self.is_stopped() && !self.is_ending
    }

    /// The request to the drives, given the controller's.
    pub(super) fn request(self, commanded: DriveRequest, all_are_ready: bool) -> DriveRequest {
        if !self.may_move() {
            DriveRequest::QuickStop
        } else if all_are_ready {
            commanded
        } else {
            DriveRequest::Off
        }
    }

    /// Whether the master may boot drives. During a stop it may not: the drives have to stop first. After a permanent
    /// stop nobody moves the drives again, and another master may control them.
    pub(super) fn may_boot(self, drives_are_off: bool) -> bool {
        match self.stop {
            Stop::None => true,
            Stop::UntilRestored => drives_are_off,
            Stop::Permanent => false,
        }
    }

    /// Stops the drives for a cause; returns whether the cause is new. A later cause is mostly a consequence of the first
    /// and changes nothing, but a refused command and a second master are never a consequence.
    pub(super) fn stop(&mut self, cause: Cause) -> bool {
        if is_refusal(cause) {
            self.stop = Stop::Permanent;
            return !std::mem::replace(&mut self.has_refused, true);
        }
        // From now on another master may control the drives, also after another stop.
        if cause == Cause::SecondMaster {
            return std::mem::replace(&mut self.stop, Stop::Permanent) != Stop::Permanent;
        }
        let is_first = !self.is_stopped();
        if is_first {
            self.stop = match cause {
                Cause::CommandLost
                | Cause::DriveFault
                | Cause::FollowingError
                | Cause::NotReady
                | Cause::NotEnabled
                | Cause::Emergency => Stop::Permanent,
                _ => Stop::UntilRestored,
            };
        }
        is_first
    }

    /// Ends a stop.
    pub(super) fn restore(&mut self) {
        self.stop = Stop::None;
    }
}

/// Whether the gate refused a command.
fn is_refusal(cause: Cause) -> bool {
    matches!(cause, Cause::BadMessage | Cause::StrokeLimit | Cause::VelocityLimit | Cause::AccelerationLimit)
}

/// Time before the report of the drives that the others wait for, ns.
const NAMED_AFTER_NS: u64 = 500_000_000;

/// The stage of the drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
enum Phase {
    /// The drives are not to be enabled.
    Off,
    /// All go to "ready to switch on", since that time.
    Preparing { since_ns: u64 },
    /// All go to "operation enabled", since that time.
    SwitchingOn { since_ns: u64 },
    /// All have been enabled: none may leave operation by itself.
    Enabled,
}

/// The progress of all drives.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Enabling {
    ready_timeout_ns: u64,
    enable_timeout_ns: u64,
    phase: Phase,
    is_named: [bool; AXES],
}

impl Enabling {
    /// Drives that are off.
    pub(super) fn new(can: &CanConfig) -> Self {
        Self {
            ready_timeout_ns: u64::from(can.ready_timeout_ms) * MILLISECOND_NS,
            enable_timeout_ns: u64::from(can.enable_timeout_ms) * MILLISECOND_NS,
            phase: Phase::Off,
            is_named: [false; AXES],
        }
    }

    /// Whether drives may be switched on: all have been ready.
    pub(super) fn may_switch_on(&self) -> bool {
        matches!(self.phase, Phase::SwitchingOn { .. } | Phase::Enabled)
    }

    /// Judges the state of a drive in a cycle with or without enabling. On the way to operation a drive may neither go
    /// into fault, which nobody resets, nor become unready, as by safe torque off.
    pub(super) fn disobedience(&self, state: Option<DriveState>, is_enable: bool) -> Option<Failure> {
        let is_in_fault = matches!(state, Some(DriveState::Fault | DriveState::FaultReactionActive));
        let has_left = match self.phase {
            Phase::Off | Phase::Preparing { .. } => false,
            Phase::SwitchingOn { .. } => !is_ready(state),
            Phase::Enabled => state != Some(DriveState::OperationEnabled),
        };
        (is_enable && (is_in_fault || has_left))
            .then(|| Failure::with(Cause::DriveFault, drive_state_code(state), 0.0))
    }

    /// Ends the judgement of a cycle; returns the verdict on each drive.
    pub(super) fn end_cycle(
        &mut self,
        now_ns: u64,
        is_enable: bool,
        states: [Option<DriveState>; AXES],
    ) -> [Option<Cause>; AXES] {
        let is_ready = states.map(is_ready);
        let is_enabled = states.map(|state| state == Some(DriveState::OperationEnabled));
        self.phase = match self.phase {
            _ if !is_enable => Phase::Off,
            Phase::Off => {
                self.is_named = [false; AXES];
                Phase::Preparing { since_ns: now_ns }
            }
            unchanged => unchanged,
        };
        if let Phase::Preparing { .. } = self.phase
            && is_ready == [true; AXES]
        {
            self.phase = Phase::SwitchingOn { since_ns: now_ns };
        }
        if self.may_switch_on() && is_enabled == [true; AXES] {
            self.phase = Phase::Enabled;
        }
        match self.phase {
            Phase::Preparing { since_ns } if now_ns - since_ns >= self.ready_timeout_ns => {
                is_ready.map(|is_ready| (!is_ready).then_some(Cause::NotReady))
            }
            Phase::Preparing { since_ns } if now_ns - since_ns >= NAMED_AFTER_NS => {
                std::array::from_fn(|axis| {
                    let is_new = !is_ready[axis] && !std::mem::replace(&mut self.is_named[axis], true);
                    is_new.then_some(Cause::WaitsForDrive)
                })
            }
            Phase::SwitchingOn { since_ns } if now_ns - since_ns >= self.enable_timeout_ns => {
                is_enabled.map(|is_enabled| (!is_enabled).then_some(Cause::NotEnabled))
            }
            _ => [None; AXES],
        }
    }
}

/// Whether the drive may be switched on, or is on.
fn is_ready(state: Option<DriveState>) -> bool {
    use DriveState::{OperationEnabled, ReadyToSwitchOn, SwitchedOn};
    matches!(state, Some(ReadyToSwitchOn | SwitchedOn | OperationEnabled))
}

#[cfg(test)]
mod supervision_tests {
    use super::*;

    #[test]
    fn a_wrong_command_and_a_drive_that_does_not_follow_stop_permanently_and_the_first_cause_counts() {
        let permanent = [
            Cause::CommandLost,
            Cause::BadMessage,
            Cause::StrokeLimit,
            Cause::VelocityLimit,
            Cause::AccelerationLimit,
            Cause::DriveFault,
            Cause::FollowingError,
            Cause::NotReady,
            Cause::NotEnabled,
        ];
        let restorable = [
            Cause::BusOff,
            Cause::BusRefused,
            Cause::NodeRestarted,
            Cause::NodeStopped,
            Cause::HeartbeatLost,
            Cause::ProcessDataLost,
            Cause::DuplicateNode,
            Cause::SdoAborted,
            Cause::BootTimeout,
            Cause::FaultFound,
        ];
        for (causes, is_permanent) in [(&permanent[..], true), (&restorable[..], false)] {
            for &cause in causes {
                let mut supervision = Supervision::default();
                assert!(!supervision.is_stopped() && !supervision.awaits_restoration());
                assert!(supervision.may_boot(false));
                assert!(supervision.stop(cause));
                for later in permanent.iter().chain(&restorable).filter(|later| !is_refusal(**later)) {
                    assert!(!supervision.stop(*later), "{later} is no first cause after {cause}");
                }
                assert!(supervision.is_stopped() && !supervision.may_boot(false), "{cause}");
                assert_eq!(supervision.awaits_restoration(), !is_permanent, "{cause}");
                assert_eq!(supervision.may_boot(true), !is_permanent, "{cause}");
                assert_eq!(supervision.stop(Cause::SecondMaster), !is_permanent, "{cause}");
                assert!(
                    !supervision.stop(Cause::SecondMaster) && !supervision.awaits_restoration(),
                    "{cause}"
                );
                assert!(!supervision.may_boot(true), "{cause}");
            }
        }
    }

    #[test]
    fn the_first_refused_command_is_new_and_permanent_whatever_stopped_the_drives_before() {
        use Cause::{AccelerationLimit, BadMessage, BusOff, CommandLost, StrokeLimit, VelocityLimit};
        for refusal in [BadMessage, StrokeLimit, VelocityLimit, AccelerationLimit] {
            for before in [None, Some(BusOff), Some(CommandLost)] {
                let mut supervision = Supervision::default();
                before.map(|cause| supervision.stop(cause));
                assert!(supervision.stop(refusal), "{refusal} after {before:?}");
                assert!(!supervision.awaits_restoration(), "{refusal} after {before:?}");
                assert!(!supervision.stop(BadMessage), "the next refused command is no news");
            }
        }
    }

    #[test]
    fn the_controllers_request_reaches_drives_that_are_all_ready_and_not_to_stop() {
        use DriveRequest::{Enable, Off, QuickStop};
        let [mut stopped, mut ending] = [Supervision::default(); 2];
        stopped.stop(Cause::BusOff);
        ending.is_ending = true;
        for commanded in [Off, Enable, QuickStop] {
            let requests = |supervision: Supervision| {
                [true, false].map(|all_are_ready| supervision.request(commanded, all_are_ready))
            };
            assert_eq!(requests(Supervision::default()), [commanded, Off]);
            assert_eq!((requests(stopped), requests(ending)), ([QuickStop; 2], [QuickStop; 2]));
        }
        assert!(!ending.is_stopped(), "the end is no fault");
        stopped.restore();
        assert!(!stopped.is_stopped() && stopped.may_boot(false));
        assert_eq!(stopped.request(Enable, true), Enable);
    }
}

#[cfg(test)]
mod enabling_tests {
    use super::*;

    const NOBODY: [Option<Cause>; AXES] = [None; AXES];

    fn enabling() -> Enabling {
        Enabling::new(&CanConfig { ready_timeout_ms: 1000, enable_timeout_ms: 100, ..CanConfig::default() })
    }

    /// All drives in one state, but for axis 4.
    fn all_but_l2(state: DriveState, of_l2: Option<DriveState>) -> [Option<DriveState>; AXES] {
        let mut states = [Some(state); AXES];
        states[4] = of_l2;
        states
    }

    fn of_l2(cause: Cause) -> [Option<Cause>; AXES] {
        let mut causes = NOBODY;
        causes[4] = Some(cause);
        causes
    }

    #[test]
    fn no_drive_is_switched_on_before_all_are_ready_and_the_missing_one_is_named() {
        use DriveState::{ReadyToSwitchOn, SwitchOnDisabled};
        for missing in [None, Some(SwitchOnDisabled)] {
            let mut enabling = enabling();
            let states = all_but_l2(ReadyToSwitchOn, missing);
            let mut told = Vec::new();
            for ms in 0..=1000 {
                let causes = enabling.end_cycle(ms * MILLISECOND_NS, true, states);
                assert!(!enabling.may_switch_on());
                told.extend((causes != NOBODY).then_some((ms, causes)));
            }
            assert_eq!(told, [(500, of_l2(Cause::WaitsForDrive)), (1000, of_l2(Cause::NotReady))]);
        }
    }

    #[test]
    fn the_time_to_enable_counts_from_the_moment_when_all_are_ready() {
        use DriveState::{OperationEnabled, ReadyToSwitchOn, SwitchedOn};
        let mut enabling = enabling();
        let at = |ms: u64| ms * MILLISECOND_NS;
        enabling.end_cycle(at(0), true, all_but_l2(ReadyToSwitchOn, None));
        enabling.end_cycle(at(900), true, [Some(ReadyToSwitchOn); AXES]);
        assert!(enabling.may_switch_on());
        let late = all_but_l2(OperationEnabled, Some(SwitchedOn));
        assert_eq!(enabling.end_cycle(at(999), true, late), NOBODY);
        let mut in_time = enabling.clone();
        assert_eq!(in_time.end_cycle(at(1000), true, [Some(OperationEnabled); AXES]), NOBODY);
        assert_eq!(in_time.end_cycle(at(5000), true, [Some(OperationEnabled); AXES]), NOBODY);
        assert_eq!(enabling.end_cycle(at(1000), true, late), of_l2(Cause::NotEnabled));
        enabling.end_cycle(at(1001), false, late);
        assert!(!enabling.may_switch_on(), "the next time begins anew");
    }

    #[test]
    fn a_drive_may_leave_operation_only_before_all_were_enabled_or_when_it_is_told_to() {
        let mut enabling = enabling();
        let left = [None, Some(DriveState::SwitchOnDisabled), Some(DriveState::SwitchedOn)];
        let may_be = |enabling: &Enabling| left.map(|state| enabling.disobedience(state, true).is_none());
        assert_eq!(may_be(&enabling), [true; 3]);
        enabling.end_cycle(0, true, [Some(DriveState::SwitchedOn); AXES]);
        assert_eq!(may_be(&enabling), [false, false, true], "while they are switched on");
        for state in [DriveState::OperationEnabled, DriveState::SwitchedOn] {
            enabling.end_cycle(0, true, [Some(state); AXES]);
            assert_eq!(enabling.disobedience(Some(DriveState::OperationEnabled), true), None);
            for state in left {
                assert_eq!(
                    enabling.disobedience(state, true),
                    Some(Failure::with(Cause::DriveFault, drive_state_code(state), 0.0))
                );
                assert_eq!(enabling.disobedience(state, false), None);
            }
        }
        enabling.end_cycle(0, false, [Some(DriveState::OperationEnabled); AXES]);
        assert_eq!(may_be(&enabling), [true; 3], "after they were switched off");
    }

    #[test]
    fn a_fault_on_the_way_to_operation_is_a_failure() {
        for state in [DriveState::Fault, DriveState::FaultReactionActive] {
            assert!(enabling().disobedience(Some(state), true).is_some());
            assert_eq!(enabling().disobedience(Some(state), false), None);
        }
    }
}
