//! Curves as SVG.

use std::error::Error;

use plotters::coord::Shift;
use plotters::prelude::*;

use masseter_charts::palette::{BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION};

const WIDTH: u32 = 960;
/// Height of a chart over time, px.
const LOW: u32 = 260;
/// Height of a chart of many curves, px.
pub(super) const HIGH: u32 = 420;
/// Room for the legend beside the plot, px; left free without one, so that the plots of a page stand in line.
const LEGEND: u32 = 210;
/// From one name of the legend to the next, px.
const ROW: u32 = 18;
const MARGIN: u32 = 12;
/// Length of a dash and of the gap behind it, px.
const DASH: (u32, u32) = (6, 4);
const COLOURS: [RGBColor; 8] =
    [BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, RGBColor(0x66, 0x66, 0x66), RGBColor(0x9a, 0x7d, 0x0a)];
const LIMIT: RGBColor = RGBColor(0xb0, 0x00, 0x20);
/// A limit further from the curves than this many times their own height is not drawn, but said.
const FAR: f64 = 1.5;

/// How values lie along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scale {
    /// Evenly.
    Linear,
    /// By their decades.
    Log,
    /// 1/(1 − quantile) by its decades, labelled as percentiles.
    Percentile,
}

impl Scale {
    fn place(self, value: f64) -> f64 {
        match self {
            Self::Linear => value,
            Self::Log | Self::Percentile => value.log10(),
        }
    }

    /// How many labels an axis takes: one a decade where there are some.
    fn labels(self, from: f64, to: f64) -> usize {
        if self == Self::Linear || to - from < 2.0 { 10 } else { (to - from).ceil() as usize + 1 }
    }

    fn label(self, place: f64) -> String {
        match self {
            Self::Linear => format!("{}", (place * 1e6).round() / 1e6),
            Self::Log => {
                format!("{:.3}", 10f64.powf(place)).trim_end_matches('0').trim_end_matches('.').to_owned()
            }
            Self::Percentile => {
                let decimals = (place.round() as usize).saturating_sub(2);
                format!("{:.decimals$} %", 100.0 * (1.0 - 10f64.powf(-place)))
            }
        }
    }
}

/// A named curve.
pub(super) struct Line {
    pub name: String,
    pub points: Vec<(f64, f64)>,
}

/// Levels that must not be passed.
pub(super) struct Limit {
    pub name: String,
    pub values: Vec<f64>,
}

/// What is drawn.
pub(super) struct Chart {
    /// In px; a long legend makes it higher.
    pub height: u32,
    pub x_label: &'static str,
    pub x: Scale,
    pub y_label: &'static str,
    pub y: Scale,
    pub lines: Vec<Line>,
    pub limits: Vec<Limit>,
}

/// What was drawn.
pub(super) struct Drawn {
    pub svg: String,
    /// Limits too far away to be drawn.
    pub beyond: Vec<Limit>,
}

/// The corners of a plot, in places of its scales.
struct Frame {
    left: f64,
    right: f64,
    low: f64,
    high: f64,
}

impl Chart {
    /// Curves over time.
    pub(super) fn over_time(y_label: &'static str, lines: Vec<Line>, limits: Vec<Limit>) -> Self {
        Self { height: LOW, x_label: "time, s", x: Scale::Linear, y_label, y: Scale::Linear, lines, limits }
    }

    /// Draws it; none without a single point, or where points are too far apart for numbers to tell.
    pub(super) fn draw(mut self) -> Option<Drawn> {
        self.keep_finite_points();
        let mut frame = self.frame()?;
        let (near, beyond) = std::mem::take(&mut self.limits).into_iter().partition(|limit| {
            let far = FAR * (frame.high - frame.low);
            let near = frame.low - far..=frame.high + far;
            self.y != Scale::Linear || limit.values.iter().any(|value| near.contains(value))
        });
        self.limits = near;
        for place in self.limits.iter().flat_map(|limit| &limit.values).map(|value| self.y.place(*value)) {
            frame.low = frame.low.min(place);
            frame.high = frame.high.max(place);
        }
        // Labels need steps that make a difference to the largest number.
        let least = frame.low.abs().max(frame.high.abs()) * 1e-9;
        let margin = ((frame.high - frame.low) * 0.05).max(1e-6).max(least);
        frame.low -= margin;
        frame.high += margin;
        if !(frame.high - frame.low).is_finite() {
            return None;
        }
        let svg = self.svg(&frame).ok()?;
        Some(Drawn { svg, beyond })
    }

