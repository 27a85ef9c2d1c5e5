//! The boot of one node: from its first message to the moment it may be started.
//!
//! A pure state machine that carries out its [plan](super::plan) over its SDO client. It judges one node
//! alone; when nodes are started, and what a failure means for the rig, is the master's.

use masseter_can::canopen::{AbortCode, CobId, NmtCommand, NmtState, NodeId, ObjectAddress, SdoResponse};
use masseter_can::cia402::{DriveState, Statusword};
use masseter_shared::clock::MILLISECOND_NS;
use masseter_shared::messages::codes::{BootPhase, Cause};

use super::plan::{Condition, STATUSWORD, Setup, Task, plan};
use super::sdo::{ATTEMPTS, Data, SdoClient, SdoFailure, TIMEOUT_NS, Taken};

/// Silence after which a node that may be alive without a heartbeat is told to boot, ns.
const RESET_EVERY_NS: u64 = 500_000_000;
/// How long a node may take to become operational once told to, ns.
const START_WITHIN_NS: u64 = 1_000_000_000;
/// How often a value is read that a drive may take some time to show.
const READINGS: u32 = 100;
/// Answers that nobody asked for in one boot before there must be a second drive: frames may come twice now and then.
const UNASKED: u32 = 5;
/// Boot-up messages in the middle of a boot before the node counts as restless.
const RESTARTS: u32 = 3;

/// Why a node may not be started.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct BootFault {
    pub(super) cause: Cause,
    pub(super) object: Option<ObjectAddress>,
    pub(super) value: f64,
    pub(super) limit: f64,
}

impl BootFault {
    const fn new(cause: Cause) -> Self {
        Self { cause, object: None, value: 0.0, limit: 0.0 }
    }

    fn at(self, object: ObjectAddress, value: u32, limit: u32) -> Self {
        Self { object: Some(object), value: f64::from(value), limit: f64::from(limit), ..self }
    }
}

impl From<SdoFailure> for BootFault {
    fn from(failure: SdoFailure) -> Self {
        match failure {
            SdoFailure::Aborted { object, code } => Self::new(Cause::SdoAborted).at(object, code.0, 0),
            SdoFailure::Silent { object } => {
                let timeout_ms = (TIMEOUT_NS / MILLISECOND_NS) as u32;
                Self::new(Cause::SdoTimeout).at(object, timeout_ms * ATTEMPTS, timeout_ms)
            }
        }
    }
}

/// A node's way to operational.
#[derive(Debug, Clone)]
pub(super) struct Boot {
    phase: BootPhase,
    tasks: Vec<Task>,
    next: usize,
    readings: u32,
    kept: Data,
    client: SdoClient,
    restarts: u32,
    has_repeated: bool,
    unasked: u32,
    reset_at_ns: u64,
    since_ns: u64,
}

impl Boot {
    /// Of a node that nothing is known of at `now_ns`.
    pub(super) fn new(node: NodeId, setup: &Setup, now_ns: u64) -> Self {
        Self {
            phase: BootPhase::Waiting,
            tasks: plan(node, setup),
            next: 0,
            readings: 0,
            kept: Data::EMPTY,
            client: SdoClient::default(),
            restarts: 0,
            has_repeated: false,
            unasked: 0,
            reset_at_ns: now_ns + RESET_EVERY_NS,
            since_ns: now_ns,
        }
    }

    pub(super) fn phase(&self) -> BootPhase {
        self.phase
    }

    /// Whether SDO transfers take place.
    pub(super) fn is_under_way(&self) -> bool {
        use BootPhase::{CheckingPdos, Configuring, Identifying};
        matches!(self.phase, Identifying | CheckingPdos | Configuring)
    }

    /// Whether everything about the node is verified.
    pub(super) fn is_verified(&self) -> bool {
        matches!(self.phase, BootPhase::Configured | BootPhase::Starting | BootPhase::Ready)
    }

    /// Begins anew: whatever the node was, it is not known to be it any more.
    pub(super) fn forget(&mut self, now_ns: u64) {
        self.start_over();
        (self.phase, self.restarts) = (BootPhase::Waiting, 0);
        (self.reset_at_ns, self.since_ns) = (now_ns + RESET_EVERY_NS, now_ns);
    }

