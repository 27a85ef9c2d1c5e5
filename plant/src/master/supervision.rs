//! Supervision of the drives' motion: whether the master lets the drives move, and how long a stop lasts.
//!
//! Other parts find the causes of a stop. The supervision keeps their consequence; the master sends it to the drives.

use masseter_runtime::messages::codes::{Cause, DriveRequest};

/// How long the drives stay stopped.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Stop {
    #[default]
    None,
    /// Until every drive is verified again and the controller has switched them off.
    UntilRestored,
    Permanent,
}

/// The supervision of all drives.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Supervision {
    stop: Stop,
    /// Whether the drives stop for the end of the run.
    is_ending: bool,
    /// Whether a refused command stopped the drives.
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

    /// Whether drives may be booted. During a stop they may not: the drives have to stop first. After a permanent stop
    /// nobody moves the drives again, and another master may control them.
    pub(super) fn may_boot(self, drives_are_off: bool) -> bool {
        match self.stop {
            Stop::None => true,
            Stop::UntilRestored => drives_are_off,
            Stop::Permanent => false,
        }
    }

    /// Stops the drives for a cause; returns whether the cause is new. A later cause is mostly a consequence of the first
    /// and changes nothing, but a refused command is never a consequence.
    pub(super) fn stop(&mut self, cause: Cause) -> bool {
        if is_refusal(cause) {
            self.stop = Stop::Permanent;
            return !std::mem::replace(&mut self.has_refused, true);
        }
        let is_first = !self.is_stopped();
        if is_first {
            self.stop = match cause {
                Cause::CommandLost
                | Cause::DriveFault
                | Cause::FollowingError
                | Cause::NotReady
                | Cause::NotEnabled => Stop::Permanent,
                _ => Stop::UntilRestored,
            };
        }
        is_first
    }

    /// Stops the drives permanently, whatever stopped them before; returns whether they were not stopped permanently yet.
    pub(super) fn stop_permanently(&mut self) -> bool {
        std::mem::replace(&mut self.stop, Stop::Permanent) != Stop::Permanent
    }

    /// Ends a stop.
    pub(super) fn restore(&mut self) {
        self.stop = Stop::None;
    }

    /// Stops the drives for the end of the run.
    pub(super) fn end(&mut self) {
        self.is_ending = true;
    }
}

/// Whether the gate refused a command.
fn is_refusal(cause: Cause) -> bool {
    matches!(cause, Cause::BadMessage | Cause::StrokeLimit | Cause::VelocityLimit | Cause::AccelerationLimit)
}

#[cfg(test)]
mod tests {
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
                assert_eq!(supervision.stop_permanently(), !is_permanent, "{cause}");
                assert!(!supervision.stop_permanently() && !supervision.awaits_restoration(), "{cause}");
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
        ending.end();
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
