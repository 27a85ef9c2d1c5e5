//! The boot of one drive: from its first message to the permission to start.
//!
//! A pure state machine that executes its [plan](super::boot_plan) over its [SDO client](super::sdo). The machine
//! judges one drive alone. The master decides on the start of the drives, and on the consequence of a failure.

use masseter_can::canopen::{AbortCode, CobId, Expedited, NmtCommand, NmtState, ObjectAddress, SdoResponse};
use masseter_can::cia402::{DriveState, Statusword};
use masseter_runtime::clock::MILLISECOND_NS;
use masseter_runtime::messages::codes::{BootPhase, Cause};
use masseter_scenario::AccelerationUnit;

use super::boot_plan::{Check, Demand, Step, Write, plan};
use super::events::Failure;
use super::sdo::{ATTEMPTS, SdoClient, SdoFailure, SdoReason, number};
use super::wanted::{WantedDrive, is_write_only};

/// Silence of a server before a transfer begins anew, ns. Drives that store parameters or boot take seconds, and no
/// motion waits for them.
const TIMEOUT_NS: u64 = 1_000_000_000;
/// Silence before a reset of a drive's communication, ns: the drive may be alive without a heartbeat.
const RESET_EVERY_NS: u64 = 500_000_000;
/// Longest time of a drive to become operational, ns.
const START_WITHIN_NS: u64 = 1_000_000_000;
/// Most readings of a value that a drive shows late.
const READINGS: u32 = 100;
/// Most answers without a request in one boot that repeated frames can explain. More of them mean a second drive with
/// this id.
const UNASKED: u32 = 7;
/// Most boot-up messages during a boot before the master gives up the drive.
const RESTARTS: u32 = 3;

/// A drive beyond its time.
pub(super) fn late(waited_ns: u64, limit_ns: u64) -> Failure {
    Failure::with(Cause::BootTimeout, waited_ns as f64 / 1e6, limit_ns as f64 / 1e6)
}

/// A failure at an object.
fn at(cause: Cause, object: ObjectAddress, value: u32, limit: u32) -> Failure {
    Failure { object: Some(object), ..Failure::with(cause, value, limit) }
}

impl From<SdoFailure> for Failure {
    fn from(SdoFailure { object, reason }: SdoFailure) -> Self {
        match reason {
            SdoReason::Aborted(code) => at(Cause::SdoAborted, object, code.0, 0),
            SdoReason::Silent => {
                let timeout_ms = (TIMEOUT_NS / MILLISECOND_NS) as u32;
                at(Cause::SdoTimeout, object, timeout_ms * ATTEMPTS, timeout_ms)
            }
        }
    }
}

/// Progress of a boot.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Boot {
    /// The progress of the boot.
    pub(super) phase: BootPhase,
    steps: Vec<Step>,
    next: usize,
    readings: u32,
    /// The value to be written back.
    kept: Expedited,
    /// The outcome of this step's write, during the read back.
    written: Option<Result<(), SdoFailure>>,
    /// The statusword of a drive found in fault.
    fault_statusword: u32,
    /// A fault was reset, which is to be reported.
    pub(super) reset_fault: Option<Failure>,
    pub(super) client: SdoClient,
    restarts: u32,
    has_repeated: bool,
    unasked: u32,
    reset_at_ns: u64,
    since_ns: u64,
}

impl Boot {
    /// The boot of a drive of which nothing is known at `now_ns`.
    pub(super) fn new(wanted: &WantedDrive, resets_faults: bool, now_ns: u64) -> Self {
        Self {
            phase: BootPhase::Waiting,
            steps: plan(wanted, resets_faults),
            next: 0,
            readings: 0,
            kept: Expedited::of_unknown_size([0; Expedited::MAX]),
            written: None,
            fault_statusword: 0,
            reset_fault: None,
            client: SdoClient::default(),
            restarts: 0,
            has_repeated: false,
            unasked: 0,
            reset_at_ns: now_ns + RESET_EVERY_NS,
            since_ns: now_ns,
        }
    }

