//! The drive as a CANopen node (CiA 301): who gets a frame, what a step does, heartbeats and emergencies.
//!
//! Network management stands in [`nmt`](super::nmt). SYNC and process data are exchanged in
//! [`exchange`](super::exchange); what the objects may become is served in [`service`](super::service).

use masseter_can::canopen::{Cob, CobId, Emergency, Heartbeat, Nmt, NmtState, NodeId};
use masseter_can::cia402::Controlword;
use masseter_can::{ErrorState, Frame};
use masseter_shared::clock::MILLISECOND_NS;
use masseter_shared::config::DriveConfig;

use super::axis::Axis;
use super::cyclic::NewTargets;
use super::dictionary::{Objects, PDOS, names};
use super::errors::{DriveError, Errors};
use super::heartbeats::{Consumer, Producer};
use super::nmt::BOOT_NS;
use super::outbox::Outbox;
use super::parameters::configure;
use super::pdo::{Rpdo, Tpdo};
use super::sdo::SdoServer;
use crate::encoder::Encoder;

/// What a node is configured with.
#[derive(Debug, Clone)]
pub(crate) struct DriveSettings {
    /// Its node id.
    pub(crate) node: NodeId,
    /// The master, whose heartbeat it watches (object 1016).
    pub(crate) master: NodeId,
    /// The drive.
    pub(crate) drive: DriveConfig,
    /// Interval of its heartbeat (object 1017), ns.
    pub(crate) heartbeat_ns: u64,
    /// Silence of the master that counts as loss of the link (object 1016), ns.
    pub(crate) link_timeout_ns: u64,
    /// Communication cycle (object 60C2), ns.
    pub(crate) period_ns: u64,
    /// Step of the servo loops, s.
    pub(crate) step_s: f64,
    /// Software position limit (object 607D): lowest and highest target, increments.
    pub(crate) position_limit_increments: [i32; 2],
}

impl DriveSettings {
    /// The object dictionary after power-on.
    pub(crate) fn objects(&self) -> Objects {
        let mut objects = Objects::new(self.node);
        let in_ms = |ns: u64| (ns / MILLISECOND_NS).min(u64::from(u16::MAX)) as u16;
        let watched = u32::from(self.master.get()) << 16 | u32::from(in_ms(self.link_timeout_ns));
        objects.set(names::WATCHED_HEARTBEAT, watched);
        objects.set(names::HEARTBEAT_MS, in_ms(self.heartbeat_ns));
        configure(&mut objects, &self.drive, self.period_ns, self.position_limit_increments);
        objects
    }
}

/// One drive.
#[derive(Debug, Clone)]
pub(crate) struct DriveNode {
    pub(super) node: NodeId,
    pub(super) objects: Objects,
    /// What a reset brings back: as configured, or as stored since (object 1010).
    pub(super) stored: Objects,
    /// As configured, which object 1011 brings back.
    pub(super) factory: Objects,
    pub(super) axis: Axis,
    pub(super) errors: Errors,
    pub(super) nmt: Option<NmtState>,
    /// What its CAN controller said last.
    pub(super) confinement: ErrorState,
    pub(super) producer: Producer,
    pub(super) consumer: Consumer,
    pub(super) rpdos: [Rpdo; PDOS],
    pub(super) tpdos: [Tpdo; PDOS],
    pub(super) sdo: SdoServer,
    /// Cyclic targets that a client wrote since the last SYNC.
    pub(super) new_targets: NewTargets,
    pub(super) boot_at_ns: u64,
    pub(super) outbox: Outbox,
}

impl DriveNode {
    /// A drive that is switched on at `now_ns` where its axis stands.
    pub(crate) fn new(settings: &DriveSettings, encoder: Encoder, now_ns: u64, position_m: f64) -> Self {
        let objects = settings.objects();
        let boot_at_ns = now_ns + BOOT_NS;
        // Staggered, so that the nodes' heartbeats do not meet.
        let stagger_ns = settings.heartbeat_ns / 8 * u64::from(settings.node.get() % 8);
        Self {
            node: settings.node,
            axis: Axis::new(settings.drive, encoder, settings.step_s, position_m, &objects),
            errors: Errors::default(),
            nmt: None,
            confinement: ErrorState::Active,
            producer: Producer::new(&objects, boot_at_ns + stagger_ns),
            consumer: Consumer::new(&objects),
            rpdos: std::array::from_fn(|number| Rpdo::new(&objects, number as u16)),
            tpdos: std::array::from_fn(|number| Tpdo::new(&objects, number as u16)),
            sdo: SdoServer::default(),
            new_targets: NewTargets::default(),
            boot_at_ns,
            outbox: Outbox::default(),
            stored: objects.clone(),
            factory: objects.clone(),
            objects,
        }
    }

    /// State of the drive's power.
    #[cfg(test)]
    pub(crate) fn power(&self) -> masseter_can::cia402::DriveState {
        self.axis.power()
    }

