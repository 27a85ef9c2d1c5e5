//! What charts are made of: axes, bars, cells, marks, legends, text, and colours for the values of a map.

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::axis::{Axis, Scale, plain_label, tick_step};

/// Pixels of labels and legends.
pub const TEXT: u32 = 13;
/// Pixels of titles.
pub const TITLE: u32 = 16;
/// Room for labels below and left of a plot, px; names of places need more than numbers.
const LABELS: [u32; 3] = [42, 64, 90];
const MARGIN: u32 = 10;
const RIM: RGBColor = RGBColor(0x55, 0x55, 0x55);
const MESH: RGBColor = RGBColor(0xe4, 0xe4, 0xe4);
/// From one row of a legend to the next, px.
const ROW: u32 = 20;
/// Width of a wide line, px.
const WIDE: u32 = 8;
/// Opacity of a wide line.
const PALE: f64 = 0.35;
/// Length of a line before a name, px.
const KEY: i32 = 18;
/// Length of a dash and of the gap after it, px.
pub(crate) const DASH: [u32; 2] = [6, 4];

/// Why a drawing failed.
pub type Error = plotters::drawing::DrawingAreaErrorKind<std::io::Error>;
/// A part of a drawing.
pub type Area<'svg> = DrawingArea<SVGBackend<'svg>, Shift>;
/// A pair of axes to draw into.
pub type Chart<'a, 'svg> = ChartContext<'a, SVGBackend<'svg>, Cartesian2d<Axis, Axis>>;

/// A bar from the bottom of a chart up to `height`.
#[derive(Debug, Clone)]
pub struct Bar {
    /// Its left and its right side.
    pub sides: [f64; 2],
    /// In values of the y axis.
    pub height: f64,
    /// Of its face.
    pub colour: RGBColor,
    /// Lines of text above it.
    pub text: Vec<String>,
}

/// A disc.
#[derive(Debug, Clone)]
pub struct Disc {
    /// Its middle, in values of the axes.
    pub at: (f64, f64),
    /// Its radius, px.
    pub radius: u32,
    /// Of its face; none leaves the face empty.
    pub colour: Option<RGBColor>,
    /// Stands beside it.
    pub text: String,
    /// Where the text begins, or ends if that is left of the middle: right and down from the middle, px.
    pub beside: [i32; 2],
}

/// What stands before a name in a legend.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Key {
    /// A stroke.
    Line,
    /// A filled box.
    Box,
}

/// A name in a legend.
#[derive(Debug, Clone)]
pub struct LegendEntry {
    /// The name.
    pub name: String,
    /// Of its key.
    pub colour: RGBColor,
    /// What stands before the name.
    pub key: Key,
}

/// The style of a line, or of a wide, pale one.
pub(crate) fn stroke(colour: RGBColor, is_wide: bool) -> ShapeStyle {
    if is_wide { colour.mix(PALE).stroke_width(WIDE) } else { colour.stroke_width(2) }
}

/// A drawing of so many pixels on white.
///
/// # Errors
/// When `draw` fails.
pub fn svg(size: (u32, u32), draw: impl FnOnce(&Area) -> Result<(), Error>) -> Result<String, Error> {
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        area.fill(&WHITE)?;
        draw(&area)?;
        area.present()?;
    }
    Ok(svg)
}

/// Axes over a whole area, with their ticks; a title where it is not empty.
///
/// # Errors
/// When the area cannot be drawn on.
pub fn chart<'a, 'svg>(
    area: &'a Area<'svg>,
    title: &str,
    x: Axis,
    y: Axis,
) -> Result<Chart<'a, 'svg>, Error> {
    let labels = [x.label.clone(), y.label.clone()];
    let [below, numbers, names] = LABELS;
    let mut builder = ChartBuilder::on(area);
    builder.margin(MARGIN).margin_right(2 * MARGIN).x_label_area_size(below);
    builder.y_label_area_size(if y.has_names() { names } else { numbers });
    if !title.is_empty() {
        builder.caption(title, ("sans-serif", TITLE));
    }
    let mut chart = builder.build_cartesian_2d(x, y)?;
    chart
        .configure_mesh()
        .bold_line_style(MESH)
        .label_style(("sans-serif", TEXT - 1))
        .axis_desc_style(("sans-serif", TEXT))
        .x_desc(&labels[0])
        .y_desc(&labels[1])
        .draw()?;
    Ok(chart)
}

