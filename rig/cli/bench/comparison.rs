//! A comparison: candidates take turns, and the machine is observed between them.
//!
//! Statistics of the rounds are computed by [`candidate`](super::candidate).

use serde::Serialize;

use super::candidate::{Candidate, Ratio, Round};
use super::disturbance::{Disturbance, Stillness};

/// Measures one round of a candidate.
pub(super) type Turn<'a> = Box<dyn FnMut() -> anyhow::Result<Round> + 'a>;

/// The results of a bench.
#[derive(Debug, Serialize)]
pub(super) struct Comparison {
    pub(super) bench: &'static str,
    /// What the durations measure.
    pub(super) measures: &'static str,
    pub(super) candidates: Vec<Candidate>,
    pub(super) ratios: Vec<Ratio>,
    pub(super) notes: Vec<String>,
    #[serde(flatten)]
    pub(super) disturbance: Disturbance,
}

/// Measures all rounds of so many candidates and observes the machine on the cores in use. Each round begins with another
/// candidate. Returns the results of each candidate.
pub(super) fn take_turns<T>(
    rounds: u32,
    candidates: usize,
    cores: &[usize],
    mut measure: impl FnMut(usize) -> anyhow::Result<T>,
) -> anyhow::Result<(Vec<Vec<T>>, Disturbance)> {
    let mut results: Vec<Vec<T>> = (0..candidates).map(|_| Vec::new()).collect();
    let mut stillness = Stillness::begin(cores);
    for round in 0..rounds as usize {
        for turn in 0..candidates {
            let index = (round + turn) % candidates;
            stillness.observe();
            results[index].push(measure(index)?);
        }
    }
    Ok((results, stillness.end()))
}

impl Comparison {
    /// Measures candidates that take turns.
    pub(super) fn by_turns(
        bench: &'static str,
        measures: &'static str,
        rounds: u32,
        cores: &[usize],
        mut turns: Vec<(&str, Turn)>,
    ) -> anyhow::Result<Self> {
        let (results, disturbance) = take_turns(rounds, turns.len(), cores, |index| turns[index].1())?;
        let named = turns.iter().zip(results);
        let candidates = named.map(|((name, _), rounds)| Candidate::from_rounds(name, rounds)).collect();
        Ok(Self { bench, measures, candidates, ratios: Vec::new(), notes: Vec::new(), disturbance })
    }

    /// Compares the first candidate of each pair, by its name, with the second.
    ///
    /// # Panics
    /// When no candidate has one of the names.
    #[must_use]
    pub(super) fn comparing<Name: AsRef<str>>(
        mut self,
        pairs: impl IntoIterator<Item = (Name, Name)>,
    ) -> Self {
        let candidate = |name: &str| {
            let found = self.candidates.iter().find(|candidate| candidate.name == name);
            found.unwrap_or_else(|| panic!("no candidate is called {name}"))
        };
        let ratio = |(of, to): (Name, Name)| candidate(of.as_ref()).ratio_to(candidate(to.as_ref()));
        self.ratios = pairs.into_iter().map(ratio).collect();
        self
    }
}

#[cfg(test)]
mod tests {
    use super::super::candidate::Spread;
    use super::super::durations::no_durations;
    use super::*;

    fn round(value_ns: u64) -> Round {
        let mut round = no_durations();
        round.record(value_ns).unwrap();
        round.into()
    }

    #[test]
    fn candidates_take_turns_and_are_compared_within_a_round() {
        let order = std::cell::RefCell::new(Vec::new());
        // The machine gets slower from round to round; the ratio stays.
        let turn = |name: &'static str, ns: u64| {
            let (order, mut pace) = (&order, 0);
            let turn: Turn = Box::new(move || {
                order.borrow_mut().push(name);
                pace += 1;
                Ok(round(ns * pace))
            });
            (name, turn)
        };
        let turns = vec![turn("a", 100), turn("b", 400)];
        let comparison = Comparison::by_turns("x", "", 3, &[0], turns).unwrap().comparing([("a", "b")]);
        assert_eq!(*order.borrow(), ["a", "b", "b", "a", "a", "b"]);
        let [p50] = &comparison.ratios[0].percentiles[..] else { panic!("{:?}", comparison.ratios) };
        assert_eq!(*p50, Spread { name: "p50".to_owned(), median: 0.25, min: 0.25, max: 0.25 });
        assert_eq!(
            comparison.candidates[0].percentiles[0],
            Spread { name: "p50".to_owned(), median: 200.0, min: 100.0, max: 300.0 }
        );
    }

    #[test]
    #[should_panic(expected = "no candidate is called c")]
    fn an_unknown_candidate_cannot_be_compared() {
        let turn: Turn = Box::new(|| Ok(round(1)));
        let comparison = Comparison::by_turns("x", "", 1, &[0], vec![("a", turn)]).unwrap();
        let _ = comparison.comparing([("a", "c")]);
    }
}
