//! A candidate of a comparison: the durations of its rounds, their percentiles, and the ratios to another candidate's.
//!
//! The order of the rounds is decided by [`comparison`](super::comparison).

use std::collections::BTreeMap;
use std::path::Path;

use hdrhistogram::Histogram;
use serde::Serialize;

use masseter_report::histogram_log;

/// With fewer samples in a round, fewer than ten lie above its 99.9th percentile.
const SAMPLES_FOR_P999: u64 = 10_000;

/// Durations of one round, ns.
pub(super) type Durations = Histogram<u64>;

/// An empty histogram of durations.
pub(super) fn no_durations() -> Durations {
    Histogram::new(3).expect("three digits are allowed")
}

/// Adds `count` times the same duration.
pub(super) fn record(durations: &mut Durations, taken_ns: u64, count: u64) {
    // Recording it zero times would still raise the histogram's maximum.
    if count == 0 {
        return;
    }
    durations.record_n(taken_ns, count).expect("a histogram that resizes itself takes any value");
}

/// The result of one round.
#[derive(Debug)]
pub(super) struct Round {
    pub(super) durations: Durations,
    /// Shares that were measured with them: name and %.
    pub(super) shares: Vec<(String, f64)>,
}

impl From<Durations> for Round {
    fn from(durations: Durations) -> Self {
        Self { durations, shares: Vec::new() }
    }
}

/// A candidate with the results of its rounds.
#[derive(Debug, Serialize)]
pub(super) struct Candidate {
    pub(super) name: String,
    /// Every round; none in place of a round that does not count.
    #[serde(skip)]
    pub(super) rounds: Vec<Option<Durations>>,
    /// Rounds that count.
    pub(super) n: usize,
    /// Over the rounds that count.
    pub(super) percentiles: Vec<Percentile>,
    /// Over the rounds that gave them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) shares: Vec<Share>,
}

/// A share that was measured beside the durations, %.
#[derive(Debug, Serialize)]
pub(super) struct Share {
    pub(super) name: String,
    #[serde(flatten)]
    pub(super) percent: Spread,
}

/// A percentile, or the maximum.
#[derive(Debug, Serialize)]
pub(super) struct Percentile {
    pub(super) name: &'static str,
    #[serde(flatten)]
    pub(super) spread: Spread,
}

/// How a value varies from round to round.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Spread {
    pub(super) median: f64,
    pub(super) min: f64,
    pub(super) max: f64,
}

impl Spread {
    pub(super) fn from_values(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let middle = values.len() / 2;
        let median = match values.len() {
            0 => f64::NAN,
            n if n % 2 == 1 => values[middle],
            _ => f64::midpoint(values[middle - 1], values[middle]),
        };
        let end = |value: Option<&f64>| value.copied().unwrap_or(f64::NAN);
        Self { median, min: end(values.first()), max: end(values.last()) }
    }
}

/// One candidate's percentiles over another's, round by round.
#[derive(Debug, Serialize)]
pub(super) struct Ratio {
    pub(super) of: String,
    pub(super) to: String,
    /// Rounds that count for both.
    pub(super) n: usize,
    pub(super) percentiles: Vec<Percentile>,
}