/// Dots.
///
/// # Errors
/// When the chart cannot be drawn on.
pub fn marks(
    chart: &mut Chart<'_, '_>,
    points: impl IntoIterator<Item = (f64, f64)>,
    radius: u32,
    colour: impl Into<ShapeStyle>,
) -> Result<(), Error> {
    let style = colour.into().filled();
    chart.draw_series(points.into_iter().map(|point| Circle::new(point, radius, style)))?;
    Ok(())
}

/// Bars with their text.
///
/// # Errors
/// When the chart cannot be drawn on.
pub fn bars(chart: &mut Chart<'_, '_>, bars: &[Bar]) -> Result<(), Error> {
    let bottom = chart.y_range().start;
    for Bar { sides: [left, right], height, colour, text } in bars {
        chart.draw_series([Rectangle::new([(*left, bottom), (*right, *height)], colour.filled())])?;
        for (line, text) in text.iter().rev().enumerate() {
            let lift = -((TEXT + 3) as i32) * (line as i32 + 1);
            let text = Text::new(text.clone(), (0, lift), ("sans-serif", TEXT));
            chart.draw_series([EmptyElement::at((*left, *height)) + text])?;
        }
    }
    Ok(())
}

/// Fills a square grid over the whole chart, row by row from the lower left; `colour` gives that of each cell, or none.
///
/// # Errors
/// When the chart cannot be drawn on.
pub fn cells(
    chart: &mut Chart<'_, '_>,
    side: usize,
    colour: impl Fn(usize) -> Option<RGBColor>,
) -> Result<(), Error> {
    let (across, up) = (chart.x_range(), chart.y_range());
    let x = |column: usize| across.start + (across.end - across.start) * column as f64 / side as f64;
    let y = |row: usize| up.start + (up.end - up.start) * row as f64 / side as f64;
    for row in 0..side {
        let cells: Vec<_> = (0..side).map(|column| (column, colour(row * side + column))).collect();
        // One rectangle for neighbours of one colour.
        for run in cells.chunk_by(|a, b| a.1 == b.1) {
            let (from, to) = (run[0].0, run[0].0 + run.len());
            let rectangle =
                |colour: RGBColor| Rectangle::new([(x(from), y(row)), (x(to), y(row + 1))], colour.filled());
            chart.draw_series(run[0].1.map(rectangle))?;
        }
    }
    Ok(())
}

/// Discs with a rim, each with text beside it.
///
/// # Errors
/// When the chart cannot be drawn on.
pub fn discs(chart: &mut Chart<'_, '_>, discs: &[Disc]) -> Result<(), Error> {
    for Disc { at, radius, colour, .. } in discs {
        let face = colour.map(|colour| Circle::new(*at, *radius, colour.filled()));
        chart.draw_series(face.into_iter().chain([Circle::new(*at, *radius, RIM.stroke_width(1))]))?;
    }
    for Disc { at, text, beside, .. } in discs {
        let end = if beside[0] < 0 { HPos::Right } else { HPos::Left };
        let style = ("sans-serif", TEXT).into_font().color(&BLACK).pos(Pos::new(end, VPos::Center));
        let text = Text::new(text.clone(), (beside[0], beside[1]), style);
        chart.draw_series([EmptyElement::at(*at) + text])?;
    }
    Ok(())
}

