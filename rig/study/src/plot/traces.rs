//! Figs. 3 and 4: the error against the iteration for single guesses.

use plotters::prelude::SeriesLabelPosition;

use super::axes::{Axes, curve, named, plain, power_of_ten};
use super::{Figure, SOLVERS};
use crate::pairs::{Pair, Pairs, Parting};

/// Iterations shown.
const SHOWN: usize = 40;
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

fn figure(parting: &Parting) -> anyhow::Result<Figure> {
    Figure::draw(parting.name, caption(parting), (760, 440), |area| {
        let points = |errors: &[f64]| -> Vec<(f64, f64)> {
            let shown = errors.iter().take(SHOWN + 1).enumerate();
            shown.map(|(at, error)| (at as f64, error.max(LEAST_CM2).log10())).collect()
        };
        let pair = parting.clearest.as_ref();
        let traces =
            pair.map(|pair| [points(&pair.published_cm2), points(&pair.newton_cm2)]).unwrap_or_default();
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
        for ((points, solver), colour) in traces.iter().zip(["paper's solver", "Newton–Raphson"]).zip(SOLVERS)
        {
            curve(&mut chart, solver, points, colour, true)?;
        }
        named(&mut chart, SeriesLabelPosition::MiddleRight)
    })
}
