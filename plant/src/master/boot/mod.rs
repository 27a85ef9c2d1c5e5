//! The boot of one drive: from its first message to the moment when it may be started.
//!
//! A pure state machine that executes its [`plan`] over its [SDO client](sdo). It judges one drive alone; when drives are
//! started, and what a failure means for the rig, is the master's matter.

mod plan;
mod sdo;

use masseter_can::canopen::{
    AbortCode, CobId, Expedited, NmtCommand, NmtState, NodeId, ObjectAddress, SdoRequest, SdoResponse,
};
use masseter_can::cia402::{DriveState, Statusword};
use masseter_shared::clock::MILLISECOND_NS;
use masseter_shared::config::Scenario;
use masseter_shared::messages::codes::{BootPhase, Cause};

use super::interlock::Failure;
use plan::{Condition, STATUSWORD, Step, plan};
use sdo::{ATTEMPTS, Data, SdoClient, SdoFailure, TIMEOUT_NS};

pub(crate) use plan::shortest_boot;

/// Silence after which the communication of a drive is reset: it may be alive without a heartbeat, ns.
const RESET_EVERY_NS: u64 = 500_000_000;
/// The time that a drive may take to become operational, ns.
const START_WITHIN_NS: u64 = 1_000_000_000;
/// Readings of a value that a drive may take some time to show.
const READINGS: u32 = 100;
/// Answers without a request in one boot that repeated frames explain; more of them mean a second drive with this id.
const UNASKED: u32 = 5;
/// Boot-up messages during a boot before the drive is given up.
const RESTARTS: u32 = 3;

/// A drive that took longer than it may.
pub(super) fn late(waited_ns: u64, limit_ns: u64) -> Failure {
    Failure::with(Cause::BootTimeout, [waited_ns, limit_ns].map(|ns| ns as f64 / 1e6))
}

/// A failure at an object.
fn at(cause: Cause, object: ObjectAddress, value: u32, limit: u32) -> Failure {
    Failure { object: Some(object), ..Failure::with(cause, [value, limit].map(f64::from)) }
}

impl From<SdoFailure> for Failure {
    fn from(failure: SdoFailure) -> Self {
        match failure {
            SdoFailure::Aborted { object, code } => at(Cause::SdoAborted, object, code.0, 0),
            SdoFailure::Silent { object } => {
                let timeout_ms = (TIMEOUT_NS / MILLISECOND_NS) as u32;
                at(Cause::SdoTimeout, object, timeout_ms * ATTEMPTS, timeout_ms)
            }
        }
    }
}

/// Progress of a boot.
#[derive(Debug, Clone)]
pub(super) struct Boot {
    phase: BootPhase,
    steps: Vec<Step>,
    next: usize,
    readings: u32,
    /// The value to be written back.
    kept: Expedited,
    client: SdoClient,
    restarts: u32,
    has_repeated: bool,
    unasked: u32,
    reset_at_ns: u64,
    since_ns: u64,
}

impl Boot {
    /// The boot of a drive of which nothing is known at `now_ns`.
    pub(super) fn new(node: NodeId, scenario: &Scenario, axis: usize, now_ns: u64) -> Self {
        Self {
            phase: BootPhase::Waiting,
            steps: plan(node, scenario, axis),
            next: 0,
            readings: 0,
            kept: Expedited::of_unknown_size([0; Expedited::MAX]),
            client: SdoClient::default(),
            restarts: 0,
            has_repeated: false,
            unasked: 0,
            reset_at_ns: now_ns + RESET_EVERY_NS,
            since_ns: now_ns,
        }
    }

