//! Numbers with units in the users' notation: `"50 um"`, `"0.2 N"`, `3`.
//!
//! The values are SI inside. No prefixes are derived: [`UNITS`] lists every valid unit.

use std::fmt::{self, Display, Formatter};
use std::str::FromStr;

use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::input::excerpt;
use crate::wording::{listed, question, shortest};

/// The kind of a quantity. Values of different kinds cannot be compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dimension {
    /// A number without a unit, or a share.
    One,
    /// Metres.
    Length,
    /// Metres per second.
    Velocity,
    /// Metres per second squared.
    Acceleration,
    /// Newtons.
    Force,
    /// Seconds.
    Time,
    /// Radians.
    Angle,
    /// Radians per second.
    AngularVelocity,
    /// Kilograms.
    Mass,
    /// Watts.
    Power,
    /// Joules.
    Energy,
    /// Square metres.
    Area,
    /// Pascals.
    Pressure,
}

/// A unit: its name, its kind, and its size in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// The users' notation.
    pub name: &'static str,
    /// What it measures.
    pub dimension: Dimension,
    /// Its size, in SI units.
    pub si: f64,
}

/// Radians in a degree.
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Every unit. The first of a kind is its SI unit.
pub const UNITS: [Unit; 34] = {
    use Dimension as D;
    const fn unit(name: &'static str, dimension: Dimension, si: f64) -> Unit {
        Unit { name, dimension, si }
    }
    [
        Unit::ONE,
        Unit::PERCENT,
        unit("m", D::Length, 1.0),
        Unit::MM,
        Unit::UM,
        unit("µm", D::Length, 1e-6),
        unit("nm", D::Length, 1e-9),
        unit("m/s", D::Velocity, 1.0),
        Unit::MM_S,
        unit("um/s", D::Velocity, 1e-6),
        unit("m/s2", D::Acceleration, 1.0),
        unit("mm/s2", D::Acceleration, 1e-3),
        Unit::N,
        unit("mN", D::Force, 1e-3),
        unit("kN", D::Force, 1e3),
        Unit::S,
        Unit::MS,
        Unit::US,
        unit("µs", D::Time, 1e-6),
        unit("ns", D::Time, 1e-9),
        unit("rad", D::Angle, 1.0),
        unit("mrad", D::Angle, 1e-3),
        Unit::DEG,
        unit("°", D::Angle, DEGREE),
        unit("rad/s", D::AngularVelocity, 1.0),
        unit("deg/s", D::AngularVelocity, DEGREE),
        unit("kg", D::Mass, 1.0),
        unit("g", D::Mass, 1e-3),
        unit("W", D::Power, 1.0),
        Unit::J,
        unit("m2", D::Area, 1.0),
        Unit::MM2,
        unit("Pa", D::Pressure, 1.0),
        Unit::MPA,
    ]
};

impl Unit {
    /// A number.
    pub const ONE: Self = Self { name: "", dimension: Dimension::One, si: 1.0 };
    /// A share in hundredths.
    pub const PERCENT: Self = Self { name: "%", dimension: Dimension::One, si: 0.01 };
    /// Millimetres.
    pub const MM: Self = Self { name: "mm", dimension: Dimension::Length, si: 1e-3 };
    /// Millimetres per second.
    pub const MM_S: Self = Self { name: "mm/s", dimension: Dimension::Velocity, si: 1e-3 };
    /// Micrometres.
    pub const UM: Self = Self { name: "um", dimension: Dimension::Length, si: 1e-6 };
    /// Newtons.
    pub const N: Self = Self { name: "N", dimension: Dimension::Force, si: 1.0 };
    /// Seconds.
    pub const S: Self = Self { name: "s", dimension: Dimension::Time, si: 1.0 };
    /// Milliseconds.
    pub const MS: Self = Self { name: "ms", dimension: Dimension::Time, si: 1e-3 };
    /// Microseconds.
    pub const US: Self = Self { name: "us", dimension: Dimension::Time, si: 1e-6 };
    /// Joules.
    pub const J: Self = Self { name: "J", dimension: Dimension::Energy, si: 1.0 };
    /// Square millimetres.
    pub const MM2: Self = Self { name: "mm2", dimension: Dimension::Area, si: 1e-6 };
    /// Megapascals.
    pub const MPA: Self = Self { name: "MPa", dimension: Dimension::Pressure, si: 1e6 };
    /// Degrees.
    pub const DEG: Self = Self { name: "deg", dimension: Dimension::Angle, si: DEGREE };

