//! The reasons why a motion does not begin, or ends early.

use std::fmt::{self, Display, Formatter};

use masseter_can::canopen::{EmergencyCode, ObjectAddress};
use masseter_can::cia402::{DriveState, StatuswordError};
use masseter_model::geometry::AXIS_NAMES;
use masseter_scenario::wording::shortest;

use crate::line_error::{LineError, OtherMaster, Restarted};

/// The reason for the stop of a motion.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum StopCause {
    /// The person stopped it.
    #[error("stopped on request")]
    Requested,
    /// The axis does not follow its demand.
    #[error("following error beyond {:.3} mm; check motor, brake and gains", .window_m * 1e3)]
    FollowingError {
        /// The window (6065h), m.
        window_m: f64,
    },
    /// The motor's force is too high.
    #[error("force {force_n:.1} N above {limit_n:.1} N; check brake and guides, or allow more with --torque")]
    Force {
        /// The force, N.
        force_n: f64,
        /// The limit, N.
        limit_n: f64,
    },
    /// A limit switch closes.
    #[error("limit switch (60FDh = {bits:08X}h); move the axis the other way")]
    LimitSwitch {
        /// 60FDh.
        bits: u32,
    },
    /// The axis moves against its target.
    #[error("moved {:.4} mm against its target; check the phases of the motor and the sign of the encoder", .moved_m * 1e3)]
    WrongDirection {
        /// The way, m.
        moved_m: f64,
    },
    /// The axis goes past its target.
    #[error("went {:.3} mm past its target; check the scale and the gains", .beyond_m * 1e3)]
    Overrun {
        /// The way, m.
        beyond_m: f64,
    },
    /// The axis does not stand still with power on.
    #[error("moved {:.3} mm with power on and no target; check brake and gains", .moved_m * 1e3)]
    Restless {
        /// The way within a second, m.
        moved_m: f64,
    },
    /// Another axis moves in spite of its brake.
    #[error("{} moved {:.3} mm, though it is off; check its brake", AXIS_NAMES[*other], .moved_m * 1e3)]
    OtherAxis {
        /// The other axis.
        other: usize,
        /// The way, m.
        moved_m: f64,
    },
    /// Another drive has power that this step did not give.
    #[error("{} went to {state}, and this step did not switch it on; end the program that controls it", AXIS_NAMES[*other])]
    OtherPowered {
        /// The axis of the other drive.
        other: usize,
        /// The state of that drive.
        state: DriveState,
    },
    /// There is a sign of another master.
    #[error(transparent)]
    OtherMaster(#[from] OtherMaster),
    /// A drive sends an emergency.
    #[error("{} sent emergency {:04X}h; see the drive's manual", AXIS_NAMES[*sender], .code.0)]
    Emergency {
        /// The axis of the drive.
        sender: usize,
        /// The code.
        code: EmergencyCode,
    },
    /// The drive leaves "operation enabled".
    #[error("the drive went to {state} (error code {error_code:04X}h); see the drive's manual")]
    LeftOperation {
        /// Its new state.
        state: DriveState,
        /// 603Fh.
        error_code: u16,
    },
    /// A drive restarts.
    #[error(transparent)]
    Restarted(#[from] Restarted),
    /// The motion takes too long.
    #[error("not done within {:.1} s; check whether the drive takes set-points, or its unit of velocity", .limit_s)]
    TimedOut {
        /// The limit, s.
        limit_s: f64,
    },
    /// The motion does not end in time, and the drive reports a limit.
    #[error(
        "not done within {limit_s:.1} s, and the drive reports a limit (statusword bit 11); check what 607Dh counts from: \
         drive_profile.homing.limits_from_home or home_sign"
    )]
    Limited {
        /// The limit, s.
        limit_s: f64,
    },
    /// The drive shows the previous homing.
    #[error(
        "homing did not begin: statusword bit 12 stays from the homing before; check mode 6 and the start bit"
    )]
    NotBegun,
    /// The drive reports a homing error.
    #[error("homing failed (statusword bit 13); check method, switches and index")]
    Homing,
}

