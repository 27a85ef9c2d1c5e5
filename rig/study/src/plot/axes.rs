//! A pair of axes with labels, as all the study's charts have them.

use std::ops::Range;

use plotters::coord::types::RangedCoordf64;
use plotters::element::PathElement;
use plotters::prelude::*;

use super::{Area, TEXT, TITLE};

/// A chart that can be drawn into.
pub(super) type Chart<'a, 'svg> =
    ChartContext<'a, SVGBackend<'svg>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// What an axis is labelled with.
pub(super) type Labels = fn(f64) -> String;

/// Title, labels and ranges.
pub(super) struct Axes<'a> {
    pub title: &'a str,
    pub x: (&'a str, Range<f64>, Labels),
    pub y: (&'a str, Range<f64>, Labels),
}

impl Axes<'_> {
    pub(super) fn on<'a, 'svg>(&self, area: &'a Area<'svg>) -> anyhow::Result<Chart<'a, 'svg>> {
        let mut builder = ChartBuilder::on(area);
        builder.margin(10).margin_right(18).x_label_area_size(46).y_label_area_size(66);
        if !self.title.is_empty() {
            builder.caption(self.title, ("sans-serif", TITLE));
        }
        let mut chart = builder.build_cartesian_2d(self.x.1.clone(), self.y.1.clone())?;
        chart
            .configure_mesh()
            .light_line_style(WHITE)
            .bold_line_style(RGBColor(0xe4, 0xe4, 0xe4))
            .label_style(("sans-serif", TEXT - 2))
            .axis_desc_style(("sans-serif", TEXT))
            .x_desc(self.x.0)
            .y_desc(self.y.0)
            .x_labels(8)
            .y_labels(8)
            .x_label_formatter(&|value| (self.x.2)(*value))
            .y_label_formatter(&|value| (self.y.2)(*value))
            .draw()?;
        Ok(chart)
    }
}

/// A named curve with a mark at each point, if they are few.
pub(super) fn curve(
    chart: &mut Chart<'_, '_>,
    name: &str,
    points: &[(f64, f64)],
    colour: RGBColor,
    marked: bool,
) -> anyhow::Result<()> {
    let line = colour.stroke_width(2);
    let series = chart.draw_series(LineSeries::new(points.iter().copied(), line))?;
    if !name.is_empty() {
        series.label(name).legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], line));
    }
    if marked {
        chart.draw_series(points.iter().map(|&point| Circle::new(point, 3, colour.filled())))?;
    }
    Ok(())
}

/// The legend of named curves.
pub(super) fn named<'a, 'svg: 'a>(
    chart: &mut Chart<'a, 'svg>,
    position: SeriesLabelPosition,
) -> anyhow::Result<()> {
    chart
        .configure_series_labels()
        .position(position)
        .label_font(("sans-serif", TEXT - 1))
        .background_style(WHITE.mix(0.85))
        .border_style(RGBColor(0xcc, 0xcc, 0xcc))
        .draw()?;
    Ok(())
}

/// Numbers as they are, without the dust of binary fractions.
pub(super) fn plain(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    format!("{}", if rounded == 0.0 { 0.0 } else { rounded })
}

/// An exponent as a power of ten.
pub(super) fn power_of_ten(exponent: f64) -> String {
    let digits = |character: char| match character {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '0' => '⁰',
        '4'..='9' => char::from_u32('⁴' as u32 + character as u32 - '4' as u32).unwrap_or(character),
        other => other,
    };
    if (exponent - exponent.round()).abs() > 1e-9 {
        return String::new();
    }
    format!("10{}", format!("{}", exponent.round() as i64).chars().map(digits).collect::<String>())
}

/// A share as per cent.
pub(super) fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_read_as_people_write_them() {
        assert_eq!(power_of_ten(-24.0), "10⁻²⁴");
        assert_eq!(power_of_ten(0.5), "");
        assert_eq!(plain(0.1_f64.mul_add(3.0, -0.3)), "0");
        assert_eq!(percent(0.25), "25 %");
    }
}
