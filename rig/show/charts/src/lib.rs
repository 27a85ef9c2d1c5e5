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
mod line_chart;

pub use axis::{Axis, Scale};
pub use canvas::{
    Area, Bar, Chart, ColourScale, Disc, Error, Key, LegendEntry, TEXT, TITLE, bars, cells, chart, discs,
    legend, marks, svg,
};
pub use line_chart::{Line, LineChart};
pub use plotters::chart::SeriesLabelPosition;

/// Colours that colour-blind people can tell apart (Okabe and Ito).
pub mod palette {
    use plotters::style::RGBColor;

    /// Blue.
    pub const BLUE: RGBColor = RGBColor(0x00, 0x72, 0xb2);
    /// Vermilion.
    pub const VERMILION: RGBColor = RGBColor(0xd5, 0x5e, 0x00);
    /// Green.
    pub const GREEN: RGBColor = RGBColor(0x00, 0x9e, 0x73);
    /// Purple.
    pub const PURPLE: RGBColor = RGBColor(0xcc, 0x79, 0xa7);
    /// Orange.
    pub const ORANGE: RGBColor = RGBColor(0xe6, 0x9f, 0x00);
    /// Sky.
    pub const SKY: RGBColor = RGBColor(0x56, 0xb4, 0xe9);
    /// Grey, for what stays in the background.
    pub const GREY: RGBColor = RGBColor(0x99, 0x99, 0x99);
    /// Red, for limits and faults.
    pub const RED: RGBColor = RGBColor(0xb0, 0x00, 0x20);

    const SERIES: [RGBColor; 8] =
        [BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, RGBColor(0x66, 0x66, 0x66), RGBColor(0x9a, 0x7d, 0x0a)];

    /// Colour of a line by its number in a chart.
    pub(crate) fn series(line: usize) -> RGBColor {
        SERIES[line % SERIES.len()]
    }

    /// Every second round of the colours is dashed, so that its lines differ from the first round's.
    pub(crate) fn is_dashed(line: usize) -> bool {
        line / SERIES.len() % 2 == 1
    }
}

#[cfg(test)]
mod tests {
    use super::palette::{is_dashed, series};

    #[test]
    fn no_two_of_sixteen_lines_look_the_same() {
        let looks = (0..16).map(|line| (series(line).0, series(line).1, series(line).2, is_dashed(line)));
        assert_eq!(looks.collect::<std::collections::BTreeSet<_>>().len(), 16);
    }
}
