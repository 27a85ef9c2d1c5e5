//! A candidate of the bench: the durations of its rounds, their percentiles, and the ratios to another candidate's.

use std::path::Path;

use hdrhistogram::Histogram;
use masseter_report::histogram_log;
use serde::Serialize;

/// Durations of one round, ns.
pub(super) type Durations = Histogram<u64>;

/// Measures one round.
pub(super) type Turn<'a> = Box<dyn FnMut() -> anyhow::Result<Round> + 'a>;

/// Percentiles, each with the fewest samples of a round that it is given for: ten lie above the 99th and the 99.9th.
const PERCENTILES: [(&str, f64, u64); 3] = [("p50", 0.5, 1), ("p99", 0.99, 1000), ("p99.9", 0.999, 10_000)];

/// An empty histogram of durations.
pub(super) fn no_durations() -> Durations {
    Histogram::new(3).expect("three digits are allowed")
}

/// Adds `count` times the same duration.
pub(super) fn add_durations(durations: &mut Durations, taken_ns: u64, count: u64) {
    // Recording it zero times would still raise the histogram's maximum.
    if count > 0 {
        durations.record_n(taken_ns, count).expect("a histogram that resizes itself takes any value");
    }
}

/// The result of one round.
#[derive(Debug)]
pub(super) struct Round {
    pub(super) durations: Durations,
    /// Deadlines that passed before the loop could wait for them, %; `None` if nobody counts them.
    pub(super) skipped_percent: Option<f64>,
}

/// A candidate with the results of its rounds.
#[derive(Debug, Serialize)]
pub(super) struct Candidate {
    name: &'static str,
    #[serde(skip)]
    rounds: Vec<Durations>,
    /// ns.
    percentiles: Vec<Spread>,
    #[serde(skip_serializing_if = "Option::is_none")]
    skipped_percent: Option<Spread>,
}

/// A value that varies from round to round.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Spread {
    name: &'static str,
    median: f64,
    min: f64,
    max: f64,
}

/// One candidate's percentiles over another's, round by round.
#[derive(Debug, Serialize)]
pub(super) struct Ratio {
    of: &'static str,
    to: &'static str,
    percentiles: Vec<Spread>,
}

impl Spread {
    /// None without a value.
    fn from_values(name: &'static str, values: impl Iterator<Item = f64>) -> Option<Self> {
        let mut values: Vec<_> = values.collect();
        values.sort_by(f64::total_cmp);
        let (min, max) = (*values.first()?, *values.last()?);
        let median = f64::midpoint(values[(values.len() - 1) / 2], values[values.len() / 2]);
        Some(Self { name, median, min, max })
    }

    /// Median (minimum–maximum), each by this factor.
    fn in_words(&self, factor: f64) -> String {
        let [median, min, max] = [self.median, self.min, self.max].map(|value| three_digits(value * factor));
        format!("{median} ({min}–{max})")
    }
}

impl Candidate {
    pub(super) fn new(name: &'static str, rounds: Vec<Round>) -> Self {
        let skipped = rounds.iter().filter_map(|round| round.skipped_percent);
        let skipped_percent = Spread::from_values("skipped deadlines", skipped);
        let rounds: Vec<_> = rounds.into_iter().map(|round| round.durations).collect();
        let mut percentiles = percentiles_of(&rounds, Durations::len, |round, quantile| {
            round.value_at_quantile(quantile) as f64
        });
        percentiles.extend(Spread::from_values("max", rounds.iter().map(|round| round.max() as f64)));
        Self { name, rounds, percentiles, skipped_percent }
    }

    pub(super) fn round_count(&self) -> usize {
        self.rounds.len()
    }

    /// This candidate's percentiles over another's, round by round. Maxima are not compared: they come from the machine.
    pub(super) fn ratio_to(&self, other: &Self) -> Ratio {
        let rounds: Vec<_> = self.rounds.iter().zip(&other.rounds).collect();
        let percentiles = percentiles_of(
            &rounds,
            |(mine, its)| mine.len().min(its.len()),
            |(mine, its), quantile| {
                mine.value_at_quantile(quantile) as f64 / its.value_at_quantile(quantile) as f64
            },
        );
        Ratio { of: self.name, to: other.name, percentiles }
    }

