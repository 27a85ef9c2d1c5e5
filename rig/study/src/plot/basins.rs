//! Maps of the basins of convergence.

use plotters::prelude::*;

use super::axes::{Axes, plain};
use super::{Figure, GREY, legend};
use crate::basins::{Basin, Basins};
use crate::contender::SHOWN;
use masseter_charts::palette::{BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION};

/// Of the classes of solutions; the true one's first.
const CLASSES: [RGBColor; 6] = [BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION];

pub(super) fn figure(basins: &Basins) -> anyhow::Result<Figure> {
    let caption = "Basins of convergence of the neutral input: which solution (leg angles in order of size) each \
                   guess leads to, with the guess's θ₃ that of the true solution.";
    Figure::draw("basins", caption.to_owned(), (1140, 500), |area| {
        let (maps, names) = area.split_vertically(424);
        for ((index, contender), panel) in SHOWN.iter().enumerate().zip(maps.split_evenly((1, 3))) {
            let axes = Axes {
                title: contender.short_name(),
                x: ("θ₁ of the guess, °", 0.0..180.0, plain),
                y: ("θ₂ of the guess, °", 0.0..180.0, plain),
            };
            let mut chart = axes.on(&panel)?;
            let step = 180.0 / basins.side as f64;
            for (row, cells) in basins.cells.chunks(basins.side).enumerate() {
                let y = row as f64 * step;
                let mut from = 0;
                for run in cells.chunk_by(|a, b| a.basins[index] == b.basins[index]) {
                    let (left, right) = (from as f64 * step, (from + run.len()) as f64 * step);
                    let fill = colour(run[0].basins[index]).filled();
                    chart.draw_series([Rectangle::new([(left, y), (right, y + step)], fill)])?;
                    from += run.len();
                }
            }
        }
        let classes = (0..basins.class_names.len()).map(Basin::Class);
        let shown = classes.chain([Basin::BelowBase, Basin::Nothing]);
        let entries: Vec<_> = shown.map(|basin| (basins.name(basin), colour(basin))).collect();
        legend(&names, &entries, 3)
    })
}

fn colour(basin: Basin) -> RGBColor {
    match basin {
        Basin::Class(class) => CLASSES[class % CLASSES.len()],
        Basin::BelowBase => GREY,
        Basin::Nothing => BLACK,
    }
}
