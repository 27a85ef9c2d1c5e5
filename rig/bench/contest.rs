//! Contenders taking turns, and what a bench found of them. What their rounds amount to is told by
//! [`contender`](super::contender).

use std::path::Path;

use serde::Serialize;

use super::contender::{Contender, Ratio, Round};
use super::disturbance::{Disturbance, Watch};

/// Plays a round of a contender.
pub(super) type Turn<'a> = Box<dyn FnMut() -> anyhow::Result<Round> + 'a>;

/// Everything a bench found.
#[derive(Debug, Serialize)]
pub(super) struct Outcome {
    pub(super) bench: &'static str,
    /// What the durations are, in a sentence.
    pub(super) measures: String,
    pub(super) contenders: Vec<Contender>,
    pub(super) ratios: Vec<Ratio>,
    pub(super) notes: Vec<String>,
    #[serde(flatten)]
    pub(super) disturbance: Disturbance,
}

/// Plays every round of so many contenders, each beginning with another one, and watches the machine from the
/// cores in use. The results lie by contender.
pub(super) fn take_turns<T>(
    rounds: u32,
    contenders: usize,
    cores: &[usize],
    mut play: impl FnMut(usize) -> anyhow::Result<T>,
) -> anyhow::Result<(Vec<Vec<T>>, Disturbance)> {
    let mut results: Vec<Vec<T>> = (0..contenders).map(|_| Vec::new()).collect();
    let mut watch = Watch::begin(cores);
    for round in 0..rounds as usize {
        for turn in 0..contenders {
            let index = (round + turn) % contenders;
            watch.look();
            results[index].push(play(index)?);
        }
    }
    Ok((results, watch.end()))
}

impl Outcome {
    /// Lets the contenders take turns.
    pub(super) fn of_turns(
        bench: &'static str,
        measures: String,
        rounds: u32,
        cores: &[usize],
        mut turns: Vec<(String, Turn)>,
    ) -> anyhow::Result<Self> {
        let (results, disturbance) = take_turns(rounds, turns.len(), cores, |index| turns[index].1())?;
        let names = turns.into_iter().map(|(name, _)| name);
        let contenders = names
            .zip(results)
            .map(|(name, rounds)| Contender::of(name, rounds.into_iter().map(Some).collect()))
            .collect();
        Ok(Self { bench, measures, contenders, ratios: Vec::new(), notes: Vec::new(), disturbance })
    }

    /// Compares the first contender of each pair with the second.
    ///
    /// # Panics
    /// At a name that no contender has.
    #[must_use]
    pub(super) fn comparing<Name: AsRef<str>>(
        mut self,
        pairs: impl IntoIterator<Item = (Name, Name)>,
    ) -> Self {
        let ratio = |(of, to): (Name, Name)| self.contender(of.as_ref()).over(self.contender(to.as_ref()));
        self.ratios = pairs.into_iter().map(ratio).collect();
        self
    }

    /// The contender of this name.
    ///
    /// # Panics
    /// If there is none.
    pub(super) fn contender(&self, name: &str) -> &Contender {
        let found = self.contenders.iter().find(|contender| contender.name == name);
        found.unwrap_or_else(|| panic!("no contender is called {name}"))
    }

    #[must_use]
    pub(super) fn noting(mut self, note: impl Into<String>) -> Self {
        self.notes.push(note.into());
        self
    }

    /// HdrHistogram V2 interval logs, a line a round.
    pub(super) fn write_logs(&self, folder: &Path) -> std::io::Result<()> {
        self.contenders.iter().try_for_each(|contender| contender.write_log(self.bench, folder))
    }
}

#[cfg(test)]
mod tests {
    use super::super::contender::{Spread, durations};
    use super::*;

    fn round(value_ns: u64) -> Round {
        let mut round = durations();
        round.record(value_ns).unwrap();
        round.into()
    }

    #[test]
    fn contenders_take_turns_and_are_compared_within_a_round() {
        let order = std::cell::RefCell::new(Vec::new());
        // The machine gets slower from round to round; the ratio stays.
        let turn = |name: &'static str, ns: u64| {
            let (order, mut pace) = (&order, 0);
            let turn: Turn = Box::new(move || {
                order.borrow_mut().push(name);
                pace += 1;
                Ok(round(ns * pace))
            });
            (name.to_owned(), turn)
        };
        let turns = vec![turn("a", 100), turn("b", 400)];
        let outcome = Outcome::of_turns("x", String::new(), 3, &[0], turns).unwrap().comparing([("a", "b")]);
        assert_eq!(*order.borrow(), ["a", "b", "b", "a", "a", "b"]);
        let [p50, p99] = &outcome.ratios[0].figures[..] else { panic!("{:?}", outcome.ratios) };
        assert_eq!(p50.spread, Spread { median: 0.25, min: 0.25, max: 0.25 });
        assert_eq!(p99.name, "p99");
        assert_eq!(outcome.contenders[0].figures[0].spread, Spread { median: 200.0, min: 100.0, max: 300.0 });
    }

    #[test]
    #[should_panic(expected = "no contender is called c")]
    fn a_contender_that_is_none_cannot_be_compared() {
        let turn: Turn = Box::new(|| Ok(round(1)));
        let outcome = Outcome::of_turns("x", String::new(), 1, &[0], vec![("a".to_owned(), turn)]).unwrap();
        let _ = outcome.comparing([("a", "c")]);
    }
}