/// Why a motion does not begin, or ends early.
#[derive(Debug, thiserror::Error)]
pub enum MotionError {
    /// The line fails.
    #[error(transparent)]
    Line(#[from] LineError),
    /// The drive gives no answer, or no state. The axis is switched off afterwards.
    #[error("{source}; {} is off", AXIS_NAMES[*axis])]
    Unread {
        /// The axis.
        axis: usize,
        /// The reason for the end of the motion.
        source: Box<MotionError>,
    },
    /// An axis or its drive.
    #[error("{}: {reason}", AXIS_NAMES[*axis])]
    OfAxis {
        /// The axis.
        axis: usize,
        /// The reason.
        reason: AxisError,
    },
}

/// What the master stops sending.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Silence {
    /// The heartbeat, which 1016h:01 watches.
    Heartbeat,
    /// The process data, which the event timer of the RPDO (1400h:05) watches.
    ProcessData,
}

impl Silence {
    /// The object with the time after which the drive must stop.
    pub fn object(self) -> ObjectAddress {
        match self {
            Self::Heartbeat => ObjectAddress::new(0x1016, 1),
            Self::ProcessData => ObjectAddress::new(0x1400, 5),
        }
    }
}

impl Display for Silence {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Heartbeat => "heartbeat",
            Self::ProcessData => "process data",
        })
    }
}

/// What to do about a drive that stays in a state without operation.
fn advice(state: DriveState, error_code: u16) -> &'static str {
    match (state, error_code >> 8) {
        (DriveState::Fault, 0x81 | 0x82) => {
            "the drive has lost its master; switch its supply off and on, and configure 6007h so that this is no fault"
        }
        _ => "check safe torque off, supply and faults",
    }
}

