//! Colours for the values of a map, and the bar that explains them.

use plotters::prelude::*;

use crate::axis::{Axis, Scale};
use crate::canvas::{Area, Error, TEXT};
use crate::ticks;

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
        let step = ticks::step(high - low);
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
            .y_desc(format!("{} (yellow: {} and more)", self.label, ticks::plain(high)))
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
