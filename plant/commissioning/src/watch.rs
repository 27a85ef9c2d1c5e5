//! The watch over a motion, and the switching of one drive with the times of its brake.
//!
//! One look reads the moved axis and one of the others, and returns a reason for a stop of the motion.

use masseter_can::canopen::{EmergencyCode, ObjectAddress};
use masseter_can::cia402::{Controlword, DriveState, StatusBit, Statusword};
use masseter_model::geometry::AXES;
use masseter_runtime::clock::{MILLISECOND_NS, SECOND_NS};
use masseter_scenario::{AxisScale, BrakeConfig, Scenario};

use crate::line::{BootUps, Line};
use crate::line_error::LineError;
use crate::motion_error::{AxisError, MotionError, StopCause, Unproved};

/// Digital inputs (60FDh): limit switches.
const INPUTS: ObjectAddress = ObjectAddress::new(0x60FD, 0);
const NEGATIVE_SWITCH: u32 = 0b01;
const POSITIVE_SWITCH: u32 = 0b10;
/// Allowed share of the motor's force limit (6072h): at the limit the motor no longer follows.
const USABLE: f64 = 0.9;

/// The caution of a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Caution {
    /// Speed (6081h), m/s.
    pub speed_m_s: f64,
    /// Acceleration and deceleration (6083h, 6084h), m/s².
    pub acceleration_m_s2: f64,
    /// Force limit (6072h), N.
    pub force_n: f64,
    /// Motion of an axis that shall stand, m.
    pub still_m: f64,
}

impl Caution {
    /// Share of the velocity and of the acceleration limit that is used by default.
    const SPEED: f64 = 0.05;
    /// Share of the force limit.
    const FORCE: f64 = 0.2;
    /// Motion of an axis that shall stand, m.
    const STILL_M: f64 = 1e-4;

    /// The usual caution for an axis: 5 % of its velocity, 20 % of its force.
    pub fn usual(scenario: &Scenario, axis: usize) -> Self {
        let drive = scenario.drives.of_axis(axis);
        Self {
            speed_m_s: Self::SPEED * drive.max_velocity_m_s,
            acceleration_m_s2: Self::SPEED * drive.quick_stop_deceleration_m_s2,
            force_n: Self::FORCE * drive.max_force_n,
            still_m: Self::STILL_M,
        }
    }
}

/// The limit switches at the beginning of a motion.
#[derive(Debug, Clone, Copy)]
struct Switches {
    /// 60FDh.
    bits: u32,
    /// Where the axis stood, m.
    place_m: f64,
}

/// The moved axis at one look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// When, ns.
    pub at_ns: u64,
    /// 6064h, m.
    pub position_m: f64,
    /// 6077h, N.
    pub force_n: f64,
    /// 6041h.
    pub status: Statusword,
}

/// The watch.
#[derive(Debug)]
pub(crate) struct Watch {
    axis: usize,
    scales: [AxisScale; AXES],
    caution: Caution,
    /// The following error window, m.
    pub(crate) window_m: f64,
    /// Positions of all axes at the beginning, m.
    began_m: [f64; AXES],
    /// Emergencies received before.
    emergencies: [usize; AXES],
    boot_ups: BootUps,
    /// None for a drive without 60FDh, and while the switches do not count.
    switches: Option<Switches>,
    /// The other axis that is looked at next.
    next: usize,
}

/// 6041h.
pub(crate) fn read_status(line: &mut Line, axis: usize) -> Result<Statusword, LineError> {
    Ok(Statusword(line.read_number(axis, ObjectAddress::new(0x6041, 0))? as u16))
}

/// The state in 6041h.
pub(crate) fn read_state(line: &mut Line, axis: usize) -> Result<DriveState, MotionError> {
    read_status(line, axis)?.state().map_err(|error| AxisError::Statusword(error).of(axis))
}

/// 6064h, m.
pub(crate) fn read_position(line: &mut Line, axis: usize, scale: &AxisScale) -> Result<f64, LineError> {
    Ok(scale.metres(line.read_number(axis, ObjectAddress::new(0x6064, 0))? as i32))
}

/// The error code (603Fh), or 0 for a drive without one.
pub(crate) fn read_error_code(line: &mut Line, axis: usize) -> u16 {
    line.read_number(axis, ObjectAddress::new(0x603F, 0)).unwrap_or(0) as u16
}

