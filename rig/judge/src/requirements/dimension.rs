//! Dimensions as products of powers of metre, kilogram and second, and the rules by which they go through functions and
//! operators. As in SI, an angle is a number.

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

    /// Of a power; `None` if its exponents are no whole numbers, or beyond what any unit has.
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

/// A part of an expression, as far as a unit depends on it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Term {
    pub(super) dimension: BaseExponents,
    /// Its value, where it is written as a number.
    number: Option<f64>,
}

/// Why a function or an operator does not accept its operands.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(super) enum Misfit {
    #[error("'{0}' needs two equal units, not {1} and {2}")]
    Unequal(&'static str, BaseExponents, BaseExponents),
    #[error("the product of {0} and {1} is beyond every unit")]
    Product(BaseExponents, BaseExponents),
    #[error("an exponent has no unit, but this one has {0}")]
    ExponentWithUnit(BaseExponents),
    #[error("the exponent of {0} must be written as a number")]
    ExponentUnknown(BaseExponents),
    #[error("no unit is {0} to the power of {1}")]
    Power(BaseExponents, f64),
    #[error("a function such as sin or exp needs a number or an angle, not {0}")]
    Function(BaseExponents),
}

impl Term {
    /// A number that is not written.
    pub(super) const NUMBER: Self = Self { dimension: BaseExponents::ONE, number: None };

    pub(super) fn of(dimension: BaseExponents) -> Self {
        Self { dimension, number: None }
    }

    pub(super) fn written(number: f64) -> Self {
        Self { dimension: BaseExponents::ONE, number: Some(number) }
    }

    pub(super) fn negated(self) -> Self {
        Self { number: self.number.map(|number| -number), ..self }
    }

    /// Another value of the same dimension.
    pub(super) fn kept(self) -> Self {
        Self::of(self.dimension)
    }

    /// Of a function that maps numbers to numbers.
    pub(super) fn function(self) -> Result<Self, Misfit> {
        match self.dimension {
            BaseExponents::ONE => Ok(self.kept()),
            dimension => Err(Misfit::Function(dimension)),
        }
    }

    /// Of two terms that must be alike. A zero is like anything.
    pub(super) fn alike(self, other: Self, operator: &'static str) -> Result<Self, Misfit> {
        let is_zero = |term: Self| term.number == Some(0.0);
        match (self.dimension, other.dimension) {
            (a, b) if a == b || is_zero(other) => Ok(self.kept()),
            _ if is_zero(self) => Ok(other.kept()),
            (a, b) => Err(Misfit::Unequal(operator, a, b)),
        }
    }

    /// Of a product with the power `sign` of another term.
    pub(super) fn product(self, other: Self, sign: i8) -> Result<Self, Misfit> {
        let product = self.dimension.times(other.dimension, sign).map(Self::of);
        product.ok_or(Misfit::Product(self.dimension, other.dimension))
    }

    pub(super) fn power(self, exponent: Self) -> Result<Self, Misfit> {
        match (self.dimension, exponent.dimension, exponent.number) {
            (_, b, _) if b != BaseExponents::ONE => Err(Misfit::ExponentWithUnit(b)),
            (BaseExponents::ONE, ..) => Ok(self.kept()),
            (a, _, None) => Err(Misfit::ExponentUnknown(a)),
            (a, _, Some(number)) => a.to_the(number).map(Self::of).ok_or(Misfit::Power(a, number)),
        }
    }

    pub(super) fn root(self, of: f64) -> Result<Self, Misfit> {
        self.power(Self::written(1.0 / of))
    }
}