    /// The next frame it wants to send.
    pub(crate) fn outgoing(&mut self) -> Option<Frame> {
        self.outbox.take()
    }

    pub(super) fn send(&mut self, frame: Frame) {
        self.outbox.add(frame);
    }

    pub(super) fn is_operational(&self) -> bool {
        self.nmt == Some(NmtState::Operational)
    }

    /// Whether it takes part in services other than network management and process data.
    pub(super) fn is_served(&self) -> bool {
        matches!(self.nmt, Some(NmtState::Operational | NmtState::PreOperational))
    }

    /// Takes a frame that arrived at `now_ns` while its axis stood at `position_m`. What is not meant
    /// for it, or malformed, has no effect; process data of a wrong length are reported by EMCY.
    pub(crate) fn receive(&mut self, now_ns: u64, frame: &Frame, position_m: f64) {
        match Cob::try_from(frame.id()) {
            Ok(Cob::Nmt) => {
                if let Ok(nmt) = Nmt::decode(frame.data())
                    && nmt.target.includes(self.node)
                {
                    self.command_nmt(nmt.command, now_ns);
                }
            }
            Ok(Cob::Sync) => self.take_sync(now_ns, frame.data(), position_m),
            Ok(Cob::SdoRequest(node)) if node == self.node && self.is_served() => {
                self.serve(now_ns, frame.data());
            }
            Ok(Cob::Heartbeat(node)) if self.nmt.is_some() => self.hear(now_ns, node, frame.data()),
            _ => self.take_process_data(now_ns, frame),
        }
    }

    /// Takes up the parameters of the RPDO of that number.
    pub(super) fn compile_rpdo(&mut self, number: usize) {
        self.rpdos[number] = Rpdo::new(&self.objects, number as u16);
    }

    /// Takes up the parameters of the TPDO of that number.
    pub(super) fn compile_tpdo(&mut self, number: usize) {
        self.tpdos[number] = Tpdo::new(&self.objects, number as u16);
    }

    fn hear(&mut self, now_ns: u64, node: NodeId, data: &[u8]) {
        // Supervision begins with a heartbeat, not with a boot-up message.
        if Heartbeat::decode(data).is_ok_and(|heartbeat| heartbeat.state != NmtState::BootUp) {
            self.consumer.hear(now_ns, node);
            if self.consumer.hears_all() {
                self.clear(DriveError::Heartbeat);
            }
        }
    }

    /// The controlword in the dictionary takes effect.
    pub(super) fn control(&mut self, now_ns: u64) {
        let word = Controlword(self.objects.get(names::CONTROLWORD));
        if self.axis.control(now_ns, word, &self.objects) {
            for error in DriveError::FAULTS {
                self.clear(error);
            }
        }
    }

    /// A step of the servo loops with the axis at `position_m`: the force until the next one, N.
    pub(crate) fn step(&mut self, now_ns: u64, position_m: f64) -> f64 {
        self.boot(now_ns);
        self.produce_heartbeat(now_ns);
        self.watch_link(now_ns);
        if let Some(abort) = self.sdo.expire(now_ns) {
            self.send(abort.frame(self.node));
        }
        if let Some(error) = self.axis.step(now_ns, position_m) {
            self.raise(error);
        }
        self.send_events(now_ns);
        self.axis.force_n()
    }

    fn produce_heartbeat(&mut self, now_ns: u64) {
        if let Some(state) = self.nmt
            && self.producer.is_due(now_ns)
        {
            self.send(Heartbeat { state }.frame(self.node));
        }
    }

    /// A lost heartbeat is a failure of the communication. A PDO that stays away leaves nobody to guide the axis either:
    /// object 6007.
    fn watch_link(&mut self, now_ns: u64) {
        if self.consumer.loses(now_ns) {
            self.raise(DriveError::Heartbeat);
            self.fail_communication(now_ns);
        }
        // Outside of operational none is waited for.
        let is_one_overdue = self.rpdos.iter_mut().fold(false, |any, rpdo| rpdo.expires(now_ns) | any);
        if is_one_overdue {
            self.judge_rpdos();
            self.lose_link(now_ns);
        }
    }

    pub(super) fn raise(&mut self, error: DriveError) {
        let emergency = self.errors.raise(error, &mut self.objects);
        self.tell(emergency);
    }

    pub(super) fn clear(&mut self, error: DriveError) {
        let emergency = self.errors.clear(error, &mut self.objects);
        self.tell(emergency);
    }

    /// Sends an emergency message, in the states in which nodes send them and unless 1014 forbids it.
    fn tell(&mut self, emergency: Option<Emergency>) {
        let cob_id = CobId(self.objects.get(names::EMERGENCY_COB_ID));
        if let Some(emergency) = emergency
            && self.is_served()
            && let Some(id) = cob_id.identifier()
        {
            self.send(Frame::fixed(id, emergency.encode()));
        }
    }
}
