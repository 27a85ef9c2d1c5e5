//! Deviations of emulated drives from the standard: `[[drives.quirk]]`.
//!
//! The plant implements the quirks.

use std::fmt::{self, Display, Formatter};

use masseter_model::{geometry::AXIS_NAMES, section::Range};
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::drive_profile::ObjectKey;
use super::error::{Checked, LONGEST_S, ranges_of, require, require_axes, require_keys, require_range};

/// Increments of a turn of the motor without a quirk: a spindle with 10 mm a turn, at 1 µm an increment.
pub const INCREMENTS_PER_TURN: u32 = 10_000;
/// Default distance of an axis' two encoders at which the drive is in fault, m. The jaw's limits are five times as
/// wide.
const ENCODERS_APART_M: f64 = 1e-4;
/// The least valid distance of two encoders for a fault, m.
const LEAST_APART_M: f64 = 1e-5;
/// The fastest valid slip of a brake, m/s.
const FASTEST_M_S: f64 = 0.01;
/// The slowest valid save, and the slowest brake, s.
const SLOWEST_S: f64 = 60.0;

macro_rules! quirk_kinds {
    ($($(#[doc = $doc:literal])+ $kind:ident $name:literal [$($need:ident)*] $([$($take:ident)*])?;)*) => {
        /// What is different.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum QuirkKindConfig {
            $($(#[doc = $doc])+ #[serde(rename = $name)] $kind,)*
        }

        impl QuirkKindConfig {
            /// Every kind.
            pub const ALL: &'static [Self] = &[$(Self::$kind),*];

            /// Its name in scenarios.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$kind => $name),* }
            }

            /// The required and the optional keys, beside `kind` and `axes`.
            pub const fn keys(self) -> [&'static [&'static str]; 2] {
                match self { $(Self::$kind => [&[$(stringify!($need)),*], &[$($(stringify!($take)),*)?]]),* }
            }

            /// Its effect.
            pub const fn about(self) -> &'static str {
                match self { $(Self::$kind => concat!($($doc),+).trim_ascii_start()),* }
            }
        }
    };
}

quirk_kinds! {
    /// The PDOs are as delivered: 6040h alone in RPDO1, 6041h alone in TPDO1, transmission types 255, inhibit times 10.
    FactoryPdos "factory_pdos" [];
    /// 6066h takes 0 alone, and 60C2h:01 takes 1 to 100.
    NarrowLimits "narrow_limits" [];
    /// 6083h, 6084h, 6085h and 609Ah count in rpm/s; 60AAh says so and takes no other unit.
    AccelerationInRpmS "acceleration_in_rpm_s" [] [increments_per_turn];
    /// 60C2h:02 is −3 and cannot be written, so that 60C2h:01 counts in ms.
    InterpolationInMs "interpolation_in_ms" [];
    /// The drive has no 6007h, 6066h and 6085h, and no cyclic synchronous position in 6502h.
    MissingObjects "missing_objects" [];
    /// PDO parameters cannot be written in operational: 08000022h.
    PdosLockedInOperation "pdos_locked_in_operation" [];
    /// The boot loader sends a boot-up message of its own before the drive's.
    TwoBootUps "two_boot_ups" [];
    /// Saving takes `for_s`; 1010h:01 reads 0 until then, and a reset before then loses the values.
    SlowSave "slow_save" [for_s];
    /// The brake opens and closes late; targets count once it is open.
    SlowBrake "slow_brake" [] [open_s close_s];
    /// The axis has no brake: without power it coasts, and a leg falls.
    NoBrake "no_brake" [];
    /// The position at home is the home offset (607Ch) instead of its negative.
    HomeOffsetSign "home_offset_sign" [];
    /// The software limits (607Dh) count from zero instead of from the home position.
    LimitsFromZero "limits_from_zero" [];
    /// Safe torque off is active at power-on, for `for_s` or for ever: the drive stays in "switch on disabled".
    StoAtPowerOn "sto_at_power_on" [] [for_s];
    /// The encoder is incremental: 6064h is 0 at power-on, wherever the axis stands.
    IncrementalEncoder "incremental_encoder" [];
    /// A second encoder sits at the joint; the drive is in fault (7320h) once both are more than `limit_m` apart.
    SecondEncoder "second_encoder" [] [limit_m];
    /// The drive is in fault at power-on, with `code` in 603Fh, until it is reset.
    FaultAtPowerOn "fault_at_power_on" [code];
    /// The drive restarts by itself once, `after_s` after power-on.
    Restarts "restarts" [after_s];
    /// The drive goes on without the master's heartbeat, though it shows 1016h.
    IgnoresHeartbeat "ignores_heartbeat" [];
    /// The drive goes on without process data, though it shows 1400h:05.
    IgnoresProcessData "ignores_process_data" [];
    /// Heartbeat and process data count as lost only `for_s` after their time.
    LateWatchdog "late_watchdog" [for_s];
    /// A lost master takes the current away at once, and the brake stays open: the axis coasts, and a leg falls.
    CoastsWithoutMaster "coasts_without_master" [];
    /// The brake slips: without power the axis creeps towards larger positions at `speed_m_s`.
    Creeps "creeps" [speed_m_s];
    /// The drives of two `axes` have each other's node id.
    SwappedIds "swapped_ids" [];
    /// SDO shows `value` in each of `objects`; writes are acknowledged, and change nothing.
    Shows "shows" [objects value];
    /// The drive has none of `objects`.
    Lacks "lacks" [objects];
}

