//! Figs. 3 and 4: the error against the iteration for single guesses.

use masseter_charts::{Axis, Error, Legend, Line, LineChart, Scale, SeriesLabelPosition};

use super::draw::{SOLVER_COLOURS, draw};
use crate::figure::Figure;
use crate::pairs::{Course, Disagreement, Pair, Pairs};

/// Iterations shown.
const ITERATIONS: usize = 40;
/// Iterations shown of a cycle.
const LAST: usize = 20;
/// Errors below this are drawn there: they are zero but for rounding, cm².
const LEAST_CM2: f64 = 1e-30;

pub(super) fn figures(pairs: &Pairs) -> Result<Vec<Figure>, Error> {
    pairs.all().into_iter().map(figure).collect()
}

fn caption(Disagreement { title, clearest, share, .. }: &Disagreement) -> String {
    match clearest {
        Some(pair) => {
            format!("{title}. {}; {} of guesses above the base do so.", guess(pair), share.percent())
        }
        None => format!("{title}: no guess of this run does so."),
    }
}

fn guess(pair: &Pair) -> String {
    let list = |values: &[f64], scale: f64| {
        values.iter().map(|value| format!("{:.1}", value * scale)).collect::<Vec<_>>().join(", ")
    };
    format!(
        "d = ({}) mm, l = ({}) mm, guess θ = ({})°",
        list(&pair.actuators.slide_m, 1e3),
        list(&pair.actuators.leg_m, 1e3),
        list(&pair.guess_rad, 1f64.to_degrees())
    )
}

/// The error over the iterations. Beside an oscillation, which is nearly a flat line there, a panel shows its last cycles.
fn figure(disagreement: &Disagreement) -> Result<Figure, Error> {
    let oscillation = disagreement.clearest.as_ref().filter(|_| disagreement.newton == Course::Oscillates);
    let width = if oscillation.is_some() { 1140 } else { 760 };
    draw(disagreement.name, caption(disagreement), (width, 440), |area| {
        let Some(pair) = oscillation else { return course(disagreement).draw_on(area) };
        let (left, right) = area.split_horizontally(690);
        course(disagreement).draw_on(&left)?;
        last_cycles(&pair.newton_cm2).draw_on(&right)
    })
}

fn course(disagreement: &Disagreement) -> LineChart {
    let line = |name, errors: &[f64], colour| {
        let shown = errors.iter().take(ITERATIONS + 1).enumerate();
        let points = shown.map(|(at, error)| (at as f64, error.max(LEAST_CM2)));
        Line::new(name, points.collect()).coloured(colour).marked()
    };
    let [published, newton, _] = SOLVER_COLOURS;
    let lines = disagreement.clearest.as_ref().map_or_else(Vec::new, |pair| {
        vec![
            line("paper's solver", &pair.published_cm2, published),
            line("Newton–Raphson", &pair.newton_cm2, newton),
        ]
    });
    LineChart {
        title: disagreement.title.to_owned(),
        x: Axis::new("iteration", Scale::Linear, [0.0, ITERATIONS as f64]),
        y: Axis::fitted("error f₁² + f₂² + f₃², cm²", Scale::Log).including(1.0),
        lines,
        limits: Vec::new(),
        legend: Legend::Inside(SeriesLabelPosition::MiddleRight),
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
        limits: Vec::new(),
        legend: Legend::Inside(SeriesLabelPosition::UpperRight),
    }
}
