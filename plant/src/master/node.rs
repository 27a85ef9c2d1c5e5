//! What the master knows of one drive.

use masseter_can::canopen::{Cob, NmtState, NodeId};
use masseter_can::cia402::{Controlword, DriveRequest, DriveState, next_controlword};
use masseter_can::{Rpdo1, Tpdo1};
use masseter_shared::messages::codes::BootPhase;

use super::boot::Boot;
use super::plan::Setup;

/// How a position object counts, and what a force object is a share of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scale {
    /// One increment of 607A and 6064, m.
    pub(crate) increment_m: f64,
    /// Force at 1000 ‰ of 6077, N.
    pub(crate) rated_force_n: f64,
}

impl Scale {
    /// The increments nearest to a position.
    fn increments(self, position_m: f64) -> f64 {
        (position_m / self.increment_m).round()
    }
}

/// A kind of object that the master takes from a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Heartbeat,
    ProcessData,
    Emergency,
    SdoAnswer,
}

impl Kind {
    const COUNT: usize = 4;

    /// The kind of an object and whose it is; none where the master takes no such object.
    pub(super) const fn of(cob: Cob) -> Option<(Self, NodeId)> {
        match cob {
            Cob::Heartbeat(node) => Some((Self::Heartbeat, node)),
            Cob::Tpdo1(node) => Some((Self::ProcessData, node)),
            Cob::Emergency(node) => Some((Self::Emergency, node)),
            Cob::SdoResponse(node) => Some((Self::SdoAnswer, node)),
            Cob::Nmt | Cob::Sync | Cob::Rpdo1(_) | Cob::SdoRequest(_) => None,
        }
    }
}

/// One drive, as the master sees it.
#[derive(Debug, Clone)]
pub(super) struct Node {
    pub(super) id: NodeId,
    pub(super) bus: usize,
    pub(super) boot: Boot,
    nmt: Option<NmtState>,
    /// Whether it was verified before it was started: only then its process data mean anything.
    is_started: bool,
    heard_ns: u64,
    /// When its newest process data came.
    answered_ns: u64,
    missing_cycles: u32,
    /// New process data beyond one a SYNC, of late. A drive that is late makes up for a cycle without any, one that hears
    /// a repeated SYNC answers it again, two of one id have one more every cycle.
    surplus: u32,
    /// New process data since the last SYNC.
    news: u32,
    /// Whether it was told that the node does not come.
    is_missed: bool,
    has_wrong_length: [bool; Kind::COUNT],
    scale: Scale,
    power: Option<DriveState>,
    actual_increments: i32,
    torque_permille: i16,
    controlword: Controlword,
}

impl Node {
    pub(super) fn new(id: NodeId, bus: usize, scale: Scale, setup: &Setup, now_ns: u64) -> Self {
        Self {
            id,
            bus,
            boot: Boot::new(id, setup, now_ns),
            nmt: None,
            is_started: false,
            heard_ns: now_ns,
            answered_ns: 0,
            missing_cycles: 0,
            surplus: 0,
            news: 0,
            is_missed: false,
            has_wrong_length: [false; Kind::COUNT],
            scale,
            power: None,
            actual_increments: 0,
            torque_permille: 0,
            controlword: Controlword::DISABLE_VOLTAGE,
        }
    }

    /// Whether it was told to exchange process data, as one that is verified.
    pub(super) fn is_started(&self) -> bool {
        self.is_started
    }

    /// Whether it exchanges process data.
    pub(super) fn is_operational(&self) -> bool {
        self.is_started && self.nmt == Some(NmtState::Operational)
    }

    /// Whether it is verified and exchanges process data.
    pub(super) fn is_ready(&self) -> bool {
        self.is_operational() && self.boot.phase() == BootPhase::Ready
    }

    /// The NMT state in which it does not exchange the process data that it was started for.
    pub(super) fn stopped_in(&self) -> Option<NmtState> {
        self.nmt.filter(|&state| self.is_started && state != NmtState::Operational)
    }

    /// How long nothing was heard of it, ns.
    pub(super) fn silent_ns(&self, now_ns: u64) -> u64 {
        now_ns.saturating_sub(self.heard_ns)
    }

    /// Whether its newest process data are newer than that.
    pub(super) fn has_answered_since(&self, time_ns: u64) -> bool {
        self.answered_ns > time_ns
    }

    /// Cycles in a row without its process data.
    pub(super) fn missing_cycles(&self) -> u32 {
        self.missing_cycles
    }

    /// New process data beyond one a SYNC, of late.
    pub(super) fn surplus(&self) -> u32 {
        self.surplus
    }

    /// It is told to become operational, and verified to be what it should.
    pub(super) fn start(&mut self, now_ns: u64) {
        self.boot.start(now_ns);
        (self.is_started, self.missing_cycles) = (true, 0);
    }

    /// It sent something.
    pub(super) fn hear(&mut self, time_ns: u64) {
        self.heard_ns = time_ns;
    }

    /// It said in which state it is.
    pub(super) fn hear_state(&mut self, time_ns: u64, state: NmtState) {
        self.hear(time_ns);
        self.nmt = Some(state);
    }

    /// A cycle is over without its process data.
    pub(super) fn miss_cycle(&mut self) {
        if self.is_operational() {
            self.missing_cycles += 1;
        }
    }