/// Keys with names, in rows of so many columns.
///
/// # Errors
/// When the area cannot be drawn on.
pub fn legend(area: &Area, entries: &[LegendEntry], columns: usize) -> Result<(), Error> {
    let (width, _) = area.dim_in_pixel();
    let column = width as i32 / columns as i32;
    let text = ("sans-serif", TEXT).into_text_style(area).pos(Pos::new(HPos::Left, VPos::Center));
    for (index, LegendEntry { name, colour, key }) in entries.iter().enumerate() {
        let x = MARGIN as i32 + column * (index % columns) as i32;
        let y = (MARGIN / 2 + ROW / 2) as i32 + ROW as i32 * (index / columns) as i32;
        match key {
            Key::Box => {
                let corners = [(x, y - 6), (x + 16, y + 6)];
                area.draw(&Rectangle::new(corners, colour.filled()))?;
                area.draw(&Rectangle::new(corners, BLACK))?;
            }
            Key::Line => area.draw(&PathElement::new([(x, y), (x + KEY, y)], stroke(*colour, false)))?,
        }
        area.draw_text(name, &text, (x + 24, y))?;
    }
    Ok(())
}

/// Steps of the colours; few enough that neighbours differ to the eye, many enough to show slopes.
const STEPS: u32 = 24;

/// Colours from violet for low values to yellow for high ones.
#[derive(Debug, Clone)]
pub struct ColourScale {
    label: String,
    ends: [f64; 2],
}

impl ColourScale {
    /// Over a range, widened to round values; values beyond it have the colour of its end.
    #[must_use]
    pub fn new(label: &str, [low, high]: [f64; 2]) -> Self {
        let high = if high > low { high } else { low + 1.0 };
        let step = tick_step(high - low);
        let ends = [(low / step).floor() * step, (high / step).ceil() * step];
        Self { label: label.to_owned(), ends }
    }

    /// The colour of a value.
    #[must_use]
    pub fn colour(&self, value: f64) -> RGBColor {
        let [low, high] = self.ends;
        let share = ((value - low) / (high - low)).clamp(0.0, 1.0);
        let steps = f64::from(STEPS);
        ViridisRGB.get_color((share * steps).round() / steps)
    }

    /// A bar of all colours with their values.
    ///
    /// # Errors
    /// When the area cannot be drawn on.
    pub fn draw(&self, area: &Area) -> Result<(), Error> {
        let [low, high] = self.ends;
        let axis = Axis::new("", Scale::Linear, self.ends);
        let mut chart = ChartBuilder::on(area)
            .margin(10)
            .margin_left(2)
            .margin_bottom(52)
            .right_y_label_area_size(64)
            .build_cartesian_2d(0.0..1.0, low..high)?
            .set_secondary_coord(0.0..1.0, axis);
        let step = (high - low) / f64::from(STEPS);
        let pieces = (0..STEPS).map(|piece| {
            let from = low + f64::from(piece) * step;
            Rectangle::new([(0.0, from), (1.0, from + step)], self.colour(from + step / 2.0).filled())
        });
        chart.draw_series(pieces)?;
        chart
            .configure_secondary_axes()
            .label_style(("sans-serif", TEXT - 1))
            .axis_desc_style(("sans-serif", TEXT))
            .y_desc(format!("{} (yellow: {} and more)", self.label, plain_label(high)))
            .draw()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_is_widened_to_round_values_and_labels_of_its_bar_differ() {
        assert_eq!(format!("{:?}", ColourScale::new("", [1.03, 2.97]).ends), "[1.0, 3.0]");
        for ends in [[2.0, 2.04], [0.013, 0.9], [5.1, 800.0], [3.0, 3.0]] {
            let scale = ColourScale::new("", ends);
            let svg = crate::svg((110, 500), |area| scale.draw(area)).unwrap();
            let texts: Vec<_> =
                svg.split("</text>").filter_map(|text| text.rsplit('>').next()).map(str::trim).collect();
            let labels: Vec<_> = texts.iter().filter(|text| text.parse::<f64>().is_ok()).collect();
            let different: std::collections::BTreeSet<_> = labels.iter().collect();
            assert!(labels.len() >= 3 && different.len() == labels.len(), "{ends:?}: {labels:?}");
        }
    }

    #[test]
    fn values_beyond_the_scale_have_the_colour_of_its_end() {
        let scale = ColourScale::new("", [1.0, 3.0]);
        assert_eq!(scale.colour(99.0), scale.colour(3.0));
        assert_ne!(scale.colour(1.0), scale.colour(3.0));
    }
}
