//! Deviations of a drive from the standard, as real drives have them, and what each changes.

use masseter_can::canopen::{AbortCode, CobId, ObjectAddress};
use serde::{Deserialize, Deserializer, Serialize, de::Error};

use crate::dictionary::{Objects, Overlay, find};
use crate::names;
use crate::table::{PDOS, RPM_PER_S};

/// A deviation from the standard. Its form in a file is a name such as `two_boot_ups`, or a name with values such as
/// `{ "slow_save": { "for_s": 3 } }`: files give times in seconds.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Quirk {
    /// The PDOs are as delivered: 6040h alone in RPDO1, 6041h alone in TPDO1, transmission types 255, inhibit times 10.
    FactoryPdos,
    /// 6066h takes 0 alone, and 60C2h:01 takes 1 to 100.
    NarrowLimits,
    /// 6083h, 6084h, 6085h and 609Ah count in rpm/s; 60AAh says so and takes no other unit.
    AccelerationInRpmS {
        /// Increments of a turn of the motor (608Fh, 6092h).
        increments_per_turn: u32,
    },
    /// 60C2h:02 is −3 and cannot be written, so that 60C2h:01 counts in ms.
    InterpolationInMs,
    /// The drive has no 6007h, 6066h and 6085h, and no cyclic synchronous position in 6502h.
    MissingObjects,
    /// PDO parameters cannot be written in operational: 08000022h.
    PdosLockedInOperation,
    /// The boot loader sends a boot-up message of its own before the drive's.
    TwoBootUps,
    /// Saving takes time. 1010h:01 reads 0 until then, and a reset before then loses the values.
    SlowSave {
        /// The time, ns.
        #[serde(rename = "for_s", deserialize_with = "seconds")]
        for_ns: u64,
    },
    /// The brake opens and closes late; targets count once it is open.
    SlowBrake {
        /// From "operation enabled" until the brake is open, ns.
        #[serde(rename = "open_s", default, deserialize_with = "seconds")]
        open_ns: u64,
        /// From the loss of current until the brake is closed, ns.
        #[serde(rename = "close_s", default, deserialize_with = "seconds")]
        close_ns: u64,
    },
    /// The axis has no brake: without power it coasts.
    NoBrake,
    /// The position at home is the home offset (607Ch) instead of its negative.
    HomeOffsetSign,
    /// The software limits (607Dh) count from zero instead of from the home position.
    LimitsFromZero,
    /// Safe torque off is active at power-on: the drive stays in "switch on disabled".
    StoAtPowerOn {
        /// How long, ns; `None` for ever.
        #[serde(rename = "for_s", default, deserialize_with = "some_seconds")]
        for_ns: Option<u64>,
    },
    /// The encoder is incremental: 6064h is 0 at power-on, wherever the axis stands.
    IncrementalEncoder,
    /// A second encoder sits at the joint ([`compare_encoders`](crate::DriveNode::compare_encoders)). The drive is in
    /// fault (7320h) once both are too far apart.
    SecondEncoder {
        /// The distance, m.
        limit_m: f64,
    },
    /// The drive is in fault at power-on, until it is reset.
    FaultAtPowerOn {
        /// Error code (603Fh).
        code: u16,
    },
    /// The drive restarts by itself once.
    Restarts {
        /// Time from power-on, ns.
        #[serde(rename = "after_s", deserialize_with = "seconds")]
        after_ns: u64,
    },
    /// The drive goes on without the master's heartbeat, though it shows 1016h.
    IgnoresHeartbeat,
    /// The drive goes on without process data, though it shows 1400h:05.
    IgnoresProcessData,
    /// Heartbeat and process data count as lost late.
    LateWatchdog {
        /// How long after their time, ns.
        #[serde(rename = "for_s", deserialize_with = "seconds")]
        for_ns: u64,
    },
    /// A lost master takes the current away at once, and the brake stays open: the axis coasts.
    CoastsWithoutMaster,
    /// The brake slips: without power the axis creeps towards larger positions.
    Creeps {
        /// Speed, m/s.
        speed_m_s: f64,
    },
    /// SDO shows a value in an object; writes are acknowledged, and change nothing.
    Shows {
        /// The object.
        object: ObjectAddress,
        /// The value, of which the object has its lowest bytes.
        value: u32,
    },
    /// The drive lacks an object.
    Lacks {
        /// The object.
        object: ObjectAddress,
    },
}

/// The longest time of a quirk, s.
const LONGEST_S: f64 = 1e6;

