//! Tables as CSV, and quantiles of samples.

/// The value at a quantile between 0 and 1: a member of the sample, or the middle between two; no number for an empty
/// sample.
pub(crate) fn quantile(sample: impl IntoIterator<Item = f64>, quantile: f64) -> f64 {
    let mut sample: Vec<_> = sample.into_iter().collect();
    sample.sort_by(f64::total_cmp);
    let place = quantile * sample.len().saturating_sub(1) as f64;
    let at = |place: f64| sample.get(place as usize).copied().unwrap_or(f64::NAN);
    f64::midpoint(at(place.floor()), at(place.ceil()))
}

/// A header and rows. A row may nest tuples and arrays: each of their values is a column.
///
/// # Panics
/// When a row has not as many columns as the header.
pub(crate) fn csv(header: &str, rows: impl IntoIterator<Item = impl serde::Serialize>) -> String {
    let mut writer = csv::WriterBuilder::new().has_headers(false).from_writer(Vec::new());
    let mut written = writer.write_record(header.split(','));
    written = written.and_then(|()| rows.into_iter().try_for_each(|row| writer.serialize(row)));
    written.expect("rows have the columns of their header");
    String::from_utf8(writer.into_inner().expect("a vector takes all bytes")).expect("all columns are text")
}

/// A number as short as it reads back the same; an empty cell where there is none.
pub(crate) fn number(value: f64) -> String {
    if value.is_finite() { value.to_string() } else { String::new() }
}

/// An angle in degrees.
pub(crate) fn degrees(angle_rad: f64) -> String {
    number(angle_rad.to_degrees())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_members_of_the_sample_or_lie_between_two() {
        assert!((quantile([3.0, 1.0, 2.0], 0.5) - 2.0).abs() < f64::EPSILON);
        assert!((quantile([1.0, 2.0, 3.0, 4.0], 1.0) - 4.0).abs() < f64::EPSILON);
        assert!((quantile([4.0, 1.0, 3.0, 2.0], 0.5) - 2.5).abs() < f64::EPSILON);
        assert!(quantile([], 0.5).is_nan());
    }
}
