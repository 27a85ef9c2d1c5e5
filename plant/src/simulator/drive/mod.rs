//! An emulated servo drive: a CANopen node (CiA 301) with the profile of servo drives (CiA 402) and an encoder.
//!
//! [`node`] implements CiA 301, [`axis`] is the profile, and the object [`dictionary`] lies between them. The node
//! counts in increments, the axis works in SI units. The drive has no bus, no encoder and no mechanism; its caller
//! delivers frames, positions, and the encoder's output. A drive depends on CAN alone: not on mechanism, scenario, or
//! transport.

pub(crate) mod axis;
pub(crate) mod dictionary;
pub(crate) mod faults;
pub(crate) mod names;
pub(crate) mod node;
pub(crate) mod table;
#[cfg(test)]
pub(crate) mod tests;

use std::collections::BTreeMap;

use masseter_can::canopen::{NodeId, ObjectAddress};
use serde::{Deserialize, Serialize};

use dictionary::{ENTRIES, Objects, Overlay, find};

/// Nanoseconds of a millisecond and of a second.
pub(crate) const MILLISECOND_NS: u64 = 1_000_000;
pub(crate) const SECOND_NS: u64 = 1_000_000_000;

/// Settings of a drive.
#[derive(Debug, Clone)]
pub(crate) struct DriveSettings {
    /// Its node id.
    pub(crate) node: NodeId,
    /// Its abilities.
    pub(crate) drive: Ratings,
    /// Step of the servo loops, s.
    pub(crate) step_s: f64,
    /// The object dictionary as delivered.
    pub(crate) objects: Objects,
    /// What the drive has stored.
    pub(crate) memory: DriveMemory,
    /// Its deviations from the standard.
    pub(crate) quirks: Quirks,
    /// The ends of the axis' stroke, m.
    pub(crate) stroke_m: [f64; 2],
}

/// The abilities of a drive, and the gains of its loops.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) struct Ratings {
    /// Force at 1000 ‰ of the torque objects (6077h), N.
    pub(crate) rated_force_n: f64,
    /// Force limit, N.
    pub(crate) max_force_n: f64,
    /// Velocity limit, m/s.
    pub(crate) max_velocity_m_s: f64,
    /// Deceleration of the quick-stop ramp (6085h), m/s².
    pub(crate) quick_stop_deceleration_m_s2: f64,
    /// Following error window (6065h), m, and how long it may be exceeded (6066h).
    pub(crate) following_error_m: f64,
    pub(crate) following_error_timeout_ms: u16,
    /// Gain of the position loop, 1/s.
    pub(crate) position_gain_per_s: f64,
    /// Gain of the velocity loop, N per m/s, and its integral time.
    pub(crate) velocity_gain_n_s_per_m: f64,
    pub(crate) velocity_integral_time_s: f64,
    /// One increment of the encoder, m, and the standard deviation of its noise.
    pub(crate) encoder_resolution_m: f64,
    pub(crate) encoder_noise_m: f64,
}

impl Ratings {
    /// The increments of the encoder nearest to a length in m; also for m/s and m/s².
    pub(crate) fn increments(&self, metres: f64) -> f64 {
        (metres / self.encoder_resolution_m).round()
    }
}

/// All deviations of a drive from the standard.
#[derive(Debug, Clone)]
pub(crate) struct Quirks {
    pub(crate) node: NodeQuirks,
    pub(crate) axis: AxisQuirks,
    pub(crate) overlay: Overlay,
}

/// The deviations of the node.
#[derive(Debug, Clone, Copy, Default)]
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

/// The non-volatile memory of a drive, without values of delivery.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DriveMemory {
    /// Serial number (1018h:04); none for the scenario's.
    pub(crate) serial_number: Option<u32>,
    /// Stored values by their objects, such as `6065:00`.
    #[serde(default)]
    pub(crate) values: BTreeMap<String, i64>,
}

impl DriveMemory {
    /// The differences between stored values and those of delivery.
    pub(crate) fn of(stored: &Objects, factory: &Objects) -> Self {
        let differs = |place: &usize| stored.words[*place] != factory.words[*place];
        let value = |place: usize| {
            let entry = &ENTRIES[place];
            (key(entry.address), entry.kind.number(stored.words[place]))
        };
        let values = (0..ENTRIES.len()).filter(differs).map(value).collect();
        Self { serial_number: Some(stored.get(names::SERIAL_NUMBER)), values }
    }

    /// Writes the memory into a dictionary as delivered.
    ///
    /// # Errors
    /// The object that the drive lacks, or whose value the drive refuses.
    pub(crate) fn restore(&self, objects: &mut Objects, overlay: &Overlay) -> Result<(), String> {
        if let Some(serial_number) = self.serial_number {
            objects.set(names::SERIAL_NUMBER, serial_number);
        }
        for (key, value) in &self.values {
            let place = address(key).and_then(|address| find(address).ok());
            let entry = place.and_then(|place| Some((place, overlay.entry(place)?)));
            let Some((place, entry)) = entry else {
                return Err(format!("{key}: the drive has no such object"));
            };
            let word = *value as u32;
            if entry.check_access().is_err()
                || entry.check_limits(word).is_err()
                || entry.kind.number(word) != *value
            {
                return Err(format!("{key} = {value}: the drive does not take this value"));
            }
            objects.words[place] = word;
        }
        Ok(())
    }
}

fn key(ObjectAddress { index, subindex }: ObjectAddress) -> String {
    format!("{index:04X}:{subindex:02X}")
}

fn address(key: &str) -> Option<ObjectAddress> {
    let (index, subindex) = key.split_once(':')?;
    let number = |digits: &str| u16::from_str_radix(digits, 16).ok();
    Some(ObjectAddress::new(number(index)?, u8::try_from(number(subindex)?).ok()?))
}