/// The limit switches of an axis that stands there; none in a drive without 60FDh.
fn read_switches(line: &mut Line, axis: usize, place_m: f64) -> Result<Option<Switches>, LineError> {
    // Silence does not prove an open switch.
    Ok(line.read_if_there(axis, INPUTS)?.map(|bits| Switches { bits, place_m }))
}

impl Watch {
    /// Begins the watch; refuses a drive with power.
    pub(crate) fn begin(
        line: &mut Line,
        axis: usize,
        scales: [AxisScale; AXES],
        caution: Caution,
        window_m: f64,
    ) -> Result<Self, MotionError> {
        let mut began_m = [0.0; AXES];
        for (axis, began_m) in began_m.iter_mut().enumerate() {
            let state = read_state(line, axis)?;
            if state.is_powered() {
                return Err(AxisError::Powered(state).of(axis));
            }
            *began_m = read_position(line, axis, &scales[axis])?;
        }
        let switches = read_switches(line, axis, began_m[axis])?;
        let emergencies = std::array::from_fn(|axis| line.heard(axis).emergencies.len());
        let boot_ups = BootUps::until_now(line);
        Ok(Self { axis, scales, caution, window_m, began_m, emergencies, boot_ups, switches, next: 0 })
    }

    /// Refuses to go on after a restart of a drive, which loses its reduced limits, and beside another master.
    ///
    /// # Errors
    /// [`AxisError::Stopped`].
    pub(crate) fn check_undisturbed(&self, line: &Line) -> Result<(), MotionError> {
        let stopped = |cause| AxisError::Stopped(cause).of(self.axis);
        let mut all = 0..AXES;
        all.try_for_each(|axis| self.boot_ups.check_axis(line, axis)).map_err(|one| stopped(one.into()))?;
        line.strangers().refuse_masters().map_err(|master| stopped(master.into()))
    }

    /// Ignores the limit switches: homing searches for them.
    pub(crate) fn ignore_switches(&mut self) {
        self.switches = None;
    }

    /// Watches the limit switches again. Switches closed now end no motion, but allow none in their direction.
    pub(crate) fn heed_switches(&mut self, line: &mut Line) -> Result<(), LineError> {
        let place_m = read_position(line, self.axis, &self.scales[self.axis])?;
        self.switches = read_switches(line, self.axis, place_m)?;
        Ok(())
    }

    /// Refuses a target beyond the place at the last reading of the switches, in the direction of a switch that was
    /// closed there. The axis is at its end, or the switch or its wire is broken. Positions within the noise are one
    /// place.
    ///
    /// # Errors
    /// [`AxisError::OnSwitch`].
    pub(crate) fn check_way(&self, target_m: f64, noise_m: f64) -> Result<(), MotionError> {
        let (axis, Some(Switches { bits, place_m })) = (self.axis, self.switches) else { return Ok(()) };
        // The drive counts the other way on a reversed axis.
        let beyond_m = (target_m - place_m) * self.scales[axis].increment_m.signum();
        let blocks = |switch, beyond_m| bits & switch != 0 && beyond_m > noise_m;
        if blocks(POSITIVE_SWITCH, beyond_m) || blocks(NEGATIVE_SWITCH, -beyond_m) {
            return Err(AxisError::OnSwitch { bits }.of(axis));
        }
        Ok(())
    }

    /// Looks once. The position is read before the statusword: a statusword without "homed" proves an old position.
    ///
    /// # Errors
    /// [`AxisError::Stopped`] for what must stop the motion.
    pub(crate) fn look(&mut self, line: &mut Line) -> Result<Sample, MotionError> {
        let (axis, scale) = (self.axis, self.scales[self.axis]);
        let at_ns = line.now_ns();
        let position_m = read_position(line, axis, &scale)?;
        let status = read_status(line, axis)?;
        let permille = line.read_number(axis, ObjectAddress::new(0x6077, 0))? as i16;
        let sample = Sample { at_ns, position_m, force_n: f64::from(permille) * scale.permille_n, status };
        self.check_undisturbed(line)?;
        let cause = match self.stop_cause(line, &sample)? {
            Some(cause) => Some(cause),
            None => self.look_at_switches(line)?.or(self.look_at_another(line)?),
        };
        cause.map_or(Ok(sample), |cause| Err(AxisError::Stopped(cause).of(axis)))
    }

