//! Lines over a common axis, with limits and a legend.

use plotters::prelude::*;

use crate::axis::{Axis, Scale};
use crate::canvas::{self, Area, Chart, DASH, Error, Key, LegendEntry, ROW, TEXT};
use crate::moments::{self, Moment};
use crate::palette;

/// Width of a chart of its own, px.
const WIDTH: u32 = 960;
/// Room for a legend beside the plot, px; left free without one, so that the plots of a page have one width.
const LEGEND: u32 = 210;
/// Room that a fitted axis leaves above and below its data, as a share of their height.
const MARGIN: f64 = 0.05;
/// A limit further from the lines than this many times their own height is not drawn, but returned.
const FAR: f64 = 1.5;
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

/// Levels that must not be passed.
#[derive(Debug, Clone, PartialEq)]
pub struct Limit {
    /// The name in the legend.
    pub name: String,
    /// In values of the y axis.
    pub values: Vec<f64>,
}

/// Where the names of lines stand.
#[derive(Debug, Clone)]
pub enum Legend {
    /// Right of the plot; a long legend makes a chart of its own higher.
    Beside,
    /// In a corner of the plot.
    Inside(SeriesLabelPosition),
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
    /// Drawn over the whole width.
    pub limits: Vec<Limit>,
    /// Drawn over the whole height, where they lie on the x axis.
    pub moments: Vec<Moment>,
    /// Where the names stand.
    pub legend: Legend,
}

/// A finished chart.
#[derive(Debug, Clone)]
pub struct Drawn {
    /// The drawing.
    pub svg: String,
    /// Limits too far from the lines to be drawn.
    pub beyond: Vec<Limit>,
}

impl LineChart {
    /// A chart of its own, at least so many pixels high; none without a single point, or where points are further apart
    /// than numbers reach.
    #[must_use]
    pub fn draw(mut self, height: u32) -> Option<Drawn> {
        let beyond = self.fit()?;
        let entries = self.lines.len() + self.limits.len();
        let size = (WIDTH, height.max((entries as u32 + 1) * ROW) + moments::room(&self.moments));
        let svg = canvas::svg(size, |area| self.draw_fitted(area)).ok()?;
        Some(Drawn { svg, beyond })
    }

    /// Draws into an area; axes alone without a single point.
    ///
    /// # Errors
    /// When the area cannot be drawn on.
    pub fn draw_on(mut self, area: &Area) -> Result<(), Error> {
        let _ = self.fit();
        self.draw_fitted(area)
    }

    /// Fits the axes to the data and returns the limits that are too far away.
    fn fit(&mut self) -> Option<Vec<Limit>> {
        let [x, y] = [self.x.scale, self.y.scale];
        for line in &mut self.lines {
            // A recording may hold any numbers, and no axis reaches to infinity.
            line.points.retain(|point| x.position(point.0).is_finite() && y.position(point.1).is_finite());
        }
        let points = || self.lines.iter().flat_map(|line| &line.points);
        points().next()?;
        let across = extremes(points().map(|point| point.0).chain(self.x.included), x);
        let mut up = extremes(points().map(|point| point.1).chain(self.y.included), y);
        let far = FAR * (up[1] - up[0]);
        let near = up[0] - far..=up[1] + far;
        let (near, beyond): (Vec<_>, _) = std::mem::take(&mut self.limits)
            .into_iter()
            .partition(|limit| y != Scale::Linear || limit.values.iter().any(|value| near.contains(value)));
        self.limits = near;
        let limits = self.limits.iter().flat_map(|limit| &limit.values).map(|value| y.position(*value));
        up = limits.fold(up, |[low, high], limit| [low.min(limit), high.max(limit)]);
        let margin = MARGIN * (up[1] - up[0]);
        let up = [up[0] - margin.max(1e-6), up[1] + margin.max(1e-6)];
        self.x.fit(across);
        self.moments.retain(|moment| self.x.covers(moment.at));
        self.y.fit(up);
        let is_finite = |[low, high]: [f64; 2]| (high - low).is_finite();
        (is_finite(across) && is_finite(up)).then_some(beyond)
    }

    fn draw_fitted(&self, area: &Area) -> Result<(), Error> {
        match &self.legend {
            Legend::Beside => {
                let (width, _) = area.dim_in_pixel();
                let (plot, beside) = area.split_horizontally(width.saturating_sub(LEGEND));
                self.plot(&plot)?;
                let entries = self.entries();
                if entries.len() > 1 { canvas::legend(&beside, &entries, 1) } else { Ok(()) }
            }
            Legend::Inside(position) => {
                let mut chart = self.plot(area)?;
                if self.lines.iter().all(|line| line.name.is_empty()) {
                    return Ok(());
                }
                chart
                    .configure_series_labels()
                    .position(position.clone())
                    .label_font(("sans-serif", TEXT))
                    .background_style(WHITE.mix(0.85))
                    .border_style(RGBColor(0xcc, 0xcc, 0xcc))
                    .draw()
            }
        }
    }

