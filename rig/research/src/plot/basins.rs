//! Maps of the basins of convergence.

use masseter_charts::palette::{BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION};
use masseter_charts::{Axis, Error, Key, LegendEntry, Scale, cells, chart, legend};
use plotters::style::{BLACK, RGBColor};

use crate::basins::Basins;
use crate::solver::COMPARED;

/// Of the classes of solutions; the true solution's first.
const CLASSES: [RGBColor; 6] = [BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION];

pub(super) fn svg(basins: &Basins) -> Result<String, Error> {
    masseter_charts::svg((1140, 500), |area| {
        let (maps, names) = area.split_vertically(424);
        let classes = basins.names.len() - 2;
        let colours: Vec<_> = CLASSES.into_iter().cycle().take(classes).chain([GREY, BLACK]).collect();
        for ((index, solver), panel) in COMPARED.iter().enumerate().zip(maps.split_evenly((1, 3))) {
            let axis = |label| Axis::new(label, Scale::Linear, [0.0, 180.0]);
            let [x, y] = ["θ₁ of the guess, °", "θ₂ of the guess, °"].map(axis);
            let mut chart = chart(&panel, solver.short_name, x, y)?;
            cells(&mut chart, basins.side, |cell| Some(colours[basins.cells[cell].basins[index]]))?;
        }
        let entry = |(name, &colour): (&String, _)| LegendEntry { name: name.clone(), colour, key: Key::Box };
        legend(&names, &basins.names.iter().zip(&colours).map(entry).collect::<Vec<_>>(), 3)
    })
}