    /// The unit of that name.
    pub fn named(name: &str) -> Option<Self> {
        UNITS.into_iter().find(|unit| unit.name == name)
    }

    /// A value given in SI units, with this unit.
    pub fn text(self, si: f64) -> String {
        let separator = if self.name.is_empty() || self.name == "°" { "" } else { " " };
        format!("{}{separator}{}", significant(si / self.si), self.name)
    }
}

/// Four significant digits: enough for a comparison, and easy to read.
fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let digits = (3 - value.abs().log10().floor() as i32).max(0) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

impl Dimension {
    /// Its powers of metre, kilogram and second. As in SI, an angle is a number.
    pub const fn exponents(self) -> [i8; 3] {
        match self {
            Self::One | Self::Angle => [0; 3],
            Self::Length => [1, 0, 0],
            Self::Velocity => [1, 0, -1],
            Self::Acceleration => [1, 0, -2],
            Self::Force => [1, 1, -2],
            Self::Time => [0, 0, 1],
            Self::AngularVelocity => [0, 0, -1],
            Self::Mass => [0, 1, 0],
            Self::Power => [2, 1, -3],
            Self::Energy => [2, 1, -2],
            Self::Area => [2, 0, 0],
            Self::Pressure => [-1, 1, -2],
        }
    }

    /// Its SI unit.
    pub fn si_unit(self) -> Unit {
        UNITS.into_iter().find(|unit| unit.dimension == self).expect("every kind has a unit")
    }

    /// The names of its units, for messages.
    pub fn unit_names(self) -> String {
        let names = UNITS.into_iter().filter(|unit| unit.dimension == self && !unit.name.is_empty());
        listed(names.map(|unit| unit.name))
    }
}

/// A value with its unit. Reading and writing keep the user's notation.
///
/// ```
/// use masseter_scenario::{Dimension, Quantity};
///
/// let limit: Quantity = "2 mm".parse()?;
/// assert_eq!((limit.si(), limit.unit().dimension), (0.002, Dimension::Length));
/// assert_eq!("50 furlong".parse::<Quantity>().unwrap_err().to_string(), "'50 furlong': the unit 'furlong' is unknown");
/// # Ok::<(), masseter_scenario::QuantityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    number: f64,
    unit: Unit,
}

/// Text that is no quantity.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("'{text}': {reason}")]
pub struct QuantityError {
    text: String,
    reason: String,
}

impl Quantity {
    /// A number of a unit.
    pub const fn new(number: f64, unit: Unit) -> Self {
        Self { number, unit }
    }

    /// The value in SI units.
    pub fn si(&self) -> f64 {
        self.number * self.unit.si
    }

    /// The given unit.
    pub fn unit(&self) -> Unit {
        self.unit
    }

    /// The value in SI units, if it has this dimension.
    ///
    /// # Errors
    /// A sentence with the remedy.
    pub fn si_of(&self, dimension: Dimension) -> Result<f64, String> {
        if self.unit.dimension == dimension {
            return Ok(self.si());
        }
        Err(match dimension {
            Dimension::One => "give a number without a unit, or %".to_owned(),
            _ => format!("give a number with one of the units {}", dimension.unit_names()),
        })
    }
}

impl FromStr for Quantity {
    type Err = QuantityError;

    fn from_str(text: &str) -> Result<Self, QuantityError> {
        let refused = |reason: String| QuantityError { text: excerpt(text), reason };
        let trimmed = text.trim();
        let is_of_number = |(place, c): (usize, char)| {
            c.is_ascii_digit() || "+-.".contains(c) || is_exponent(trimmed, place)
        };
        let end = trimmed.char_indices().find(|&at| !is_of_number(at)).map_or(trimmed.len(), |(at, _)| at);
        let (number, unit) = trimmed.split_at(end);
        let number = number.parse::<f64>().ok().filter(|number| number.is_finite());
        let number =
            number.ok_or_else(|| refused("write a number and its unit, such as \"50 um\"".to_owned()))?;
        // The Greek letter and the micro sign look alike.
        let name = &unit.trim().replace('μ', "µ");
        let unit = Unit::named(name).ok_or_else(|| {
            let question = question(name, UNITS.iter().map(|unit| unit.name));
            refused(format!("the unit '{}' is unknown{question}", excerpt(name)))
        })?;
        if !(number * unit.si).is_finite() {
            return Err(refused("the number is too large".to_owned()));
        }
        Ok(Self { number, unit })
    }
}

