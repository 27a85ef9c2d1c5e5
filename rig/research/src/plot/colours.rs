//! Colours that several figures share.

use masseter_charts::palette::{BLUE, GREEN, VERMILION};
use plotters::style::RGBColor;

/// Of the paper's solver, Newton–Raphson and the controller's, in every figure.
pub(super) const SOLVER_COLOURS: [RGBColor; 3] = [BLUE, VERMILION, GREEN];
