//! How often random guesses lead to the true solution, by how far away they are.

use plotters::prelude::*;

use super::axes::{Axes, curve, named, percent, plain};
use super::{Area, Figure, SOLVERS};
use crate::contender::{Contender, SHOWN};
use crate::sample::{GUESSES, Guesses};
use crate::share::Share;
use crate::trials::Trials;

/// Where guesses anywhere above the base are drawn, °: each leg is within 90° of the vertical.
const ABOVE_BASE_DEG: f64 = 90.0;

pub(super) fn figure(trials: &Trials) -> anyhow::Result<Figure> {
    let caption = "Success of random guesses over how far from the true leg angles they are drawn (every leg within \
                   ± this; the points at 90° are guesses anywhere above the base). Left: any solution reached. Right: \
                   the true one.";
    Figure::draw("success", caption.to_owned(), (1100, 440), |area| {
        let panels = area.split_evenly((1, 2));
        panel(&panels[0], "Any solution", |contender, guesses| trials.solved(contender, guesses))?;
        panel(&panels[1], "The true solution", |contender, guesses| trials.true_ones(contender, guesses))
    })
}

fn panel(area: &Area, title: &str, share: impl Fn(Contender, Guesses) -> Share) -> anyhow::Result<()> {
    let axes = Axes {
        title,
        x: ("guesses within ±, °", 0.0..95.0, plain),
        y: ("share of guesses", 0.0..1.02, percent),
    };
    let mut chart = axes.on(area)?;
    for (contender, colour) in SHOWN.into_iter().zip(SOLVERS) {
        let point = |guesses| {
            let x = match guesses {
                Guesses::Within(deg) => deg,
                Guesses::AboveBase => ABOVE_BASE_DEG,
            };
            (x, share(contender, guesses).value())
        };
        let points: Vec<_> = GUESSES.into_iter().map(point).collect();
        curve(&mut chart, contender.short_name(), &points, colour, true)?;
    }
    named(&mut chart, SeriesLabelPosition::LowerLeft)
}