    fn stop_cause(&self, line: &mut Line, sample: &Sample) -> Result<Option<StopCause>, MotionError> {
        let (axis, window_m, limit_n) = (self.axis, self.window_m, USABLE * self.caution.force_n);
        let Sample { status, force_n, .. } = *sample;
        // In homing the same bit is a homing error, which the caller judges.
        let state = status.state().map_err(|error| AxisError::Statusword(error).of(axis))?;
        let fails = state != DriveState::OperationEnabled;
        if fails && status.has(StatusBit::FollowingError) {
            return Ok(Some(StopCause::FollowingError { window_m }));
        }
        for (sender, &before) in self.emergencies.iter().enumerate() {
            let new = line.heard(sender).emergencies[before..].iter().find(|emergency| !emergency.is_reset());
            if let Some(emergency) = new {
                let is_following = sender == axis && emergency.code == EmergencyCode::FOLLOWING_ERROR;
                let emergency = StopCause::Emergency { sender, code: emergency.code };
                let following = StopCause::FollowingError { window_m };
                return Ok(Some(if is_following { following } else { emergency }));
            }
        }
        if fails {
            return Ok(Some(StopCause::LeftOperation { state, error_code: read_error_code(line, axis) }));
        }
        Ok((force_n.abs() > limit_n).then_some(StopCause::Force { force_n, limit_n }))
    }

    /// A switch that was closed at the beginning stops no motion, because the axis may leave it.
    fn look_at_switches(&self, line: &mut Line) -> Result<Option<StopCause>, MotionError> {
        let Some(before) = self.switches else { return Ok(None) };
        let bits = line.read_number(self.axis, INPUTS)?;
        let closed = bits & !before.bits & (NEGATIVE_SWITCH | POSITIVE_SWITCH);
        Ok((closed != 0).then_some(StopCause::LimitSwitch { bits }))
    }

    pub(crate) fn look_at_another(&mut self, line: &mut Line) -> Result<Option<StopCause>, MotionError> {
        let other = self.next;
        self.next = (other + 1) % AXES;
        if other == self.axis {
            return Ok(None);
        }
        let state = read_state(line, other)?;
        // A drive in fault reacts without power too, and its emergency has more information.
        if state.is_powered() && state != DriveState::FaultReactionActive {
            return Ok(Some(StopCause::OtherPowered { other, state }));
        }
        let moved_m = read_position(line, other, &self.scales[other])? - self.began_m[other];
        Ok((moved_m.abs() > self.caution.still_m).then_some(StopCause::OtherAxis { other, moved_m }))
    }
}

/// Longest time of a drive from one state to the next, ns.
pub(crate) const TRANSITION_NS: u64 = SECOND_NS;
/// Time of the watch over an axis after the loss of its power, and of its last part, in which a brake holds the axis, ns.
const SETTLING_NS: u64 = SECOND_NS;
const HELD_NS: u64 = SECOND_NS / 2;
/// Largest way within that last part, m and increments: more is no noise of an encoder.
const MOST_CREEP_M: f64 = 1e-5;
const MOST_CREEP_INCREMENTS: f64 = 3.0;
/// Largest way of an axis while its brake closes, m: some turns of play, not a fall.
const MOST_DROP_M: f64 = 5e-4;
/// Longest time of the attempts at a stop, and the time between two commands, ns.
const STOP_NS: u64 = SECOND_NS;
const REPEAT_NS: u64 = 200 * MILLISECOND_NS;

/// Switches a drive on, up to "operation enabled". The brake opens then: the axis may not move before it is open. A
/// restarted drive has lost its reduced limits, and gets no power. A drive that restarts later is no longer ready to
/// switch on, and takes no further word.
pub(crate) fn switch_on_drive(line: &mut Line, axis: usize, watch: &Watch) -> Result<(), MotionError> {
    for (word, wanted) in [
        (Controlword::SHUTDOWN, DriveState::ReadyToSwitchOn),
        (Controlword::SWITCH_ON, DriveState::SwitchedOn),
        (Controlword::ENABLE_OPERATION, DriveState::OperationEnabled),
    ] {
        line.control(axis, word)?;
        let state = wait_for_state(line, axis, TRANSITION_NS, |state| state == wanted)?;
        if state != wanted {
            let error_code = read_error_code(line, axis);
            return Err(AxisError::NotEnabled { state, error_code }.of(axis));
        }
        watch.check_undisturbed(line)?;
    }
    Ok(())
}