type Statistic = (&'static str, fn(&Durations) -> f64);

const P50: Statistic = ("p50", |round| round.value_at_quantile(0.5) as f64);
const P99: Statistic = ("p99", |round| round.value_at_quantile(0.99) as f64);
const P999: Statistic = ("p99.9", |round| round.value_at_quantile(0.999) as f64);
const MAX: Statistic = ("max", |round| round.max() as f64);

impl Candidate {
    /// From its rounds; one without a duration does not count, but its shares do.
    pub(super) fn from_rounds(name: String, rounds: Vec<Option<Round>>) -> Self {
        let mut percents: BTreeMap<String, Vec<f64>> = BTreeMap::new();
        let mut counted = |round: Round| {
            for (share, percent) in round.shares {
                percents.entry(share).or_default().push(percent);
            }
            Some(round.durations).filter(|durations| !durations.is_empty())
        };
        let rounds: Vec<_> = rounds.into_iter().map(|round| round.and_then(&mut counted)).collect();
        let shares =
            percents.into_iter().map(|(name, percent)| Share { name, percent: Spread::from_values(percent) });
        let shares = shares.collect();
        let count = || rounds.iter().flatten();
        let fewest = count().map(Durations::len).min().unwrap_or(0);
        let statistics = [Some(P50), Some(P99), (fewest >= SAMPLES_FOR_P999).then_some(P999), Some(MAX)];
        let percentile = |(name, of): Statistic| Percentile {
            name,
            spread: Spread::from_values(count().map(of).collect()),
        };
        let percentiles = match count().count() {
            0 => Vec::new(),
            _ => statistics.into_iter().flatten().map(percentile).collect(),
        };
        Self { name, n: count().count(), rounds, percentiles, shares }
    }

    /// The median of a percentile over the rounds.
    pub(super) fn median(&self, percentile: &str) -> Option<f64> {
        self.percentiles.iter().find(|found| found.name == percentile).map(|found| found.spread.median)
    }

    /// This candidate's percentiles over another's, in the rounds that count for both. Maxima are not compared: they come
    /// from the machine.
    pub(super) fn ratio_to(&self, other: &Self) -> Ratio {
        let both = || {
            let pairs = self.rounds.iter().zip(&other.rounds);
            pairs.filter_map(|(mine, its)| Some((mine.as_ref()?, its.as_ref()?)))
        };
        let compared = [P50, P99, P999].into_iter().filter(|(name, _)| {
            both().count() > 0 && [self, other].iter().all(|side| side.median(name).is_some())
        });
        let percentile = |(name, of): Statistic| Percentile {
            name,
            spread: Spread::from_values(both().map(|(mine, its)| of(mine) / of(its)).collect()),
        };
        Ratio {
            of: self.name.clone(),
            to: other.name.clone(),
            n: both().count(),
            percentiles: compared.map(percentile).collect(),
        }
    }

    pub(super) fn write_log(&self, bench: &str, folder: &Path) -> std::io::Result<()> {
        let name = self.name.replace(|c: char| !c.is_ascii_alphanumeric(), "-");
        let path = folder.join(format!("{bench}-{name}.hlog"));
        let comment = format!("masseter bench {bench}: {}, ns, one line per round", self.name);
        let starts_ns = (0..).step_by(histogram_log::INTERVAL_NS as usize);
        let rounds = starts_ns.zip(&self.rounds);
        histogram_log::write(
            &path,
            &comment,
            rounds.filter_map(|(start_ns, round)| Some((start_ns, round.as_ref()?))),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round(value_ns: u64) -> Round {
        let mut round = no_durations();
        round.record(value_ns).unwrap();
        round.into()
    }

    #[test]
    fn rounds_that_do_not_count_change_neither_percentiles_nor_ratios() {
        let own = [Some(round(100)), None, Some(no_durations().into()), Some(round(300))];
        let other = [Some(round(200)), Some(round(1)), Some(round(1)), None];
        let [own, other] = [own, other].map(|rounds| Candidate::from_rounds(String::new(), rounds.into()));
        assert_eq!((own.n, other.n), (2, 3));
        assert_eq!(own.percentiles[0].spread, Spread { median: 200.0, min: 100.0, max: 300.0 });
        let ratio = own.ratio_to(&other);
        assert_eq!(ratio.n, 1);
        assert_eq!(ratio.percentiles[0].spread, Spread { median: 0.5, min: 0.5, max: 0.5 });
        let none = Candidate::from_rounds(String::new(), vec![None]);
        assert!(none.percentiles.is_empty() && none.ratio_to(&own).percentiles.is_empty());
    }

    #[test]
    fn the_median_of_an_even_number_lies_between() {
        assert!((Spread::from_values(vec![4.0, 1.0, 3.0, 2.0]).median - 2.5).abs() < 1e-12);
    }
}
