//! The study's figures, as SVG.

mod axes;
mod basins;
mod mechanism;
mod rates;
mod solutions;
mod speed;
mod traces;
mod workspace;

use plotters::coord::Shift;
use plotters::prelude::*;

use super::Study;
use masseter_charts::palette::{BLUE, GREEN, VERMILION};

const GREY: RGBColor = RGBColor(0x99, 0x99, 0x99);
/// Of the paper's solver, Newton–Raphson and the controller's, everywhere.
const SOLVERS: [RGBColor; 3] = [BLUE, VERMILION, GREEN];

/// Pixels of the text at the figures' own size.
const TEXT: u32 = 15;
const TITLE: u32 = 17;

/// A finished figure.
#[derive(Debug, Clone)]
pub(super) struct Figure {
    /// File name without its extension.
    pub name: &'static str,
    pub caption: String,
    pub svg: String,
}

type Area<'svg> = DrawingArea<SVGBackend<'svg>, Shift>;

/// All of them, in the order in which they are told.
pub(super) fn figures(study: &Study) -> anyhow::Result<Vec<Figure>> {
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

impl Figure {
    fn draw(
        name: &'static str,
        caption: String,
        size: (u32, u32),
        content: impl FnOnce(&Area) -> anyhow::Result<()>,
    ) -> anyhow::Result<Self> {
        let mut svg = String::new();
        {
            let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
            area.fill(&WHITE)?;
            content(&area)?;
            area.present()?;
        }
        Ok(Self { name, caption, svg })
    }
}

/// Text at a place of an area, anchored at its left and middle.
fn write(area: &Area, text: &str, at: (i32, i32), size: u32) -> anyhow::Result<()> {
    use plotters::style::text_anchor::{HPos, Pos, VPos};
    let style = ("sans-serif", size).into_text_style(area).pos(Pos::new(HPos::Left, VPos::Center));
    area.draw_text(text, &style, at)?;
    Ok(())
}

/// Coloured boxes with names, in rows of so many columns.
fn legend(area: &Area, entries: &[(String, RGBColor)], columns: usize) -> anyhow::Result<()> {
    let (width, _) = area.dim_in_pixel();
    let column = width as i32 / columns as i32;
    for (index, (name, colour)) in entries.iter().enumerate() {
        let (x, y) = (20 + column * (index % columns) as i32, 14 + 22 * (index / columns) as i32);
        area.draw(&Rectangle::new([(x, y - 6), (x + 16, y + 6)], colour.filled()))?;
        area.draw(&Rectangle::new([(x, y - 6), (x + 16, y + 6)], BLACK))?;
        write(area, name, (x + 24, y), TEXT)?;
    }
    Ok(())
}
