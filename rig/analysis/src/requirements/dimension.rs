//! The dimension of an expression, derived from those of its signals. As in SI, an angle is a number.
//!
//! The expression is evaluated once more, with dimensions in place of values.

use std::num::ParseFloatError;
use std::str::FromStr;

use exmex::{BinOp, Express, FlatEx, MakeOperators, Operator};
use masseter_scenario::Dimension;

use super::base_exponents::BaseExponents;

/// The dimension of a part of an expression, or why it has none.
#[derive(Debug, Clone)]
struct Term {
    dimension: Result<BaseExponents, String>,
    /// Its value, where it is written as a number.
    number: Option<f64>,
}

/// The dimension of an expression; `of` gives that of each signal.
///
/// # Errors
/// A sentence that names the operator and the units that do not fit.
pub(super) fn derived(text: &str, of: impl Fn(&str) -> Dimension) -> Result<BaseExponents, String> {
    let parsed = FlatEx::<Term, Operators>::parse(text).map_err(|error| error.to_string())?;
    let terms: Vec<_> = parsed.var_names().iter().map(|name| Term::of(BaseExponents::of(of(name)))).collect();
    parsed.eval(&terms).map_err(|error| error.to_string())?.dimension
}

impl Default for Term {
    fn default() -> Self {
        Self::of(BaseExponents::ONE)
    }
}

impl FromStr for Term {
    type Err = ParseFloatError;

    fn from_str(text: &str) -> Result<Self, ParseFloatError> {
        Ok(Self { number: Some(text.parse()?), ..Self::default() })
    }
}

impl Term {
    fn of(dimension: BaseExponents) -> Self {
        Self { dimension: Ok(dimension), number: None }
    }

    /// The same dimension, for another value.
    fn kept(self) -> Self {
        Self { number: None, ..self }
    }

    fn negated(self) -> Self {
        Self { number: self.number.map(|number| -number), ..self }
    }

    /// Of two terms that must be alike. A zero is like anything.
    fn alike(self, other: Self, operator: &str) -> Self {
        let is_zero = |term: &Self| term.number.is_some_and(|number| number == 0.0);
        let (is_zero, is_other_zero) = (is_zero(&self), is_zero(&other));
        let dimension = self.dimension.and_then(|a| match other.dimension? {
            b if a == b || is_other_zero => Ok(a),
            b if is_zero => Ok(b),
            b => Err(format!("'{operator}' needs two equal units, not {a} and {b}")),
        });
        Self { dimension, number: None }
    }

    fn product(self, other: Self, sign: i8) -> Self {
        let dimension = self.dimension.and_then(|a| {
            let b = other.dimension?;
            a.times(b, sign).ok_or_else(|| format!("the product of {a} and {b} is beyond every unit"))
        });
        Self { dimension, number: None }
    }

    fn power(self, exponent: Self) -> Self {
        let dimension = self.dimension.and_then(|a| match (exponent.dimension?, exponent.number) {
            (b, _) if b != BaseExponents::ONE => {
                Err(format!("an exponent has no unit, but this one has {b}"))
            }
            _ if a == BaseExponents::ONE => Ok(a),
            (_, None) => Err(format!("the exponent of {a} must be written as a number")),
            (_, Some(number)) => {
                a.to_the(number).ok_or_else(|| format!("no unit is {a} to the power of {number}"))
            }
        });
        Self { dimension, number: None }
    }

    fn root(self, of: f64) -> Self {
        self.power(Self { number: Some(1.0 / of), ..Self::default() })
    }

    /// A number, whatever it comes from.
    fn into_number(self) -> Self {
        Self { dimension: self.dimension.map(|_| BaseExponents::ONE), number: None }
    }

    /// Of a function that maps numbers to numbers.
    fn function(self) -> Self {
        let dimension = self.dimension.and_then(|a| match a {
            BaseExponents::ONE => Ok(a),
            _ => Err(format!("a function such as sin or exp needs a number or an angle, not {a}")),
        });
        Self { dimension, number: None }
    }
}

/// The operators of `exmex` for numbers, with dimensions in place of values.
#[derive(Debug, Clone)]
struct Operators;

