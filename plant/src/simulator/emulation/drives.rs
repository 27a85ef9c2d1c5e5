//! The emulated drives of a scenario: their settings, their deviations from the standard, their memory.
//!
//! The file of the memory is JSON, by the names of the axes. A drive without an entry has stored nothing.

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::{fs, io};

use masseter_can::canopen::{CobId, NodeId};
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_runtime::clock::SECOND_NS;
use masseter_scenario::input::{MOST_KEPT_BYTES, read_text};
use masseter_scenario::{
    DriveConfig, DriveProfile, INCREMENTS_PER_TURN, MASTER_NODE, ObjectKey, QuirkConfig,
    QuirkKindConfig as Kind, Scenario,
};

use crate::error::PlantError;
use crate::master::link::{check_quantities, node_ids};
use crate::simulator::drive::axis::parameters::configure;
use crate::simulator::drive::dictionary::{Objects, Overlay, find};
use crate::simulator::drive::names;
use crate::simulator::drive::table::{self, PDOS, RPM_PER_S};
use crate::simulator::drive::{AxisQuirks, DriveMemory, DriveSettings, NodeQuirks, Quirks, Ratings};
use crate::state::state;

/// The settings of a scenario's drives, in the order of the axes.
///
/// # Errors
/// [`PlantError`] for quantities that contradict each other and for node ids that cannot be used.
pub(crate) fn drive_settings(scenario: &Scenario) -> Result<[DriveSettings; AXES], PlantError> {
    check_quantities(scenario)?;
    let mut ids = node_ids(&scenario.can)?;
    for quirk in scenario.drives.quirk.iter().filter(|quirk| quirk.kind == Kind::SwappedIds) {
        let mut pair = (0..AXES).filter(|&axis| quirk.is_on(axis));
        if let (Some(one), Some(other)) = (pair.next(), pair.next()) {
            ids.swap(one, other);
        }
    }
    let all =
        (0..AXES).map(|axis| settings_of_axis(scenario, axis, ids[axis])).collect::<Result<Vec<_>, _>>()?;
    Ok(all.try_into().expect("a drive for every axis"))
}

fn settings_of_axis(scenario: &Scenario, axis: usize, node: NodeId) -> Result<DriveSettings, PlantError> {
    let drive = Ratings::from(scenario.drives.of_axis(axis));
    let stroke_m = scenario.mechanism.strokes.of_axis(axis);
    let position_limits = stroke_m.map(|end_m| drive.increments(end_m) as i32);
    let watched = u32::from(MASTER_NODE.get()) << 16 | u32::from(scenario.can.heartbeat_consumer_ms);
    let mut objects = Objects::new(node);
    let DriveProfile { identity, pdos, .. } = scenario.profile(axis);
    objects.set_mapping(0x1600, pdos.rpdo1().entries());
    objects.set_mapping(0x1A00, pdos.tpdo1().entries());
    objects.set(names::DEVICE_TYPE, identity.device_type);
    objects.set(names::VENDOR_ID, identity.vendor_id);
    objects.set(names::PRODUCT_CODE, identity.product_code);
    objects.set(names::REVISION, identity.revision);
    // A drive keeps its serial number under another node id.
    objects.set(names::SERIAL_NUMBER, scenario.can.node_ids[axis].into());
    objects.set(names::CONSUMER_HEARTBEAT_TIME, watched);
    objects.set(names::PRODUCER_HEARTBEAT_TIME_MS, scenario.can.heartbeat_producer_ms);
    let on_axis: Vec<_> = scenario.drives.quirk.iter().filter(|quirk| quirk.is_on(axis)).collect();
    // The units come first: quantities are written in them.
    set_units(&on_axis, &mut objects);
    configure(&mut objects, &drive, scenario.period_ns(), position_limits);
    let quirks = quirks(&on_axis, scenario.period_ns(), &mut objects)?;
    let (step_s, memory) = (scenario.dynamics.step_ns as f64 * 1e-9, DriveMemory::default());
    Ok(DriveSettings { node, drive, step_s, objects, memory, quirks, stroke_m })
}

