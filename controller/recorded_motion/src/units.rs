//! The units of a recording's times, lengths and angles, by their names in files and in a scenario.

use std::fmt::{self, Display, Formatter};

use masseter_scenario::{AngleUnit, FileConfig, LengthUnit, TimeUnit};

/// A unit of a recording, by its key.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub enum Unit {
    /// Of times.
    #[serde(rename = "time_unit")]
    Time(TimeUnit),
    /// Of lengths.
    #[serde(rename = "length_unit")]
    Length(LengthUnit),
    /// Of three angles.
    #[serde(rename = "angle_unit")]
    Angle(AngleUnit),
}

/// What a unit is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Quantity {
    Time,
    Length,
    Angle,
}

/// Every unit with its size in s, mm or rad, its name in a scenario, and its other names in files.
const UNITS: [(Unit, f64, &[&str]); 9] = [
    (Unit::Time(TimeUnit::S), 1.0, &["s", "sec", "second", "seconds", "sek"]),
    (Unit::Time(TimeUnit::Ms), 1e-3, &["ms", "msec", "millisecond", "milliseconds"]),
    (Unit::Time(TimeUnit::Us), 1e-6, &["us", "µs", "μs", "microsecond", "microseconds"]),
    (Unit::Length(LengthUnit::Um), 1e-3, &["um", "µm", "μm", "micrometer", "micrometers"]),
    (Unit::Length(LengthUnit::Mm), 1.0, &["mm", "millimeter", "millimeters", "millimetre", "millimetres"]),
    (Unit::Length(LengthUnit::Cm), 10.0, &["cm", "centimeter", "centimeters", "centimetre", "centimetres"]),
    (Unit::Length(LengthUnit::M), 1000.0, &["m", "meter", "meters", "metre", "metres"]),
    (Unit::Angle(AngleUnit::Deg), std::f64::consts::PI / 180.0, &["deg", "degree", "degrees", "°"]),
    (Unit::Angle(AngleUnit::Rad), 1.0, &["rad", "radian", "radians"]),
];

impl Quantity {
    /// The key of its unit, and the valid values of the key.
    pub(super) fn key(self) -> (&'static str, &'static str) {
        match self {
            Self::Time => ("time_unit", "\"s\", \"ms\" or \"us\""),
            Self::Length => ("length_unit", "\"um\", \"mm\", \"cm\" or \"m\""),
            Self::Angle => ("angle_unit", "\"deg\" or \"rad\""),
        }
    }
}

impl Unit {
    /// The unit of that name.
    pub(super) fn of(word: &str) -> Option<Self> {
        let word = word.trim().to_lowercase();
        UNITS.iter().find(|(_, _, names)| names.contains(&word.as_str())).map(|(unit, ..)| *unit)
    }

    /// The units that the keys of a section set.
    pub(super) fn set_by(config: &FileConfig) -> impl Iterator<Item = Self> {
        let FileConfig { time_unit, length_unit, angle_unit, .. } = *config;
        [time_unit.map(Self::Time), length_unit.map(Self::Length), angle_unit.map(Self::Angle)]
            .into_iter()
            .flatten()
    }

    /// The section with this unit.
    pub fn applied(self, config: &FileConfig) -> FileConfig {
        let mut config = config.clone();
        match self {
            Self::Time(unit) => config.time_unit = Some(unit),
            Self::Length(unit) => config.length_unit = Some(unit),
            Self::Angle(unit) => config.angle_unit = Some(unit),
        }
        config
    }

    pub(super) fn quantity(self) -> Quantity {
        match self {
            Self::Time(_) => Quantity::Time,
            Self::Length(_) => Quantity::Length,
            Self::Angle(_) => Quantity::Angle,
        }
    }

    /// Its name, as in a scenario, and its size in s, mm or rad.
    pub(super) fn parts(self) -> (&'static str, f64) {
        let row = UNITS.iter().find(|(unit, ..)| *unit == self);
        row.map(|(_, size, names)| (names[0], *size)).expect("the table has every unit")
    }
}

/// The key and its value.
impl Display for Unit {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} = \"{}\"", self.quantity().key().0, self.parts().0)
    }
}
