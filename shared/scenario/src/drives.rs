//! The drives with their encoders, what the emulated ones do otherwise than the standard, and the scale of their numbers:
//! `[drives]`, `[[drives.quirk]]`.

use std::fmt::{self, Display, Formatter};
use std::path::PathBuf;

use masseter_model::geometry::{AXIS_NAMES, LEGS};
use masseter_model::section::Range;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::json;
use toml::Table;

use super::drive_profile::{AccelerationUnit, DriveProfile, ObjectKey, VelocityUnit};
use super::error::{
    Checked, LONGEST_S, ranges_of, require, require_axes, require_each, require_keys, require_range,
};

/// Increments of encoders: with a coarser one the drives are never as near to their targets as the following limit
/// asks, m.
const FINEST_M: f64 = 1e-12;
const COARSEST_M: f64 = 1e-5;
/// Most noise of an encoder, m.
const NOISIEST_M: f64 = 1e-3;
/// Increments of a turn of the motor, unless a quirk says otherwise: a spindle that moves the axis by 10 mm a turn, at
/// 1 µm an increment.
pub const INCREMENTS_PER_TURN: u32 = 10_000;
/// The distance of an axis' two encoders that is a fault by default, m: the jaw's limits are five times as wide.
const ENCODERS_APART_M: f64 = 1e-4;
/// The same in standard deviations of the noise and in increments, so that neither is a fault.
const ENCODERS_APART: f64 = 10.0;
/// The slowest save that is worth a test, and the slowest brake, s.
const SLOWEST_S: f64 = 60.0;

keys! {
    /// A servo drive with its encoder. Scales and limits hold for real ones too, gains and noise for emulated ones.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct DriveConfig {
        /// Force at 1000 ‰ of the torque objects (6077).
        pub rated_force_n: f64 => Positive,
        /// Force limit of the drive.
        pub max_force_n: f64 => Positive,
        /// Velocity limit of the drive; the master refuses commands beyond it.
        pub max_velocity_m_s: f64 => Positive,
        /// Acceleration beyond which the master refuses commands. The default motions take 1.3 m/s², and pose control up to
        /// 41 m/s² after stalls of the machine. Targets may stop at once and go on as before within twice the time-out of
        /// commands.
        pub max_acceleration_m_s2: f64 => Positive,
        /// Deceleration of the quick-stop ramp (6085). The drive's unit of acceleration is taken to be one increment of its
        /// position a second squared.
        pub quick_stop_deceleration_m_s2: f64 => Positive,
        /// Following error window (6065).
        #[doc(alias("position deviation", "contouring error", "lag error"))]
        pub following_error_m: f64 => Positive,
        /// Longest time outside the window (6066).
        #[doc(alias = "following error time out")]
        pub following_error_timeout_ms: u16,
        /// Gain of the position loop.
        pub position_gain_per_s: f64 => Positive,
        /// Gain of the velocity loop.
        pub velocity_gain_n_s_per_m: f64 => Positive,
        /// Integral time of the velocity loop.
        pub velocity_integral_time_s: f64 => Positive,
        /// One increment of the encoder.
        pub encoder_resolution_m: f64 => Within(FINEST_M, COARSEST_M) "a stroke's end must fit into 32 bits",
        /// Standard deviation of the encoder's noise.
        pub encoder_noise_m: f64 => Within(0.0, NOISIEST_M),
    }
}

impl DriveConfig {
    /// The increments of the encoder nearest to a length in m; also for m/s and m/s².
    pub fn increments(&self, metres: f64) -> f64 {
        (metres / self.encoder_resolution_m).round()
    }
}

keys! {
    /// The drives of slides and of legs; a key that a table does not have keeps its default.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct DrivesConfig {
        /// File with the non-volatile memory of the emulated drives: what 1010h has stored, and the serial numbers. It is
        /// read when the drives are switched on. Tools and `masseter plant --emulate` write it once a drive has saved; a
        /// run only reads it.
        pub memory: Option<PathBuf> => "a path, relative to the scenario's folder",
        /// Drives of d₁ d₂ d₃.
        #[serde(deserialize_with = "slide")]
        pub slide: DriveConfig,
        /// Drives of l₁ l₂ l₃.
        #[serde(deserialize_with = "leg")]
        pub leg: DriveConfig,
        /// What emulated drives do otherwise than the standard.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub quirk: Vec<QuirkConfig>,
    }
}

fn slide<'de, D: Deserializer<'de>>(table: D) -> Result<DriveConfig, D::Error> {
    over(DrivesConfig::default().slide, table)
}