impl Display for QuirkKindConfig {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

keys! {
    /// A quirk of some drives.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct QuirkConfig {
        /// What is different.
        pub kind: QuirkKindConfig => "as above",
        /// The axes whose drives have it; by default all.
        pub axes: Option<Vec<String>> => "`d1` to `l3`, at least one",
        /// How long it lasts.
        pub for_s: Option<f64> => Within(0.0, LONGEST_S) "at most 60 of `slow_save`",
        /// Time from power-on to the restart.
        pub after_s: Option<f64> => Within(0.0, LONGEST_S),
        /// From "operation enabled" until the brake is open; by default 0.
        pub open_s: Option<f64> => Within(0.0, SLOWEST_S) "this or `close_s` is required",
        /// From the loss of current until the brake is closed; by default 0.
        pub close_s: Option<f64> => Within(0.0, SLOWEST_S),
        /// Speed of an axis without power.
        pub speed_m_s: Option<f64> => Within(0.0, FASTEST_M_S),
        /// Increments of a turn of the motor (608Fh, 6092h); by default 10000.
        pub increments_per_turn: Option<u32> => "above 0",
        /// Largest distance of the two encoders of an axis; by default 0.0001.
        pub limit_m: Option<f64> => Within(LEAST_APART_M, 0.1) "at least ten times the encoder's increment and its noise",
        /// Error code (603Fh).
        pub code: Option<u16> => "1 to 0xFFFF",
        /// The objects that it is about.
        pub objects: Option<Vec<ObjectKey>> => "such as `[\"6065h\", \"60C2h:01\"]`, at least one",
        /// What they show, of which each has its lowest bytes.
        pub value: Option<u32> => "0 to 0xFFFFFFFF",
    }
}

impl QuirkConfig {
    /// A quirk of all drives, without values.
    pub fn new(kind: QuirkKindConfig) -> Self {
        serde_json::from_value(json!({ "kind": kind })).expect("a kind alone is a quirk")
    }

    /// Whether the drive of an axis has the quirk.
    pub fn is_on(&self, axis: usize) -> bool {
        self.axes.as_ref().is_none_or(|axes| axes.iter().any(|name| name == AXIS_NAMES[axis]))
    }

    /// The distance of the two encoders at which the drive is in fault, m; none without a second encoder.
    pub fn encoders_apart_m(&self) -> Option<f64> {
        let is_second = self.kind == QuirkKindConfig::SecondEncoder;
        is_second.then(|| self.limit_m.unwrap_or(ENCODERS_APART_M))
    }

    pub(super) fn validate(&self) -> Checked {
        self.require_keys()?;
        let Self { kind, axes, for_s, objects, .. } = self;
        require_axes("drives.quirk.axes", axes.as_deref().unwrap_or_default())?;
        let is_empty = axes.as_ref().is_some_and(Vec::is_empty);
        let need = "name at least one axis, or leave it away for all";
        require(!is_empty, "drives.quirk.axes", &"[]", need)?;
        let is_empty = objects.as_ref().is_some_and(Vec::is_empty);
        require(!is_empty, "drives.quirk.objects", &"[]", "name at least one object, such as '6065h'")?;
        let is_turn = self.increments_per_turn != Some(0);
        require(is_turn, "drives.quirk.increments_per_turn", &0, "use at least 1")?;
        let need = "use an error code of CiA 402: 0 is no error";
        require(self.code != Some(0), "drives.quirk.code", &0, need)?;
        self.check_ranges(ranges_of("drives.quirk"))?;
        let save_s = for_s.filter(|_| *kind == QuirkKindConfig::SlowSave);
        save_s.map_or(Ok(()), |save_s| {
            require_range("drives.quirk.for_s", Range::Within(0.0, SLOWEST_S), save_s)
        })
    }

