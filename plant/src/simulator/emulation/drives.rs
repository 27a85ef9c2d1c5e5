//! The emulated drives of a scenario: their settings, their deviations from the standard, their memory.
//!
//! The file of the memory is JSON, by the names of the axes. A drive without an entry has stored nothing.

#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};
use std::{collections::BTreeMap, fs, io};

use masseter_can::canopen::{NodeId, ObjectAddress};
use masseter_drives::{DriveMemory, DriveNode, DriveSettings, Identity, Quirk, Ratings, SettingsError};
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_runtime::clock::SECOND_NS;
use masseter_scenario::input::{MOST_KEPT_BYTES, read_text};
use masseter_scenario::{
    DriveConfig, DriveProfile, INCREMENTS_PER_TURN, MASTER_NODE, ObjectKey, QuirkConfig,
    QuirkKindConfig as Kind, Scenario,
};

use crate::error::PlantError;
use crate::master::link::{check_quantities, node_ids};

/// The settings of a scenario's drives, in the order of the axes.
///
/// # Errors
/// [`PlantError`] for quantities that contradict each other and for node ids that cannot be used.
pub fn drive_settings(scenario: &Scenario) -> Result<[DriveSettings; AXES], PlantError> {
    check_quantities(scenario)?;
    let mut ids = node_ids(&scenario.can)?;
    for quirk in scenario.drives.quirk.iter().filter(|quirk| quirk.kind == Kind::SwappedIds) {
        let mut pair = (0..AXES).filter(|&axis| quirk.is_on(axis));
        if let (Some(one), Some(other)) = (pair.next(), pair.next()) {
            ids.swap(one, other);
        }
    }
    let all = ids.into_iter().enumerate().map(|(axis, node)| settings_of_axis(scenario, axis, node));
    Ok(all.collect::<Result<Vec<_>, _>>()?.try_into().expect("a drive for every axis"))
}

fn settings_of_axis(scenario: &Scenario, axis: usize, node: NodeId) -> Result<DriveSettings, PlantError> {
    let DriveProfile { identity, pdos, .. } = scenario.profile(axis);
    let quirks = scenario.drives.quirk.iter().filter(|quirk| quirk.is_on(axis)).flat_map(quirks);
    let settings = DriveSettings {
        node,
        identity: Identity {
            device_type: identity.device_type,
            vendor_id: identity.vendor_id,
            product_code: identity.product_code,
            revision: identity.revision,
            // A drive keeps its serial number under another node id.
            serial_number: Some(scenario.can.node_ids[axis].into()),
        },
        ratings: ratings(scenario.drives.of_axis(axis)),
        stroke_m: scenario.mechanism.strokes.of_axis(axis),
        rpdo1: pdos.rpdo1(),
        tpdo1: pdos.tpdo1(),
        period_ns: scenario.period_ns(),
        step_ns: scenario.dynamics.step_ns,
        master: MASTER_NODE,
        master_timeout_ms: scenario.can.heartbeat_consumer_ms,
        heartbeat_ms: scenario.can.heartbeat_producer_ms,
        quirks: quirks.collect(),
        memory: DriveMemory::default(),
    };
    settings.objects()?;
    Ok(settings)
}

/// The key that is to blame. A memory is refused by its file.
impl From<SettingsError> for PlantError {
    fn from(error: SettingsError) -> Self {
        Self::Scenario(format!("drives.quirk.objects: {error}"))
    }
}

fn ratings(config: DriveConfig) -> Ratings {
    Ratings {
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

/// What a quirk of the scenario is for a drive that has the quirk.
fn quirks(config: &QuirkConfig) -> Vec<Quirk> {
    let ns = |time_s: f64| (time_s * SECOND_NS as f64) as u64;
    let or_0 = |time_s: Option<f64>| time_s.map_or(0, ns);
    let for_ns = or_0(config.for_s);
    let of_objects = |quirk: fn(ObjectAddress, u32) -> Quirk| {
        let objects = config.objects.iter().flatten();
        objects.map(|ObjectKey(object)| quirk(*object, config.value.unwrap_or_default())).collect()
    };
    vec![match config.kind {
        Kind::FactoryPdos => Quirk::FactoryPdos,
        Kind::NarrowLimits => Quirk::NarrowLimits,
        Kind::AccelerationInRpmS => {
            let increments_per_turn = config.increments_per_turn.unwrap_or(INCREMENTS_PER_TURN);
            Quirk::AccelerationInRpmS { increments_per_turn }
        }
        Kind::InterpolationInMs => Quirk::InterpolationInMs,
        Kind::MissingObjects => Quirk::MissingObjects,
        Kind::PdosLockedInOperation => Quirk::PdosLockedInOperation,
        Kind::TwoBootUps => Quirk::TwoBootUps,
        Kind::SlowSave => Quirk::SlowSave { for_ns },
        Kind::SlowBrake => Quirk::SlowBrake { open_ns: or_0(config.open_s), close_ns: or_0(config.close_s) },
        Kind::NoBrake => Quirk::NoBrake,
        Kind::HomeOffsetSign => Quirk::HomeOffsetSign,
        Kind::LimitsFromZero => Quirk::LimitsFromZero,
        Kind::StoAtPowerOn => Quirk::StoAtPowerOn { for_ns: config.for_s.map(ns) },
        Kind::IncrementalEncoder => Quirk::IncrementalEncoder,
        Kind::SecondEncoder => {
            Quirk::SecondEncoder { limit_m: config.encoders_apart_m().unwrap_or(f64::INFINITY) }
        }
        Kind::FaultAtPowerOn => Quirk::FaultAtPowerOn { code: config.code.unwrap_or_default() },
        Kind::Restarts => Quirk::Restarts { after_ns: or_0(config.after_s) },
        Kind::IgnoresHeartbeat => Quirk::IgnoresHeartbeat,
        Kind::IgnoresProcessData => Quirk::IgnoresProcessData,
        Kind::LateWatchdog => Quirk::LateWatchdog { for_ns },
        Kind::CoastsWithoutMaster => Quirk::CoastsWithoutMaster,
        Kind::Creeps => Quirk::Creeps { speed_m_s: config.speed_m_s.unwrap_or_default() },
        // The node ids are given out before.
        Kind::SwappedIds => return Vec::new(),
        Kind::Shows => return of_objects(|object, value| Quirk::Shows { object, value }),
        Kind::Lacks => return of_objects(|object, _| Quirk::Lacks { object }),
    }]
}

/// A drive without a scale of its own counts as the scenario says.
const _: () = assert!(INCREMENTS_PER_TURN == masseter_drives::INCREMENTS_PER_TURN);

/// The memory of all drives and its file.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct MemoryFile {
    path: PathBuf,
    pub(super) drives: [DriveMemory; AXES],
    /// Whether the file does not have the present values.
    is_stale: bool,
}

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

    /// The refusal of a drive's values in the file.
    pub(super) fn refuse(&self, axis: usize, reason: &SettingsError) -> PlantError {
        refused(&self.path, &format!("{}: {reason}", AXIS_NAMES[axis]))
    }

    /// Takes what the drives have stored. Writes the file, unless the file has the present values, as a whole or not at all.
    pub(super) fn save(&mut self, drives: &mut [DriveNode]) -> Result<(), PlantError> {
        for (memory, drive) in self.drives.iter_mut().zip(drives) {
            if let Some(changed) = drive.changed_memory() {
                (*memory, self.is_stale) = (changed, true);
            }
        }
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