/// Whether the letter at that place begins an exponent, as in `1e-6`.
fn is_exponent(text: &str, place: usize) -> bool {
    let bytes = text.as_bytes();
    matches!(bytes[place], b'e' | b'E')
        && bytes.get(place + 1).is_some_and(|next| next.is_ascii_digit() || matches!(next, b'+' | b'-'))
}

impl Display for Quantity {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&shortest(self.number))?;
        if self.unit.name.is_empty() { Ok(()) } else { write!(f, " {}", self.unit.name) }
    }
}

impl Serialize for Quantity {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.unit.name.is_empty() {
            serializer.serialize_f64(self.number)
        } else {
            serializer.collect_str(self)
        }
    }
}

impl<'de> Deserialize<'de> for Quantity {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Given;

        impl Visitor<'_> for Given {
            type Value = Quantity;

            fn expecting(&self, f: &mut Formatter<'_>) -> fmt::Result {
                f.write_str("a number with its unit, such as \"50 um\"")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Quantity, E> {
                text.parse().map_err(E::custom)
            }

            fn visit_f64<E: Error>(self, number: f64) -> Result<Quantity, E> {
                let quantity = Quantity::new(number, Unit::ONE);
                if number.is_finite() { Ok(quantity) } else { Err(E::custom("use a finite number")) }
            }

            fn visit_i64<E: Error>(self, number: i64) -> Result<Quantity, E> {
                self.visit_f64(number as f64)
            }
        }
        deserializer.deserialize_any(Given)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantity_is_a_number_and_a_unit() {
        for (text, si, dimension) in [
            ("50 um", 50e-6, Dimension::Length),
            ("50um", 50e-6, Dimension::Length),
            ("-1.5e-1 mm/s", -1.5e-4, Dimension::Velocity),
            ("180 deg", std::f64::consts::PI, Dimension::Angle),
            ("20 %", 0.2, Dimension::One),
            ("3", 3.0, Dimension::One),
            ("2e3 N", 2000.0, Dimension::Force),
        ] {
            let quantity: Quantity = text.parse().unwrap();
            assert!((quantity.si() - si).abs() <= 1e-15 * si.abs().max(1.0), "{text}: {quantity:?}");
            assert_eq!(quantity.unit().dimension, dimension, "{text}");
        }
    }

    #[test]
    fn what_is_none_is_refused_with_a_question() {
        for (text, message) in [
            ("um", "'um': write a number and its unit, such as \"50 um\""),
            ("", "'': write a number and its unit, such as \"50 um\""),
            ("1.2.3 m", "'1.2.3 m': write a number and its unit, such as \"50 um\""),
            ("3 mms", "'3 mms': the unit 'mms' is unknown; did you mean 'mm"),
        ] {
            assert!(text.parse::<Quantity>().unwrap_err().to_string().starts_with(message), "{text}");
        }
        let length: Quantity = "1 mm".parse().unwrap();
        assert_eq!(
            length.si_of(Dimension::Force).unwrap_err(),
            "give a number with one of the units N, mN, kN"
        );
    }

    #[test]
    fn it_is_written_back_as_it_was_given() {
        #[derive(Debug, PartialEq, Serialize, Deserialize)]
        struct Table {
            max: Quantity,
        }
        for text in ["max = \"50 um\"\n", "max = 3.0\n"] {
            let table: Table = toml::from_str(text).unwrap();
            assert_eq!(toml::to_string(&table).unwrap(), text);
        }
        for text in ["max = nan", "max = inf", "max = '1e308 kN'"] {
            toml::from_str::<Table>(text).unwrap_err();
        }
        let error = toml::from_str::<Table>("max = [1]").unwrap_err().to_string();
        assert!(error.contains("a number with its unit"), "{error}");
    }

    #[test]
    fn values_are_shown_in_the_unit_with_four_digits() {
        let unit = |name| Unit::named(name).unwrap();
        assert_eq!(unit("um").text(12.3456e-6), "12.35 um");
        assert_eq!(unit("mm").text(1.0), "1000 mm");
        assert_eq!(unit("").text(0.5), "0.5");
        assert_eq!(unit("ms").text(0.0), "0 ms");
    }
}