    /// Whether SDO transfers take place.
    fn is_under_way(&self) -> bool {
        use BootPhase::{CheckingPdos, Configuring, Identifying};
        matches!(self.phase, Identifying | CheckingPdos | Configuring)
    }

    /// Whether identity and configuration are verified.
    pub(super) fn is_verified(&self) -> bool {
        matches!(self.phase, BootPhase::Configured | BootPhase::Starting | BootPhase::Ready)
    }

    /// Begins anew, and forgets all knowledge of the drive.
    pub(super) fn forget(&mut self, now_ns: u64) {
        self.start_over();
        (self.phase, self.restarts) = (BootPhase::Waiting, 0);
        (self.reset_at_ns, self.since_ns) = (now_ns.saturating_add(RESET_EVERY_NS), now_ns);
    }

    /// The plan begins anew, and no transfer is under way.
    fn start_over(&mut self) {
        (self.next, self.readings, self.client) = (0, 0, SdoClient::default());
        (self.has_repeated, self.unasked, self.written) = (false, 0, None);
    }

    /// Takes a heartbeat or a boot-up message.
    pub(super) fn hear(&mut self, now_ns: u64, state: NmtState) -> Result<(), Failure> {
        if state != NmtState::BootUp {
            if self.phase == BootPhase::Waiting {
                // A drive that was alive before this master may have any configuration, so the master resets the drive
                // at once.
                self.reset_at_ns = self.reset_at_ns.min(now_ns);
            }
            return Ok(());
        }
        if self.is_under_way() {
            self.restarts += 1;
            if self.restarts > RESTARTS {
                return Err(Failure::new(Cause::NodeRestarted));
            }
        }
        self.start_over();
        self.begin_next(now_ns);
        Ok(())
    }

    /// The command of network management that is due, if any.
    pub(super) fn command(&mut self, now_ns: u64) -> Option<NmtCommand> {
        let is_due = self.phase == BootPhase::Waiting && now_ns >= self.reset_at_ns;
        is_due.then(|| {
            self.reset_at_ns = now_ns + RESET_EVERY_NS;
            NmtCommand::ResetCommunication
        })
    }

    /// The drive is commanded to become operational.
    pub(super) fn start(&mut self, now_ns: u64) {
        (self.phase, self.since_ns) = (BootPhase::Starting, now_ns);
    }

    /// The time spent waiting for the drive, ns.
    pub(super) fn waited_ns(&self, now_ns: u64) -> u64 {
        now_ns.saturating_sub(self.since_ns)
    }

    /// Takes an answer of the drive's SDO server.
    pub(super) fn take_answer(&mut self, now_ns: u64, response: SdoResponse) -> Result<(), Failure> {
        if !self.is_under_way() && self.phase != BootPhase::Configured {
            return Ok(());
        }
        self.has_repeated |= self.client.is_repeating();
        if let Some(outcome) = self.client.take_answer(response, None) {
            self.end_transfer(outcome.map(|value| value.expect("no value of a boot is long")))?;
            self.begin_next(now_ns);
            return Ok(());
        }
        self.unasked += u32::from(!self.has_repeated);
        if self.unasked > UNASKED { Err(Failure::new(Cause::DuplicateNode)) } else { Ok(()) }
    }

    /// Checks the time-outs.
    pub(super) fn expire(&mut self, now_ns: u64) -> Result<(), Failure> {
        if self.is_under_way() {
            self.client.expire(now_ns, TIMEOUT_NS)?;
            return Ok(());
        }
        let is_late = self.phase == BootPhase::Starting && self.waited_ns(now_ns) > START_WITHIN_NS;
        if is_late {
            return Err(late(self.waited_ns(now_ns), START_WITHIN_NS));
        }
        Ok(())
    }

    /// Begins the next step that takes a transfer, and those before it.
    fn begin_next(&mut self, now_ns: u64) {
        while self.client.is_idle() && self.next < self.steps.len() {
            self.begin(self.steps[self.next]);
        }
        if self.phase == BootPhase::Configured {
            self.since_ns = now_ns;
        }
    }