fn leg<'de, D: Deserializer<'de>>(table: D) -> Result<DriveConfig, D::Error> {
    over(DrivesConfig::default().leg, table)
}

fn over<'de, D: Deserializer<'de>>(defaults: DriveConfig, given: D) -> Result<DriveConfig, D::Error> {
    let mut table = Table::try_from(defaults).map_err(Error::custom)?;
    table.extend(Table::deserialize(given)?);
    table.try_into().map_err(Error::custom)
}

impl Default for DrivesConfig {
    fn default() -> Self {
        let leg = DriveConfig {
            rated_force_n: 500.0,
            max_force_n: 1000.0,
            max_velocity_m_s: 0.4,
            max_acceleration_m_s2: 100.0,
            quick_stop_deceleration_m_s2: 10.0,
            following_error_m: 0.002,
            following_error_timeout_ms: 20,
            position_gain_per_s: 100.0,
            velocity_gain_n_s_per_m: 600.0,
            velocity_integral_time_s: 0.01,
            encoder_resolution_m: 1e-6,
            encoder_noise_m: 0.2e-6,
        };
        let slide = DriveConfig {
            rated_force_n: 250.0,
            max_force_n: 500.0,
            max_velocity_m_s: 0.2,
            velocity_gain_n_s_per_m: 2000.0,
            ..leg
        };
        Self { memory: None, slide, leg, quirk: Vec::new() }
    }
}

impl DrivesConfig {
    /// The drive of an axis.
    pub const fn of_axis(&self, axis: usize) -> DriveConfig {
        if axis < LEGS { self.slide } else { self.leg }
    }

    pub(super) fn validate(&self) -> Checked {
        self.slide.check_ranges(ranges_of("drives.slide"))?;
        self.leg.check_ranges(ranges_of("drives.leg"))?;
        require_each(&self.quirk, QuirkConfig::validate)?;
        require_each(&self.quirk, |quirk| self.check_second_encoder(quirk))
    }

    /// Refuses a limit that an encoder without a fault may exceed.
    fn check_second_encoder(&self, quirk: &QuirkConfig) -> Checked {
        let Some(limit_m) = quirk.encoders_apart_m() else { return Ok(()) };
        let drives = (0..AXIS_NAMES.len()).filter(|axis| quirk.is_on(*axis)).map(|axis| self.of_axis(axis));
        let uncertain_m = |drive: DriveConfig| drive.encoder_noise_m.max(drive.encoder_resolution_m);
        let least_m = ENCODERS_APART * drives.map(uncertain_m).fold(0.0, f64::max);
        let need = format!("use at least {least_m}: ten times the encoder's noise and its increment");
        require(limit_m >= least_m, "drives.quirk.limit_m", &limit_m, &need)
    }
}

/// The scales of one axis. Positions have the axis' sign; velocities and accelerations of profiles and limits have none.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AxisScale {
    /// d or l for an increment of 6064h, m: negative on an axis that counts the other way.
    pub increment_m: f64,
    /// A unit of velocity, m/s.
    pub velocity_m_s: f64,
    /// A unit of acceleration, m/s².
    pub acceleration_m_s2: f64,
    /// Force for 1 ‰ of the torque objects, N: negative like `increment_m`.
    pub permille_n: f64,
}

impl AxisScale {
    pub(crate) fn new(drive: &DriveConfig, profile: &DriveProfile, axis: usize) -> Self {
        let (length_m, sign) =
            (drive.encoder_resolution_m, if profile.is_reversed(axis) { -1.0 } else { 1.0 });
        // A profile that counts turns has a lead: it is refused otherwise.
        let rpm_m_s = profile.units.travel_per_turn_m().unwrap_or(length_m) / 60.0;
        Self {
            increment_m: sign * length_m,
            velocity_m_s: match profile.units.velocity {
                VelocityUnit::IncrementsS => length_m,
                VelocityUnit::TenthIncrementsS => length_m / 10.0,
                VelocityUnit::Rpm => rpm_m_s,
            },
            acceleration_m_s2: match profile.units.acceleration {
                AccelerationUnit::IncrementsS2 => length_m,
                AccelerationUnit::RpmPerS => rpm_m_s,
            },
            permille_n: sign * drive.rated_force_n / 1000.0,
        }
    }

    /// The increments nearest to d or l; out of their range the nearest of all.
    #[inline]
    pub fn increments(&self, position_m: f64) -> i32 {
        (position_m / self.increment_m).round() as i32
    }

    /// d or l at a number of increments, m.
    #[inline]
    pub fn metres(&self, increments: i32) -> f64 {
        f64::from(increments) * self.increment_m
    }

