//! What a line has heard: of each drive, and of nodes that should not be there.

use std::collections::BTreeSet;

use masseter_can::Frame;
use masseter_can::canopen::{Cob, Emergency, Heartbeat, NmtState, NodeId, SdoResponse};
use masseter_scenario::MASTER_NODE;

/// Sign of another master that commands nodes.
pub(super) const NMT: &str = "NMT";

/// What was heard of one drive.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Heard {
    /// State of its heartbeat.
    pub nmt: Option<NmtState>,
    /// Boot-up messages.
    pub boot_ups: u32,
    /// Its emergencies, the oldest first.
    pub emergencies: Vec<Emergency>,
    /// When it began to transmit process data last, ns.
    pub(super) process_data_ns: Option<u64>,
    /// An answer of its SDO server that nobody has taken.
    pub(super) answer: Option<SdoResponse>,
}

impl Heard {
    /// Takes a frame of the drive. Malformed frames have no effect; the log has them.
    pub(super) fn take(&mut self, cob: Cob, frame: &Frame) {
        match cob {
            Cob::Heartbeat(_) => {
                if let Ok(Heartbeat { state }) = Heartbeat::decode(frame.data()) {
                    self.boot_ups += u32::from(state == NmtState::BootUp);
                    self.nmt = Some(state);
                }
            }
            Cob::Emergency(_) => self.emergencies.extend(Emergency::decode(frame.data())),
            Cob::SdoResponse(_) => self.answer = SdoResponse::decode(frame.data()).ok(),
            _ => {}
        }
    }
}

/// Another master, which may control the drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("bus {bus}: another master sends {sign}; end that program")]
pub struct OtherMaster {
    /// The bus.
    pub bus: usize,
    /// What it sends.
    pub sign: &'static str,
}

/// Signs of other masters and of nodes that the scenario does not have.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Strangers {
    /// SYNC, NMT, process data or SDO requests to a drive, or a heartbeat of the master's node id: with the bus.
    pub masters: BTreeSet<(usize, &'static str)>,
    /// Node ids that are none of the scenario, with their bus.
    pub nodes: BTreeSet<(usize, NodeId)>,
}

impl Strangers {
    /// Whether nobody else was heard.
    pub fn is_empty(&self) -> bool {
        self.masters.is_empty() && self.nodes.is_empty()
    }

    /// Refuses to go on where another master was heard.
    ///
    /// # Errors
    /// [`OtherMaster`].
    pub fn refuse_masters(&self) -> Result<(), OtherMaster> {
        self.masters.first().map_or(Ok(()), |&(bus, sign)| Err(OtherMaster { bus, sign }))
    }

    /// Takes a frame of a node that is no drive of the scenario.
    pub(super) fn take(&mut self, bus: usize, cob: Cob) {
        let sign = match cob {
            Cob::Sync => "SYNC",
            Cob::Nmt => NMT,
            Cob::SdoRequest(_) => "SDO requests",
            Cob::Rpdo1(_) => "process data",
            Cob::Heartbeat(node) if node == MASTER_NODE => "a heartbeat of node 127",
            Cob::Heartbeat(node) | Cob::Emergency(node) | Cob::SdoResponse(node) | Cob::Tpdo1(node) => {
                self.nodes.insert((bus, node));
                return;
            }
        };
        self.masters.insert((bus, sign));
    }
}