/// A time of a file in ns.
fn seconds<'de, D: Deserializer<'de>>(given: D) -> Result<u64, D::Error> {
    let time_s = f64::deserialize(given)?;
    let is_time = (0.0..=LONGEST_S).contains(&time_s);
    let refusal = || D::Error::custom(format!("a time of {time_s} s; use 0 to {LONGEST_S} s"));
    is_time.then_some((time_s * 1e9) as u64).ok_or_else(refusal)
}

fn some_seconds<'de, D: Deserializer<'de>>(given: D) -> Result<Option<u64>, D::Error> {
    seconds(given).map(Some)
}

impl Quirk {
    /// Writes the units that the drive counts in into its dictionary.
    pub(crate) fn set_units(&self, objects: &mut Objects) {
        let Self::AccelerationInRpmS { increments_per_turn } = *self else { return };
        objects.set(names::ACCELERATION_UNIT, RPM_PER_S);
        objects.set(names::INCREMENTS_PER_TURN, increments_per_turn);
        objects.set(names::FEED_PER_TURN, increments_per_turn);
    }
}

/// The deviations of the node.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(crate) struct NodeQuirks {
    /// Boot-up messages at a start.
    pub(crate) boot_ups: u8,
    /// Whether PDO parameters are closed in operational.
    pub(crate) locks_pdos: bool,
    /// Time of saving, ns.
    pub(crate) save_ns: u64,
    /// The error at power-on (603Fh).
    pub(crate) fault: Option<u16>,
    /// Time from power-on to a restart by itself, ns.
    pub(crate) restart_ns: Option<u64>,
    /// How much later than configured a heartbeat and process data count as lost, ns; `u64::MAX` for never.
    pub(crate) heartbeat_late_ns: u64,
    pub(crate) process_data_late_ns: u64,
}

/// The deviations of the axis.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[expect(clippy::struct_excessive_bools, reason = "quirks that are independent of each other")]
pub(crate) struct AxisQuirks {
    /// Whether the position at home is the home offset instead of its negative.
    pub(crate) is_offset_inverted: bool,
    /// Whether the software limits count from zero instead of from home.
    pub(crate) are_limits_from_zero: bool,
    /// Whether the encoder counts from its place at power-on.
    pub(crate) is_incremental: bool,
    /// Largest distance of the encoder from a second one at the joint, m; none without a second one.
    pub(crate) encoders_apart_m: Option<f64>,
    /// Whether a lost master takes the current away, with an open brake.
    pub(crate) coasts_without_master: bool,
    /// Speed of the axis while the brake is closed, m/s.
    pub(crate) creep_m_s: f64,
    /// Time of safe torque off after power-on, ns.
    pub(crate) torque_off_ns: u64,
    /// Opening time of the brake, ns.
    pub(crate) opening_ns: u64,
    /// Closing time of the brake, ns; none without a brake.
    pub(crate) closing_ns: Option<u64>,
}

/// A drive as it is delivered, before it has its memory.
#[derive(Debug, Clone)]
pub(crate) struct Delivered {
    pub(crate) objects: Objects,
    pub(crate) overlay: Overlay,
    pub(crate) node: NodeQuirks,
    pub(crate) axis: AxisQuirks,
}

/// Highest value of 60C2h:01 with narrow limits.
const NARROW_PERIOD: u8 = 100;
/// Milliseconds in 60C2h:02.
const MILLISECONDS: i8 = -3;
/// Cyclic synchronous position in 6502h.
const CYCLIC_POSITION: u32 = 1 << 7;

impl Delivered {
    /// A drive with these objects.
    pub(crate) fn without_quirks(objects: Objects) -> Self {
        Self {
            objects,
            overlay: Overlay::default(),
            node: NodeQuirks { boot_ups: 1, ..NodeQuirks::default() },
            axis: AxisQuirks { closing_ns: Some(0), ..AxisQuirks::default() },
        }
    }