    /// Refuses keys that have no effect on this kind, and requires those that it needs.
    fn require_keys(&self) -> Checked {
        let kind = self.kind;
        let of_any = |key: &&str| QuirkKindConfig::ALL.iter().any(|kind| kind.keys().concat().contains(key));
        let keys = Self::KEYS.iter().map(|key| key.name).filter(of_any);
        let need_of = |_: &str| format!("give it: {}", kind.about());
        require_keys(kind.name(), kind.keys(), keys, [self, &Self::new(kind)], need_of)
            .map_err(|refusal| refusal.in_table("drives.quirk"))?;
        let is_pair = matches!(self.axes.as_deref(), Some([one, other]) if one != other);
        let need = "name the two axes whose drives have each other's node id";
        require(kind != QuirkKindConfig::SwappedIds || is_pair, "drives.quirk.axes", &"no pair", need)?;
        let is_brake_timed = self.open_s.is_some() || self.close_s.is_some();
        let need = "give open_s, close_s or both";
        require(kind != QuirkKindConfig::SlowBrake || is_brake_timed, "drives.quirk.open_s", &"none", need)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scenario;

    fn refusal(text: &str) -> Option<String> {
        let text = format!("[[drives.quirk]]\n{text}");
        let scenario = Scenario::parse(std::path::Path::new("s.toml"), &text);
        scenario.and_then(|scenario| scenario.validate()).err().map(|error| error.to_string())
    }

    #[test]
    fn every_kind_is_read_by_its_name_with_its_keys() {
        for kind in QuirkKindConfig::ALL {
            let values = kind.keys().concat().into_iter().map(|key| match key {
                "increments_per_turn" => "increments_per_turn = 4096\n".to_owned(),
                "code" => "code = 0x7305\n".to_owned(),
                "objects" => "objects = ['60C2h:01']\n".to_owned(),
                "value" => "value = 1\n".to_owned(),
                "limit_m" => "limit_m = 0.001\n".to_owned(),
                "speed_m_s" => "speed_m_s = 5e-5\n".to_owned(),
                time => format!("{time} = 0.5\n"),
            });
            let axes = if *kind == QuirkKindConfig::SwappedIds { "'l2', 'l3'" } else { "'l2'" };
            let text = format!("kind = '{kind}'\naxes = [{axes}]\n{}", values.collect::<String>());
            assert_eq!(refusal(&text), None, "{text}");
            assert!(kind.about().ends_with('.'), "{kind}");
        }
    }

    #[test]
    fn a_quirk_is_refused_with_the_key_and_what_to_do() {
        let table = [
            ("kind = 'two_boot_ups'\nfor_s = 1.0", "quirk.for_s = given: leave it away"),
            ("kind = 'slow_save'", "quirk.for_s = none: give it"),
            ("kind = 'slow_save'\nfor_s = 61.0", "quirk.for_s = 61: use 0 to 60"),
            ("kind = 'slow_brake'", "quirk.open_s = none: give open_s, close_s or both"),
            ("kind = 'no_brake'\naxes = ['x']", "quirk.axes = 'x': name axes: d1"),
            ("kind = 'swapped_ids'\naxes = ['l1']", "quirk.axes = no pair: name the two axes"),
            ("kind = 'creeps'\nspeed_m_s = 0.02", "quirk.speed_m_s = 0.02: use 0 to 0.01"),
            ("kind = 'no_brake'\naxes = []", "quirk.axes = []: name at least one"),
            ("kind = 'fault_at_power_on'\ncode = 0", "quirk.code = 0: use an error code"),
            ("kind = 'acceleration_in_rpm_s'\nincrements_per_turn = 0", "use at least 1"),
            ("kind = 'second_encoder'\nlimit_m = 0.2", "quirk.limit_m = 0.2: use 0.00001 to 0.1"),
            (
                "kind = 'second_encoder'\n[drives.leg]\nencoder_noise_m = 2e-5",
                "quirk.limit_m = 0.0001: use at least 0.0002",
            ),
            ("kind = 'slow_saves'\nfor_s = 1.0", "did you mean 'slow_save'?"),
            ("kind = 'shows'\nobjects = ['6065h']", "quirk.value = none: give it"),
            ("kind = 'lacks'\nobjects = []", "quirk.objects = []: name at least one"),
        ];
        for (text, expected) in table {
            let refusal = refusal(text).unwrap_or_else(|| panic!("{text} is accepted"));
            assert!(refusal.contains(expected), "{refusal}");
        }
    }

    #[test]
    fn a_quirk_without_axes_is_on_every_one() {
        let mut quirk = QuirkConfig::new(QuirkKindConfig::NoBrake);
        assert!((0..6).all(|axis| quirk.is_on(axis)));
        quirk.axes = Some(vec!["l2".to_owned()]);
        assert!((0..6).all(|axis| quirk.is_on(axis) == (axis == 4)));
    }
}
