//! What a drive does otherwise than the standard, from the scenario's quirks: in its dictionary, as a node, as an axis.

use masseter_can::canopen::CobId;
use masseter_runtime::clock::SECOND_NS;
use masseter_scenario::{INCREMENTS_PER_TURN, ObjectKey, QuirkConfig, QuirkKindConfig as Kind};

use super::dictionary::{Objects, Overlay, PDOS, RPM_PER_S, find, names};
use crate::error::PlantError;

/// Inhibit time of transmit PDOs as delivered: 1 ms.
const FACTORY_INHIBIT: u16 = 10;
/// CiA 402's generic PDOs after their first object, the controlword or the statusword: nothing, mode, position.
const GENERIC: [[Option<u32>; 2]; 3] =
    [[None, None], [Some(0x6060_0008), Some(0x6061_0008)], [Some(0x607A_0020), Some(0x6064_0020)]];
/// Most that 60C2h:01 takes where its limits are narrow.
const NARROW_PERIOD: u8 = 100;
/// Milliseconds in 60C2h:02.
const MILLISECONDS: i8 = -3;

/// What the node does otherwise.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NodeQuirks {
    /// Boot-up messages at a start.
    pub(crate) boot_ups: u8,
    /// Whether PDO parameters are closed in operational.
    pub(crate) locks_pdos: bool,
    /// How long saving takes, ns.
    pub(crate) save_ns: u64,
    /// The error that is present at power-on (603Fh).
    pub(crate) fault: Option<u16>,
    /// How long after power-on it restarts by itself, ns.
    pub(crate) restart_ns: Option<u64>,
}

/// What the axis does otherwise.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct AxisQuirks {
    /// Whether the position at home is the home offset instead of its negative.
    pub(crate) is_offset_inverted: bool,
    /// Whether the software limits count from zero instead of from home.
    pub(crate) are_limits_from_zero: bool,
    /// Whether the encoder counts from where it is at power-on.
    pub(crate) is_incremental: bool,
    /// How long after power-on the torque is safely off, ns.
    pub(crate) torque_off_ns: u64,
    /// How long the brake takes to open, ns.
    pub(crate) opening_ns: u64,
    /// How long the brake takes to close, ns; none without a brake.
    pub(crate) closing_ns: Option<u64>,
}

/// Everything that a drive does otherwise.
#[derive(Debug, Clone)]
pub(crate) struct Quirks {
    pub(crate) node: NodeQuirks,
    pub(crate) axis: AxisQuirks,
    pub(crate) overlay: Overlay,
    /// Those that change the dictionary.
    of_dictionary: Vec<QuirkConfig>,
}

impl Quirks {
    /// The quirks of one drive.
    ///
    /// # Errors
    /// [`PlantError::Scenario`] for an object that no emulated drive has.
    pub(crate) fn new<'a>(mut quirks: impl Iterator<Item = &'a QuirkConfig>) -> Result<Self, PlantError> {
        let node = NodeQuirks { boot_ups: 1, locks_pdos: false, save_ns: 0, fault: None, restart_ns: None };
        let axis = AxisQuirks { closing_ns: Some(0), ..AxisQuirks::default() };
        let mut all = Self { node, axis, overlay: Overlay::default(), of_dictionary: Vec::new() };
        quirks.try_for_each(|quirk| all.add(quirk))?;
        Ok(all)
    }

    fn add(&mut self, quirk: &QuirkConfig) -> Result<(), PlantError> {
        let ns = |time_s: Option<f64>| time_s.map(|time_s| (time_s * SECOND_NS as f64) as u64);
        let Self { node, axis, overlay, of_dictionary } = self;
        match quirk.kind {
            Kind::FactoryPdos | Kind::AccelerationInRpmS => of_dictionary.push(quirk.clone()),
            Kind::NarrowLimits => {
                overlay.limit(names::FOLLOWING_TIMEOUT_MS.place, 0, 0);
                overlay.limit(names::PERIOD_VALUE.place, 1, i64::from(NARROW_PERIOD));
                of_dictionary.push(quirk.clone());
            }
            Kind::InterpolationInMs => {
                overlay.lock(names::PERIOD_INDEX.place);
                of_dictionary.push(quirk.clone());
            }
            Kind::MissingObjects => {
                for index in [0x6007, 0x6066, 0x6085] {
                    overlay.hide(index);
                }
                of_dictionary.push(quirk.clone());
            }
            Kind::PdosLockedInOperation => node.locks_pdos = true,
            Kind::TwoBootUps => node.boot_ups = 2,
            Kind::SlowSave => node.save_ns = ns(quirk.for_s).unwrap_or(0),
            Kind::FaultAtPowerOn => node.fault = quirk.code,
            Kind::Restarts => node.restart_ns = ns(quirk.after_s),
            Kind::SlowBrake => {
                axis.opening_ns = ns(quirk.open_s).unwrap_or(0);
                axis.closing_ns = axis.closing_ns.and(Some(ns(quirk.close_s).unwrap_or(0)));
            }
            Kind::NoBrake => axis.closing_ns = None,
            Kind::HomeOffsetSign => axis.is_offset_inverted = true,
            Kind::LimitsFromZero => axis.are_limits_from_zero = true,
            Kind::StoAtPowerOn => axis.torque_off_ns = ns(quirk.for_s).unwrap_or(u64::MAX),
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
        Ok(())
    }

    /// Writes the units that the drive counts in into its dictionary: before quantities are written in them.
    pub(crate) fn set_units(&mut self, objects: &mut Objects) {
        let quirk = self.of_dictionary.iter().find(|quirk| quirk.kind == Kind::AccelerationInRpmS);
        let Some(quirk) = quirk else { return };
        let per_turn = quirk.increments_per_turn.unwrap_or(INCREMENTS_PER_TURN);
        objects.set(names::ACCELERATION_UNIT, RPM_PER_S);
        objects.set(names::INCREMENTS_PER_TURN, per_turn);
        objects.set(names::FEED_PER_TURN, per_turn);
        self.overlay.limit(names::ACCELERATION_UNIT.place, i64::from(RPM_PER_S), i64::from(RPM_PER_S));
    }

    /// Writes the values that the drive is delivered with into its dictionary.
    pub(crate) fn set_values(&self, period_ns: u64, objects: &mut Objects) {
        for quirk in &self.of_dictionary {
            match quirk.kind {
                Kind::FactoryPdos => set_factory_pdos(objects),
                Kind::NarrowLimits => {
                    objects.set(names::FOLLOWING_TIMEOUT_MS, 0);
                    objects.set(names::PERIOD_VALUE, objects.get(names::PERIOD_VALUE).min(NARROW_PERIOD));
                }
                Kind::InterpolationInMs => {
                    let period_ms = (period_ns as f64 * 1e-6).round().clamp(1.0, 255.0);
                    objects.set(names::PERIOD_VALUE, period_ms as u8);
                    objects.set(names::PERIOD_INDEX, MILLISECONDS);
                }
                Kind::MissingObjects => {
                    const CYCLIC_POSITION: u32 = 1 << 7;
                    objects
                        .set(names::SUPPORTED_MODES, objects.get(names::SUPPORTED_MODES) & !CYCLIC_POSITION);
                    objects.set(names::MODE, 1);
                }
                _ => {}
            }
        }
    }
}

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
