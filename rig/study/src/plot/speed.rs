//! Fig. 5: how many iterations and how much time a solution takes.

use plotters::prelude::*;

use super::axes::{Axes, curve, named, percent, plain, power_of_ten};
use super::{Area, Figure, SOLVERS, TEXT, write};
use crate::Study;
use crate::contender::SHOWN;
use crate::sample::Guesses;
use crate::speed::Situation;

/// Iterations shown.
const MOST: usize = 40;
const SITUATIONS: [Situation; 2] = [Situation::Random, Situation::Warm];

pub(super) fn figure(study: &Study) -> anyhow::Result<Figure> {
    let caption = "Fig. 5. Left: share of guesses above the base that have led to any solution after so many \
                   iterations (the controller's count is of its last start; a cold one eliminates first). Right: median \
                   time of a solution, with the ratio to Newton–Raphson's; from random guesses only where all three \
                   arrive.";
    Figure::draw("fig5_speed", caption.to_owned(), (1100, 460), |area| {
        let (left, right) = area.split_horizontally(580);
        iterations(&left, study)?;
        times(&right, study)
    })
}

fn iterations(area: &Area, study: &Study) -> anyhow::Result<()> {
    let axes = Axes {
        title: "Solved within so many iterations",
        x: ("iterations", 0.0..MOST as f64, plain),
        y: ("share of guesses solved", 0.0..1.02, percent),
    };
    let mut chart = axes.on(area)?;
    let trials = study.trials.with(Guesses::AboveBase).len() as f64;
    for (contender, colour) in SHOWN.into_iter().zip(SOLVERS) {
        let counts = study.trials.histogram(contender);
        let mut solved = 0;
        let points: Vec<_> = (0..=MOST)
            .map(|iterations| {
                solved += counts.get(iterations).copied().unwrap_or(0);
                (iterations as f64, solved as f64 / trials)
            })
            .collect();
        curve(&mut chart, contender.short_name(), &points, colour, false)?;
    }
    named(&mut chart, SeriesLabelPosition::LowerRight)
}

/// Bars from 10 ns upwards, by decades.
fn times(area: &Area, study: &Study) -> anyhow::Result<()> {
    let most_ns = study.speed.taken.iter().map(|taken| taken.median_ns).fold(1e3, f64::max);
    let (low, high) = (1.0, (most_ns * 2.0).log10().ceil());
    let axes = Axes {
        title: "Time of a solution",
        x: ("", 0.0..8.0, |_| String::new()),
        y: ("median, ns", low..high, power_of_ten),
    };
    let mut chart = axes.on(area)?;
    for (group, situation) in SITUATIONS.into_iter().enumerate() {
        for (place, (contender, colour)) in SHOWN.into_iter().zip(SOLVERS).enumerate() {
            let taken = study.speed.of(situation, contender);
            if !taken.median_ns.is_finite() {
                continue;
            }
            let (x, top) = (0.5 + 4.0 * group as f64 + place as f64, taken.median_ns.log10());
            chart.draw_series([Rectangle::new([(x, low), (x + 0.9, top)], colour.filled())])?;
            let label = format!("{:.0} ns\n×{:.2}", taken.median_ns, taken.to_newton);
            for (line, text) in label.lines().enumerate() {
                let lift = 0.30 - 0.14 * line as f64;
                let style = ("sans-serif", TEXT - 2);
                chart.draw_series([Text::new(text.to_owned(), (x + 0.02, top + lift), style)])?;
            }
        }
    }
    let (width, height) = area.dim_in_pixel();
    let middle = |group: i32| 76 + (width as i32 - 94) * (4 * group) / 8;
    for (group, situation) in (0..).zip(SITUATIONS) {
        let (from, rest) = situation.name().split_once(' ').unwrap_or((situation.name(), ""));
        write(area, &format!("{from} {rest}"), (middle(group), height as i32 - 36), TEXT - 2)?;
    }
    Ok(())
}
