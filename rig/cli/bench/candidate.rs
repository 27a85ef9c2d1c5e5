//! A candidate of a comparison: the durations of its rounds, their percentiles, and the ratios to another candidate's.
//!
//! The order of the rounds is decided by [`comparison`](super::comparison).

use std::collections::BTreeMap;
use std::path::Path;

use super::durations::Durations;
use serde::Serialize;

use masseter_report::histogram_log;

/// The result of one round.
#[derive(Debug)]
pub(super) struct Round {
    /// Empty if the round does not count.
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
    #[serde(skip)]
    pub(super) rounds: Vec<Durations>,
    /// Rounds that count.
    pub(super) n: usize,
    /// Over the rounds that count, ns.
    pub(super) percentiles: Vec<Spread>,
    /// Over the rounds that gave them, %.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) shares: Vec<Spread>,
}

/// A value that varies from round to round.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Spread {
    pub(super) name: String,
    pub(super) median: f64,
    pub(super) min: f64,
    pub(super) max: f64,
}

impl Spread {
    /// None without a value.
    fn from_values(name: &str, mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        let (min, max) = (*values.first()?, *values.last()?);
        let median = f64::midpoint(values[(values.len() - 1) / 2], values[values.len() / 2]);
        Some(Self { name: name.to_owned(), median, min, max })
    }
}

/// One candidate's percentiles over another's, round by round.
#[derive(Debug, Serialize)]
pub(super) struct Ratio {
    pub(super) of: String,
    pub(super) to: String,
    /// Rounds that count for both.
    pub(super) n: usize,
    pub(super) percentiles: Vec<Spread>,
}

/// Percentiles, each with the fewest samples of a round that it is given for: ten lie above the 99th and the 99.9th.
const PERCENTILES: [(&str, f64, u64); 3] = [("p50", 0.5, 1), ("p99", 0.99, 1000), ("p99.9", 0.999, 10_000)];

impl Candidate {
    pub(super) fn from_rounds(name: &str, rounds: Vec<Round>) -> Self {
        let mut shares: BTreeMap<String, Vec<f64>> = BTreeMap::new();
        for (share, percent) in rounds.iter().flat_map(|round| round.shares.clone()) {
            shares.entry(share).or_default().push(percent);
        }
        let rounds: Vec<_> = rounds.into_iter().map(|round| round.durations).collect();
        let counted: Vec<_> = rounds.iter().filter(|round| !round.is_empty()).collect();
        let percentiles = PERCENTILES.iter().filter_map(|&(name, quantile, samples)| {
            let is_reached = counted.iter().all(|round| round.len() >= samples);
            let values = counted.iter().map(|round| round.value_at_quantile(quantile) as f64);
            is_reached.then(|| Spread::from_values(name, values.collect()))?
        });
        let max = Spread::from_values("max", counted.iter().map(|round| round.max() as f64).collect());
        Self {
            name: name.to_owned(),
            n: counted.len(),
            percentiles: percentiles.chain(max).collect(),
            shares: shares
                .into_iter()
                .filter_map(|(name, values)| Spread::from_values(&name, values))
                .collect(),
            rounds,
        }
    }

    /// This candidate's percentiles over another's, in the rounds that count for both. Maxima are not compared: they come
    /// from the machine.
    pub(super) fn ratio_to(&self, other: &Self) -> Ratio {
        let pairs = self.rounds.iter().zip(&other.rounds);
        let both: Vec<_> = pairs.filter(|(mine, its)| !mine.is_empty() && !its.is_empty()).collect();
        let percentiles = PERCENTILES.iter().filter_map(|&(name, quantile, samples)| {
            let is_reached = both.iter().all(|(mine, its)| mine.len().min(its.len()) >= samples);
            let of = |round: &Durations| round.value_at_quantile(quantile) as f64;
            is_reached.then(|| {
                Spread::from_values(name, both.iter().map(|(mine, its)| of(mine) / of(its)).collect())
            })?
        });
        Ratio {
            of: self.name.clone(),
            to: other.name.clone(),
            n: both.len(),
            percentiles: percentiles.collect(),
        }
    }

    pub(super) fn write_log(&self, bench: &str, folder: &Path) -> std::io::Result<()> {
        let name = self.name.replace(|c: char| !c.is_ascii_alphanumeric(), "-");
        let comment = format!("masseter bench {bench}: {}, ns, one line per round", self.name);
        let starts_ns = (0..).step_by(histogram_log::INTERVAL_NS as usize);
        let counted = starts_ns.zip(&self.rounds).filter(|(_, round)| !round.is_empty());
        histogram_log::write(&folder.join(format!("{bench}-{name}.hlog")), &comment, counted)
    }
}

#[cfg(test)]
mod tests {
    use super::super::durations::{no_durations, record};

    use super::*;

    fn round(value_ns: u64) -> Round {
        let mut round = no_durations();
        round.record(value_ns).unwrap();
        round.into()
    }

    fn figure(median: f64, min: f64, max: f64) -> Spread {
        Spread { name: "p50".to_owned(), median, min, max }
    }

    #[test]
    fn rounds_that_do_not_count_change_neither_percentiles_nor_ratios() {
        let uncounted = || Round::from(no_durations());
        let own = [round(100), uncounted(), uncounted(), round(300)];
        let other = [round(200), round(1), round(1), uncounted()];
        let [own, other] = [own, other].map(|rounds| Candidate::from_rounds("", rounds.into()));
        assert_eq!((own.n, other.n), (2, 3));
        assert_eq!(own.percentiles[0], figure(200.0, 100.0, 300.0));
        let ratio = own.ratio_to(&other);
        assert_eq!(ratio.n, 1);
        assert_eq!(ratio.percentiles[0], figure(0.5, 0.5, 0.5));
        let none = Candidate::from_rounds("", vec![uncounted()]);
        assert!(none.percentiles.is_empty() && none.ratio_to(&own).percentiles.is_empty());
    }

    #[test]
    fn a_percentile_that_fewer_than_ten_samples_exceed_is_not_given() {
        let of = |samples| {
            let mut round = no_durations();
            record(&mut round, 100, samples);
            let candidate = Candidate::from_rounds("", vec![round.into()]);
            let names =
                |figures: &[Spread]| figures.iter().map(|figure| figure.name.clone()).collect::<Vec<_>>();
            (names(&candidate.percentiles), names(&candidate.ratio_to(&candidate).percentiles))
        };
        assert_eq!(of(9_999).0, ["p50", "p99", "max"]);
        assert_eq!(of(9_999).1, ["p50", "p99"]);
        assert_eq!(of(10_000).0, ["p50", "p99", "p99.9", "max"]);
        assert_eq!(of(10_000).1, ["p50", "p99", "p99.9"]);
    }

    #[test]
    fn the_median_of_an_even_number_lies_between() {
        assert_eq!(Spread::from_values("p50", vec![4.0, 1.0, 3.0, 2.0]), Some(figure(2.5, 1.0, 4.0)));
        assert_eq!(Spread::from_values("p50", vec![3.0, 1.0, 2.0]), Some(figure(2.0, 1.0, 3.0)));
    }
}
