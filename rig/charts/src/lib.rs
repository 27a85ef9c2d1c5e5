//! Charts as SVG: lines, bars, grids of colours, with axes, ticks, legends and one palette.
//!
//! Drawing itself is done by `plotters`; this crate fixes what all charts of the rig have in common. Which data a chart
//! shows is decided by its users: the report and the paper study.
//!
//! ```
//! use masseter_charts::{Axis, Legend, Line, LineChart, Scale};
//!
//! let chart = LineChart {
//!     title: "Step response".to_owned(),
//!     x: Axis::fitted("time, s", Scale::Linear).including(0.0),
//!     y: Axis::fitted("stroke, mm", Scale::Linear),
//!     lines: vec![Line::new("slide 1", vec![(0.0, 0.0), (0.1, 4.0), (0.2, 5.0)])],
//!     limits: Vec::new(),
//!     moments: Vec::new(),
//!     legend: Legend::Beside,
//! };
//! let drawn = chart.draw(260).expect("three points make a chart");
//! assert!(drawn.svg.starts_with("<svg") && drawn.svg.contains("time, s"));
//! ```

mod axis;
mod canvas;
mod colour_scale;
mod line_chart;
mod moments;
pub mod palette;
mod ticks;

pub use axis::{Axis, Scale};
pub use canvas::{
    Area, Bar, Chart, Disc, Error, Key, LegendEntry, TEXT, TITLE, bars, cells, chart, discs, legend, marks,
    svg,
};
pub use colour_scale::ColourScale;
pub use line_chart::{Drawn, Legend, Limit, Line, LineChart};
pub use moments::Moment;
pub use plotters::chart::SeriesLabelPosition;
