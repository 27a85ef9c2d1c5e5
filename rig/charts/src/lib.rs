//! Charts as SVG: lines, bars, grids of colours, with axes, ticks, legends and one palette.
//!
//! Drawing itself is done by `plotters`; this crate fixes what all charts of the rig have in common. Which data a chart
//! shows is decided by its users: the studies and the page of a campaign. The page of a run draws itself (`masseter-page`).
//!
//! ```
//! use masseter_charts::{Axis, Line, LineChart, Scale, SeriesLabelPosition, svg};
//!
//! let chart = LineChart {
//!     title: "Step response".to_owned(),
//!     x: Axis::fitted("time, s", Scale::Linear).including(0.0),
//!     y: Axis::fitted("stroke, mm", Scale::Linear),
//!     lines: vec![Line::new("slide 1", vec![(0.0, 0.0), (0.1, 4.0), (0.2, 5.0)])],
//!     legend: SeriesLabelPosition::LowerRight,
//! };
//! let drawn = svg((960, 260), |area| chart.draw_on(area))?;
//! assert!(drawn.starts_with("<svg") && drawn.contains("time, s"));
//! # Ok::<(), masseter_charts::Error>(())
//! ```

mod axis;
mod canvas;
mod colour_scale;
mod line_chart;
pub mod palette;
mod ticks;

pub use axis::{Axis, Scale};
pub use canvas::{
    Area, Bar, Chart, Disc, Error, Key, LegendEntry, TEXT, TITLE, bars, cells, chart, discs, legend, marks,
    svg,
};
pub use colour_scale::ColourScale;
pub use line_chart::{Line, LineChart};
pub use plotters::chart::SeriesLabelPosition;
