//! Charts as SVG: lines and dots over two axes, with round ticks and one palette.
//!
//! Pictures without a browser's scripts are drawn here: figures for print, and recorded motions. Pages draw
//! themselves (`masseter-page`).
//!
//! ```
//! use masseter_charts::{Axis, BLUE, Chart, Look, Series, drawing};
//!
//! let points = vec![(0.0, 0.0), (0.1, 4.0), (0.2, 5.0)];
//! let chart = Chart {
//!     frame: [0.0, 0.0, 960.0, 260.0],
//!     title: "Step response".to_owned(),
//!     x: Axis { label: "time, s".to_owned(), ends: [0.0, 0.2] },
//!     y: Axis { label: "stroke, mm".to_owned(), ends: [0.0, 5.0] },
//!     series: vec![Series { name: "slide 1".to_owned(), colour: BLUE, look: Look::Line, points }],
//! };
//! let drawn = drawing([960.0, 260.0], &[chart]);
//! assert!(drawn.starts_with("<svg") && drawn.contains("time, s"));
//! ```

use std::fmt::Write;

// Colours that colour-blind people can tell apart (Okabe and Ito), and one for what stays in the background.
/// Blue.
pub const BLUE: &str = "#0072b2";
/// Vermilion.
pub const VERMILION: &str = "#d55e00";
/// Green.
pub const GREEN: &str = "#009e73";
/// Red, for limits and faults.
pub const RED: &str = "#b00020";
/// Grey.
pub const GREY: &str = "#999999";

/// Room around a plot for title, labels and numbers, px: left, above, right, below.
pub const ROOM: [f64; 4] = [64.0, 30.0, 20.0, 46.0];
/// Most ticks of an axis, but for one at its end.
const MOST_TICKS: f64 = 8.0;
/// Radius of a dot, px.
const DOT: f64 = 3.0;
/// Least length of an axis, and the same as a share of its greatest value: ticks must differ from each other.
const LEAST: f64 = 1e-6;
const LEAST_SHARE: f64 = 1e-9;
/// A path of no size is drawn in a box of this size, in the unit of its axes.
const LEAST_PATH: f64 = 1.0;

/// An axis.
#[derive(Debug, Clone)]
pub struct Axis {
    /// What it shows, with the unit.
    pub label: String,
    /// The values at its ends.
    pub ends: [f64; 2],
}

impl Axis {
    /// Evenly over all of these values, with so much room beyond them, as a share of their extent.
    #[must_use]
    pub fn around(label: &str, values: impl IntoIterator<Item = f64>, room: f64) -> Self {
        let [low, high] = extent(values);
        let room = room * (high - low);
        Self { label: label.to_owned(), ends: [low - room, high + room] }
    }

    /// To the right and upwards, in one scale around all points of a chart of this width and height, px. `around` is the extent of
    /// the axes by that of the points.
    #[must_use]
    pub fn in_one_scale(
        labels: [&str; 2],
        series: &[Series],
        [width, height]: [f64; 2],
        around: f64,
    ) -> [Self; 2] {
        let points = || series.iter().flat_map(|series| &series.points);
        let extents = [extent(points().map(|point| point.0)), extent(points().map(|point| point.1))];
        let plot = [width - ROOM[0] - ROOM[2], height - ROOM[1] - ROOM[3]];
        let [x, y] = [0, 1].map(|of| around * (extents[of][1] - extents[of][0]) / plot[of]);
        let per_px = x.max(y).max(LEAST_PATH / plot[0]);
        [0, 1].map(|of| {
            let (middle, half) = (f64::midpoint(extents[of][0], extents[of][1]), per_px * plot[of] / 2.0);
            Self::around(labels[of], [middle - half, middle + half], 0.0)
        })
    }

    /// Both ends, along which places are even.
    fn places(&self) -> [f64; 2] {
        let [low, high] = self.ends;
        let least = LEAST.max(LEAST_SHARE * low.abs().max(high.abs()));
        if low.is_finite() && high.is_finite() { [low, high.max(low + least)] } else { [0.0, 1.0] }
    }

    /// Where a value lies: 0 at the lower end, 1 at the upper one.
    fn share(&self, value: f64) -> f64 {
        let [low, high] = self.places();
        (value - low) / (high - low)
    }

    /// Multiples of 1, 2 or 5 times a power of ten from end to end, each with as many decimals as their distance needs.
    fn ticks(&self) -> Vec<(f64, String)> {
        let [low, high] = self.places();
        let least = (high - low) / MOST_TICKS;
        let power = 10f64.powf(least.log10().floor());
        let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * power >= least * (1.0 - 1e-9));
        let step = factor.unwrap_or(10.0) * power;
        let decimals = -(step.log10() + 1e-9).floor();
        let tick = |multiple: i64| {
            let value = multiple as f64 * step;
            (value, format!("{value:.*}", decimals.max(0.0) as usize))
        };
        ((low / step - 1e-9).ceil() as i64..=(high / step + 1e-9).floor() as i64).map(tick).collect()
    }
}

