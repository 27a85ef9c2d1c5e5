//! A contender with the durations of its rounds: its figures, and their ratios to another one's. Who plays when is not
//! told here.

use std::collections::BTreeMap;
use std::path::Path;

use hdrhistogram::Histogram;
use serde::Serialize;

use masseter_report::histogram_log;

/// Below this many samples a round, its 99.9th percentile rests on fewer than ten of them.
const SAMPLES_FOR_P999: u64 = 10_000;

/// Durations of one round, ns.
pub(super) type Durations = Histogram<u64>;

/// An empty histogram of durations.
pub(super) fn durations() -> Durations {
    Histogram::new(3).expect("three digits are allowed")
}

/// Adds `count` times the same duration.
pub(super) fn record(durations: &mut Durations, taken_ns: u64, count: u64) {
    // None at all would still raise the histogram's maximum.
    if count == 0 {
        return;
    }
    durations.record_n(taken_ns, count).expect("a histogram that resizes itself takes any value");
}

/// What a round of a contender gave.
#[derive(Debug)]
pub(super) struct Round {
    pub(super) durations: Durations,
    /// What else it tells: names and shares, %.
    pub(super) shares: Vec<(String, f64)>,
}

impl From<Durations> for Round {
    fn from(durations: Durations) -> Self {
        Self { durations, shares: Vec::new() }
    }
}

/// A contender with what its rounds gave.
#[derive(Debug, Serialize)]
pub(super) struct Contender {
    pub(super) name: String,
    /// Every round; none in place of those that do not count.
    #[serde(skip)]
    pub(super) rounds: Vec<Option<Durations>>,
    /// Rounds that count.
    pub(super) n: usize,
    /// Every figure, round by round.
    pub(super) figures: Vec<Figure>,
    /// What else the rounds tell.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) shares: Vec<Share>,
}

/// A share that a contender's rounds tell of beside their durations, %.
#[derive(Debug, Serialize)]
pub(super) struct Share {
    pub(super) name: String,
    #[serde(flatten)]
    pub(super) percent: Spread,
}

/// A figure of a contender.
#[derive(Debug, Serialize)]
pub(super) struct Figure {
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
    pub(super) fn of(mut values: Vec<f64>) -> Self {
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

/// One contender's percentiles over another's, round by round.
#[derive(Debug, Serialize)]
pub(super) struct Ratio {
    pub(super) of: String,
    pub(super) to: String,
    /// Rounds that count for both.
    pub(super) n: usize,
    pub(super) figures: Vec<Figure>,
}

type Percentile = (&'static str, fn(&Durations) -> f64);

const P50: Percentile = ("p50", |round| round.value_at_quantile(0.5) as f64);
const P99: Percentile = ("p99", |round| round.value_at_quantile(0.99) as f64);
const P999: Percentile = ("p99.9", |round| round.value_at_quantile(0.999) as f64);
const MAX: Percentile = ("max", |round| round.max() as f64);

impl Contender {
    /// Of its rounds; one without a duration does not count, though its shares are told.
    pub(super) fn of(name: String, rounds: Vec<Option<Round>>) -> Self {
        let mut percents: BTreeMap<String, Vec<f64>> = BTreeMap::new();
        let mut counted = |round: Round| {
            for (share, percent) in round.shares {
                percents.entry(share).or_default().push(percent);
            }
            Some(round.durations).filter(|durations| !durations.is_empty())
        };
        let rounds: Vec<_> = rounds.into_iter().map(|round| round.and_then(&mut counted)).collect();
        let shares = percents.into_iter().map(|(name, percent)| Share { name, percent: Spread::of(percent) });
        let shares = shares.collect();
        let count = || rounds.iter().flatten();
        let fewest = count().map(Durations::len).min().unwrap_or(0);
        let percentiles = [Some(P50), Some(P99), (fewest >= SAMPLES_FOR_P999).then_some(P999), Some(MAX)];
        let figure = |(name, of): Percentile| Figure { name, spread: Spread::of(count().map(of).collect()) };
        let figures = match count().count() {
            0 => Vec::new(),
            _ => percentiles.into_iter().flatten().map(figure).collect(),
        };
        Self { name, n: count().count(), rounds, figures, shares }
    }

    /// The median of a figure over the rounds.
    pub(super) fn median(&self, figure: &str) -> Option<f64> {
        self.figures.iter().find(|found| found.name == figure).map(|found| found.spread.median)
    }

    /// This one's percentiles over another's, in the rounds that count for both; maxima are the machine's and not
    /// compared.
    pub(super) fn over(&self, other: &Self) -> Ratio {
        let both = || {
            let pairs = self.rounds.iter().zip(&other.rounds);
            pairs.filter_map(|(mine, its)| Some((mine.as_ref()?, its.as_ref()?)))
        };
        let compared = [P50, P99, P999].into_iter().filter(|(name, _)| {
            both().count() > 0 && [self, other].iter().all(|side| side.median(name).is_some())
        });
        let figure = |(name, of): Percentile| Figure {
            name,
            spread: Spread::of(both().map(|(mine, its)| of(mine) / of(its)).collect()),
        };
        Ratio {
            of: self.name.clone(),
            to: other.name.clone(),
            n: both().count(),
            figures: compared.map(figure).collect(),
        }
    }

    pub(super) fn write_log(&self, bench: &str, folder: &Path) -> std::io::Result<()> {
        let name = self.name.replace(|c: char| !c.is_ascii_alphanumeric(), "-");
        let path = folder.join(format!("{bench}-{name}.hlog"));
        let comment = format!("masseter bench {bench}: {}, ns, a line a round", self.name);
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
        let mut round = durations();
        round.record(value_ns).unwrap();
        round.into()
    }

    #[test]
    fn rounds_that_do_not_count_neither_improve_a_figure_nor_shift_a_ratio() {
        let own = [Some(round(100)), None, Some(durations().into()), Some(round(300))];
        let other = [Some(round(200)), Some(round(1)), Some(round(1)), None];
        let [own, other] = [own, other].map(|rounds| Contender::of(String::new(), rounds.into()));
        assert_eq!((own.n, other.n), (2, 3));
        assert_eq!(own.figures[0].spread, Spread { median: 200.0, min: 100.0, max: 300.0 });
        let ratio = own.over(&other);
        assert_eq!(ratio.n, 1);
        assert_eq!(ratio.figures[0].spread, Spread { median: 0.5, min: 0.5, max: 0.5 });
        let none = Contender::of(String::new(), vec![None]);
        assert!(none.figures.is_empty() && none.over(&own).figures.is_empty());
    }

    #[test]
    fn the_median_of_an_even_number_lies_between() {
        assert!((Spread::of(vec![4.0, 1.0, 3.0, 2.0]).median - 2.5).abs() < 1e-12);
    }
}
