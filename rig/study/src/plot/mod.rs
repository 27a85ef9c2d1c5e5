//! The study's figures, as SVG.

mod basins;
mod mechanism;
mod rates;
mod solutions;
mod speed;
mod traces;
mod workspace;

use masseter_charts::palette::{BLUE, GREEN, VERMILION};
use masseter_charts::{Area, Error, svg};
use plotters::style::RGBColor;

use crate::figure::Figure;
use crate::study::Study;

/// Of the paper's solver, Newton–Raphson and the controller's, in every figure.
const SOLVER_COLOURS: [RGBColor; 3] = [BLUE, VERMILION, GREEN];

/// All figures, in the order of the page.
pub(super) fn figures(study: &Study) -> Result<Vec<Figure>, Error> {
    let mut figures = traces::figures(&study.pairs)?;
    figures.extend([
        speed::figure(study)?,
        mechanism::assemblies(study)?,
        mechanism::solution_set(study)?,
        solutions::figure(&study.multiplicity)?,
        basins::figure(&study.basins)?,
        rates::figure(&study.trials)?,
    ]);
    figures.extend(workspace::figures(study)?);
    Ok(figures)
}

fn draw(
    name: &'static str,
    caption: String,
    size: (u32, u32),
    content: impl FnOnce(&Area) -> Result<(), Error>,
) -> Result<Figure, Error> {
    Ok(Figure { name, caption, svg: svg(size, content)? })
}