    /// A recording may hold any numbers, and no axis reaches to those that are none.
    fn keep_finite_points(&mut self) {
        let (x, y) = (self.x, self.y);
        for line in &mut self.lines {
            line.points.retain(|point| x.place(point.0).is_finite() && y.place(point.1).is_finite());
        }
    }

    fn frame(&self) -> Option<Frame> {
        let points = || self.lines.iter().flat_map(|line| &line.points);
        points().next()?;
        let xs = || points().map(|point| self.x.place(point.0));
        let ys = || points().map(|point| self.y.place(point.1));
        Some(Frame {
            left: xs().fold(f64::INFINITY, f64::min).min(0.0),
            right: xs().fold(f64::NEG_INFINITY, f64::max).max(1e-6),
            low: ys().fold(f64::INFINITY, f64::min),
            high: ys().fold(f64::NEG_INFINITY, f64::max),
        })
    }

    fn svg(&self, frame: &Frame) -> Result<String, Box<dyn Error>> {
        let mut svg = String::new();
        {
            let rows = (self.lines.len() + self.limits.len()) as u32;
            let size = (WIDTH, self.height.max(rows * ROW + 2 * MARGIN));
            let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
            area.fill(&WHITE)?;
            let (plot, legend) = area.split_horizontally(WIDTH - LEGEND);
            self.plot(frame, &plot)?;
            if rows > 1 {
                self.legend(&legend)?;
            }
            area.present()?;
        }
        Ok(svg)
    }

    fn plot(&self, frame: &Frame, area: &Area<'_>) -> Result<(), Box<dyn Error>> {
        let mut chart = ChartBuilder::on(area)
            .margin(MARGIN)
            .x_label_area_size(36)
            .y_label_area_size(64)
            .build_cartesian_2d(frame.left..frame.right, frame.low..frame.high)?;
        chart
            .configure_mesh()
            .light_line_style(WHITE)
            .x_desc(self.x_label)
            .y_desc(self.y_label)
            .x_labels(self.x.labels(frame.left, frame.right))
            .y_labels(self.y.labels(frame.low, frame.high))
            .x_label_formatter(&|place| self.x.label(*place))
            .y_label_formatter(&|place| self.y.label(*place))
            .draw()?;
        for (index, line) in self.lines.iter().enumerate() {
            let points = line.points.iter().map(|point| (self.x.place(point.0), self.y.place(point.1)));
            if is_dashed(index) {
                chart.draw_series(DashedLineSeries::new(points, DASH.0, DASH.1, colour(index).into()))?;
            } else {
                chart.draw_series(LineSeries::new(points, colour(index)))?;
            }
        }
        for value in self.limits.iter().flat_map(|limit| &limit.values) {
            let place = self.y.place(*value);
            chart.draw_series([PathElement::new([(frame.left, place), (frame.right, place)], LIMIT)])?;
        }
        Ok(())
    }