    /// The phase.
    pub(super) fn phase(&self) -> BootPhase {
        self.phase
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

    /// Begins anew: nothing known of the drive counts any more.
    pub(super) fn forget(&mut self, now_ns: u64) {
        self.start_over();
        (self.phase, self.restarts) = (BootPhase::Waiting, 0);
        (self.reset_at_ns, self.since_ns) = (now_ns + RESET_EVERY_NS, now_ns);
    }

    /// The plan begins anew, and no transfer is under way.
    fn start_over(&mut self) {
        (self.next, self.readings, self.client) = (0, 0, SdoClient::default());
        (self.has_repeated, self.unasked) = (false, 0);
    }

    /// Takes a heartbeat or a boot-up message.
    pub(super) fn hear(&mut self, now_ns: u64, state: NmtState) -> Result<(), Failure> {
        if state != NmtState::BootUp {
            if self.phase == BootPhase::Waiting {
                // A drive that was alive before this master may have any configuration: it is reset at once.
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
        self.carry_on(now_ns)
    }

    /// The command of network management that is due, if any.
    pub(super) fn command(&mut self, now_ns: u64) -> Option<NmtCommand> {
        let is_due = self.phase == BootPhase::Waiting && now_ns >= self.reset_at_ns;
        is_due.then(|| {
            self.reset_at_ns = now_ns + RESET_EVERY_NS;
            NmtCommand::ResetCommunication
        })
    }

    /// The drive is told to become operational.
    pub(super) fn start(&mut self, now_ns: u64) {
        (self.phase, self.since_ns) = (BootPhase::Starting, now_ns);
    }

    /// The drive is operational.
    pub(super) fn complete(&mut self) {
        self.phase = BootPhase::Ready;
    }

    /// The drive is given up until it boots again.
    pub(super) fn give_up(&mut self) {
        self.phase = BootPhase::Failed;
    }

    /// The time spent waiting for the drive, ns.
    pub(super) fn waited_ns(&self, now_ns: u64) -> u64 {
        now_ns.saturating_sub(self.since_ns)
    }

    /// The SDO request that is due, if any.
    pub(super) fn request(&mut self, now_ns: u64) -> Option<SdoRequest> {
        self.client.poll(now_ns)
    }

    /// Takes an answer of the drive's SDO server.
    pub(super) fn take(&mut self, now_ns: u64, response: SdoResponse) -> Result<(), Failure> {
        if !self.is_under_way() && self.phase != BootPhase::Configured {
            return Ok(());
        }
        self.has_repeated |= self.client.is_repeating();
        if self.client.take(response) {
            return self.carry_on(now_ns);
        }
        self.unasked += u32::from(!self.has_repeated);
        if self.unasked > UNASKED { Err(Failure::new(Cause::DuplicateNode)) } else { Ok(()) }
    }

    /// Checks the time-outs.
    pub(super) fn expire(&mut self, now_ns: u64) -> Result<(), Failure> {
        if self.is_under_way() {
            self.client.expire(now_ns);
            self.has_repeated |= self.client.is_repeating();
            return self.carry_on(now_ns);
        }
        let is_late = self.phase == BootPhase::Starting && self.waited_ns(now_ns) > START_WITHIN_NS;
        if is_late {
            return Err(late(self.waited_ns(now_ns), START_WITHIN_NS));
        }
        Ok(())
    }

    /// Ends the step whose answer is there, and begins the next.
    fn carry_on(&mut self, now_ns: u64) -> Result<(), Failure> {
        match self.client.outcome() {
            Some(Err(SdoFailure::Aborted { code, .. })) if self.may_be_refused(code) => self.end_step(false),
            Some(outcome) => self.conclude(outcome?)?,
            None => {}
        }
        while self.client.is_idle() && self.next < self.steps.len() {
            self.begin(self.steps[self.next]);
        }
        if self.phase == BootPhase::Configured {
            self.since_ns = now_ns;
        }
        Ok(())
    }

    /// Whether the step under way may fail with that code: it is an offer, or the drive lacks an optional object.
    fn may_be_refused(&self, code: AbortCode) -> bool {
        match self.steps[self.next] {
            Step::Offer { .. } => true,
            Step::ExpectUnset { .. } | Step::If { condition: Condition::Exchanged(_), .. } => {
                matches!(code, AbortCode::NO_OBJECT | AbortCode::NO_SUBINDEX)
            }
            _ => false,
        }
    }

    /// Ends the step under way, and skips the steps of a condition that does not hold.
    fn end_step(&mut self, holds: bool) {
        let skipped = match self.steps[self.next] {
            Step::If { otherwise_skip, .. } if !holds => otherwise_skip,
            _ => 0,
        };
        (self.next, self.readings) = (self.next + 1 + skipped, 0);
    }

    fn begin(&mut self, step: Step) {
        match step {
            Step::Enter(phase) => {
                self.phase = phase;
                self.end_step(true);
            }
            Step::Expect { object, .. }
            | Step::ExpectUnset { object, .. }
            | Step::Keep(object)
            | Step::If { condition: Condition::Exchanged(object), .. } => self.client.read(object),
            Step::If { condition: Condition::InFault, .. } | Step::ExpectNoFault | Step::ExpectOff => {
                self.client.read(STATUSWORD);
            }
            Step::Write { object, value, bytes } | Step::Offer { object, value, bytes } => {
                let value = Expedited::new(&value.to_le_bytes()[..bytes]).expect("one to four bytes");
                self.client.write(object, value);
            }
            Step::WriteKept(object) => self.client.write(object, self.kept),
        }
    }

    /// Judges the value that the step under way has read.
    fn conclude(&mut self, read: Data) -> Result<(), Failure> {
        let number = read.number().unwrap_or(0);
        let mut holds = true;
        match self.steps[self.next] {
            Step::Expect { object, mask, value, otherwise } if number & mask != value & mask => {
                let failure = at(otherwise, object, number, value);
                let may_change = otherwise == Cause::NotAccepted;
                return if may_change { self.read_again(failure) } else { Err(failure) };
            }
            Step::ExpectUnset { object, otherwise } if number != 0 => {
                return Err(at(otherwise, object, number, 0));
            }
            Step::ExpectNoFault if in_fault(number) => {
                let code = self.kept.data().iter().rfold(0, |code, &byte| code << 8 | u32::from(byte));
                return self.read_again(at(Cause::FaultAtStart, STATUSWORD, code, 0));
            }
            Step::ExpectOff if may_be_powered(number) => {
                return self.read_again(at(Cause::StillPowered, STATUSWORD, number, 0));
            }
            Step::If { condition, .. } => holds = self.holds(condition, number),
            Step::Keep(object) => {
                let wrong_length = at(Cause::SdoAborted, object, AbortCode::LENGTH.0, 0);
                self.kept = Expedited::new(read.bytes()).ok_or(wrong_length)?;
            }
            _ => {}
        }
        self.end_step(holds);
        Ok(())
    }

    /// A value that may still change is read again, but not for ever.
    fn read_again(&mut self, failure: Failure) -> Result<(), Failure> {
        self.readings += 1;
        if self.readings < READINGS { Ok(()) } else { Err(failure) }
    }

    /// Whether a condition holds, given the value read for it.
    fn holds(&mut self, condition: Condition, number: u32) -> bool {
        match condition {
            Condition::InFault => in_fault(number),
            Condition::Exchanged(_) => {
                let cob_id = CobId(number);
                self.kept = Expedited::new(&cob_id.invalidated().0.to_le_bytes()).expect("four bytes");
                cob_id.is_valid()
            }
        }
    }
}

/// A statusword without a meaning does not prove that a drive is off.
fn may_be_powered(statusword: u32) -> bool {
    let state = Statusword(statusword as u16).state();
    !state.is_ok_and(|state| !state.is_powered())
}

fn in_fault(statusword: u32) -> bool {
    let state = Statusword(statusword as u16).state();
    matches!(state, Ok(DriveState::Fault | DriveState::FaultReactionActive))
}
