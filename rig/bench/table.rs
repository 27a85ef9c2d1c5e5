//! A comparison as text for a terminal.

use std::fmt::Write;

use super::candidate::{Percentile, Share};
use super::comparison::Comparison;

/// Candidates in µs, then their ratios: median (minimum to maximum) over the rounds.
pub(super) fn text(comparison: &Comparison) -> String {
    let rounds = comparison.candidates.first().map_or(0, |candidate| candidate.rounds.len());
    let mut text = format!(
        "\n{}: {}\nmedian (minimum–maximum) of {rounds} rounds, µs\n",
        comparison.bench, comparison.measures
    );
    for candidate in &comparison.candidates {
        let of_rounds = counted(candidate.n, candidate.rounds.len());
        let _ = writeln!(text, "  {:<34} {}{of_rounds}", candidate.name, line(&candidate.percentiles, 1e-3));
        if !candidate.shares.is_empty() {
            let _ = writeln!(text, "  {:<34} {}", "", shares(&candidate.shares));
        }
    }
    if !comparison.ratios.is_empty() {
        text.push_str("ratios within a round\n");
    }
    for ratio in &comparison.ratios {
        let name = format!("{} / {}", ratio.of, ratio.to);
        if ratio.n > 0 {
            let _ =
                writeln!(text, "  {name:<34} {}{}", line(&ratio.percentiles, 1.0), counted(ratio.n, rounds));
        }
    }
    for note in &comparison.notes {
        let _ = writeln!(text, "  {note}");
    }
    if let Some(reason) = &comparison.disturbance.reason {
        let _ = writeln!(text, "INVALID: {reason}");
    }
    text
}

/// A remark where some rounds do not count.
fn counted(n: usize, rounds: usize) -> String {
    if n == rounds { String::new() } else { format!("  ({n} of {rounds} rounds count)") }
}

fn line(percentiles: &[Percentile], scale: f64) -> String {
    let cells = percentiles.iter().map(|percentile| {
        let [median, min, max] = [percentile.spread.median, percentile.spread.min, percentile.spread.max]
            .map(|value| short(value * scale));
        format!("{:<5} {:<20}", percentile.name, format!("{median} ({min}–{max})"))
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