/// Least and greatest of some values; from +∞ to −∞ without any.
#[must_use]
pub fn extent(values: impl IntoIterator<Item = f64>) -> [f64; 2] {
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    values.into_iter().fold(none, |[low, high], value| [low.min(value), high.max(value)])
}

/// How points are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// Joined.
    Line,
    /// Joined by a thin line: one of many.
    Hair,
    /// The border of a pale area.
    Area,
    /// One by one.
    Dots,
}

/// Points of one colour.
#[derive(Debug, Clone)]
pub struct Series {
    /// Above the plot, in the series' colour; may be empty.
    pub name: String,
    /// As in a style sheet.
    pub colour: &'static str,
    /// How they are drawn.
    pub look: Look,
    /// In values of the axes.
    pub points: Vec<(f64, f64)>,
}

/// A chart.
#[derive(Debug, Clone)]
pub struct Chart {
    /// Left, top, width and height in the drawing, px.
    pub frame: [f64; 4],
    /// Above the plot; may be empty.
    pub title: String,
    /// From left to right.
    pub x: Axis,
    /// From bottom to top.
    pub y: Axis,
    /// The first is drawn first.
    pub series: Vec<Series>,
}

/// Width of a printed column, 85 mm, px: letters of 12 px then have 7 pt, lines of 2 px 0.4 mm.
pub const PRINT_COLUMN: f64 = 412.0;
const PX_PER_MM: f64 = PRINT_COLUMN / 85.0;

/// Charts on white, in a drawing of this width and height, px.
#[must_use]
pub fn drawing(size: [f64; 2], charts: &[Chart]) -> String {
    sized(size, size.map(|px| px.to_string()), charts)
}

/// The same with a size in mm, for print: [`PRINT_COLUMN`] is 85 mm.
#[must_use]
pub fn printed(size: [f64; 2], charts: &[Chart]) -> String {
    sized(size, size.map(|px| format!("{:.4}mm", px / PX_PER_MM).replace(".0000", "")), charts)
}

fn sized([width, height]: [f64; 2], [shown_width, shown_height]: [String; 2], charts: &[Chart]) -> String {
    let charts: String = charts.iter().map(Chart::svg).collect();
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{shown_width}\" height=\"{shown_height}\" \
         font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n{charts}</svg>\n"
    )
}

impl Chart {
    fn svg(&self) -> String {
        let [left, top, width, height] = self.frame;
        let (right, bottom) = (left + width - ROOM[2], top + height - ROOM[3]);
        let (left, top) = (left + ROOM[0], top + ROOM[1]);
        let x = |value: f64| left + (right - left) * self.x.share(value);
        let y = |value: f64| bottom - (bottom - top) * self.y.share(value);
        let mut svg = String::new();
        for (at, name) in self.x.ticks().into_iter().map(|(value, name)| (x(value), name)) {
            svg += &line([at, top], [at, bottom]);
            svg += &text([at, bottom + 16.0], "middle", &name);
        }
        for (at, name) in self.y.ticks().into_iter().map(|(value, name)| (y(value), name)) {
            svg += &line([left, at], [right, at]);
            svg += &text([left - 6.0, at + 4.0], "end", &name);
        }
        svg += &text([f64::midpoint(left, right), bottom + 36.0], "middle", &self.x.label);
        svg += &text([left, top - 8.0], "start", &format!("{}  {}", self.y.label, self.title));
        let named = self.series.iter().filter(|series| !series.name.is_empty());
        let names = named.map(|Series { name, colour, .. }| {
            format!("<tspan fill=\"{colour}\">\u{2003}{}</tspan>", escaped(name))
        });
        let _ = writeln!(
            svg,
            "<text x=\"{right:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            top - 8.0,
            names.collect::<String>()
        );
        for Series { colour, look, points, .. } in &self.series {
            let points = points.iter().map(|&(across, up)| (x(across), y(up)));
            let points = points.filter(|(x, y)| x.is_finite() && y.is_finite());
            let mut shape = |element: &str, attributes: &str| {
                let points: Vec<_> = points.clone().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
                writeln!(svg, "<{element} points=\"{}\" {attributes}/>", points.join(" "))
            };
            let line = |width: &str| format!("fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\"");
            let _ = match look {
                Look::Line => shape("polyline", &line("2")),
                Look::Hair => shape("polyline", &line("0.8")),
                Look::Area => shape("polygon", &format!("fill=\"{colour}\" fill-opacity=\"0.2\"")),
                Look::Dots => points.into_iter().try_for_each(|(x, y)| {
                    writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{DOT}\" fill=\"{colour}\"/>")
                }),
            };
        }
        svg
    }
}

