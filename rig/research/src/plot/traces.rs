//! Figs. 3 and 4: the error against the iteration for single guesses.

use masseter_charts::{Axis, Error, Line, LineChart, Scale, SeriesLabelPosition};

use super::colours::SOLVER_COLOURS;
use crate::pairs::{Course, Disagreement, Trace};

/// Iterations shown.
const ITERATIONS: usize = 40;
/// Iterations shown of a cycle.
const LAST: usize = 20;
/// Errors below this are drawn there: they are zero but for rounding, cm².
const LEAST_CM2: f64 = 1e-30;

/// The error over the iterations. Beside an oscillation, which is nearly a flat line there, a panel shows its last cycles.
pub(super) fn svg(disagreement: &Disagreement) -> Result<String, Error> {
    let oscillation =
        disagreement.clearest.as_ref().filter(|_| disagreement.courses[1] == Course::Oscillates);
    let width = if oscillation.is_some() { 1140 } else { 760 };
    masseter_charts::svg((width, 440), |area| {
        let Some(pair) = oscillation else { return course(disagreement).draw_on(area) };
        let (left, right) = area.split_horizontally(690);
        course(disagreement).draw_on(&left)?;
        last_cycles(&pair.traces[1].errors_cm2).draw_on(&right)
    })
}

fn course(disagreement: &Disagreement) -> LineChart {
    let line = |((name, trace), colour): ((_, &Trace), _)| {
        let shown = trace.errors_cm2.iter().take(ITERATIONS + 1).enumerate();
        let points = shown.map(|(at, error)| (at as f64, error.max(LEAST_CM2)));
        Line::new(name, points.collect()).coloured(colour).marked()
    };
    let traces = disagreement.clearest.iter().flat_map(|pair| &pair.traces);
    let named = ["paper's solver", "Newton–Raphson"].into_iter().zip(traces);
    LineChart {
        title: disagreement.title.to_owned(),
        x: Axis::new("iteration", Scale::Linear, [0.0, ITERATIONS as f64]),
        y: Axis::fitted("error f₁² + f₂² + f₃², cm²", Scale::Log).including(1.0),
        lines: named.zip(SOLVER_COLOURS).map(line).collect(),
        legend: SeriesLabelPosition::MiddleRight,
    }
}

/// Newton–Raphson's last errors on a linear axis that they fill.
fn last_cycles(errors_cm2: &[f64]) -> LineChart {
    let from = errors_cm2.len().saturating_sub(LAST);
    let points = (from..).map(|at| at as f64).zip(errors_cm2[from..].iter().copied());
    let [_, colour, _] = SOLVER_COLOURS;
    LineChart {
        title: "Newton–Raphson: last cycles".to_owned(),
        x: Axis::fitted("iteration", Scale::Linear),
        y: Axis::fitted("", Scale::Linear),
        lines: vec![Line::new("", points.collect()).coloured(colour).marked()],
        legend: SeriesLabelPosition::UpperRight,
    }
}
