//! One axis with power, under watch: prepared, switched on, moved to a position, and stopped in every case.

use masseter_can::canopen::{NmtCommand, ObjectAddress};
use masseter_can::cia402::{ControlBit, Controlword, StatusBit};
use masseter_model::geometry::AXES;
use masseter_plant::wanted::OFFSETS;
use masseter_runtime::clock::SECOND_NS;
use masseter_scenario::{AxisScale, DriveProfile, MASTER_NODE, ObjectKey, ObjectRule, Scenario};

use crate::loan::{Borrowed, Loan};
use crate::motion_error::{AxisError, MotionError, StopCause};
use crate::watch::{
    Caution, Sample, Watch, read_position, seconds, stop_drive, switch_off_drive, switch_on_drive,
    wait_for_mode,
};
use crate::{line::Line, line_error::LineError};

/// Profile position and homing (6060h).
pub(crate) const POSITIONING: i8 = 1;
pub(crate) const HOMING: i8 = 6;
/// Time at rest with power on, and the time limit for it, ns.
const STILL_NS: u64 = SECOND_NS;
const RESTLESS_NS: u64 = 5 * SECOND_NS;
/// Largest apparent way against the target that is no motion: the larger of these multiples of the noise and of an
/// increment.
const NOISES: f64 = 3.0;
const INCREMENTS: f64 = 3.0;

/// One axis to be moved.
pub(crate) struct Mover<'a> {
    pub(crate) line: &'a mut Line,
    scenario: &'a Scenario,
    pub(crate) axis: usize,
    pub(crate) operator: &'a mut Operator<'a>,
    pub(crate) caution: Caution,
    pub(crate) borrowed: Borrowed<'a>,
    pub(crate) watch: Watch,
    /// Half of the range of 6064h while the axis stood, m.
    pub(crate) noise_m: f64,
}

impl<'a> Mover<'a> {
    /// Prepares a drive without power: pre-operational, the watched heartbeat, reduced limits.
    pub(crate) fn prepare(
        line: &'a mut Line,
        scenario: &'a Scenario,
        axis: usize,
        caution: Caution,
        operator: &'a mut Operator<'a>,
    ) -> Result<Self, MotionError> {
        line.command(axis, NmtCommand::EnterPreOperational)?;
        let following_m = scenario.drives.of_axis(axis).following_error_m;
        let window_m = following_m.min(2.0 * caution.still_m + caution.speed_m_s * 0.05);
        let scales = std::array::from_fn::<_, AXES, _>(|axis| scenario.scale(axis));
        let watch = Watch::begin(line, axis, scales, caution, window_m)?;
        let mut mover = Self {
            line,
            scenario,
            axis,
            operator,
            caution,
            borrowed: Borrowed::of_axis(axis, scenario.profile(axis)),
            watch,
            noise_m: 0.0,
        };
        match mover.configure() {
            Ok(()) => Ok(mover),
            Err(error) => mover.give_back(Err(error)),
        }
    }

    fn configure(&mut self) -> Result<(), MotionError> {
        let (can, scale) = (&self.scenario.can, self.scale());
        let Caution { speed_m_s, acceleration_m_s2, force_n, .. } = self.caution;
        // The drive stops when this program dies: a lost heartbeat is a quick stop.
        self.line.traffic.beat_every(can.heartbeat_producer_ms);
        let consumed = u32::from(MASTER_NODE.get()) << 16 | u32::from(can.heartbeat_consumer_ms);
        let acceleration = scale.acceleration(acceleration_m_s2);
        let permille = (force_n / scale.permille_n.abs()).round() as u32;
        // A following error is a fault at once, and a fault closes the brake at once. With a wrong feedback, a ramp
        // only drives the axis further. Not every drive takes these values.
        let at_once = [0x6066, 0x605E].map(|index| Loan { may_lack: true, ..Loan::new(index, 0, 0, 2) });
        let window = scale.window(self.watch.window_m);
        let reduced = [
            Loan::new(0x1016, 1, consumed, 4),
            Loan::new(0x6007, 0, 3, 2),
            Loan::new(0x605A, 0, 2, 2),
            Loan::new(0x6065, 0, window, 4),
            Loan::new(0x6072, 0, permille, 2),
            Loan::new(0x6081, 0, scale.velocity(speed_m_s), 4),
            Loan::new(0x6083, 0, acceleration, 4),
            Loan::new(0x6084, 0, acceleration, 4),
        ];
        self.borrow(&[&reduced[..], &at_once].concat())?;
        // A profile may forbid the write of an object. Then the drive itself must be as careful.
        self.require(0x1016, 1, |found| found == consumed)?;
        self.require(0x6072, 0, |found| found <= permille)?;
        self.require(0x6081, 0, |found| found <= scale.velocity(speed_m_s))?;
        self.clear_offsets()?;
        Ok(())
    }

