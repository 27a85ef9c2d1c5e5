//! The enumerations that messages carry as numbers. The conversion refuses a number without a meaning.

use masseter_can::{UnknownCode, codes};

pub use masseter_can::cia402::{DriveRequest, DriveState};
pub use masseter_scenario::ControllerState;

/// [`Event::axis`](super::Event::axis) of an event without an axis.
pub const NO_AXIS: u32 = u32::MAX;

/// [`Event::object`](super::Event::object) of a stimulus that the controller's side carries out.
pub const OF_OPERATOR: u32 = 1;

/// [`Reading::drive_state`](super::Reading::drive_state) of a drive that is silent so far, or lost.
pub const NO_DRIVE_STATE: u32 = 0;
/// Its name.
const NO_STATE_NAME: &str = "unknown";

codes! {
    /// Progress of the CAN master with the boot of a node.
    BootPhase as u32 {
        /// Waiting for its boot-up message.
        Waiting = 0 "waiting",
        /// Reading what device it is.
        Identifying = 1 "identifying",
        /// Comparing its PDOs with those that will be exchanged.
        CheckingPdos = 2 "checking_pdos",
        /// Writing its configuration.
        Configuring = 3 "configuring",
        /// Verified and configured; waiting for the others.
        Configured = 4 "configured",
        /// Commanded to become operational.
        Starting = 5 "starting",
        /// Operational, exchanging process data.
        Ready = 6 "ready",
        /// Given up until it boots again; an event of its own has the reason.
        Failed = 7 "failed",
    }

    /// Who reports an event.
    Source as u32 {
        /// The controller.
        Controller = 1 "controller",
        /// The plant: CAN master.
        Master = 2 "master",
        /// The plant: a message of a drive to the master.
        Drive = 3 "drive",
        /// A simulated wire, or the faults of a real one.
        Wire = 5 "wire",
        /// The scenario: its faults and stimuli.
        Scenario = 6 "scenario",
    }

    /// What kind of event it is.
    EventKind as u32 {
        /// A state machine moved; `from` and `to` name the states.
        Transition = 0 "transition",
        /// Something is wrong; `cause`, `value` and `limit` explain it.
        Fault = 1 "fault",
        /// An observation without a reaction.
        Notice = 2 "notice",
    }

    /// Why kinematics gave no pose, in the `object` of an event of the controller.
    NoPose as u32 {
        /// A coordinate is no finite number.
        NotFinite = 1 "not_finite",
        /// A leg has no length; the event names its axis.
        NoLength = 2 "no_length",
        /// No pose fits the positions.
        Unassemblable = 3 "unassemblable",
        /// Only poses with a folded mechanism fit the positions.
        WrongAssembly = 4 "wrong_assembly",
        /// Several poses fit the positions, and the last pose does not decide between them.
        Ambiguous = 5 "ambiguous",
        /// Several poses fit the positions, and rounding hides their difference.
        Undecided = 6 "undecided",
        /// The pose is singular, or an iteration came to none.
        NotFound = 7 "not_found",
    }

    /// Cause of an event. The unit of the event's `value` and `limit` is given in brackets.
    Cause as u32 {
        /// In the course of the sequence.
        Sequence = 0 "sequence",
        /// Asked for from outside (signal).
        StopRequested = 1 "stop_requested",
        /// No fresh reading for too long (cycles).
        StaleReading = 2 "stale_reading",
        /// A drive is in fault or fell out of operation (drive condition).
        DriveFault = 3 "drive_fault",
        /// Forward kinematics gave no acceptable pose (residual, m).
        ForwardKinematics = 4 "forward_kinematics",
        /// An axis outside its stroke (m).
        StrokeLimit = 5 "stroke_limit",
        /// An axis asked to go faster than its drive may (m/s).
        VelocityLimit = 6 "velocity_limit",
        /// The desired pose has no joint coordinates.
        InverseKinematics = 7 "inverse_kinematics",
        /// A reading answers a command that this controller never sent (cycle).
        ForeignCommand = 8 "foreign_command",
        /// The drives did not reach operation enabled, or at the end off, in time (cycles).
        EnableTimeout = 9 "enable_timeout",
        /// Incisal point too far from where it should be (m).
        TrackingLost = 10 "tracking_lost",
        /// No fresh command for too long (cycles).
        CommandLost = 11 "command_lost",
        /// A drive's heartbeat is overdue (ms).
        HeartbeatLost = 12 "heartbeat_lost",
        /// An emergency message of a drive (EMCY code; the limit is the error register, object 1001).
        Emergency = 15 "emergency",
        /// Process data of a drive missing (cycles).
        ProcessDataLost = 16 "process_data_lost",
        /// The bus refused a frame.
        BusRefused = 18 "bus_refused",
        /// A value in a message is not a finite number or no known code, or the message has another version.
        BadMessage = 19 "bad_message",
        /// A drive did not boot in time (ms).
        BootTimeout = 20 "boot_timeout",
        /// The CAN master refuses to move anything; an event of its own has the reason.
        MasterFault = 23 "master_fault",
        /// A bounded buffer had no room (items lost).
        Overflow = 24 "overflow",
        /// A node is another device than configured (value of the identity object).
        WrongIdentity = 25 "wrong_identity",
        /// A node's PDOs are not those that the master exchanges (value of the object).
        WrongPdo = 26 "wrong_pdo",
        /// A node does not show a value that it was configured with (value of the object).
        NotAccepted = 27 "not_accepted",
        /// A node refused to have an object read or written (SDO abort code).
        SdoAborted = 28 "sdo_aborted",
        /// A node did not answer an SDO request (ms).
        SdoTimeout = 29 "sdo_timeout",
        /// Two nodes have one id: they answer SDO requests or SYNCs more than once, again and again.
        DuplicateNode = 30 "duplicate_node",
        /// A node booted without a request.
        NodeRestarted = 31 "node_restarted",
        /// A drive is in fault and a fault reset does not help (EMCY code, object 603F; the limit is the statusword).
        FaultAtStart = 32 "fault_at_start",
        /// A node left the NMT state operational by itself (reported NMT state; the limit is the code of operational).
        NodeStopped = 33 "node_stopped",
        /// A bus or a node works again after a fault.
        Recovered = 34 "recovered",
        /// A frame does not have the length of its object (bytes).
        WrongLength = 35 "wrong_length",
        /// A node that is not configured is on the bus.
        UnknownNode = 36 "unknown_node",
        /// Another node sends SYNC or NMT, or has the master's id: its heartbeats would keep the drives going without this one.
        SecondMaster = 37 "second_master",
        /// A drive has voltage in spite of a quick stop (statusword, object 6041).
        StillPowered = 38 "still_powered",
        /// A drive counts its software limits from elsewhere than its positions (home offset, object 607C).
        HomeOffset = 39 "home_offset",
        /// A CAN controller became error active again (transmit error counter).
        ErrorActive = 40 "error_active",
        /// A CAN controller became error passive (transmit error counter).
        ErrorPassive = 41 "error_passive",
        /// A CAN controller went off the bus (transmit error counter).
        BusOff = 42 "bus_off",
        /// A fault of the scenario began to act (number in its list, from 1).
        FaultInjected = 43 "fault_injected",
        /// A fault of the scenario is over (number in its list, from 1; number of activations).
        FaultEnded = 44 "fault_ended",
        /// An axis asked to change its velocity faster than it may (m/s²).
        AccelerationLimit = 45 "acceleration_limit",
        /// A drive is not where its targets should have taken it (m).
        FollowingError = 46 "following_error",
        /// Platform turned too far from where it should be (rad).
        OrientationLost = 48 "orientation_lost",
        /// The pose law failed (0), or gave a pose with a bad coordinate (m), or with a bad quaternion (its length; the
        /// limit is 1).
        LawFailed = 49 "law_failed",
        /// A parameter of the controller was set (new value; the limit is the value before). The object is its place.
        ParameterSet = 50 "parameter_set",
        /// A stimulus of the scenario began (number in its list, from 1).
        StimulusBegan = 51 "stimulus_began",
        /// A stimulus of the scenario is over (number in its list, from 1).
        StimulusEnded = 52 "stimulus_ended",
        /// An object of a drive is not as its profile says (value; the limit is the expected one).
        WrongObject = 53 "wrong_object",
        /// A drive counts accelerations in another unit than its profile says (60AAh; the limit is the expected one).
        WrongUnit = 54 "wrong_unit",
        /// A drive is in fault at the start, and no reset is allowed (EMCY code, object 603F; the limit is the statusword).
        FaultFound = 55 "fault_found",
        /// A fault found at the start was reset (EMCY code, object 603F; the limit is the statusword).
        FaultReset = 56 "fault_reset",
        /// The drives wait for one that is not ready to switch on (statusword; the limit is its EMCY code).
        WaitsForDrive = 57 "waits_for_drive",
        /// A drive did not become ready to switch on in time (statusword; the limit is its EMCY code).
        NotReady = 58 "not_ready",
        /// A drive was not enabled in time with the others (statusword; the limit is its EMCY code).
        NotEnabled = 59 "not_enabled",
        /// The jaw is too far from the first pose of the motion (m).
        StartTooFar = 60 "start_too_far",
        /// Food between the teeth broke (force before, N; the limit is its strength). The object is the first of its teeth.
        FoodBroke = 61 "food_broke",
        /// An axis of the mechanism ran into an end stop (m/s).
        EndStopHit = 62 "end_stop_hit",
        /// A drive acknowledged a value and shows another one (value that it shows; the limit is the one written).
        NotKept = 63 "not_kept",
        /// The bite force exceeds the limit of the force control (N).
        ForceLimit = 64 "force_limit",
        /// The motion waited too long for lost or late commands and readings (s).
        MotionLate = 65 "motion_late",
        /// A bite shows another stiffness than stated (N/m; the limit is the stated one).
        WrongStiffness = 66 "wrong_stiffness",
    }
}