    /// The name, and the percentiles in µs.
    pub(super) fn row(&self) -> (String, String) {
        let skipped = self.skipped_percent.as_ref();
        let skipped = skipped.map(|share| format!("  {}, %: {}", share.name, share.in_words(1.0)));
        (self.name.to_owned(), cells(&self.percentiles, 1e-3) + &skipped.unwrap_or_default())
    }

    pub(super) fn write_log(&self, folder: &Path) -> std::io::Result<()> {
        let name = self.name.replace(|c: char| !c.is_ascii_alphanumeric(), "-");
        let comment = format!("masseter bench loop: {}, ns, one line per round", self.name);
        let starts_ns = (0..).step_by(histogram_log::INTERVAL_NS as usize);
        histogram_log::write(&folder.join(format!("loop-{name}.hlog")), &comment, starts_ns.zip(&self.rounds))
    }
}

impl Ratio {
    pub(super) fn row(&self) -> (String, String) {
        (format!("{} / {}", self.of, self.to), cells(&self.percentiles, 1.0))
    }
}

/// Each percentile for which all rounds have enough samples.
fn percentiles_of<R>(
    rounds: &[R],
    samples: impl Fn(&R) -> u64,
    value: impl Fn(&R, f64) -> f64,
) -> Vec<Spread> {
    let reached =
        PERCENTILES.iter().filter(|(.., least)| rounds.iter().all(|round| samples(round) >= *least));
    let spread = |&(name, quantile, _): &(&'static str, f64, u64)| {
        Spread::from_values(name, rounds.iter().map(|round| value(round, quantile)))
    };
    reached.filter_map(spread).collect()
}

fn cells(spreads: &[Spread], factor: f64) -> String {
    let cell = |spread: &Spread| format!("{:<5} {:<20}", spread.name, spread.in_words(factor));
    spreads.iter().map(cell).collect::<Vec<_>>().join("  ").trim_end().to_owned()
}

fn three_digits(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let whole_digits = value.abs().max(1e-9).log10().floor() as i32 + 1;
    format!("{value:.*}", (3 - whole_digits).clamp(0, 5) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_percentile_that_fewer_than_ten_samples_exceed_is_not_given() {
        let of = |samples| {
            let mut durations = no_durations();
            add_durations(&mut durations, 100, samples);
            let candidate = Candidate::new("", vec![Round { durations, skipped_percent: None }]);
            let names = |spreads: &[Spread]| spreads.iter().map(|spread| spread.name).collect::<Vec<_>>();
            (names(&candidate.percentiles), names(&candidate.ratio_to(&candidate).percentiles))
        };
        assert_eq!(of(9_999).0, ["p50", "p99", "max"]);
        assert_eq!(of(9_999).1, ["p50", "p99"]);
        assert_eq!(of(10_000).0, ["p50", "p99", "p99.9", "max"]);
        assert_eq!(of(10_000).1, ["p50", "p99", "p99.9"]);
    }

    #[test]
    fn the_median_of_an_even_number_lies_between() {
        let of = |values: &[f64]| Spread::from_values("p50", values.iter().copied());
        let spread = |median, min, max| Some(Spread { name: "p50", median, min, max });
        assert_eq!(of(&[4.0, 1.0, 3.0, 2.0]), spread(2.5, 1.0, 4.0));
        assert_eq!(of(&[3.0, 1.0, 2.0]), spread(2.0, 1.0, 3.0));
        assert_eq!(of(&[]), None);
    }

    #[test]
    fn three_digits_count() {
        let cases = [
            (0.0, "0"),
            (0.001_234, "0.00123"),
            (0.5, "0.500"),
            (1.234, "1.23"),
            (123.4, "123"),
            (1234.0, "1234"),
        ];
        for (value, expected) in cases {
            assert_eq!(three_digits(value), expected);
        }
    }
}