    /// The number of steps to skip after the refusal of the present step, for an optional value or an optional object.
    /// None for a refusal that is a failure.
    fn skipped_if_refused(&self, failure: SdoFailure) -> Option<usize> {
        let SdoReason::Aborted(code) = failure.reason else { return None };
        let is_missing = matches!(code, AbortCode::NO_OBJECT | AbortCode::NO_SUBINDEX);
        match self.steps[self.next] {
            Step::Write(Write { demand: Demand::KeptIfTaken | Demand::Nothing, .. }) => Some(0),
            Step::Write(Write { demand: Demand::KeptIfPresent, .. })
            | Step::Read(_, Check::EqualsIfPresent { value: 0, .. } | Check::Unit(_))
                if is_missing =>
            {
                Some(0)
            }
            Step::Read(_, Check::PdoElseSkip(skipped)) if is_missing => Some(skipped),
            _ => None,
        }
    }

    /// Whether a drive that refuses this step may have the value already.
    fn may_be_constant(&self, failure: SdoFailure) -> bool {
        let SdoReason::Aborted(code) = failure.reason else { return false };
        match self.steps[self.next] {
            Step::Write(Write { demand: Demand::KeptIfPresent, .. }) => true,
            Step::Write(_) => code == AbortCode::READ_ONLY,
            _ => false,
        }
    }

    /// The present write, if any.
    fn write(&self) -> Option<Write> {
        match self.steps[self.next] {
            Step::Write(write) => Some(write),
            Step::WriteKept(object) => {
                let (value, bytes) = (number(self.kept.data()), self.kept.data().len());
                Some(Write { object, value, bytes, demand: Demand::Kept })
            }
            _ => None,
        }
    }

    /// Ends the step of a write: the object must show the value, whether new or unchanged. A drive may show a new value
    /// late.
    fn judge_shown(
        &mut self,
        written: Result<(), SdoFailure>,
        read: Result<Expedited, SdoFailure>,
    ) -> Result<(), Failure> {
        let Write { object, value, .. } = self.write().expect("only a write is read back");
        let bits = self.bits_to_show().unwrap_or(u32::MAX);
        match (written, read.map(|read| number(read.data()) & bits)) {
            (_, Ok(found)) if found == value & bits => self.end_step(0),
            (Err(refused), _) => return Err(refused.into()),
            (Ok(()), Ok(found)) => {
                self.read_again(at(Cause::NotKept, object, found, value & bits))?;
                self.written = Some(Ok(()));
            }
            (Ok(()), Err(SdoFailure { reason: SdoReason::Aborted(code), .. })) if is_write_only(code) => {
                self.end_step(0);
            }
            (Ok(()), Err(failure)) => return Err(failure.into()),
        }
        Ok(())
    }

    /// The bits that prove the present write; none for no write, or for a proof in a later step.
    fn bits_to_show(&self) -> Option<u32> {
        self.write()?.shown_bits()
    }

    /// Ends the step under way, and skips the next ones.
    fn end_step(&mut self, skipped: usize) {
        (self.next, self.readings) = (self.next + 1 + skipped, 0);
    }

    fn begin(&mut self, step: Step) {
        match step {
            Step::Enter(phase) => {
                self.phase = phase;
                self.end_step(0);
            }
            Step::Read(object, _) => self.client.begin(object, None),
            Step::Write(_) | Step::WriteKept(_) => {
                let Write { object, value, bytes, .. } = self.write().expect("a write is under way");
                let value = Expedited::new(&value.to_le_bytes()[..bytes]).expect("one to four bytes");
                self.client.begin(object, self.written.is_none().then_some(value));
            }
        }
    }