    /// Sets the offsets of the cyclic modes (60B0h to 60B2h) to 0. A drive may keep the last offset of its process
    /// data, and some drives add the offset in every mode.
    fn clear_offsets(&mut self) -> Result<(), LineError> {
        for (index, bytes) in OFFSETS {
            let object = ObjectAddress::new(index, 0);
            if self.profile().object(ObjectKey(object)).rule == ObjectRule::Absent {
                continue;
            }
            if self.line.read_if_there(self.axis, object)?.is_some_and(|offset| offset != 0) {
                self.line.write(self.axis, object, 0, bytes)?;
            }
        }
        Ok(())
    }

    /// Reads an object that must be good before the drive gets power.
    fn require(
        &mut self,
        index: u16,
        subindex: u8,
        is_good: impl Fn(u32) -> bool,
    ) -> Result<(), MotionError> {
        let (axis, object) = (self.axis, ObjectAddress::new(index, subindex));
        let found = self.line.read_number(axis, object)?;
        if is_good(found) { Ok(()) } else { Err(AxisError::Careless { object, found }.of(axis)) }
    }

    /// Changes objects until the end.
    pub(crate) fn borrow(&mut self, loans: &[Loan]) -> Result<(), LineError> {
        self.borrowed.set_all(self.line, loans)
    }

    /// Refuses a target in the direction of a limit switch that is closed.
    pub(crate) fn check_way(&self, target: i32) -> Result<(), MotionError> {
        self.watch.check_way(self.scale().metres(target), self.backwards_m())
    }

    /// Largest apparent way backwards of an axis, m.
    fn backwards_m(&self) -> f64 {
        (NOISES * self.noise_m).max(INCREMENTS * self.scale().increment_m.abs())
    }

    /// Scales of the axis.
    pub(crate) fn scale(&self) -> AxisScale {
        self.scenario.scale(self.axis)
    }

