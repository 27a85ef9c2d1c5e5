//! What the page's charts have in common.

use masseter_analysis::Curve;
use masseter_page::{Limit, Points, Series, Style};

/// A curve of several alike, in another unit.
pub(super) fn plain(name: &str, curve: &Curve, unit: f64) -> Series {
    Series::new(name, Style::Plain, Points::over_time(&in_unit(curve, 0.0, unit)))
}

pub(super) fn limit(name: &str, values: &[f64]) -> Limit {
    Limit { name: name.to_owned(), values: values.to_vec() }
}

/// A curve in another unit, from another zero.
pub(super) fn in_unit(curve: &Curve, zero: f64, unit: f64) -> Vec<(f64, f64)> {
    curve.iter().map(|&(at_s, value)| (at_s, (value - zero) * unit)).collect()
}
