//! What all figures of the study share.

use masseter_charts::palette::{BLUE, GREEN, VERMILION};
use masseter_charts::{Area, Error, svg};
use plotters::style::RGBColor;

use crate::figure::Figure;

/// Of the paper's solver, Newton–Raphson and the controller's, in every figure.
pub(super) const SOLVER_COLOURS: [RGBColor; 3] = [BLUE, VERMILION, GREEN];

/// A figure with this name and caption.
pub(super) fn draw(
    name: &'static str,
    caption: String,
    size: (u32, u32),
    content: impl FnOnce(&Area) -> Result<(), Error>,
) -> Result<Figure, Error> {
    Ok(Figure { name, caption, svg: svg(size, content)? })
}
