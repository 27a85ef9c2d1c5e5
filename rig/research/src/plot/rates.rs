//! How often random guesses lead to the true solution, by their distance from it.

use masseter_charts::{Axis, Error, Line, LineChart, Scale, SeriesLabelPosition};

use super::colours::SOLVER_COLOURS;
use crate::sample::{GUESSES, Guesses};
use crate::share::Share;
use crate::solver::{COMPARED, Solver};
use crate::trials::Trials;

/// Where guesses anywhere above the base are drawn, °: each leg is within 90° of the vertical.
const ABOVE_BASE_DEG: f64 = 90.0;

pub(super) fn svg(trials: &Trials) -> Result<String, Error> {
    masseter_charts::svg((1100, 440), |area| {
        let panels = area.split_evenly((1, 2));
        panel("Any solution", |solver, guesses| trials.solved(solver, guesses)).draw_on(&panels[0])?;
        panel("The true solution", |solver, guesses| trials.true_ones(solver, guesses)).draw_on(&panels[1])
    })
}

fn panel(title: &str, share: impl Fn(Solver, Guesses) -> Share) -> LineChart {
    let line = |(solver, colour): (Solver, _)| {
        let point = |guesses| {
            let x = match guesses {
                Guesses::Within(deg) => deg,
                Guesses::AboveBase => ABOVE_BASE_DEG,
            };
            (x, 100.0 * share(solver, guesses).value())
        };
        Line::new(solver.short_name, GUESSES.into_iter().map(point).collect()).coloured(colour).marked()
    };
    LineChart {
        title: title.to_owned(),
        x: Axis::new("guesses within ±, °", Scale::Linear, [0.0, 95.0]),
        y: Axis::new("share of guesses, %", Scale::Linear, [0.0, 102.0]),
        lines: COMPARED.into_iter().zip(SOLVER_COLOURS).map(line).collect(),
        legend: SeriesLabelPosition::LowerLeft,
    }
}