/// The numbers and names of an enumeration that messages carry, by the name of its type; empty for other types.
pub(super) fn of_enumeration(name: &str) -> Vec<(u32, &'static str)> {
    macro_rules! among {
        ($($enumeration:ident),*) => {
            match name {
                $(stringify!($enumeration) => {
                    $enumeration::ALL.map(|value| (u32::from(value.code()), value.name())).to_vec()
                })*
                _ => Vec::new(),
            }
        };
    }
    let mut codes = among!(DriveRequest, DriveState, ControllerState, Source, EventKind, Cause, NoPose);
    if name == "DriveState" {
        codes.insert(0, (NO_DRIVE_STATE, NO_STATE_NAME));
    }
    codes
}

/// The code of a drive's state in a message; [`NO_DRIVE_STATE`] for none.
pub fn drive_state_code(state: Option<DriveState>) -> u32 {
    state.map_or(NO_DRIVE_STATE, DriveState::code)
}

/// The state of a drive by its code in a message; none for [`NO_DRIVE_STATE`].
///
/// # Errors
/// A code that no state has.
pub fn drive_state(code: u32) -> Result<Option<DriveState>, UnknownCode> {
    if code == NO_DRIVE_STATE { Ok(None) } else { DriveState::try_from(code).map(Some) }
}

