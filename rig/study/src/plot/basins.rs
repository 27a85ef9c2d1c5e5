//! Maps of the basins of convergence.

use masseter_charts::palette::{BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION};
use masseter_charts::{Axis, Error, Key, LegendEntry, Scale, cells, chart, legend};
use plotters::style::{BLACK, RGBColor};

use super::draw::draw;
use crate::basins::{Basin, Basins};
use crate::figure::Figure;
use crate::solver::COMPARED;

/// Of the classes of solutions; the true solution's first.
const CLASSES: [RGBColor; 6] = [BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION];

pub(super) fn figure(basins: &Basins) -> Result<Figure, Error> {
    let caption = "Basins of convergence of the neutral input: which solution (leg angles in order of size) each \
                   guess leads to. The guess's θ₃ is that of the true solution.";
    draw("basins", caption.to_owned(), (1140, 500), |area| {
        let (maps, names) = area.split_vertically(424);
        for ((index, solver), panel) in COMPARED.iter().enumerate().zip(maps.split_evenly((1, 3))) {
            let axis = |label| Axis::new(label, Scale::Linear, [0.0, 180.0]);
            let axes = [axis("θ₁ of the guess, °"), axis("θ₂ of the guess, °")];
            let [x, y] = axes;
            let mut chart = chart(&panel, solver.short_name(), x, y)?;
            cells(&mut chart, basins.side, |cell| Some(colour(basins.cells[cell].basins[index])))?;
        }
        let classes = (0..basins.class_names.len()).map(Basin::Class);
        let shown = classes.chain([Basin::BelowBase, Basin::Nothing]);
        let entry = |basin| LegendEntry { name: basins.name(basin), colour: colour(basin), key: Key::Box };
        legend(&names, &shown.map(entry).collect::<Vec<_>>(), 3)
    })
}

fn colour(basin: Basin) -> RGBColor {
    match basin {
        Basin::Class(class) => CLASSES[class % CLASSES.len()],
        Basin::BelowBase => GREY,
        Basin::Nothing => BLACK,
    }
}