    /// Ends the present step with the outcome of its transfer, unless a value needs another reading.
    fn end_transfer(&mut self, outcome: Result<Expedited, SdoFailure>) -> Result<(), Failure> {
        if let Some(written) = self.written.take() {
            return self.judge_shown(written, outcome);
        }
        let skipped = match (outcome, self.steps[self.next]) {
            (Ok(value), Step::Read(object, check)) => self.judge_value(object, check, value)?,
            (Ok(_), _) if self.bits_to_show().is_some() => {
                self.written = Some(Ok(()));
                None
            }
            (Ok(_), _) => Some(0),
            (Err(failure), _) => match self.skipped_if_refused(failure) {
                None if self.may_be_constant(failure) => {
                    self.written = Some(Err(failure));
                    None
                }
                skipped => Some(skipped.ok_or(failure)?),
            },
        };
        if let Some(skipped) = skipped {
            self.end_step(skipped);
        }
        Ok(())
    }

    /// Judges a value; returns the number of steps to skip, or none for another reading.
    fn judge_value(
        &mut self,
        object: ObjectAddress,
        check: Check,
        read: Expedited,
    ) -> Result<Option<usize>, Failure> {
        let found = number(read.data());
        match check {
            Check::Equals { mask, value, otherwise } if found & mask != value & mask => {
                let failure = at(otherwise, object, found, value);
                return if otherwise == Cause::NotAccepted { self.read_again(failure) } else { Err(failure) };
            }
            Check::EqualsIfPresent { value, otherwise } if found != value => {
                return Err(at(otherwise, object, found, value));
            }
            Check::Unit(declared) if is_other_unit(found, declared) => {
                return Err(at(Cause::WrongUnit, object, found, declared.code()));
            }
            Check::FaultRefused => return Err(at(Cause::FaultFound, object, found, self.fault_statusword)),
            Check::NoFault if in_fault(found) => {
                return self.read_again(self.fault(Cause::FaultAtStart, object));
            }
            Check::NoFault => self.reset_fault = Some(self.fault(Cause::FaultReset, object)),
            Check::NoVoltage if may_be_powered(found) => {
                return self.read_again(at(Cause::StillPowered, object, found, 0));
            }
            Check::Keep => self.kept = Expedited::new(read.data()).expect("one to four bytes"),
            Check::FaultElseSkip(skipped) if !in_fault(found) => return Ok(Some(skipped)),
            Check::FaultElseSkip(_) => self.fault_statusword = found,
            Check::PdoElseSkip(skipped) => {
                let cob_id = CobId(found);
                self.kept = Expedited::new(&cob_id.invalidated().0.to_le_bytes()).expect("four bytes");
                return Ok(Some(if cob_id.is_valid() { 0 } else { skipped }));
            }
            _ => {}
        }
        Ok(Some(0))
    }

    /// The fault of the drive, by its kept code (603Fh).
    fn fault(&self, cause: Cause, object: ObjectAddress) -> Failure {
        at(cause, object, number(self.kept.data()), self.fault_statusword)
    }

    /// Reads a value that may still change again, for a limited number of times.
    fn read_again(&mut self, failure: Failure) -> Result<Option<usize>, Failure> {
        self.readings += 1;
        if self.readings < READINGS { Ok(None) } else { Err(failure) }
    }
}

/// A statusword without a meaning does not prove a drive off.
fn may_be_powered(statusword: u32) -> bool {
    let state = Statusword(statusword as u16).state();
    !state.is_ok_and(|state| !state.is_powered())
}

fn is_other_unit(code: u32, declared: AccelerationUnit) -> bool {
    code != declared.code() && AccelerationUnit::ALL.iter().any(|unit| unit.code() == code)
}

fn in_fault(statusword: u32) -> bool {
    let state = Statusword(statusword as u16).state();
    matches!(state, Ok(DriveState::Fault | DriveState::FaultReactionActive))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drive_that_is_waited_for_is_reset_twice_a_second() {
        let node = masseter_can::canopen::NodeId::new(4).unwrap();
        let wanted = WantedDrive::of_axis(&masseter_scenario::Scenario::default(), 3, node).unwrap();
        let mut boot = Boot::new(&wanted, false, 0);
        let resets: Vec<_> = (0..1600).filter(|ms| boot.command(ms * MILLISECOND_NS).is_some()).collect();
        assert_eq!(resets, [500, 1000, 1500]);
    }
}
