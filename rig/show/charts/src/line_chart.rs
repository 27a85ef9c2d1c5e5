//! Lines over a common axis, with a legend.

use plotters::chart::SeriesLabelPosition;
use plotters::prelude::*;

use crate::axis::{Axis, Scale};
use crate::canvas::{self, Area, Chart, DASH, Error, TEXT};
use crate::palette;

/// Room that a fitted axis leaves above and below its data, as a share of their height.
const MARGIN: f64 = 0.05;
/// Radius of a mark, px.
const MARK: u32 = 3;

/// A named line.
#[derive(Debug, Clone)]
pub struct Line {
    /// The name in the legend; none stands there where it is empty.
    pub name: String,
    /// Points in values of the axes.
    pub points: Vec<(f64, f64)>,
    /// The palette's by the line's number, or another.
    pub colour: Option<RGBColor>,
    /// Whether each point is marked.
    pub is_marked: bool,
    /// Whether it is wide and pale, so that a line on top of it leaves it visible.
    pub is_wide: bool,
}

impl Line {
    /// In the palette's colour, without marks.
    #[must_use]
    pub fn new(name: &str, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.to_owned(), points, colour: None, is_marked: false, is_wide: false }
    }

    /// In this colour.
    #[must_use]
    pub fn coloured(mut self, colour: RGBColor) -> Self {
        self.colour = Some(colour);
        self
    }

    /// With a mark at each point.
    #[must_use]
    pub fn marked(mut self) -> Self {
        self.is_marked = true;
        self
    }

    /// Wide and pale.
    #[must_use]
    pub fn wide(mut self) -> Self {
        self.is_wide = true;
        self
    }
}

/// A chart of lines.
#[derive(Debug, Clone)]
pub struct LineChart {
    /// Above the plot; may be empty.
    pub title: String,
    /// The common axis.
    pub x: Axis,
    /// The axis of the values.
    pub y: Axis,
    /// The first is drawn first.
    pub lines: Vec<Line>,
    /// The corner in which the names stand.
    pub legend: SeriesLabelPosition,
}

impl LineChart {
    /// Draws into an area; axes alone without a single point.
    ///
    /// # Errors
    /// When the area cannot be drawn on.
    pub fn draw_on(mut self, area: &Area) -> Result<(), Error> {
        self.fit();
        let mut chart = self.plot(area)?;
        if self.lines.iter().all(|line| line.name.is_empty()) {
            return Ok(());
        }
        chart
            .configure_series_labels()
            .position(self.legend.clone())
            .label_font(("sans-serif", TEXT))
            .background_style(WHITE.mix(0.85))
            .border_style(RGBColor(0xcc, 0xcc, 0xcc))
            .draw()
    }

    /// Fits the axes to the data.
    fn fit(&mut self) {
        let [x, y] = [self.x.scale, self.y.scale];
        for line in &mut self.lines {
            // No axis reaches to infinity.
            line.points.retain(|point| x.position(point.0).is_finite() && y.position(point.1).is_finite());
        }
        let points = || self.lines.iter().flat_map(|line| &line.points);
        if points().next().is_none() {
            return;
        }
        let across = extremes(points().map(|point| point.0).chain(self.x.included), x);
        let up = extremes(points().map(|point| point.1).chain(self.y.included), y);
        let margin = (MARGIN * (up[1] - up[0])).max(1e-6);
        self.x.fit(across);
        self.y.fit([up[0] - margin, up[1] + margin]);
    }

    fn plot<'a, 'svg>(&self, area: &'a Area<'svg>) -> Result<Chart<'a, 'svg>, Error> {
        let mut chart = canvas::chart(area, &self.title, self.x.clone(), self.y.clone())?;
        for (index, line) in self.lines.iter().enumerate() {
            let colour = line.colour.unwrap_or(palette::series(index));
            let style = canvas::stroke(colour, line.is_wide);
            let points = line.points.iter().copied();
            let series = if palette::is_dashed(index) {
                chart.draw_series(DashedLineSeries::new(points.clone(), DASH[0], DASH[1], style))?
            } else {
                chart.draw_series(LineSeries::new(points.clone(), style))?
            };
            if !line.name.is_empty() {
                series.label(&line.name).legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], style));
            }
            if line.is_marked {
                canvas::marks(&mut chart, points, MARK, colour)?;
            }
        }
        Ok(chart)
    }
}

/// Least and greatest position.
fn extremes(values: impl Iterator<Item = f64>, scale: Scale) -> [f64; 2] {
    let outside = [f64::INFINITY, f64::NEG_INFINITY];
    values.map(|value| scale.position(value)).fold(outside, |[low, high], at| [low.min(at), high.max(at)])
}
