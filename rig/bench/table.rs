//! A bench's outcome as text for a terminal.

use std::fmt::Write;

use super::contender::{Figure, Share};
use super::contest::Outcome;

/// Contenders in µs, then their ratios: median (minimum to maximum) over the rounds.
pub(super) fn of(outcome: &Outcome) -> String {
    let rounds = outcome.contenders.first().map_or(0, |contender| contender.rounds.len());
    let mut text = format!(
        "\n{}: {}\nmedian (minimum–maximum) of {rounds} rounds, µs\n",
        outcome.bench, outcome.measures
    );
    for contender in &outcome.contenders {
        let of_rounds = counted(contender.n, contender.rounds.len());
        let _ = writeln!(text, "  {:<34} {}{of_rounds}", contender.name, line(&contender.figures, 1e-3));
        if !contender.shares.is_empty() {
            let _ = writeln!(text, "  {:<34} {}", "", shares(&contender.shares));
        }
    }
    if !outcome.ratios.is_empty() {
        text.push_str("ratios within a round\n");
    }
    for ratio in &outcome.ratios {
        let name = format!("{} / {}", ratio.of, ratio.to);
        if ratio.n > 0 {
            let _ = writeln!(text, "  {name:<34} {}{}", line(&ratio.figures, 1.0), counted(ratio.n, rounds));
        }
    }
    for note in &outcome.notes {
        let _ = writeln!(text, "  {note}");
    }
    if let Some(reason) = &outcome.disturbance.reason {
        let _ = writeln!(text, "INVALID: {reason}");
    }
    text
}

/// Said of what not all rounds count for.
fn counted(n: usize, rounds: usize) -> String {
    if n == rounds { String::new() } else { format!("  ({n} of {rounds} rounds count)") }
}

fn line(figures: &[Figure], scale: f64) -> String {
    let cells = figures.iter().map(|figure| {
        let [median, min, max] =
            [figure.spread.median, figure.spread.min, figure.spread.max].map(|value| short(value * scale));
        format!("{:<5} {:<20}", figure.name, format!("{median} ({min}–{max})"))
    });
    cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
}

fn shares(shares: &[Share]) -> String {
    let cells = shares.iter().map(|share| {
        let [median, min, max] = [share.percent.median, share.percent.min, share.percent.max].map(short);
        format!("{} {median} % ({min}–{max})", share.name)
    });
    cells.collect::<Vec<_>>().join(", ")
}

/// Three significant digits.
fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let whole_digits = value.abs().max(1e-9).log10().floor() as i32 + 1;
    format!("{value:.*}", (3 - whole_digits).clamp(0, 5) as usize)
}

#[cfg(test)]
mod tests {
    use super::short;

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
            assert_eq!(short(value), expected);
        }
    }
}
