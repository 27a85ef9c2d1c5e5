//! Figs. 3 and 4: the error against the iteration for single guesses.

use plotters::prelude::SeriesLabelPosition;

use super::axes::{Axes, curve, named, plain, power_of_ten};
use super::{Area, Figure, SOLVERS};
use crate::pairs::{Course, Pair, Pairs, Parting};

/// Iterations shown.
const SHOWN: usize = 40;
/// Iterations shown of a cycle.
const LAST: usize = 20;
/// Errors below this are drawn there: they are zero but for rounding, cm².
const LEAST_CM2: f64 = 1e-30;

pub(super) fn figures(pairs: &Pairs) -> anyhow::Result<Vec<Figure>> {
    pairs.all().into_iter().map(figure).collect()
}

fn caption(Parting { title, clearest, share, .. }: &Parting) -> String {
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
fn figure(parting: &Parting) -> anyhow::Result<Figure> {
    let oscillation = parting.clearest.as_ref().filter(|_| parting.newton == Course::Oscillates);
    let width = if oscillation.is_some() { 1140 } else { 760 };
    Figure::draw(parting.name, caption(parting), (width, 440), |area| {
        let Some(pair) = oscillation else { return course(area, parting) };
        let (left, right) = area.split_horizontally(690);
        course(&left, parting)?;
        last_cycles(&right, &pair.newton_cm2)
    })
}

fn course(area: &Area, parting: &Parting) -> anyhow::Result<()> {
    let points = |errors: &[f64]| -> Vec<(f64, f64)> {
        let shown = errors.iter().take(SHOWN + 1).enumerate();
        shown.map(|(at, error)| (at as f64, error.max(LEAST_CM2).log10())).collect()
    };
    let pair = parting.clearest.as_ref();
    let traces = pair.map(|pair| [points(&pair.published_cm2), points(&pair.newton_cm2)]).unwrap_or_default();
    let all = || traces.iter().flatten();
    let last = all().map(|point| point.0).fold(1.0, f64::max);
    let low = all().map(|point| point.1).fold(0.0, f64::min).floor();
    let high = all().map(|point| point.1).fold(1.0, f64::max).ceil();
    let axes = Axes {
        title: parting.title,
        x: ("iteration", 0.0..last, plain),
        y: ("error f₁² + f₂² + f₃², cm²", low..high, power_of_ten),
    };
    let mut chart = axes.on(area)?;
    for ((points, solver), colour) in traces.iter().zip(["paper's solver", "Newton–Raphson"]).zip(SOLVERS) {
        curve(&mut chart, solver, points, colour, true)?;
    }
    named(&mut chart, SeriesLabelPosition::MiddleRight)
}

/// Newton–Raphson's last errors on a linear axis that they fill.
fn last_cycles(area: &Area, errors_cm2: &[f64]) -> anyhow::Result<()> {
    let from = errors_cm2.len().saturating_sub(LAST);
    let points: Vec<_> = (from..).map(|at| at as f64).zip(errors_cm2[from..].iter().copied()).collect();
    let extreme = |pick: fn(f64, f64) -> f64| points.iter().map(|point| point.1).reduce(pick).unwrap_or(1.0);
    let (low, high) = (extreme(f64::min), extreme(f64::max));
    let margin = 0.15 * (high - low);
    let axes = Axes {
        title: "Newton–Raphson: last cycles",
        x: ("iteration", from as f64..(errors_cm2.len() - 1) as f64, plain),
        y: ("", low - margin..high + margin, plain),
    };
    let [_, colour, _] = SOLVERS;
    curve(&mut axes.on(area)?, "", &points, colour, true)
}