    /// It does not come; whether that is news.
    pub(super) fn miss(&mut self) -> bool {
        !std::mem::replace(&mut self.is_missed, true)
    }

    /// Nothing that was found out about it counts any more, its state neither; it has to boot again.
    pub(super) fn forget(&mut self, now_ns: u64) {
        self.boot.forget(now_ns);
        (self.missing_cycles, self.surplus, self.is_missed, self.power) = (0, 0, true, None);
    }

    /// It is told to boot, or did: what it sends until it is started anew means nothing.
    pub(super) fn stop_exchange(&mut self) {
        (self.is_started, self.power, self.answered_ns) = (false, None, 0);
        self.controlword = Controlword::DISABLE_VOLTAGE;
    }

    /// Whether this is its first object of that kind with a wrong length.
    pub(super) fn is_first_wrong_length(&mut self, kind: Kind) -> bool {
        !std::mem::replace(&mut self.has_wrong_length[kind as usize], true)
    }

    /// SYNC asks it for new process data.
    pub(super) fn begin_cycle(&mut self) {
        self.surplus = match std::mem::take(&mut self.news) {
            0 | 1 => self.surplus.saturating_sub(1),
            several => self.surplus + several - 1,
        };
    }

    /// Takes process data, which only an operational node sends; a statusword without a meaning keeps the last state.
    /// The state of the drive before and after; none while they mean nothing.
    pub(super) fn take(&mut self, tpdo: Tpdo1, time_ns: u64) -> Option<[Option<DriveState>; 2]> {
        self.hear_state(time_ns, NmtState::Operational);
        self.missing_cycles = 0;
        if !self.is_started {
            return None;
        }
        let before = self.drive_state();
        if let Ok(state) = tpdo.statusword.state() {
            self.power = Some(state);
        }
        let data = (tpdo.actual_increments, tpdo.torque_permille);
        // A frame that its transmitter had to repeat says the same twice.
        self.news += u32::from(data != (self.actual_increments, self.torque_permille));
        (self.actual_increments, self.torque_permille) = data;
        self.answered_ns = time_ns;
        Some([before, self.drive_state()])
    }

    pub(super) fn drive_state(&self) -> Option<DriveState> {
        self.power.filter(|_| self.is_operational())
    }

    pub(super) fn position_m(&self) -> f64 {
        f64::from(self.actual_increments) * self.scale.increment_m
    }

    pub(super) fn force_n(&self) -> f64 {
        f64::from(self.torque_permille) / 1000.0 * self.scale.rated_force_n
    }

    /// Whether a target has a number of increments that 607A can hold; what is no number has none.
    pub(super) fn can_go_to(&self, target_m: f64) -> bool {
        (f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&self.scale.increments(target_m))
    }

    /// The process data that bring the drive where it is wanted. Until it follows targets, its target is
    /// where it stands, so that nothing jumps when it begins to (607A := 6064).
    pub(super) fn process_data(&mut self, request: DriveRequest, target_m: f64) -> Rpdo1 {
        let state = self.power.unwrap_or(DriveState::NotReadyToSwitchOn);
        self.controlword = next_controlword(state, request, self.controlword);
        let follows = state == DriveState::OperationEnabled && request == DriveRequest::Enable;
        let target_increments =
            if follows { self.scale.increments(target_m) as i32 } else { self.actual_increments };
        Rpdo1 { controlword: self.controlword, target_increments }
    }
}

#[cfg(test)]
mod tests {
    use masseter_can::cia402::Statusword;
    use masseter_shared::config::Scenario;

    use super::*;
    use crate::expectation::setup;
    use crate::master::supervision::SURPLUS;

    /// The surplus after so many SYNCs of a moving drive, each answered by as many frames as told.
    fn surplus(syncs: u32, answers: impl Fn(u32) -> u32) -> u32 {
        let id = NodeId::new(1).unwrap();
        let scale = Scale { increment_m: 1e-6, rated_force_n: 500.0 };
        let mut node = Node::new(id, 0, scale, &setup(&Scenario::default(), 0), 0);
        node.start(0);
        let statusword = Statusword::of(DriveState::OperationEnabled);
        for sync in 0..syncs {
            node.begin_cycle();
            for _ in 0..answers(sync) {
                let actual_increments = node.actual_increments + 1;
                node.take(Tpdo1 { statusword, actual_increments, torque_permille: 0 }, 0);
            }
        }
        node.begin_cycle();
        node.surplus()
    }

    #[test]
    fn a_drive_that_answers_late_is_still_one() {
        assert!(surplus(100, |sync| if sync % 2 == 0 { 0 } else { 2 }) <= 1, "every other cycle");
        assert!(surplus(100, |sync| if sync % 4 == 3 { 4 } else { 0 }) <= SURPLUS);
    }

    #[test]
    fn a_drive_that_answers_a_repeated_sync_again_is_still_one() {
        assert!(surplus(10_000, |sync| if sync % 3 == 0 { 2 } else { 1 }) <= 1);
    }

    #[test]
    fn two_drives_of_one_id_answer_once_too_often_every_cycle() {
        assert_eq!(surplus(10, |_| 1), 0);
        assert_eq!(surplus(10, |_| 2), 10);
    }
}