/// The name of a drive's state by its code in a message.
///
/// # Errors
/// A code that no state has.
pub fn drive_state_name(code: u32) -> Result<&'static str, UnknownCode> {
    Ok(drive_state(code)?.map_or(NO_STATE_NAME, DriveState::name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_is_its_value_or_refused() {
        /// The numbers below 256 with a value. Asserts that each is the number of its value.
        fn numbers<T: TryFrom<u32, Error = UnknownCode>>(code: impl Fn(T) -> u32) -> Vec<u32> {
            let check = |number| match T::try_from(number) {
                Ok(value) => assert_eq!(code(value), number),
                Err(unknown) => assert_eq!(unknown.number, number),
            };
            (0..256).for_each(check);
            (0..256).filter(|&number| T::try_from(number).is_ok()).collect()
        }
        assert_eq!(numbers(ControllerState::code).len(), ControllerState::ALL.len());
        assert_eq!(numbers(BootPhase::code).len(), BootPhase::ALL.len());
        assert_eq!(numbers(Source::code), [1, 2, 3, 5, 6]);
        assert_eq!(numbers(EventKind::code).len(), EventKind::ALL.len());
        assert_eq!(numbers(NoPose::code).len(), NoPose::ALL.len());
        assert_eq!(numbers(Cause::code).len(), Cause::ALL.len());
        assert_eq!(numbers(DriveRequest::code), [0, 1, 2]);
        assert_eq!(numbers(DriveState::code), [1, 2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(drive_state(NO_DRIVE_STATE), Ok(None));
        assert_eq!(drive_state(9), Err(UnknownCode { enumeration: "DriveState", number: 9 }));
    }
}
