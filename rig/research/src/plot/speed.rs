//! Fig. 5: iterations and time of a solution.

use masseter_charts::{Area, Axis, Bar, Error, Line, LineChart, Scale, SeriesLabelPosition, bars, chart};

use super::colours::SOLVER_COLOURS;
use crate::sample::Guesses;
use crate::solver::{COMPARED, Solver};
use crate::speed::Timing;
use crate::study::Study;

/// Iterations shown.
const MOST: usize = 40;

pub(super) fn svg(study: &Study) -> Result<String, Error> {
    masseter_charts::svg((1100, 460), |area| {
        let (left, right) = area.split_horizontally(580);
        iterations(study).draw_on(&left)?;
        times(&right, study)
    })
}

fn iterations(study: &Study) -> LineChart {
    let trials = study.trials.with(Guesses::AboveBase).len() as f64;
    let line = |(solver, colour): (Solver, _)| {
        let counts = study.trials.histogram(solver);
        let mut solved = 0;
        let points = (0..=MOST).map(|iterations| {
            solved += counts.get(iterations).copied().unwrap_or(0);
            (iterations as f64, 100.0 * solved as f64 / trials)
        });
        Line::new(solver.short_name, points.collect()).coloured(colour)
    };
    LineChart {
        title: "Solved within so many iterations".to_owned(),
        x: Axis::new("iterations", Scale::Linear, [0.0, MOST as f64]),
        y: Axis::new("share of guesses solved, %", Scale::Linear, [0.0, 102.0]),
        lines: COMPARED.into_iter().zip(SOLVER_COLOURS).map(line).collect(),
        legend: SeriesLabelPosition::LowerRight,
    }
}

/// Bars from 10 ns upwards, by decades.
fn times(area: &Area, study: &Study) -> Result<(), Error> {
    let medians_ns =
        study.speed.iter().flat_map(|situation| situation.timings).map(|timing| timing.median_ns);
    let names = study.speed.iter().map(|situation| situation.name.to_owned()).collect();
    let y = Axis::new("median, ns", Scale::Log, [10.0, medians_ns.fold(1e3, f64::max) * 4.0]);
    let mut chart = chart(area, "Time of a solution", Axis::of_names("", names), y)?;
    for (group, situation) in study.speed.iter().enumerate() {
        let bar = |(index, (timing, colour)): (usize, (Timing, _))| {
            let left = group as f64 - 0.42 + 0.29 * index as f64;
            let text = vec![format!("{:.0} ns", timing.median_ns), format!("×{:.2}", timing.to_newton)];
            Bar { sides: [left, left + 0.26], height: timing.median_ns, colour, text }
        };
        let shown = situation.timings.into_iter().zip(SOLVER_COLOURS).enumerate().map(bar);
        bars(&mut chart, &shown.filter(|bar| bar.height.is_finite()).collect::<Vec<_>>())?;
    }
    Ok(())
}