    fn plot<'a, 'svg>(&self, area: &'a Area<'svg>) -> Result<Chart<'a, 'svg>, Error> {
        let room = moments::room(&self.moments);
        let mut chart = canvas::chart_below(room, area, &self.title, self.x.clone(), self.y.clone())?;
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
        let across = chart.x_range();
        let level = |&value: &f64| {
            PathElement::new([(across.start, value), (across.end, value)], palette::RED.stroke_width(2))
        };
        chart.draw_series(self.limits.iter().flat_map(|limit| &limit.values).map(level))?;
        moments::draw(area, &chart, &self.moments)?;
        Ok(chart)
    }

    fn entries(&self) -> Vec<LegendEntry> {
        let entry = |name: &String, colour, key| LegendEntry { name: name.clone(), colour, key };
        let lines = self.lines.iter().enumerate().map(|(index, line)| {
            let key = match line.is_wide {
                true => Key::Wide,
                false if palette::is_dashed(index) => Key::Dashes,
                false => Key::Line,
            };
            entry(&line.name, line.colour.unwrap_or(palette::series(index)), key)
        });
        let limits = self.limits.iter().map(|limit| entry(&limit.name, palette::RED, Key::Line));
        lines.chain(limits).collect()
    }
}

/// Least and greatest position.
fn extremes(values: impl Iterator<Item = f64>, scale: Scale) -> [f64; 2] {
    let outside = [f64::INFINITY, f64::NEG_INFINITY];
    values.map(|value| scale.position(value)).fold(outside, |[low, high], at| [low.min(at), high.max(at)])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn over_time(lines: Vec<Line>, limits: Vec<Limit>) -> LineChart {
        LineChart {
            title: String::new(),
            x: Axis::fitted("time, s", Scale::Linear).including(0.0),
            y: Axis::fitted("y", Scale::Linear),
            lines,
            limits,
            moments: Vec::new(),
            legend: Legend::Beside,
        }
    }

    fn limit(value: f64) -> Limit {
        Limit { name: "limit".to_owned(), values: vec![value] }
    }

    #[test]
    fn a_limit_is_drawn_where_it_leaves_the_lines_room_and_returned_otherwise() {
        let beyond = |value| {
            let line = Line::new("a", vec![(0.0, 1.0), (1.0, 2.0)]);
            over_time(vec![line], vec![limit(value)]).draw(260).unwrap().beyond
        };
        assert!(beyond(3.0).is_empty());
        assert_eq!(beyond(300.0), [limit(300.0)]);
    }

    /// Heights of the texts of a drawing.
    fn heights_of(names: &[String], svg: &str) -> Vec<i32> {
        let height = |name: &String| {
            let (before, _) = svg.split_once(&format!("\n{name}\n")).unwrap();
            let (_, tag) = before.rsplit_once("<text ").unwrap();
            tag.split("y=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
        };
        names.iter().map(height).collect()
    }

    #[test]
    fn a_legend_stands_beside_its_plot_and_makes_it_high_enough() {
        let names: Vec<_> = (0..40).map(|number| format!("line {number}")).collect();
        let lines = names.iter().map(|name| Line::new(name, vec![(0.0, 1.0), (1.0, 2.0)])).collect();
        let drawn = over_time(lines, Vec::new()).draw(260).unwrap();
        let heights = heights_of(&names, &drawn.svg);
        assert!(heights.is_sorted_by(|a, b| a < b), "{heights:?}");
        let (_, size) = drawn.svg.split_once("height=\"").unwrap();
        let height: i32 = size.split('"').next().unwrap().parse().unwrap();
        assert!(*heights.last().unwrap() < height, "{heights:?} of {height}");
    }

    #[test]
    fn a_line_without_points_makes_no_chart() {
        assert!(over_time(Vec::new(), Vec::new()).draw(260).is_none());
        assert!(over_time(vec![Line::new("a", Vec::new())], Vec::new()).draw(260).is_none());
    }

    #[test]
    fn moments_on_the_axis_are_named_above_the_plot_and_others_left_out() {
        let line = || vec![Line::new("a", vec![(0.0, 1.0), (1.0, 2.0)]).wide()];
        let moment = |at: f64| Moment { name: format!("moment {at}"), at };
        let moments = vec![moment(0.5), moment(0.51), moment(2.5), moment(f64::NAN)];
        let x = Axis::new("time, s", Scale::Linear, [0.0, 2.0]);
        let drawn = LineChart { x, moments, ..over_time(line(), Vec::new()) }.draw(260).unwrap();
        let heights = heights_of(&["moment 0.51".to_owned(), "moment 0.5".to_owned()], &drawn.svg);
        assert!(heights[1] < heights[0] && heights[0] < 50, "{heights:?}");
        assert!(!drawn.svg.contains("moment 2.5") && !drawn.svg.contains("NaN"));
    }

    #[test]
    fn no_number_of_a_recording_draws_for_ever() {
        let draw =
            |points: Vec<(f64, f64)>| over_time(vec![Line::new("a", points)], vec![limit(1.0)]).draw(260);
        let jump = |a, b| draw(vec![(0.0, 1.0), (1.0, a), (2.0, b), (3.0, 2.0)]);
        assert!(jump(f64::INFINITY, f64::NAN).is_some());
        assert!(jump(1e307, -1e307).is_some());
        assert!(jump(1e308, -1e308).is_none());
        let level = |value| vec![(0.0, value), (1.0, value)];
        for points in [level(1e17), level(1e300), vec![(0.0, 1e300), (1.0, 1e300_f64.next_up())]] {
            assert!(draw(points).is_some());
        }
    }
}