    /// The profile of the drive.
    pub(crate) fn profile(&self) -> &'a DriveProfile {
        self.scenario.profile(self.axis)
    }

    /// Position of the axis, m.
    pub(crate) fn position_m(&mut self) -> Result<f64, LineError> {
        read_position(self.line, self.axis, &self.scale())
    }

    /// One look at the axis.
    pub(crate) fn look(&mut self) -> Result<Sample, MotionError> {
        self.watch.look(self.line)
    }

    /// Sends a controlword.
    pub(crate) fn control(&mut self, word: Controlword) -> Result<(), LineError> {
        self.line.control(self.axis, word)
    }

    /// Ends the motion for that reason.
    pub(crate) fn stopped<T>(&self, cause: StopCause) -> Result<T, MotionError> {
        Err(AxisError::Stopped(cause).of(self.axis))
    }

    /// Switches on in a mode, with the place of the axis as its target, and waits until brake and axis are ready.
    pub(crate) fn switch_on(&mut self, mode: i8) -> Result<(), MotionError> {
        self.borrow(&[Loan::new(0x6060, 0, mode as u32, 1)])?;
        wait_for_mode(self.line, self.axis, mode)?;
        let here = self.line.read_number(self.axis, ObjectAddress::new(0x6064, 0))?;
        self.line.write(self.axis, ObjectAddress::new(0x607A, 0), here, 4)?;
        switch_on_drive(self.line, self.axis, &self.watch)?;
        let opened_ns = self.line.now_ns() + seconds(self.profile().brake.open_s);
        while self.line.now_ns() < opened_ns {
            self.look()?;
        }
        self.wait_until_still()
    }

    /// Waits until the axis has stood for a second.
    fn wait_until_still(&mut self) -> Result<(), MotionError> {
        let restless_ns = self.line.now_ns() + RESTLESS_NS;
        let mut since_ns = self.line.now_ns();
        let mut range_m = [f64::INFINITY, f64::NEG_INFINITY];
        loop {
            let Sample { at_ns, position_m, .. } = self.look()?;
            if (self.operator)(at_ns) == Wish::Stop {
                return self.stopped(StopCause::Requested);
            }
            range_m = [range_m[0].min(position_m), range_m[1].max(position_m)];
            let moved_m = range_m[1] - range_m[0];
            if moved_m > self.caution.still_m {
                if at_ns >= restless_ns {
                    return self.stopped(StopCause::Restless { moved_m });
                }
                (since_ns, range_m) = (at_ns, [position_m; 2]);
            } else if at_ns - since_ns >= STILL_NS {
                self.noise_m = moved_m / 2.0;
                return Ok(());
            }
        }
    }

    /// Moves to a position in profile position; returns all looks from the set-point on.
    pub(crate) fn move_to(&mut self, target: i32) -> Result<Vec<Sample>, MotionError> {
        self.check_way(target)?;
        let scale = self.scale();
        let Caution { speed_m_s, acceleration_m_s2, still_m, .. } = self.caution;
        let way = Way {
            start_m: self.position_m()?,
            target_m: scale.metres(target),
            backwards_m: self.backwards_m(),
            beyond_m: 2.0 * still_m + self.watch.window_m,
        };
        let limit_s = 1.5 * (way.length_m() / speed_m_s + speed_m_s / acceleration_m_s2) + 1.0;
        let word = Controlword::ENABLE_OPERATION;
        self.line.write(self.axis, ObjectAddress::new(0x607A, 0), target as u32, 4)?;
        self.line.control(self.axis, word)?;
        self.wait_for_leave()?;
        self.line.control(self.axis, word.with(ControlBit::Start).with(ControlBit::ChangeImmediately))?;
        let mut until_ns = self.line.now_ns() + seconds(limit_s);
        let (mut seen, mut is_taken, mut halted_ns) = (vec![], false, None);
        loop {
            let sample = self.look()?;
            seen.push(sample);
            if let Some(cause) = way.left_at(sample.position_m) {
                return self.stopped(cause);
            }
            match ((self.operator)(sample.at_ns), halted_ns) {
                (Wish::Stop, _) => return self.stopped(StopCause::Requested),
                (Wish::Halt, None) => {
                    self.line.control(self.axis, word.with(ControlBit::Halt))?;
                    halted_ns = Some(sample.at_ns);
                }
                (Wish::Move, Some(since_ns)) => {
                    self.line.control(self.axis, word)?;
                    until_ns += sample.at_ns - since_ns;
                    halted_ns = None;
                }
                _ => {}
            }
            if !is_taken && sample.status.has(StatusBit::SETPOINT_ACKNOWLEDGED) {
                is_taken = true;
                self.line.control(
                    self.axis,
                    if halted_ns.is_some() { word.with(ControlBit::Halt) } else { word },
                )?;
            }
            let is_there = (sample.position_m - way.target_m).abs() <= still_m;
            if is_taken && is_there && sample.status.has(StatusBit::TargetReached) {
                return Ok(seen);
            }
            if halted_ns.is_none() && sample.at_ns >= until_ns {
                let is_limited = sample.status.has(StatusBit::InternalLimit);
                return self.stopped(if is_limited {
                    StopCause::Limited { limit_s }
                } else {
                    StopCause::TimedOut { limit_s }
                });
            }
        }
    }

    /// Waits until the operator lets the axis move: a motion begins on a wish to move alone.
    fn wait_for_leave(&mut self) -> Result<(), MotionError> {
        loop {
            match (self.operator)(self.line.now_ns()) {
                Wish::Move => return Ok(()),
                Wish::Stop => return self.stopped(StopCause::Requested),
                Wish::Halt => drop(self.look()?),
            }
        }
    }

    /// Looks at an axis at rest for that time.
    pub(crate) fn dwell(&mut self, for_ns: u64) -> Result<Vec<Sample>, MotionError> {
        let until_ns = self.line.now_ns() + for_ns;
        let mut seen = Vec::new();
        while self.line.now_ns() < until_ns {
            let sample = self.look()?;
            seen.push(sample);
            if (self.operator)(sample.at_ns) == Wish::Stop {
                return self.stopped(StopCause::Requested);
            }
        }
        Ok(seen)
    }

    /// Switches off an axis at rest; returns its way meanwhile, m.
    pub(crate) fn switch_off(&mut self) -> Result<f64, MotionError> {
        switch_off_drive(self.line, self.axis, &self.scale(), &self.profile().brake)
    }

    /// Ends the motion: stops and switches off after a failure, and writes the old values back. A drive without a proof
    /// of power off keeps its reduced limits.
    ///
    /// # Errors
    /// That of the motion, unless the proof of power off fails, or an old value has not returned.
    pub(crate) fn end_motion<T>(mut self, done: Result<T, MotionError>) -> Result<T, MotionError> {
        let axis = self.axis;
        if done.is_err() {
            stop_drive(self.line, axis, &self.profile().brake)?;
        }
        let done = done.map_err(|error| match error {
            MotionError::Line(LineError::NotKept { .. }) => error,
            MotionError::Line(_) | MotionError::OfAxis { reason: AxisError::Statusword(_), .. } => {
                MotionError::Unread { axis, source: Box::new(error) }
            }
            error => error,
        });
        self.give_back(done)
    }

    /// Writes the old values back, and judges the motion. A restart or another master is the cause of all other signs,
    /// such as a jump of the position.
    fn give_back<T>(&mut self, done: Result<T, MotionError>) -> Result<T, MotionError> {
        let restored = self.borrowed.restore(self.line);
        let done = self.watch.check_undisturbed(self.line).and(done);
        let Err(why) = restored else { return done };
        let cause = done.err().map(Box::new);
        Err(AxisError::NotRestored { cause, why }.of(self.axis))
    }
}

/// The way of a motion from rest to rest, with its tolerances.
#[expect(clippy::struct_field_names, reason = "the unit ends every name")]
struct Way {
    start_m: f64,
    target_m: f64,
    /// Largest apparent way backwards.
    backwards_m: f64,
    /// Largest way beyond the target.
    beyond_m: f64,
}

impl Way {
    fn length_m(&self) -> f64 {
        (self.target_m - self.start_m).abs()
    }

    /// The reason for a stop of an axis at this position, if any.
    fn left_at(&self, position_m: f64) -> Option<StopCause> {
        let direction = (self.target_m - self.start_m).signum();
        let moved_m = (self.start_m - position_m) * direction;
        if moved_m > self.backwards_m {
            return Some(StopCause::WrongDirection { moved_m });
        }
        let beyond_m = (position_m - self.target_m) * direction;
        (beyond_m > self.beyond_m).then_some(StopCause::Overrun { beyond_m })
    }
}

/// The order of the person at the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wish {
    /// To go on.
    Move,
    /// To halt for the moment.
    Halt,
    /// To end.
    Stop,
}

/// Asked at every look, with the line's time, ns.
pub type Operator<'a> = dyn FnMut(u64) -> Wish + 'a;