    /// Nothing of the plan has been done, nothing is under way.
    fn start_over(&mut self) {
        (self.next, self.readings, self.client) = (0, 0, SdoClient::default());
        (self.has_repeated, self.unasked) = (false, 0);
    }

    /// The node said in which state it is.
    pub(super) fn hear(&mut self, now_ns: u64, state: NmtState) -> Result<(), BootFault> {
        if state != NmtState::BootUp {
            if self.phase == BootPhase::Waiting {
                // Alive before it was asked: who knows how it is configured.
                self.reset_at_ns = self.reset_at_ns.min(now_ns);
            }
            return Ok(());
        }
        if self.is_under_way() {
            self.restarts += 1;
            if self.restarts > RESTARTS {
                return Err(BootFault::new(Cause::NodeRestarted));
            }
        }
        self.start_over();
        self.carry_on(now_ns)
    }

    /// The command that the node needs to get on, if any.
    pub(super) fn command(&mut self, now_ns: u64) -> Option<NmtCommand> {
        let is_due = self.phase == BootPhase::Waiting && now_ns >= self.reset_at_ns;
        is_due.then(|| {
            self.reset_at_ns = now_ns + RESET_EVERY_NS;
            NmtCommand::ResetCommunication
        })
    }

    /// The node has been told to become operational.
    pub(super) fn start(&mut self, now_ns: u64) {
        (self.phase, self.since_ns) = (BootPhase::Starting, now_ns);
    }

    /// The node is operational.
    pub(super) fn complete(&mut self) {
        self.phase = BootPhase::Ready;
    }

    /// The node is given up until it boots again.
    pub(super) fn give_up(&mut self) {
        self.phase = BootPhase::Failed;
    }

    /// How long the node has been waited for, ns.
    pub(super) fn waited_ns(&self, now_ns: u64) -> u64 {
        now_ns.saturating_sub(self.since_ns)
    }

    /// Its SDO client, for what is to be sent.
    pub(super) fn client(&mut self) -> &mut SdoClient {
        &mut self.client
    }

    /// Takes an answer of the node's SDO server.
    pub(super) fn take(&mut self, now_ns: u64, response: SdoResponse) -> Result<(), BootFault> {
        if !self.is_under_way() && self.phase != BootPhase::Configured {
            return Ok(());
        }
        self.has_repeated |= self.client.is_repeating();
        match self.client.take(response) {
            Taken::Expected => self.carry_on(now_ns),
            Taken::Unasked if self.has_repeated => Ok(()),
            Taken::Unasked => {
                self.unasked += 1;
                let are_two = self.unasked > UNASKED;
                if are_two { Err(BootFault::new(Cause::DuplicateNode)) } else { Ok(()) }
            }
        }
    }

    /// Lets time pass.
    pub(super) fn expire(&mut self, now_ns: u64) -> Result<(), BootFault> {
        if self.is_under_way() {
            self.client.expire(now_ns);
            self.has_repeated |= self.client.is_repeating();
            return self.carry_on(now_ns);
        }
        let is_late = self.phase == BootPhase::Starting && self.waited_ns(now_ns) > START_WITHIN_NS;
        if is_late {
            let [waited_ms, limit_ms] = [self.waited_ns(now_ns), START_WITHIN_NS].map(|ns| ns as f64 / 1e6);
            return Err(BootFault {
                value: waited_ms,
                limit: limit_ms,
                ..BootFault::new(Cause::BootTimeout)
            });
        }
        Ok(())
    }

    /// Ends the task whose answer is there, and begins the next.
    fn carry_on(&mut self, now_ns: u64) -> Result<(), BootFault> {
        match self.client.outcome() {
            Some(Err(SdoFailure::Aborted { code, .. })) if self.may_be_refused(code) => self.go_on(false),
            Some(outcome) => self.conclude(outcome?)?,
            None => {}
        }
        while self.client.is_idle() && self.next < self.tasks.len() {
            self.begin(self.tasks[self.next]);
        }
        if self.phase == BootPhase::Configured {
            self.since_ns = now_ns;
        }
        Ok(())
    }

