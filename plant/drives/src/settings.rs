//! The settings of a drive, and what they make of its object dictionary.

use masseter_can::PdoMapping;
use masseter_can::canopen::{AbortCode, NodeId, ObjectAddress};

use crate::memory::{DriveMemory, MemoryError};
use crate::quirks::{Delivered, Quirk};
use crate::{MILLISECOND_NS, axis::parameters::configure, dictionary::Objects, names, ratings::Ratings};

/// The usual node of a master.
const MASTER: NodeId = match NodeId::new(127) {
    Ok(node) => node,
    Err(_) => unreachable!(),
};

/// Settings of a drive. [`new`](Self::new) gives those of a drive without quirks; every field may be replaced.
///
/// ```
/// use masseter_can::canopen::NodeId;
/// use masseter_drives::{DriveSettings, Quirk};
///
/// let settings = DriveSettings {
///     stroke_m: [0.0, 0.5],
///     quirks: vec![Quirk::TwoBootUps, Quirk::SlowSave { for_ns: 3_000_000_000 }],
///     ..DriveSettings::new(NodeId::new(4)?)
/// };
/// assert_eq!(settings.objects()?.at(0x607D, 2), 500_000, "the upper software limit, increments");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct DriveSettings {
    /// Its node id.
    pub node: NodeId,
    /// What the drive reports of itself.
    pub identity: Identity,
    /// Its abilities.
    pub ratings: Ratings,
    /// The ends of the axis' stroke, which are the software position limits (607Dh) as delivered, m.
    pub stroke_m: [f64; 2],
    /// The objects of RPDO1 (1600h) as delivered.
    pub rpdo1: PdoMapping,
    /// The objects of TPDO1 (1A00h) as delivered.
    pub tpdo1: PdoMapping,
    /// Time from one cyclic target to the next (60C2h) as delivered, ns.
    pub period_ns: u64,
    /// Step of the servo loops, ns: the caller steps the drive so often.
    pub step_ns: u64,
    /// The node whose heartbeat the drive supervises (1016h:01).
    pub master: NodeId,
    /// The master's longest silence, ms; 0 for no supervision.
    pub master_timeout_ms: u16,
    /// Period of the drive's own heartbeat (1017h), ms; 0 for none.
    pub heartbeat_ms: u16,
    /// Its deviations from the standard.
    pub quirks: Vec<Quirk>,
    /// What the drive has stored.
    pub memory: DriveMemory,
}

/// What a drive reports of itself (1000h, 1018h).
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Identity {
    /// Device type (1000h).
    pub device_type: u32,
    /// Vendor (1018h:01). The number of the default is not registered with CiA.
    pub vendor_id: u32,
    /// Product (1018h:02).
    pub product_code: u32,
    /// Revision (1018h:03).
    pub revision: u32,
    /// Serial number (1018h:04); by default the node id.
    pub serial_number: Option<u32>,
}

impl Default for Identity {
    fn default() -> Self {
        Self {
            device_type: 0x0002_0192,
            vendor_id: 0x004D_5354,
            product_code: 0x0000_0402,
            revision: 0x0001_0000,
            serial_number: None,
        }
    }
}

/// Settings that make no drive.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SettingsError {
    /// A quirk about an object that no drive of this crate has.
    #[error("{object}: {code}; name an object of the drive")]
    Quirk {
        /// The object.
        object: ObjectAddress,
        /// The drive's answer to a client that asks for it.
        code: AbortCode,
    },
    /// The memory.
    #[error(transparent)]
    Memory(#[from] MemoryError),
}

impl DriveSettings {
    /// A drive without quirks: cyclic targets each millisecond, a step of 125 µs, a stroke of 0.3 m, node 127 as
    /// master with 150 ms of longest silence, a heartbeat each 50 ms.
    pub fn new(node: NodeId) -> Self {
        Self {
            node,
            identity: Identity::default(),
            ratings: Ratings::default(),
            stroke_m: [0.0, 0.3],
            rpdo1: PdoMapping::RPDO1,
            tpdo1: PdoMapping::TPDO1,
            period_ns: MILLISECOND_NS,
            step_ns: MILLISECOND_NS / 8,
            master: MASTER,
            master_timeout_ms: 150,
            heartbeat_ms: 50,
            quirks: Vec::new(),
            memory: DriveMemory::default(),
        }
    }

    /// The object dictionary as delivered.
    ///
    /// # Errors
    /// [`SettingsError::Quirk`].
    pub fn objects(&self) -> Result<Objects, SettingsError> {
        Ok(self.delivered()?.objects)
    }

    pub(crate) fn delivered(&self) -> Result<Delivered, SettingsError> {
        let Self { identity, ratings, .. } = self;
        let mut objects = Objects::new(self.node);
        objects.set_mapping(0x1600, self.rpdo1.entries());
        objects.set_mapping(0x1A00, self.tpdo1.entries());
        objects.set(names::DEVICE_TYPE, identity.device_type);
        objects.set(names::VENDOR_ID, identity.vendor_id);
        objects.set(names::PRODUCT_CODE, identity.product_code);
        objects.set(names::REVISION, identity.revision);
        if let Some(serial_number) = identity.serial_number {
            objects.set(names::SERIAL_NUMBER, serial_number);
        }
        let watched = u32::from(self.master.get()) << 16 | u32::from(self.master_timeout_ms);
        objects.set(names::CONSUMER_HEARTBEAT_TIME, watched);
        objects.set(names::PRODUCER_HEARTBEAT_TIME_MS, self.heartbeat_ms);
        // The units come first: quantities are written in them. Of several quirks the first one decides.
        self.quirks.iter().rev().for_each(|quirk| quirk.set_units(&mut objects));
        let position_limits = self.stroke_m.map(|end_m| ratings.increments(end_m) as i32);
        configure(&mut objects, ratings, self.period_ns, position_limits);
        let mut delivered = Delivered::without_quirks(objects);
        for quirk in &self.quirks {
            let changed = delivered.change(quirk, self.period_ns);
            changed.map_err(|(object, code)| SettingsError::Quirk { object, code })?;
        }
        Ok(delivered)
    }
}
