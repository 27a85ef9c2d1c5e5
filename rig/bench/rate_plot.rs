//! The results of `bench rate`: one small chart for each quantity, over the rate.

use masseter_charts::{Axis, Error, Legend, Line, LineChart, Scale, SeriesLabelPosition, svg};

use super::candidate::Candidate;
use super::comparison::Comparison;
use super::rate::{RATES_HZ, ROUND_TRIP, candidate_name};

const SIZE: (u32, u32) = (960, 760);
/// Height of a y axis over the greatest value: the legend needs room.
const ROOM: f64 = 1.3;

/// The charts as one SVG; none when no rate has a run that counts.
pub(super) fn of_rates(comparison: &Comparison) -> Option<String> {
    let panels = panels(comparison);
    let is_empty = panels[0].lines.iter().all(|line| line.points.is_empty());
    if is_empty { None } else { draw(panels).ok() }
}

fn draw(panels: [LineChart; 4]) -> Result<String, Error> {
    svg(SIZE, |area| {
        area.split_evenly((2, 2)).iter().zip(panels).try_for_each(|(area, panel)| panel.draw_on(area))
    })
}

fn panels(comparison: &Comparison) -> [LineChart; 4] {
    let trips = round_trips(comparison);
    let over_rate = |name: &str, value: &dyn Fn(&Candidate) -> Option<f64>| {
        let points = trips.iter().filter_map(|(rate_khz, trip)| Some((*rate_khz, value(trip)?)));
        Line::new(name, points.collect()).marked()
    };
    let percentile =
        |name| over_rate(name, &|trip: &Candidate| trip.median(name).map(|median_ns| median_ns / 1e3));
    let share = |name: &str, label: &str| {
        over_rate(label, &|trip: &Candidate| {
            Some(trip.shares.iter().find(|share| share.name == name)?.percent.median)
        })
    };
    let cpu = ["controller", "plant", "recorder"].map(|name| share(&format!("{name} CPU"), name));
    [
        panel(ROUND_TRIP, "µs", vec![percentile("p50"), percentile("p99")]),
        panel("CPU time of a core", "%", cpu.into()),
        panel(
            "missed cycles",
            "%",
            vec![share("missed", "all"), share("missed by the machine", "by the machine")],
        ),
        panel("dropped messages", "%", vec![share("dropped", "all")]),
    ]
}

fn panel(quantity: &str, unit: &str, lines: Vec<Line>) -> LineChart {
    let [slowest, .., fastest] = RATES_HZ.map(|rate_hz| f64::from(rate_hz) / 1e3);
    let values = lines.iter().flat_map(|line| &line.points).map(|point| point.1);
    let highest = (ROOM * values.fold(0.0, f64::max)).max(1.0);
    LineChart {
        title: quantity.to_owned(),
        x: Axis::new("rate, kHz", Scale::Linear, [slowest, fastest]),
        y: Axis::new(unit, Scale::Linear, [0.0, highest]),
        lines,
        limits: Vec::new(),
        legend: Legend::Inside(SeriesLabelPosition::UpperLeft),
    }
}

/// The round trip of every rate in kHz; it carries the shares.
fn round_trips(comparison: &Comparison) -> Vec<(f64, &Candidate)> {
    let trip = |rate_hz| comparison.candidate(&candidate_name(rate_hz, ROUND_TRIP));
    RATES_HZ.into_iter().map(|rate_hz| (f64::from(rate_hz) / 1e3, trip(rate_hz))).collect()
}

#[cfg(test)]
mod tests {
    use super::super::candidate::{Round, no_durations, record};
    use super::super::disturbance::Stillness;
    use super::*;

    #[test]
    fn every_quantity_is_drawn_over_the_rates_that_count() {
        let trip = |rate_hz: u32| {
            let mut taken = no_durations();
            record(&mut taken, 20_000, 1);
            let round = Round { durations: taken, shares: vec![("plant CPU".to_owned(), 40.0)] };
            let counts = rate_hz <= 5000;
            Candidate::from_rounds(candidate_name(rate_hz, ROUND_TRIP), vec![counts.then_some(round)])
        };
        let comparison = Comparison {
            bench: "rate",
            measures: String::new(),
            candidates: RATES_HZ.map(trip).into(),
            ratios: Vec::new(),
            notes: Vec::new(),
            disturbance: Stillness::begin(&[0]).end(),
        };
        let [trips, cpu, ..] = panels(&comparison);
        let rates: Vec<_> = trips.lines[0].points.iter().map(|point| point.0).collect();
        assert_eq!(rates, [1.0, 2.0, 5.0]);
        assert_eq!(cpu.lines[1].points[0], (1.0, 40.0));
        let svg = of_rates(&comparison).unwrap();
        for said in ["round trip", "CPU time of a core", "missed cycles", "dropped messages", "rate, kHz"] {
            assert!(svg.contains(said), "{said}");
        }
    }
}
