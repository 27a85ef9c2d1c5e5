//! Dimensions as products of powers of metre, kilogram and second. As in SI, an angle is a number.

use std::fmt::{self, Display, Formatter};

use masseter_scenario::{Dimension, UNITS};

/// The exponents of metre, kilogram and second.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct BaseExponents([i8; 3]);

impl BaseExponents {
    /// Those of a number.
    pub(super) const ONE: Self = Self([0; 3]);

    /// Those of a dimension.
    pub(super) const fn of(dimension: Dimension) -> Self {
        Self(dimension.exponents())
    }

    /// Of a product with the power `sign` of another dimension; none beyond what any unit has.
    pub(super) fn times(self, other: Self, sign: i8) -> Option<Self> {
        let mut product = self;
        for (own, other) in product.0.iter_mut().zip(other.0) {
            *own = own.checked_add(other.checked_mul(sign)?)?;
        }
        Some(product)
    }

    /// Of a power; none where its exponents are no whole numbers, or beyond what any unit has.
    pub(super) fn to_the(self, power: f64) -> Option<Self> {
        let mut product = self;
        for own in &mut product.0 {
            let exponent = f64::from(*own) * power;
            let whole = exponent.round();
            if (exponent - whole).abs() > 1e-9 || whole.abs() > f64::from(i8::MAX) {
                return None;
            }
            *own = whole as i8;
        }
        Some(product)
    }
}

/// The SI unit, by its name where it has one.
impl Display for BaseExponents {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if *self == Self::ONE {
            return f.write_str("a number");
        }
        if let Some(unit) = UNITS.into_iter().find(|unit| unit.dimension.exponents() == self.0) {
            return f.write_str(unit.name);
        }
        let product = |sign: i8| {
            let bases = ["m", "kg", "s"].into_iter().zip(self.0).filter(|(_, exponent)| exponent * sign > 0);
            let powers = bases.map(|(base, exponent)| match exponent.abs() {
                1 => base.to_owned(),
                exponent => format!("{base}{exponent}"),
            });
            powers.collect::<Vec<_>>().join(" ")
        };
        match (product(1), product(-1)) {
            (above, below) if below.is_empty() => f.write_str(&above),
            (above, below) => write!(f, "{}/{below}", if above.is_empty() { "1" } else { &above }),
        }
    }
}