impl From<DriveConfig> for Ratings {
    fn from(config: DriveConfig) -> Self {
        Self {
            rated_force_n: config.rated_force_n,
            max_force_n: config.max_force_n,
            max_velocity_m_s: config.max_velocity_m_s,
            quick_stop_deceleration_m_s2: config.quick_stop_deceleration_m_s2,
            following_error_m: config.following_error_m,
            following_error_timeout_ms: config.following_error_timeout_ms,
            position_gain_per_s: config.position_gain_per_s,
            velocity_gain_n_s_per_m: config.velocity_gain_n_s_per_m,
            velocity_integral_time_s: config.velocity_integral_time_s,
            encoder_resolution_m: config.encoder_resolution_m,
            encoder_noise_m: config.encoder_noise_m,
        }
    }
}

/// Inhibit time of transmit PDOs as delivered: 1 ms.
const FACTORY_INHIBIT: u16 = 10;
/// CiA 402's generic PDOs after their first object, the controlword or the statusword: nothing, mode, position.
const GENERIC: [[Option<u32>; 2]; 3] =
    [[None, None], [Some(0x6060_0008), Some(0x6061_0008)], [Some(0x607A_0020), Some(0x6064_0020)]];
/// Highest value of 60C2h:01 with narrow limits.
const NARROW_PERIOD: u8 = 100;
/// Milliseconds in 60C2h:02.
const MILLISECONDS: i8 = -3;
/// Cyclic synchronous position in 6502h.
const CYCLIC_POSITION: u32 = 1 << 7;

/// The deviations of a drive from the standard. Writes the drive's values of delivery into its dictionary.
///
/// # Errors
/// [`PlantError::Scenario`] for an object that no emulated drive has.
fn quirks(on_axis: &[&QuirkConfig], period_ns: u64, objects: &mut Objects) -> Result<Quirks, PlantError> {
    let ns = |time_s: Option<f64>| time_s.map(|time_s| (time_s * SECOND_NS as f64) as u64);
    let mut node = NodeQuirks { boot_ups: 1, ..NodeQuirks::default() };
    let mut axis = AxisQuirks { closing_ns: Some(0), ..AxisQuirks::default() };
    let mut overlay = Overlay::default();
    for quirk in on_axis {
        match quirk.kind {
            Kind::FactoryPdos => set_factory_pdos(objects),
            Kind::AccelerationInRpmS => {
                overlay.limit(names::ACCELERATION_UNIT.place, i64::from(RPM_PER_S), i64::from(RPM_PER_S));
            }
            Kind::NarrowLimits => {
                objects.set(names::FOLLOWING_TIMEOUT_MS, 0);
                objects.set(names::PERIOD_VALUE, objects.get(names::PERIOD_VALUE).min(NARROW_PERIOD));
                overlay.limit(names::FOLLOWING_TIMEOUT_MS.place, 0, 0);
                overlay.limit(names::PERIOD_VALUE.place, 1, i64::from(NARROW_PERIOD));
            }
            Kind::InterpolationInMs => {
                let period_ms = (period_ns as f64 * 1e-6).round().clamp(1.0, 255.0);
                objects.set(names::PERIOD_VALUE, period_ms as u8);
                objects.set(names::PERIOD_INDEX, MILLISECONDS);
                overlay.lock(names::PERIOD_INDEX.place);
            }
            Kind::MissingObjects => {
                let modes = objects.get(names::SUPPORTED_MODES);
                objects.set(names::SUPPORTED_MODES, modes & !CYCLIC_POSITION);
                objects.set(names::MODE, 1);
                for index in [0x6007, 0x6066, 0x6085] {
                    overlay.hide(index);
                }
            }
            Kind::PdosLockedInOperation => node.locks_pdos = true,
            Kind::TwoBootUps => node.boot_ups = 2,
            Kind::SlowSave => node.save_ns = ns(quirk.for_s).unwrap_or(0),
            Kind::FaultAtPowerOn => node.fault = quirk.code,
            Kind::IgnoresHeartbeat => node.heartbeat_late_ns = u64::MAX,
            Kind::IgnoresProcessData => node.process_data_late_ns = u64::MAX,
            Kind::LateWatchdog => {
                let late_ns = ns(quirk.for_s).unwrap_or(0);
                node.heartbeat_late_ns = node.heartbeat_late_ns.max(late_ns);
                node.process_data_late_ns = node.process_data_late_ns.max(late_ns);
            }
            Kind::CoastsWithoutMaster => axis.coasts_without_master = true,
            Kind::Restarts => node.restart_ns = ns(quirk.after_s),
            Kind::SlowBrake => {
                axis.opening_ns = ns(quirk.open_s).unwrap_or(0);
                axis.closing_ns = axis.closing_ns.and(Some(ns(quirk.close_s).unwrap_or(0)));
            }
            Kind::NoBrake => axis.closing_ns = None,
            Kind::Creeps => axis.creep_m_s = quirk.speed_m_s.unwrap_or(0.0),
            // The node ids are given out before.
            Kind::SwappedIds => {}
            Kind::HomeOffsetSign => axis.is_offset_inverted = true,
            Kind::LimitsFromZero => axis.are_limits_from_zero = true,
            Kind::StoAtPowerOn => axis.torque_off_ns = ns(quirk.for_s).unwrap_or(u64::MAX),
            Kind::SecondEncoder => axis.encoders_apart_m = quirk.encoders_apart_m(),
            Kind::IncrementalEncoder => axis.is_incremental = true,
            Kind::Shows | Kind::Lacks => {
                for ObjectKey(object) in quirk.objects.iter().flatten() {
                    let place = find(*object).map_err(|code| {
                        PlantError::Scenario(format!("drives.quirk.objects: {object}: {code}"))
                    })?;
                    match quirk.value {
                        Some(word) => overlay.show(place, word),
                        None => overlay.hide_entry(place),
                    }
                }
            }
        }
    }
    Ok(Quirks { node, axis, overlay })
}