    /// A stroke and a name for every curve and every limit.
    fn legend(&self, area: &Area<'_>) -> Result<(), Box<dyn Error>> {
        let (dash, step) = (DASH.0 as i32, (DASH.0 + DASH.1) as i32);
        let curves = self.lines.iter().enumerate().map(|(index, line)| {
            let gap = if is_dashed(index) { step } else { dash };
            (&line.name, ShapeStyle::from(colour(index)), gap)
        });
        let limits = self.limits.iter().map(|limit| (&limit.name, LIMIT.stroke_width(2), dash));
        let middles = (0..).map(|row| (MARGIN + row * ROW + ROW / 2) as i32);
        for ((name, style, step), y) in curves.chain(limits).zip(middles) {
            for x in (0..3).map(|stroke| stroke * step) {
                area.draw(&PathElement::new([(x, y), (x + dash, y)], style))?;
            }
            area.draw(&Text::new(name.clone(), (3 * (dash + DASH.1 as i32) + 4, y - 6), ("sans-serif", 12)))?;
        }
        Ok(())
    }
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

fn colour(line: usize) -> RGBColor {
    COLOURS[line % COLOURS.len()]
}

/// Every second round of the colours is dashed, which tells its lines from the first's.
fn is_dashed(line: usize) -> bool {
    line / COLOURS.len() % 2 == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(limit: f64) -> Option<Drawn> {
        let lines = vec![Line { name: "a".to_owned(), points: vec![(0.0, 1.0), (1.0, 2.0)] }];
        Chart::over_time("y", lines, vec![Limit { name: "limit".to_owned(), values: vec![limit] }]).draw()
    }

    #[test]
    fn a_limit_is_drawn_where_it_leaves_the_curve_room_and_said_otherwise() {
        assert!(chart(3.0).unwrap().beyond.is_empty());
        assert_eq!(chart(300.0).unwrap().beyond[0].values, [300.0]);
    }

    /// Heights of the texts of a drawing that are to be read from left to right.
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
        let names: Vec<_> = (0..40).map(|number| format!("curve {number}")).collect();
        let line = |name: &String| Line { name: name.clone(), points: vec![(0.0, 1.0), (1.0, 2.0)] };
        let drawn = Chart::over_time("y", names.iter().map(line).collect(), Vec::new()).draw().unwrap();
        let heights = heights_of(&names, &drawn.svg);
        assert!(heights.is_sorted_by(|a, b| a < b), "{heights:?}");
        let (_, size) = drawn.svg.split_once("height=\"").unwrap();
        let height: i32 = size.split('"').next().unwrap().parse().unwrap();
        assert!(*heights.last().unwrap() < height, "{heights:?} of {height}");
    }

    #[test]
    fn no_two_of_sixteen_lines_look_the_same() {
        let looks = (0..16).map(|line| (colour(line).0, colour(line).1, colour(line).2, is_dashed(line)));
        assert_eq!(looks.collect::<std::collections::BTreeSet<_>>().len(), 16);
    }

    #[test]
    fn nothing_makes_no_plot() {
        assert!(Chart::over_time("y", Vec::new(), Vec::new()).draw().is_none());
    }

    #[test]
    fn no_number_of_a_recording_draws_for_ever() {
        let draw = |values: [f64; 2]| {
            let points = vec![(0.0, 1.0), (1.0, values[0]), (2.0, values[1]), (3.0, 2.0)];
            let limit = Limit { name: "limit".to_owned(), values: vec![1.0] };
            let line = Line { name: "a".to_owned(), points };
            Chart::over_time("y", vec![line], vec![limit]).draw()
        };
        assert!(draw([f64::INFINITY, f64::NAN]).is_some());
        assert!(draw([1e307, -1e307]).is_some());
        assert!(draw([1e308, -1e308]).is_none());
        let far = |value| vec![(0.0, value), (1.0, value)];
        for points in [far(1e17), far(1e300), vec![(0.0, 1e300), (1.0, 1e300_f64.next_up())]] {
            let line = Line { name: "a".to_owned(), points };
            assert!(Chart::over_time("y", vec![line], Vec::new()).draw().is_some());
        }
    }

    #[test]
    fn percentiles_are_labelled_as_people_say_them() {
        let labels = [0.0, 1.0, 2.0, 3.0, 4.0].map(|place| Scale::Percentile.label(place));
        assert_eq!(labels, ["0 %", "90 %", "99 %", "99.9 %", "99.99 %"]);
        assert_eq!(Scale::Log.label(2.0), "100");
    }
}
