//! What a study shows: shares and quantiles of samples, tables as CSV, and the claims of the paper that are judged by
//! them.

use std::fmt;

use serde::Serialize;

/// So many of so many.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Share {
    pub hits: usize,
    pub of: usize,
}

impl Share {
    pub(crate) fn count(holds: impl IntoIterator<Item = bool>) -> Self {
        holds.into_iter().fold(Self::default(), |share, holds| Self {
            hits: share.hits + usize::from(holds),
            of: share.of + 1,
        })
    }

    /// From 0 to 1; no number for an empty sample.
    pub(crate) fn value(self) -> f64 {
        self.hits as f64 / self.of as f64
    }

    pub(crate) fn is_all(self) -> bool {
        self.of > 0 && self.hits == self.of
    }

    /// Whether it exceeds another by three standard errors of their difference: another sample would hardly contradict.
    pub(crate) fn clearly_exceeds(self, other: Self) -> bool {
        let variance = |share: Self| share.value() * (1.0 - share.value()) / share.of as f64;
        let difference = self.value() - other.value();
        difference > 0.0 && difference >= 3.0 * (variance(self) + variance(other)).sqrt()
    }
}

/// In per cent; with more digits where rounding would give 0 or 100 %.
impl fmt::Display for Share {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rounded = format!("{:.1}", 100.0 * self.value());
        let pretends = (rounded == "100.0" && !self.is_all()) || (rounded == "0.0" && self.hits > 0);
        write!(f, "{:.*} %", if pretends { 3 } else { 1 }, 100.0 * self.value())
    }
}

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
pub(crate) fn csv(header: &str, rows: impl IntoIterator<Item = impl Serialize>) -> String {
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

/// Whether a claim holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClaimJudgement {
    /// By its criterion.
    Holds,
    /// By the weaker criterion.
    HoldsPartly,
    /// By neither.
    DoesNotHold,
}

/// A claim of the paper with its judgement.
#[derive(Debug, Clone)]
pub struct PaperClaim {
    /// The claim, paraphrased.
    pub statement: &'static str,
    /// Where the paper makes it.
    pub section: &'static str,
    /// The measurements that decide.
    pub measured: String,
    /// When it holds, and when it holds partly.
    pub criterion: &'static str,
    /// Whether it holds.
    pub judgement: ClaimJudgement,
    /// The figure that shows it.
    pub figure: Option<&'static str>,
}

impl ClaimJudgement {
    /// As the page and the terminal show it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::HoldsPartly => "holds partly",
            Self::DoesNotHold => "does not hold",
        }
    }

    /// Holds by its criterion, or partly by the weaker one.
    #[must_use]
    pub fn new(holds: bool, partly: bool) -> Self {
        match (holds, partly) {
            (true, _) => Self::Holds,
            (false, true) => Self::HoldsPartly,
            (false, false) => Self::DoesNotHold,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_difference_of_small_samples_is_not_clear() {
        let share = |hits, of| Share { hits, of };
        assert!(!share(6, 10).clearly_exceeds(share(5, 10)));
        assert!(share(6000, 10_000).clearly_exceeds(share(5000, 10_000)));
        assert!(!share(5, 10).clearly_exceeds(share(5, 10)));
        assert!(!share(0, 0).clearly_exceeds(share(0, 0)));
    }

    #[test]
    fn nearly_all_does_not_read_as_all() {
        assert_eq!(Share { hits: 9999, of: 10_000 }.to_string(), "99.990 %");
        assert_eq!(Share { hits: 10, of: 10 }.to_string(), "100.0 %");
        assert_eq!(Share { hits: 1, of: 10_000 }.to_string(), "0.010 %");
    }

    #[test]
    fn quantiles_are_members_of_the_sample_or_lie_between_two() {
        assert!((quantile([3.0, 1.0, 2.0], 0.5) - 2.0).abs() < f64::EPSILON);
        assert!((quantile([1.0, 2.0, 3.0, 4.0], 1.0) - 4.0).abs() < f64::EPSILON);
        assert!((quantile([4.0, 1.0, 3.0, 2.0], 0.5) - 2.5).abs() < f64::EPSILON);
        assert!(quantile([], 0.5).is_nan());
    }
}
