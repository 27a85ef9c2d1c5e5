//! Differences of the emulated drives from the standard, as drives of vendors have them at first contact:
//! `[[drives.quirk]]`.

use std::fmt::{self, Display, Formatter};

use masseter_model::geometry::AXIS_NAMES;
use serde::{Deserialize, Serialize};

use super::drive_profile::ObjectKey;
use super::error::ScenarioError;
use super::need::{LONGEST_S, require_within};

/// Increments of a turn of the motor, unless a quirk says otherwise: a spindle that moves the axis by 10 mm a turn, at
/// 1 µm an increment.
pub const INCREMENTS_PER_TURN: u32 = 10_000;
/// The slowest save that is worth a test, and the slowest brake, s.
const SLOWEST_S: f64 = 60.0;

macro_rules! quirk_kinds {
    ($($(#[doc = $doc:literal])+ $kind:ident $name:literal [$($key:literal),*];)*) => {
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

            /// The keys that have an effect on it, beside `kind` and `axes`.
            pub const fn keys(self) -> &'static [&'static str] {
                match self { $(Self::$kind => &[$($key),*]),* }
            }

            /// What it does.
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
    AccelerationInRpmS "acceleration_in_rpm_s" ["increments_per_turn"];
    /// 60C2h:02 is −3 and cannot be written, so that 60C2h:01 counts in ms.
    InterpolationInMs "interpolation_in_ms" [];
    /// The drive has no 6007h, 6066h and 6085h, and no cyclic synchronous position in 6502h.
    MissingObjects "missing_objects" [];
    /// PDO parameters cannot be written in operational: 08000022h.
    PdosLockedInOperation "pdos_locked_in_operation" [];
    /// The boot loader sends a boot-up message of its own before the drive's.
    TwoBootUps "two_boot_ups" [];
    /// Saving takes `for_s`; 1010h:01 reads 0 until then, and a reset before then loses the values.
    SlowSave "slow_save" ["for_s"];
    /// The brake opens and closes late; targets count once it is open.
    SlowBrake "slow_brake" ["open_s", "close_s"];
    /// The axis has no brake: without power it coasts, and a leg falls.
    NoBrake "no_brake" [];
    /// The position at home is the home offset (607Ch) instead of its negative.
    HomeOffsetSign "home_offset_sign" [];
    /// The software limits (607Dh) count from zero instead of from the home position.
    LimitsFromZero "limits_from_zero" [];
    /// Safe torque off is active at power-on, for `for_s` or for ever: the drive stays in "switch on disabled".
    StoAtPowerOn "sto_at_power_on" ["for_s"];
    /// The encoder is incremental: 6064h is 0 at power-on, wherever the axis stands.
    IncrementalEncoder "incremental_encoder" [];
    /// The drive is in fault at power-on, with `code` in 603Fh, until it is reset.
    FaultAtPowerOn "fault_at_power_on" ["code"];
    /// The drive restarts by itself once, `after_s` after power-on.
    Restarts "restarts" ["after_s"];
    /// SDO shows `value` in each of `objects`; writes are acknowledged, and change nothing.
    Shows "shows" ["objects", "value"];
    /// The drive has none of `objects`.
    Lacks "lacks" ["objects"];
}

impl Display for QuirkKindConfig {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A quirk of some drives.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QuirkConfig {
    /// What is different.
    pub kind: QuirkKindConfig,
    /// The axes whose drives have it, d1 to l3; all when absent.
    pub axes: Option<Vec<String>>,
    /// How long it lasts, s.
    pub for_s: Option<f64>,
    /// How long after power-on it happens, s.
    pub after_s: Option<f64>,
    /// How long the brake takes to open, s; 0 when absent.
    pub open_s: Option<f64>,
    /// How long the brake takes to close, s; 0 when absent.
    pub close_s: Option<f64>,
    /// Increments of a turn of the motor; [`INCREMENTS_PER_TURN`] when absent.
    pub increments_per_turn: Option<u32>,
    /// Error code (603Fh).
    pub code: Option<u16>,
    /// The objects that it is about.
    pub objects: Option<Vec<ObjectKey>>,
    /// What they show.
    pub value: Option<u32>,
}

impl QuirkConfig {
    /// A quirk of all drives, without values.
    pub const fn new(kind: QuirkKindConfig) -> Self {
        Self {
            kind,
            axes: None,
            for_s: None,
            after_s: None,
            open_s: None,
            close_s: None,
            increments_per_turn: None,
            code: None,
            objects: None,
            value: None,
        }
    }

    /// Whether the drive of an axis has it.
    pub fn is_on(&self, axis: usize) -> bool {
        self.axes.as_ref().is_none_or(|axes| axes.iter().any(|name| name == AXIS_NAMES[axis]))
    }

    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        use QuirkKindConfig::{FaultAtPowerOn, Lacks, Restarts, Shows, SlowBrake, SlowSave};
        let Self { kind, axes, for_s, after_s, open_s, close_s, increments_per_turn, code, objects, value } =
            self;
        let bad = |key, value: &dyn Display, need: &str| Err(ScenarioError::bad(key, value, need));
        let given = [
            ("drives.quirk.for_s", "for_s", for_s.is_some(), *kind == SlowSave),
            ("drives.quirk.after_s", "after_s", after_s.is_some(), *kind == Restarts),
            ("drives.quirk.open_s", "open_s", open_s.is_some(), false),
            ("drives.quirk.close_s", "close_s", close_s.is_some(), false),
            ("drives.quirk.increments_per_turn", "increments_per_turn", increments_per_turn.is_some(), false),
            ("drives.quirk.code", "code", code.is_some(), *kind == FaultAtPowerOn),
            ("drives.quirk.objects", "objects", objects.is_some(), matches!(kind, Shows | Lacks)),
            ("drives.quirk.value", "value", value.is_some(), *kind == Shows),
        ];
        for (whole, key, is_given, is_needed) in given {
            if is_given && !kind.keys().contains(&key) {
                let need = format!("leave it away: it has no effect on {kind}");
                return bad(whole, &"given", &need);
            }
            if is_needed && !is_given {
                return bad(whole, &"none", &format!("give it: {}", kind.about()));
            }
        }
        if *kind == SlowBrake && open_s.is_none() && close_s.is_none() {
            return bad("drives.quirk.open_s", &"none", "give open_s, close_s or both");
        }
        let unknown = axes.iter().flatten().find(|name| !AXIS_NAMES.contains(&name.as_str()));
        if let Some(name) = unknown {
            return bad("drives.quirk.axes", name, &format!("name axes: {}", AXIS_NAMES.join(", ")));
        }
        if axes.as_ref().is_some_and(Vec::is_empty) {
            return bad("drives.quirk.axes", &"[]", "name at least one axis, or leave it away for all");
        }
        if objects.as_ref().is_some_and(Vec::is_empty) {
            return bad("drives.quirk.objects", &"[]", "name at least one object, such as '6065h'");
        }
        if *increments_per_turn == Some(0) {
            return bad("drives.quirk.increments_per_turn", &0, "use at least 1");
        }
        if *code == Some(0) {
            return bad("drives.quirk.code", &0, "use an error code of CiA 402: 0 is no error");
        }
        let times = [
            ("drives.quirk.for_s", *for_s, if *kind == SlowSave { SLOWEST_S } else { LONGEST_S }),
            ("drives.quirk.after_s", *after_s, LONGEST_S),
            ("drives.quirk.open_s", *open_s, SLOWEST_S),
            ("drives.quirk.close_s", *close_s, SLOWEST_S),
        ];
        times.into_iter().try_for_each(|(key, time_s, most_s)| match time_s {
            Some(time_s) => require_within(&[(key, time_s, 0.0, most_s)]),
            None => Ok(()),
        })
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
            let values = kind.keys().iter().map(|key| match *key {
                "increments_per_turn" => "increments_per_turn = 4096\n".to_owned(),
                "code" => "code = 0x7305\n".to_owned(),
                "objects" => "objects = ['60C2h:01']\n".to_owned(),
                "value" => "value = 1\n".to_owned(),
                time => format!("{time} = 0.5\n"),
            });
            let text = format!("kind = '{kind}'\naxes = ['l2']\n{}", values.collect::<String>());
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
            ("kind = 'no_brake'\naxes = ['x']", "quirk.axes = x: name axes: d1"),
            ("kind = 'no_brake'\naxes = []", "quirk.axes = []: name at least one"),
            ("kind = 'fault_at_power_on'\ncode = 0", "quirk.code = 0: use an error code"),
            ("kind = 'acceleration_in_rpm_s'\nincrements_per_turn = 0", "use at least 1"),
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