    /// Changes the drive by a quirk. `period_ns` is the time from one cyclic target to the next.
    ///
    /// # Errors
    /// The object that no drive has, and the drive's answer to a client that asks for it.
    pub(crate) fn change(&mut self, quirk: &Quirk, period_ns: u64) -> Result<(), (ObjectAddress, AbortCode)> {
        let Self { objects, overlay, node, axis } = self;
        let place_of = |object| find(object).map_err(|code| (object, code));
        match *quirk {
            Quirk::FactoryPdos => set_factory_pdos(objects),
            Quirk::AccelerationInRpmS { .. } => {
                overlay.limit(names::ACCELERATION_UNIT.place, i64::from(RPM_PER_S), i64::from(RPM_PER_S));
            }
            Quirk::NarrowLimits => {
                objects.set(names::FOLLOWING_TIMEOUT_MS, 0);
                objects.set(names::PERIOD_VALUE, objects.get(names::PERIOD_VALUE).min(NARROW_PERIOD));
                overlay.limit(names::FOLLOWING_TIMEOUT_MS.place, 0, 0);
                overlay.limit(names::PERIOD_VALUE.place, 1, i64::from(NARROW_PERIOD));
            }
            Quirk::InterpolationInMs => {
                let period_ms = (period_ns as f64 * 1e-6).round().clamp(1.0, 255.0);
                objects.set(names::PERIOD_VALUE, period_ms as u8);
                objects.set(names::PERIOD_INDEX, MILLISECONDS);
                overlay.lock(names::PERIOD_INDEX.place);
            }
            Quirk::MissingObjects => {
                let modes = objects.get(names::SUPPORTED_MODES);
                objects.set(names::SUPPORTED_MODES, modes & !CYCLIC_POSITION);
                objects.set(names::MODE, 1);
                overlay.hide(names::ABORT_CONNECTION_OPTION.place);
                overlay.hide(names::FOLLOWING_TIMEOUT_MS.place);
                overlay.hide(names::QUICK_STOP_DECELERATION.place);
            }
            Quirk::PdosLockedInOperation => node.locks_pdos = true,
            Quirk::TwoBootUps => node.boot_ups = 2,
            Quirk::SlowSave { for_ns } => node.save_ns = for_ns,
            Quirk::FaultAtPowerOn { code } => node.fault = Some(code),
            Quirk::IgnoresHeartbeat => node.heartbeat_late_ns = u64::MAX,
            Quirk::IgnoresProcessData => node.process_data_late_ns = u64::MAX,
            Quirk::LateWatchdog { for_ns } => {
                node.heartbeat_late_ns = node.heartbeat_late_ns.max(for_ns);
                node.process_data_late_ns = node.process_data_late_ns.max(for_ns);
            }
            Quirk::CoastsWithoutMaster => axis.coasts_without_master = true,
            Quirk::Restarts { after_ns } => node.restart_ns = Some(after_ns),
            Quirk::SlowBrake { open_ns, close_ns } => {
                axis.opening_ns = open_ns;
                axis.closing_ns = axis.closing_ns.and(Some(close_ns));
            }
            Quirk::NoBrake => axis.closing_ns = None,
            Quirk::Creeps { speed_m_s } => axis.creep_m_s = speed_m_s,
            Quirk::HomeOffsetSign => axis.is_offset_inverted = true,
            Quirk::LimitsFromZero => axis.are_limits_from_zero = true,
            Quirk::StoAtPowerOn { for_ns } => axis.torque_off_ns = for_ns.unwrap_or(u64::MAX),
            Quirk::SecondEncoder { limit_m } => axis.encoders_apart_m = Some(limit_m),
            Quirk::IncrementalEncoder => axis.is_incremental = true,
            Quirk::Shows { object, value } => overlay.show(place_of(object)?, value),
            Quirk::Lacks { object } => overlay.hide(place_of(object)?),
        }
        Ok(())
    }
}

/// Inhibit time of transmit PDOs as delivered: 1 ms.
const FACTORY_INHIBIT: u16 = 10;
/// CiA 402's generic PDOs after their first object, the controlword or the statusword: nothing, mode, position.
const GENERIC: [[Option<u32>; 2]; 3] =
    [[None, None], [Some(0x6060_0008), Some(0x6061_0008)], [Some(0x607A_0020), Some(0x6064_0020)]];

/// The generic PDOs of CiA 402, event-driven: of those that the drive receives the first three exist, of those that it
/// transmits the first one.
fn set_factory_pdos(objects: &mut Objects) {
    for number in 0..PDOS as u16 {
        let places = [(0x1400, 0x6040_0010, 0, 3), (0x1800, 0x6041_0010, 1, 1)];
        for (communication, first, direction, exist) in places {
            let index = communication + number;
            let cob_id = CobId(objects.at(index, 1) & !CobId::NOT_VALID);
            objects.set_at(index, 1, if number < exist { cob_id.0 } else { cob_id.invalidated().0 });
            objects.set_at(index, 2, 255);
            if communication == 0x1800 {
                objects.set_at(index, 3, u32::from(FACTORY_INHIBIT));
            }
            let second = GENERIC.get(usize::from(number)).map(|generic| generic[direction]);
            let mapped = [second.map(|_| first), second.flatten()];
            objects.set_mapping(index + 0x0200, &mapped.into_iter().flatten().collect::<Vec<_>>());
        }
    }
}