/// Writes the units that the drive counts in into its dictionary.
fn set_units(on_axis: &[&QuirkConfig], objects: &mut Objects) {
    let quirk = on_axis.iter().find(|quirk| quirk.kind == Kind::AccelerationInRpmS);
    let Some(quirk) = quirk else { return };
    let per_turn = quirk.increments_per_turn.unwrap_or(INCREMENTS_PER_TURN);
    objects.set(names::ACCELERATION_UNIT, RPM_PER_S);
    objects.set(names::INCREMENTS_PER_TURN, per_turn);
    objects.set(names::FEED_PER_TURN, per_turn);
}

/// A drive without a scale of its own counts as the scenario says.
const _: () = assert!(INCREMENTS_PER_TURN == table::INCREMENTS_PER_TURN);

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

/// The memory of all drives and its file.
#[derive(Debug, Clone)]
pub(super) struct MemoryFile {
    path: PathBuf,
    pub(super) drives: [DriveMemory; AXES],
    /// Whether the file does not have the present values.
    is_stale: bool,
}

state!(MemoryFile {
    values: drives is_stale;
    constant: path;
});

impl MemoryFile {
    /// Reads a file. A missing file stands for drives that have stored nothing.
    pub(super) fn read(path: &Path) -> Result<Self, PlantError> {
        let text = match read_text(path, MOST_KEPT_BYTES) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => "{}".to_owned(),
            Err(error) => return Err(refused(path, &error)),
        };
        let mut by_name: BTreeMap<String, DriveMemory> =
            serde_json::from_str(&text).map_err(|error| refused(path, &error))?;
        let drives = AXIS_NAMES.map(|name| by_name.remove(name).unwrap_or_default());
        if let Some(name) = by_name.keys().next() {
            return Err(refused(path, &format!("'{name}' is no axis; name axes: {}", AXIS_NAMES.join(", "))));
        }
        Ok(Self { path: path.to_owned(), drives, is_stale: false })
    }

    /// Takes the stored values of a drive.
    pub(super) fn set_of_axis(&mut self, axis: usize, memory: DriveMemory) {
        self.drives[axis] = memory;
        self.is_stale = true;
    }

    /// The refusal of a drive's values in the file.
    pub(super) fn refuse(&self, axis: usize, reason: &str) -> PlantError {
        refused(&self.path, &format!("{}: {reason}", AXIS_NAMES[axis]))
    }

    /// Writes the file, unless the file has the present values, as a whole or not at all.
    pub(super) fn write_if_stale(&mut self) -> Result<(), PlantError> {
        if !self.is_stale {
            return Ok(());
        }
        let by_name: BTreeMap<_, _> = AXIS_NAMES.iter().zip(&self.drives).collect();
        let text = serde_json::to_string_pretty(&by_name).expect("numbers and texts have a JSON form");
        let beside = self.path.with_extension("json.new");
        fs::write(&beside, text + "\n")
            .and_then(|()| fs::rename(&beside, &self.path))
            .map_err(|error| refused(&self.path, &error))?;
        self.is_stale = false;
        Ok(())
    }
}

fn refused(path: &Path, reason: &dyn std::fmt::Display) -> PlantError {
    PlantError::Memory { path: path.to_owned(), reason: reason.to_string() }
}
