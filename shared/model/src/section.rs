//! Tables of a scenario: every key has one declaration with its meaning, default, range, and further condition. Checks
//! and documents follow from the declaration.

use std::fmt::{self, Display, Formatter};
use std::iter;

/// Suffixes of keys with their units. Of two that fit, the longer comes first.
const UNITS: [(&str, &str); 22] = [
    ("_kg_m2", "kg m²"),
    ("_n_s_per_m", "N s/m"),
    ("_n_per_m", "N/m"),
    ("_s_per_m", "s/m"),
    ("_per_s", "1/s"),
    ("_m_s2", "m/s²"),
    ("_m_s", "m/s"),
    ("_n_m", "N m"),
    ("_m", "m"),
    ("_mm", "mm"),
    ("_s", "s"),
    ("_ms", "ms"),
    ("_us", "µs"),
    ("_ns", "ns"),
    ("_hz", "Hz"),
    ("_bps", "bit/s"),
    ("_rad", "rad"),
    ("_deg", "°"),
    ("_kg", "kg"),
    ("_n", "N"),
    ("_cycles", "cycles"),
    ("_percent", "%"),
];

/// The unit of a key, by the suffix of its name; none without a suffix.
pub fn unit_of(key: &str) -> Option<&'static str> {
    UNITS.iter().find(|(suffix, _)| key.ends_with(suffix)).map(|(_, unit)| *unit)
}

/// A key as it is declared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Key {
    /// Its name.
    pub name: &'static str,
    /// The lines of its doc comment. The first paragraph is its meaning.
    pub about: &'static [&'static str],
    /// The range of its numbers; none allows any number.
    pub range: Option<Range>,
    /// A further condition on its value, in words; empty for none.
    pub condition: &'static str,
}

/// The range of a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Range {
    /// From the first to the second number.
    Within(f64, f64),
    /// Finite and above 0.
    Positive,
    /// Finite and not below 0.
    NotNegative,
    /// Above 0 and at most this.
    UpTo(f64),
}

impl Range {
    /// Whether a number is in the range.
    pub fn contains(self, number: f64) -> bool {
        match self {
            Self::Within(least, most) => (least..=most).contains(&number),
            Self::Positive => number.is_finite() && number > 0.0,
            Self::NotNegative => number.is_finite() && number >= 0.0,
            Self::UpTo(most) => number > 0.0 && number <= most,
        }
    }

    /// The range with the unit of its key: `0 to 60 mm`.
    pub fn of_key(self, key: &str) -> String {
        unit_of(key).map_or_else(|| self.to_string(), |unit| format!("{self} {unit}"))
    }
}

/// The range in the words of a message: `0 to 1`, `a finite number above 0`.
impl Display for Range {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Within(least, most) => write!(f, "{least} to {most}"),
            Self::Positive => f.write_str("a finite number above 0"),
            Self::NotNegative => f.write_str("a finite number not below 0"),
            Self::UpTo(most) => write!(f, "more than 0 and at most {most}"),
        }
    }
}

/// A value with numbers in the range of its key.
pub trait Numbers {
    /// Its numbers; empty if the key is absent.
    fn numbers(&self) -> impl Iterator<Item = f64>;
}

impl Numbers for f64 {
    fn numbers(&self) -> impl Iterator<Item = f64> {
        iter::once(*self)
    }
}

macro_rules! numbers {
    ($($integer:ty)*) => {$(
        impl Numbers for $integer {
            fn numbers(&self) -> impl Iterator<Item = f64> {
                iter::once(*self as f64)
            }
        }
    )*};
}

numbers!(u8 u16 u32 u64);

impl<T: Numbers, const N: usize> Numbers for [T; N] {
    fn numbers(&self) -> impl Iterator<Item = f64> {
        self.iter().flat_map(T::numbers)
    }
}

impl<T: Numbers> Numbers for Option<T> {
    fn numbers(&self) -> impl Iterator<Item = f64> {
        self.iter().flat_map(T::numbers)
    }
}

/// Declares a table. After `=>` stand the range of a key's numbers and, in words, a further condition on its value.
#[macro_export]
macro_rules! keys {
    ($(#[$attribute:meta])* pub struct $name:ident {$(
        $(#[doc = $doc:literal])+ $(#[doc($($alias:tt)*)])* $(#[serde($($serde:tt)*)])*
        pub $field:ident: $type:ty $(=> $($range:ident $(($($bound:expr),+))?)? $($condition:literal)?)?,
    )*}) => {
        $(#[$attribute])*
        pub struct $name {$(
            $(#[doc = $doc])+ $(#[doc($($alias)*)])* $(#[serde($($serde)*)])*
            pub $field: $type,
        )*}

        impl $name {
            /// Its keys in the order of declaration.
            pub const KEYS: &'static [$crate::section::Key] = &[$($crate::section::Key {
                name: stringify!($field),
                about: &[$($doc),+],
                range: $crate::keys!(@range $($($range $(($($bound),+))?)?)?),
                condition: concat!($($($condition)?)?),
            },)*];

            /// Calls `check` with key, range and number, for every number with a range.
            ///
            /// # Errors
            /// The first error of `check`.
            #[allow(unused_mut, unused_variables, reason = "a table may have no range")]
            pub fn check_ranges<E>(
                &self,
                mut check: impl FnMut(&'static str, $crate::section::Range, f64) -> Result<(), E>,
            ) -> Result<(), E> {
                $($($(
                    let range = $crate::section::Range::$range $(($($bound),+))?;
                    $crate::section::Numbers::numbers(&self.$field)
                        .try_for_each(|number| check(stringify!($field), range, number))?;
                )?)?)*
                Ok(())
            }
        }
    };
    (@range) => { None };
    (@range $range:ident $(($($bound:expr),+))?) => { Some($crate::section::Range::$range $(($($bound),+))?) };
}

/// Declares a table whose keys are all optional: each has its default behind `=`.
#[macro_export]
macro_rules! section {
    ($(#[$attribute:meta])* pub struct $name:ident {$(
        $(#[doc = $doc:literal])+ $(#[doc($($alias:tt)*)])* $(#[serde($($serde:tt)*)])*
        pub $field:ident: $type:ty = $default:expr
            $(=> $($range:ident $(($($bound:expr),+))?)? $($condition:literal)?)?,
    )*}) => {
        $crate::keys! {
            $(#[$attribute])*
            #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
            #[serde(deny_unknown_fields, default)]
            pub struct $name {$(
                $(#[doc = $doc])+ $(#[doc($($alias)*)])* $(#[serde($($serde)*)])*
                pub $field: $type $(=> $($range $(($($bound),+))?)? $($condition)?)?,
            )*}
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }
    };
}