impl MakeOperators<Term> for Operators {
    fn make<'a>() -> Vec<Operator<'a, Term>> {
        // The priorities are those of `exmex`.
        let binary = |apply: fn(Term, Term) -> Term, prio| BinOp { apply, prio, is_commutative: false };
        let mut all = vec![
            Operator::make_bin("^", binary(Term::power, 4)),
            Operator::make_bin("*", binary(|a, b| a.product(b, 1), 2)),
            Operator::make_bin("/", binary(|a, b| a.product(b, -1), 3)),
            Operator::make_bin_unary("+", binary(|a, b| a.alike(b, "+"), 0), |a| a),
            Operator::make_bin_unary("-", binary(|a, b| a.alike(b, "-"), 1), Term::negated),
            Operator::make_bin("min", binary(|a, b| a.alike(b, "min"), 0)),
            Operator::make_bin("max", binary(|a, b| a.alike(b, "max"), 0)),
            Operator::make_bin("atan2", binary(|a, b| a.alike(b, "atan2").into_number(), 0)),
            Operator::make_unary("signum", Term::into_number),
            Operator::make_unary("sqrt", |a| a.root(2.0)),
            Operator::make_unary("cbrt", |a| a.root(3.0)),
        ];
        all.extend(
            ["abs", "floor", "round", "ceil", "trunc", "fract"]
                .map(|name| Operator::make_unary(name, Term::kept)),
        );
        let functions = [
            "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh",
            "exp", "ln", "log2", "log10", "log",
        ];
        all.extend(functions.map(|name| Operator::make_unary(name, Term::function)));
        all.extend(
            ["PI", "π", "E", "e", "TAU", "τ"].map(|name| Operator::make_constant(name, Term::default())),
        );
        all
    }
}

#[cfg(test)]
mod tests {
    use exmex::FloatOpsFactory;

    use super::*;

    fn of(text: &str) -> Result<String, String> {
        let of = |name: &str| match name {
            "f" => Dimension::Force,
            "v" => Dimension::Velocity,
            "x" => Dimension::Length,
            "phi" => Dimension::Angle,
            "m" => Dimension::Mass,
            _ => Dimension::One,
        };
        derived(text, of).map(|dimension| dimension.to_string())
    }

    #[test]
    fn units_follow_from_those_of_the_signals() {
        for (text, unit) in [
            ("abs({f} - 2 * {f})", "N"),
            ("{f} * {v}", "W"),
            ("{f} * {x}", "J"),
            ("{f} / {m}", "m/s2"),
            ("sqrt({x}^2 + {x} * {x})", "m"),
            ("{x}^-1", "1/m"),
            ("cbrt({x}^3) / {v}", "s"),
            ("{m} * {x}^2", "m2 kg"),
            ("{f} / {x}^2", "kg/m s2"),
            ("sin({phi}) + exp({f} / {f}) + 1", "a number"),
            ("atan2({x}, {x})", "a number"),
            ("{n}^2.5", "a number"),
            ("max({f}, 0)", "N"),
            ("{phi} * {x}", "m"),
        ] {
            assert_eq!(of(text).as_deref(), Ok(unit), "{text}");
        }
    }

    #[test]
    fn what_does_not_fit_is_refused_with_both_units() {
        for (text, message) in [
            ("{f} + {x}", "'+' needs two equal units, not N and m"),
            ("{f} - 5", "'-' needs two equal units, not N and a number"),
            ("min({f}, {v})", "'min' needs two equal units, not N and m/s"),
            ("sin({x})", "a function such as sin or exp needs a number or an angle, not m"),
            ("sqrt({x})", "no unit is m to the power of 0.5"),
            ("{x}^{n}", "the exponent of m must be written as a number"),
            ("{n}^{x}", "an exponent has no unit, but this one has m"),
            ("2 * ({f} + {x})", "'+' needs two equal units, not N and m"),
        ] {
            assert_eq!(of(text).unwrap_err(), message, "{text}");
        }
    }

    #[test]
    fn every_operator_of_an_expression_has_its_rule() {
        let mut own: Vec<_> = Operators::make().iter().map(Operator::repr).collect();
        let mut all: Vec<_> = FloatOpsFactory::<f64>::make().iter().map(Operator::repr).collect();
        own.sort_unstable();
        all.sort_unstable();
        assert_eq!(own, all);
    }
}
