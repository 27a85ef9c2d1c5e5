//! A comparison as text for a terminal.

use masseter_scenario::wording::counted;

use super::candidate::{Ratio, Spread};
use super::comparison::Comparison;

/// Candidates in µs, then their ratios: median (minimum to maximum) over the rounds.
pub(super) fn text(comparison: &Comparison) -> String {
    let Comparison { bench, measures, candidates, ratios, notes, disturbance } = comparison;
    let rounds = candidates.first().map_or(0, |candidate| candidate.rounds.len());
    let of_rounds = |n| if n == rounds { String::new() } else { format!("  ({n} of {rounds} rounds count)") };
    let ratio_name = |ratio: &Ratio| format!("{} / {}", ratio.of, ratio.to);
    let names =
        candidates.iter().map(|candidate| candidate.name.clone()).chain(ratios.iter().map(ratio_name));
    let width = names.map(|name| name.chars().count()).max().unwrap_or(0);
    let row = |name: &str, figures: String| format!("  {name:<width$} {figures}\n");
    let mut text = format!(
        "\n{bench}: {measures}\nmedian (minimum–maximum) of {}, µs\n",
        counted(rounds as u64, "round")
    );
    for candidate in candidates {
        text += &row(&candidate.name, percentiles(&candidate.percentiles, 1e-3) + &of_rounds(candidate.n));
        if !candidate.shares.is_empty() {
            text += &row("", shares(&candidate.shares));
        }
    }
    if !ratios.is_empty() {
        text += "ratios within a round\n";
    }
    for ratio in ratios.iter().filter(|ratio| ratio.n > 0) {
        text += &row(&ratio_name(ratio), percentiles(&ratio.percentiles, 1.0) + &of_rounds(ratio.n));
    }
    text.extend(notes.iter().map(|note| format!("  {note}\n")));
    text.extend(disturbance.reason.iter().map(|reason| format!("INVALID: {reason}\n")));
    text
}

fn percentiles(figures: &[Spread], scale: f64) -> String {
    let cells = figures.iter().map(|figure| {
        let [median, min, max] = [figure.median, figure.min, figure.max].map(|value| short(value * scale));
        format!("{:<5} {:<20}", figure.name, format!("{median} ({min}–{max})"))
    });
    cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
}

fn shares(figures: &[Spread]) -> String {
    let cells = figures.iter().map(|figure| {
        let [median, min, max] = [figure.median, figure.min, figure.max].map(short);
        format!("{} {median} % ({min}–{max})", figure.name)
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