    /// Whether the task under way may fail with that code: it offers something, or asks for something that a drive need
    /// not have, and this one has not.
    fn may_be_refused(&self, code: AbortCode) -> bool {
        match self.tasks[self.next] {
            Task::Offer { .. } => true,
            Task::ExpectUnset { .. } | Task::If { condition: Condition::Exchanged(_), .. } => {
                matches!(code, AbortCode::NO_OBJECT | AbortCode::NO_SUBINDEX)
            }
            _ => false,
        }
    }

    /// Ends the task under way, and leaves out those of a condition that does not hold.
    fn go_on(&mut self, holds: bool) {
        let left_out = match self.tasks[self.next] {
            Task::If { otherwise_skip, .. } if !holds => otherwise_skip,
            _ => 0,
        };
        (self.next, self.readings) = (self.next + 1 + left_out, 0);
    }

    fn begin(&mut self, task: Task) {
        match task {
            Task::Enter(phase) => {
                self.phase = phase;
                self.go_on(true);
            }
            Task::Expect { object, .. }
            | Task::ExpectUnset { object, .. }
            | Task::Keep(object)
            | Task::If { condition: Condition::Exchanged(object), .. } => self.client.read(object),
            Task::If { condition: Condition::InFault, .. } | Task::ExpectNoFault | Task::ExpectOff => {
                self.client.read(STATUSWORD);
            }
            Task::Write { object, value, bytes } | Task::Offer { object, value, bytes } => {
                let value = Data::new(&value.to_le_bytes()[..bytes]).expect("at most four bytes");
                self.client.write(object, value);
            }
            Task::WriteKept(object) => self.client.write(object, self.kept),
        }
    }

    /// Judges what the task under way read.
    fn conclude(&mut self, read: Data) -> Result<(), BootFault> {
        let number = read.number().unwrap_or(0);
        let mut holds = true;
        match self.tasks[self.next] {
            Task::Expect { object, mask, value, otherwise } if number & mask != value & mask => {
                self.readings += 1;
                let may_change = otherwise == Cause::NotAccepted && self.readings < READINGS;
                return if may_change {
                    Ok(())
                } else {
                    Err(BootFault::new(otherwise).at(object, number, value))
                };
            }
            Task::ExpectUnset { object, otherwise } if number != 0 => {
                return Err(BootFault::new(otherwise).at(object, number, 0));
            }
            Task::ExpectNoFault if in_fault(number) => {
                self.readings += 1;
                let code = self.kept.number().unwrap_or(0);
                let fault = BootFault::new(Cause::FaultAtStart).at(STATUSWORD, code, 0);
                return if self.readings < READINGS { Ok(()) } else { Err(fault) };
            }
            Task::ExpectOff if may_be_powered(number) => {
                self.readings += 1;
                let fault = BootFault::new(Cause::StillPowered).at(STATUSWORD, number, 0);
                return if self.readings < READINGS { Ok(()) } else { Err(fault) };
            }
            Task::If { condition, .. } => holds = self.holds(condition, number),
            Task::Keep(_) => self.kept = read,
            _ => {}
        }
        self.go_on(holds);
        Ok(())
    }

    /// Whether a condition holds, given what was read of it.
    fn holds(&mut self, condition: Condition, number: u32) -> bool {
        match condition {
            Condition::InFault => in_fault(number),
            Condition::Exchanged(_) => {
                let cob_id = CobId(number);
                self.kept = Data::new(&cob_id.invalidated().0.to_le_bytes()).expect("four bytes");
                cob_id.is_valid()
            }
        }
    }
}

/// A statusword without a meaning is none of a drive that is off.
fn may_be_powered(statusword: u32) -> bool {
    let state = Statusword(statusword as u16).state();
    !state.is_ok_and(|state| !state.is_powered())
}

fn in_fault(statusword: u32) -> bool {
    let state = Statusword(statusword as u16).state();
    matches!(state, Ok(DriveState::Fault | DriveState::FaultReactionActive))
}