/// Why one axis does not begin a motion, or ends a motion early.
#[derive(Debug, thiserror::Error)]
pub enum AxisError {
    /// The axis has been stopped and switched off.
    #[error("{0}; the axis is off")]
    Stopped(StopCause),
    /// The drive has power that this step did not give.
    #[error("{0} already; end the program that controls it, and switch the drive off")]
    Powered(DriveState),
    /// The drive does not go to "operation enabled".
    #[error("stays in {state} (error code {error_code:04X}h); {}", advice(*state, *error_code))]
    NotEnabled {
        /// The state of the drive.
        state: DriveState,
        /// 603Fh.
        error_code: u16,
    },
    /// The drive refuses a mode of operation.
    #[error("mode {wanted} was asked for, 6061h shows {found}; check 6502h")]
    Mode {
        /// The mode.
        wanted: i8,
        /// 6061h.
        found: i8,
    },
    /// A statusword of no state.
    #[error("{0}")]
    Statusword(StatuswordError),
    /// The drive does not confirm that its power is off.
    #[error(
        "NOT PROVED OFF ({0}); press the emergency stop. The next step that writes gives the old limits back"
    )]
    StaysOn(Unproved),
    /// Objects of the drive keep the values of this step.
    #[error(
        "{}not every old value returned ({why}); the next step that writes tries again",
        cause.as_ref().map(|cause| format!("{cause}; ")).unwrap_or_default()
    )]
    NotRestored {
        /// The reason for an early end of the motion, if any.
        cause: Option<Box<MotionError>>,
        /// The reason why the old value has not returned.
        why: LineError,
    },
    /// The profile forbids the write of an object, and its value is not careful enough.
    #[error(
        "object {object} is {found}, and its rule in drive_profile.objects lets nobody reduce it; change the rule"
    )]
    Careless {
        /// The object.
        object: ObjectAddress,
        /// Its value.
        found: u32,
    },
    /// A limit switch in the direction of the way is closed at the beginning.
    #[error(
        "a limit switch is closed (60FDh = {bits:08X}h), and the way goes in its direction; move the axis the other way, \
         or check the switch and its wire"
    )]
    OnSwitch {
        /// 60FDh.
        bits: u32,
    },
    /// The axis moves after the loss of its power.
    #[error(
        "moved {:.3} mm after its power went; support the axis, and let the drive close the brake before it takes the \
         current away",
        .moved_m * 1e3
    )]
    Dropped {
        /// The way, m.
        moved_m: f64,
    },
    /// The axis still moves when its brake should hold it.
    #[error("still moves at {:.3} mm/s half a second after its power went; support the axis, and mend its brake", .speed_m_s * 1e3)]
    Creeps {
        /// The speed, m/s.
        speed_m_s: f64,
    },
    /// The drive does not react to a silence of the master.
    #[error(
        "kept its power for {waited_ms:.0} ms after the last {silence}, while {} is {timeout_ms} ms; nothing stops this drive \
         without {silence}: check {} and 6007h, or use another drive", .silence.object(), .silence.object()
    )]
    Unwatched {
        /// What the master did not send.
        silence: Silence,
        /// For how long, ms.
        waited_ms: f64,
        /// After which time the drive should stop, ms.
        timeout_ms: u16,
    },
    /// The drive stops too late, or its stop was seen too late.
    #[error(
        "was seen without power only {stopped_after_ms:.0} ms after the last {silence}, while {} is {timeout_ms} ms; check the \
         unit of that object and what else delays the drive, then repeat the step", .silence.object()
    )]
    LateWatchdog {
        /// What the master did not send.
        silence: Silence,
        /// When the stop was seen, ms.
        stopped_after_ms: f64,
        /// After which time the drive should stop, ms.
        timeout_ms: u16,
    },
    /// The drive stopped, and not because of the silence.
    #[error(
        "stopped {stopped_after_ms:.0} ms after the last {silence}, while {} is {timeout_ms} ms, and its emergency messages name \
         no lost {silence}; find what else stopped the drive, then repeat the step", .silence.object()
    )]
    OtherStop {
        /// What the master did not send.
        silence: Silence,
        /// When the drive stopped, ms.
        stopped_after_ms: f64,
        /// After which time it should, ms.
        timeout_ms: u16,
    },
    /// The drive left operation, and keeps its power.
    #[error("stays in {state} without {silence}; check 605Ah and 605Eh: the drive must take the power away")]
    KeepsPower {
        /// What the master did not send.
        silence: Silence,
        /// The state of the drive.
        state: DriveState,
    },
    /// A fault that the silence made does not end.
    #[error(
        "stays in fault (error code {error_code:04X}h) though the heartbeat is back; look the code up in the drive's manual"
    )]
    KeepsFault {
        /// 603Fh.
        error_code: u16,
    },
    /// The proof of a watchdog failed, and a fault of its silence stays.
    #[error("{cause}; {left}")]
    Unrecovered {
        /// Why the proof failed.
        cause: Box<AxisError>,
        /// What stays.
        left: Box<MotionError>,
    },
    /// The drive stops without an emergency message.
    #[error("stopped without {silence}, and sent no emergency message; check 1014h")]
    Unreported {
        /// What the master did not send.
        silence: Silence,
    },
    /// RPDO1 is not the one that the rig sends.
    #[error("{index:04X}h is not as the rig needs it; run 'masseter robot configure' again")]
    OtherMapping {
        /// The object.
        index: u16,
    },
    /// A way that this step does not allow.
    #[error("{} mm is no way for a jog; give up to {:.0} mm, at least ten increments", shortest(.by_m * 1e3), .most_m * 1e3)]
    Way {
        /// The way, m.
        by_m: f64,
        /// The longest, m.
        most_m: f64,
    },
    /// An incremental encoder without a position at home.
    #[error("enter drive_profile.homing.home_position_m: what d or l is at the home position")]
    NoHomePosition,
    /// 6064h at home is not the value in the profile.
    #[error(
        "6064h shows {:.3} mm at home, the profile says {:.3} mm; check drive_profile.homing.home_sign, home_object and \
         reversed",
        .found_m * 1e3, .expected_m * 1e3
    )]
    HomePosition {
        /// What 6064h shows, m.
        found_m: f64,
        /// The value in the profile, m.
        expected_m: f64,
    },
    /// A second homing finds another place.
    #[error(
        "a second homing is {:.3} mm beside the first, allowed are {:.3} mm (drive_profile.homing.tolerance_m)",
        .spread_m * 1e3, .tolerance_m * 1e3
    )]
    Spread {
        /// The distance, m.
        spread_m: f64,
        /// The limit, m.
        tolerance_m: f64,
    },
    /// An absolute encoder shows a position beyond the stroke.
    #[error(
        "6064h shows {:.3} mm, the stroke is {:.1} to {:.1} mm; check the stored home, drive_profile.reversed and \
         encoder_resolution_m",
        .found_m * 1e3, .stroke_m[0] * 1e3, .stroke_m[1] * 1e3
    )]
    BeyondStroke {
        /// What 6064h shows, m.
        found_m: f64,
        /// The stroke, m.
        stroke_m: [f64; 2],
    },
}

impl AxisError {
    /// The error of a motion of that axis.
    pub(crate) const fn of(self, axis: usize) -> MotionError {
        MotionError::OfAxis { axis, reason: self }
    }
}

/// The known state of a drive that does not confirm its power off.
#[derive(Debug, thiserror::Error)]
pub enum Unproved {
    /// The drive has another state.
    #[error("it shows {0}")]
    Shows(DriveState),
    /// The read of its state or the transmission fails.
    #[error(transparent)]
    Unread(Box<MotionError>),
}