/// Switches off an axis that stands: "disable operation" closes the brake, and the voltage goes once the brake holds. Returns
/// how far the axis moved until a second later, m.
///
/// # Errors
/// [`AxisError::Dropped`] and [`AxisError::Creeps`] for an axis that nothing holds without power.
pub(crate) fn switch_off_drive(
    line: &mut Line,
    axis: usize,
    scale: &AxisScale,
    brake: &BrakeConfig,
) -> Result<f64, MotionError> {
    let before_m = read_position(line, axis, scale)?;
    line.control(axis, Controlword::SWITCH_ON)?;
    line.listen(seconds(brake.close_s))?;
    disable_voltage(line, axis)?;
    watch_unpowered(line, axis, scale, before_m)
}

/// Watches an axis for a second after the loss of its power. Returns its way from a position, m.
///
/// # Errors
/// [`AxisError::Dropped`] and [`AxisError::Creeps`] for an axis that nothing holds.
pub(crate) fn watch_unpowered(
    line: &mut Line,
    axis: usize,
    scale: &AxisScale,
    before_m: f64,
) -> Result<f64, MotionError> {
    line.listen(SETTLING_NS - HELD_NS)?;
    let held_m = read_position(line, axis, scale)?;
    line.listen(HELD_NS)?;
    let now_m = read_position(line, axis, scale)?;
    let (moved_m, crept_m) = (now_m - before_m, now_m - held_m);
    let most_m = MOST_CREEP_M.max(MOST_CREEP_INCREMENTS * scale.increment_m.abs());
    if moved_m.abs() > MOST_DROP_M {
        return Err(AxisError::Dropped { moved_m }.of(axis));
    }
    if crept_m.abs() > most_m {
        let speed_m_s = crept_m * SECOND_NS as f64 / HELD_NS as f64;
        return Err(AxisError::Creeps { speed_m_s }.of(axis));
    }
    Ok(moved_m)
}

/// Stops an axis in every state: quick stop, then voltage off. Neither word can enable a drive in any state. Lost
/// commands are repeated.
///
/// # Errors
/// [`AxisError::StaysOn`] unless the statusword proves that the drive is off.
pub(crate) fn stop_drive(line: &mut Line, axis: usize, brake: &BrakeConfig) -> Result<(), MotionError> {
    // The drive may stay in the quick stop (605Ah = 5 or 6): the voltage goes after the same time.
    let _ = repeat(line, axis, Controlword::QUICK_STOP);
    disable_voltage(line, axis)?;
    Ok(line.listen(seconds(brake.close_s))?)
}

pub(crate) fn disable_voltage(line: &mut Line, axis: usize) -> Result<(), MotionError> {
    repeat(line, axis, Controlword::DISABLE_VOLTAGE).map_err(|reason| AxisError::StaysOn(reason).of(axis))?;
    line.note_off(axis);
    Ok(())
}

/// Repeats a controlword until the drive shows no voltage, for a limited time. Returns the reason for a missing proof.
fn repeat(line: &mut Line, axis: usize, word: Controlword) -> Result<(), Unproved> {
    let until_ns = line.now_ns() + STOP_NS;
    loop {
        let sent = line.control(axis, word);
        let reason = match wait_for_state(line, axis, REPEAT_NS, |state| !state.is_powered()) {
            Ok(state) if !state.is_powered() => return Ok(()),
            Ok(state) => Unproved::Shows(state),
            Err(error) => Unproved::Unread(Box::new(error)),
        };
        if line.now_ns() >= until_ns {
            return Err(sent.err().map_or(reason, |error| Unproved::Unread(Box::new(error.into()))));
        }
        // Time passes also without a transmission.
        let _ = line.listen(MILLISECOND_NS);
    }
}

/// Waits until a drive shows a mode of operation (6061h).
pub(crate) fn wait_for_mode(line: &mut Line, axis: usize, wanted: i8) -> Result<(), MotionError> {
    let mode = |line: &mut Line| {
        let mode = line.read_number(axis, ObjectAddress::new(0x6061, 0))?;
        Ok::<_, LineError>(mode as i8)
    };
    let found = line.look_until(TRANSITION_NS, MILLISECOND_NS, mode, |found| found == wanted)?;
    if found == wanted { Ok(()) } else { Err(AxisError::Mode { wanted, found }.of(axis)) }
}

/// The state of a drive when the condition holds, or at the end of the time.
pub(crate) fn wait_for_state(
    line: &mut Line,
    axis: usize,
    within_ns: u64,
    holds: impl Fn(DriveState) -> bool,
) -> Result<DriveState, MotionError> {
    line.look_until(within_ns, MILLISECOND_NS, |line| read_state(line, axis), holds)
}

/// Seconds in ns.
pub(crate) fn seconds(time_s: f64) -> u64 {
    (time_s * SECOND_NS as f64) as u64
}
