//! How the margins of many checks are spread: a histogram, in which what fails differs from what holds.
//!
//! Margins beyond a whole limit are counted in the bar at that end. One check far beyond its limit would else hide all others.

use crate::chart::{Across, Chart, Scale, Series};

/// Height of the plot, px.
const HEIGHT: u32 = 130;
/// Most bars.
const MOST: f64 = 24.0;
/// Widths of a bar, percent. Each ends a bar at 0.
const WIDTHS: [f64; 5] = [1.0, 2.0, 5.0, 10.0, 20.0];
/// Margins beyond this are counted at the end, percent.
const END: f64 = 100.0;

/// A histogram of margins, each a share of its limit. `noun` is what has a margin; none without a margin.
#[must_use]
pub fn margin_histogram(title: &str, noun: &str, margins: &[f64]) -> Option<Chart> {
    let percents: Vec<_> = margins
        .iter()
        .filter(|margin| !margin.is_nan())
        .map(|margin| (margin * 100.0).clamp(-END, END))
        .collect();
    let [low, high] = [f64::min, f64::max].map(|end| percents.iter().copied().reduce(end));
    let (low, high) = (low?.min(0.0), high?.max(0.0));
    let width = WIDTHS.into_iter().find(|width| (high - low) / width <= MOST - 2.0).unwrap_or(END / 5.0);
    // What is exactly 0 holds; a whole limit belongs to the last bar.
    let place = |percent: f64| (percent / width).floor().min(END / width - 1.0) as i64;
    let bars = |places: std::ops::RangeInclusive<i64>| {
        places.map(|bar| {
            let count = percents.iter().filter(|percent| place(**percent) == bar).count();
            let [from, to] = [bar, bar + 1].map(|edge| edge as f64 * width);
            let words = match (from <= -END, to >= END) {
                (true, _) => format!("{to} % or less"),
                (_, true) => format!("{from} % or more"),
                _ => format!("{from} to {to} %"),
            };
            let plural = if count == 1 { "" } else { "s" };
            ((f64::midpoint(from, to), count as f64), format!("{count} {noun}{plural}, margin {words}"))
        })
    };
    // Two bars at least say how wide a bar is.
    let (first, last) = (place(low).min(-1), place(high).max(0));
    let series = [("fail", 1, bars(first..=-1)), ("hold", 0, bars(0..=last))];
    let series = series.map(|(name, colour, bars)| Series::bars(name, bars).coloured(colour));
    let across = Across::Quantity { label: "margin, % of the limit".to_owned(), scale: Scale::Linear };
    Some(Chart { across, series: series.into(), height: HEIGHT, ..Chart::over_time(title, "") })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(chart: &Chart) -> Vec<(f64, f64)> {
        chart.series.iter().flat_map(|series| series.points.iter()).collect()
    }

    #[test]
    fn every_margin_is_in_one_bar_and_what_fails_lies_below_nothing() {
        let margins = [-53.0, -0.0001, 0.0, 0.999, 1.0, 7.0, f64::NAN];
        let chart = margin_histogram("Margins", "case", &margins).unwrap();
        let [fail, hold] = &chart.series[..] else { panic!("two series") };
        let sum = |series: &Series| series.points.iter().map(|(_, count)| count).sum::<f64>();
        assert_eq!((sum(fail), sum(hold)), (2.0, 4.0));
        assert_eq!(fail.names[0], "1 case, margin -90 % or less");
        assert_eq!(hold.names.last().unwrap(), "3 cases, margin 90 % or more");
        assert!(counts(&chart).windows(2).all(|pair| (pair[1].0 - pair[0].0 - 10.0).abs() < 1e-9));
    }

    #[test]
    fn close_margins_have_narrow_bars_and_one_margin_has_two() {
        let chart = margin_histogram("Margins", "case", &[0.02, 0.031, 0.042]).unwrap();
        assert_eq!(counts(&chart), [(-0.5, 0.0), (0.5, 0.0), (1.5, 0.0), (2.5, 1.0), (3.5, 1.0), (4.5, 1.0)]);
        let all_but_one = margin_histogram("Margins", "case", &[0.0]).unwrap();
        assert_eq!(counts(&all_but_one), [(-0.5, 0.0), (0.5, 1.0)]);
        assert_eq!(margin_histogram("Margins", "case", &[]), None);
    }
}