    /// A force in the direction of d or l, in ‰ of the rated force.
    #[inline]
    pub fn permille(&self, force_n: f64) -> i16 {
        (force_n / self.permille_n).round() as i16
    }

    /// A length without a sign, such as a window, in increments.
    #[inline]
    pub fn window(&self, length_m: f64) -> u32 {
        (length_m / self.increment_m.abs()).round() as u32
    }

    /// A velocity without a sign, in the drive's unit: at least 1.
    pub fn velocity(&self, velocity_m_s: f64) -> u32 {
        ((velocity_m_s / self.velocity_m_s).round() as u32).max(1)
    }

    /// An acceleration without a sign, in the drive's unit: at least 1.
    pub fn acceleration(&self, acceleration_m_s2: f64) -> u32 {
        ((acceleration_m_s2 / self.acceleration_m_s2).round() as u32).max(1)
    }
}

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

            /// The keys that it needs, and those that it may have as well, beside `kind` and `axes`.
            pub const fn keys(self) -> [&'static [&'static str]; 2] {
                match self { $(Self::$kind => [&[$(stringify!($need)),*], &[$($(stringify!($take)),*)?]]),* }
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
        /// Increments of a turn of the motor (608Fh, 6092h); by default 10000.
        pub increments_per_turn: Option<u32> => "above 0",
        /// Largest distance of the two encoders of an axis; by default 0.0001.
        pub limit_m: Option<f64> => Within(COARSEST_M, 0.1) "at least ten times the encoder's increment and its noise",
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

    /// Whether the drive of an axis has it.
    pub fn is_on(&self, axis: usize) -> bool {
        self.axes.as_ref().is_none_or(|axes| axes.iter().any(|name| name == AXIS_NAMES[axis]))
    }

    /// The distance of the two encoders that is a fault, m; none without a second one.
    pub fn encoders_apart_m(&self) -> Option<f64> {
        let is_second = self.kind == QuirkKindConfig::SecondEncoder;
        is_second.then(|| self.limit_m.unwrap_or(ENCODERS_APART_M))
    }

    fn validate(&self) -> Checked {
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
        let is_brake_timed = self.open_s.is_some() || self.close_s.is_some();
        let need = "give open_s, close_s or both";
        require(kind != QuirkKindConfig::SlowBrake || is_brake_timed, "drives.quirk.open_s", &"none", need)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Scenario, UnitsConfig};

    fn scale(units: UnitsConfig, reversed: &[&str]) -> AxisScale {
        let reversed = reversed.iter().map(|&name| name.to_owned()).collect();
        let profile = DriveProfile { reversed, units, ..DriveProfile::default() };
        Scenario { drive_profile: vec![profile], ..Scenario::default() }.scale(3)
    }

    /// 5 mm a turn, 2 µm an increment would be 2500 increments a turn; the default leg has 1 µm.
    #[test]
    fn an_acceleration_counts_in_the_unit_of_the_drive() {
        let units = UnitsConfig {
            acceleration: AccelerationUnit::RpmPerS,
            velocity: VelocityUnit::Rpm,
            gear_ratio: 2.0,
            lead_m: Some(0.006),
        };
        let turns = scale(units, &[]);
        // 3 mm a motor turn: 10 m/s² are 3333.3 turns/s², 200 000 rpm/s.
        assert_eq!((turns.acceleration(10.0), turns.velocity(0.03)), (200_000, 600));
        let increments = scale(UnitsConfig::default(), &[]);
        assert_eq!((increments.acceleration(10.0), increments.velocity(0.03)), (10_000_000, 30_000));
        let tenths = UnitsConfig { velocity: VelocityUnit::TenthIncrementsS, ..UnitsConfig::default() };
        assert_eq!(scale(tenths, &[]).velocity(0.03), 300_000);
    }

    #[test]
    fn a_reversed_axis_has_the_other_sign_and_the_same_windows() {
        let (ahead, back) = (scale(UnitsConfig::default(), &[]), scale(UnitsConfig::default(), &["l1"]));
        assert_eq!((ahead.increments(0.1), back.increments(0.1)), (100_000, -100_000));
        let is_near = |a: f64, b: f64| (a - b).abs() < 1e-15;
        assert!(is_near(ahead.metres(5), 5e-6) && is_near(back.metres(-5), 5e-6));
        assert_eq!((ahead.window(0.002), back.window(0.002)), (2000, 2000));
        assert!(is_near(ahead.permille_n, -back.permille_n));
        let force_n = 40.0 * ahead.permille_n;
        assert_eq!((ahead.permille(force_n), back.permille(force_n)), (40, -40));
    }

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
            ("kind = 'no_brake'\naxes = ['x']", "quirk.axes = 'x': name axes: d1"),
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