/// A line of the mesh.
fn line([x1, y1]: [f64; 2], [x2, y2]: [f64; 2]) -> String {
    format!("<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"#e4e4e4\"/>\n")
}

fn text([x, y]: [f64; 2], anchor: &str, text: &str) -> String {
    format!("<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{}</text>\n", escaped(text))
}

/// Without characters that are markup.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attributes(svg: &str, key: &str) -> Vec<f64> {
        let key = format!(" {key}=\"");
        let values = svg.split(&key).skip(1).filter_map(|rest| rest.split('"').next());
        values.filter_map(|value| value.parse().ok()).collect()
    }

    #[test]
    fn every_finite_point_lies_in_the_plot_and_others_are_left_out() {
        let points = vec![(1.0, -2.0), (10.0, f64::NAN), (100.0, 3.0), (f64::INFINITY, 0.0)];
        let chart = Chart {
            frame: [10.0, 20.0, 400.0, 300.0],
            title: "a < b".to_owned(),
            x: Axis { label: "x".to_owned(), ends: [1.0, 100.0] },
            y: Axis::around("y", points.iter().map(|point| point.1), 0.1),
            series: vec![Series { name: "dots".to_owned(), colour: BLUE, look: Look::Dots, points }],
        };
        let svg = drawing([500.0, 400.0], &[chart]);
        assert_eq!(attributes(&svg, "cx"), [10.0 + ROOM[0], 410.0 - ROOM[2]]);
        let plot = (20.0 + ROOM[1])..=(320.0 - ROOM[3]);
        let up = attributes(&svg, "cy");
        assert!(up.len() == 2 && up.iter().all(|y| plot.contains(y)) && up[0] > up[1], "{up:?}");
        assert!(svg.contains("a &lt; b") && svg.contains(">20<"), "{svg}");
    }

    fn labels(low: f64, high: f64) -> Vec<String> {
        let axis = Axis { label: String::new(), ends: [low, high] };
        axis.ticks().into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn ticks_are_round_few_and_their_labels_differ() {
        assert_eq!(labels(-0.1, 1.05), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels(-40.0, 81.0), ["-40", "-20", "0", "20", "40", "60", "80"]);
        assert_eq!(labels(2.0, 2.0301), ["2.000", "2.005", "2.010", "2.015", "2.020", "2.025", "2.030"]);
        for (low, high) in [(2.0, 2.04), (0.0, 0.9), (1.0, 3.5), (-7.0, 20.0), (5.0, 800.0), (1e6, 1e6 + 1.0)]
        {
            let ticks = labels(low, high);
            assert!((3..=9).contains(&ticks.len()), "{ticks:?}");
            let mut different = ticks.clone();
            different.dedup();
            assert_eq!(different, ticks);
        }
    }

    #[test]
    fn an_axis_without_values_or_without_length_has_a_place_for_everything() {
        for axis in [Axis::around("", [], 0.1), Axis::around("", [3.0], 0.1)] {
            assert!(axis.share(3.0).is_finite(), "{axis:?}");
            assert!(axis.ticks().iter().all(|(value, _)| value.is_finite()), "{axis:?}");
        }
    }

    #[test]
    fn axes_in_one_scale_hold_all_points_also_of_a_path_without_size() {
        let path = |points| Series { name: String::new(), colour: BLUE, look: Look::Hair, points };
        let frame = [412.0, 250.0];
        let plot = [frame[0] - ROOM[0] - ROOM[2], frame[1] - ROOM[1] - ROOM[3]];
        for points in [vec![(-5.0, -18.0), (1.0, 0.0)], vec![(2.0, 2.0)]] {
            let axes = Axis::in_one_scale(["x", "y"], &[path(points.clone())], frame, 1.1);
            let [x, y] = [0, 1].map(|of| (axes[of].ends[1] - axes[of].ends[0]) / plot[of]);
            assert!((x / y - 1.0).abs() < 1e-9 && x > 0.0, "{axes:?}");
            let inside = 0.0..=1.0;
            assert!(
                points
                    .iter()
                    .all(|at| inside.contains(&axes[0].share(at.0)) && inside.contains(&axes[1].share(at.1)))
            );
        }
        let none = Axis::in_one_scale(["x", "y"], &[], frame, 1.1);
        assert!(none.iter().all(|axis| axis.share(3.0).is_finite()), "{none:?}");
    }
}
