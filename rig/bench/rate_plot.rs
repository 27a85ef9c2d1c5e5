//! The outcome of `bench rate` as one small plot a quantity, over the rate.

use std::error::Error;

use plotters::prelude::*;

use super::contender::Contender;
use super::contest::Outcome;
use super::plot::{Curve, bound, draw_curves};
use super::rate::{RATES_HZ, ROUND_TRIP, contender_name};

const SIZE: (u32, u32) = (960, 760);

/// One of the plots.
struct Panel {
    quantity: &'static str,
    unit: &'static str,
    curves: Vec<Curve>,
}

/// The plots as one SVG; none when no rate has a run that counts.
pub(super) fn of(outcome: &Outcome) -> Option<String> {
    let panels = panels(outcome);
    bound(&panels[0].curves, |point| point.0, f64::max)?;
    let mut svg = String::new();
    draw(&mut svg, &panels).ok()?;
    Some(svg)
}

fn panels(outcome: &Outcome) -> [Panel; 4] {
    let trips = of_rates(outcome);
    let over_rate = |name: &str, value: &dyn Fn(&Contender) -> Option<f64>| Curve {
        name: name.to_owned(),
        points: trips.iter().filter_map(|(rate_khz, trip)| Some((*rate_khz, value(trip)?))).collect(),
    };
    let percentile =
        |name| over_rate(name, &|trip: &Contender| trip.median(name).map(|median_ns| median_ns / 1e3));
    let share = |name: &str, called: &str| {
        over_rate(called, &|trip: &Contender| {
            Some(trip.shares.iter().find(|share| share.name == name)?.percent.median)
        })
    };
    [
        Panel { quantity: ROUND_TRIP, unit: "µs", curves: vec![percentile("p50"), percentile("p99")] },
        Panel {
            quantity: "CPU time of a core",
            unit: "%",
            curves: ["controller", "plant", "recorder"]
                .map(|name| share(&format!("{name} CPU"), name))
                .into(),
        },
        Panel {
            quantity: "missed cycles",
            unit: "%",
            curves: vec![share("missed", "all"), share("missed by the machine", "by the machine")],
        },
        Panel { quantity: "dropped messages", unit: "%", curves: vec![share("dropped", "all")] },
    ]
}

/// The round trip of every rate in kHz; it carries the shares.
fn of_rates(outcome: &Outcome) -> Vec<(f64, &Contender)> {
    let trip = |rate_hz| outcome.contender(&contender_name(rate_hz, ROUND_TRIP));
    RATES_HZ.into_iter().map(|rate_hz| (f64::from(rate_hz) / 1e3, trip(rate_hz))).collect()
}

fn draw(svg: &mut String, panels: &[Panel; 4]) -> Result<(), Box<dyn Error>> {
    let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let [slowest, .., fastest] = RATES_HZ.map(|rate_hz| f64::from(rate_hz) / 1e3);
    for (area, panel) in area.split_evenly((2, 2)).iter().zip(panels) {
        let highest = bound(&panel.curves, |point| point.1, f64::max).unwrap_or(0.0);
        let mut chart = ChartBuilder::on(area)
            .margin(12)
            .caption(panel.quantity, ("sans-serif", 16))
            .x_label_area_size(36)
            .y_label_area_size(56)
            .build_cartesian_2d(slowest..fastest, 0.0..(1.3 * highest).max(1.0))?;
        draw_curves(&mut chart, &panel.curves, ["rate, kHz", panel.unit])?;
    }
    area.present()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::contender::{Round, durations, record};
    use super::super::disturbance::Watch;
    use super::*;

    #[test]
    fn every_quantity_is_drawn_over_the_rates_that_count() {
        let trip = |rate_hz: u32| {
            let mut taken = durations();
            record(&mut taken, 20_000, 1);
            let round = Round { durations: taken, shares: vec![("plant CPU".to_owned(), 40.0)] };
            let counts = rate_hz <= 5000;
            Contender::of(contender_name(rate_hz, ROUND_TRIP), vec![counts.then_some(round)])
        };
        let outcome = Outcome {
            bench: "rate",
            measures: String::new(),
            contenders: RATES_HZ.map(trip).into(),
            ratios: Vec::new(),
            notes: Vec::new(),
            disturbance: Watch::begin(&[0]).end(),
        };
        let [trips, cpu, ..] = panels(&outcome);
        let rates: Vec<_> = trips.curves[0].points.iter().map(|point| point.0).collect();
        assert_eq!(rates, [1.0, 2.0, 5.0]);
        assert_eq!(cpu.curves[1].points[0], (1.0, 40.0));
        let svg = of(&outcome).unwrap();
        for said in ["round trip", "CPU time of a core", "missed cycles", "dropped messages", "rate, kHz"] {
            assert!(svg.contains(said), "{said}");
        }
    }
}
