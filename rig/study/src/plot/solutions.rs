//! How many solutions random inputs have.

use masseter_controller::kinematics::MOST_SOLUTIONS;
use plotters::prelude::*;

use super::axes::{Axes, percent, plain};
use super::{Figure, TEXT};
use crate::multiplicity::Multiplicity;
use masseter_charts::palette::BLUE;

pub(super) fn figure(multiplicity: &Multiplicity) -> anyhow::Result<Figure> {
    let caption = "Number of real solutions of random inputs over the whole strokes; without any the mechanism cannot \
                   be assembled.";
    Figure::draw("multiplicity", caption.to_owned(), (760, 420), |area| {
        let numbers = || (0..=MOST_SOLUTIONS).step_by(2);
        let most = numbers().map(|number| multiplicity.with_solutions(number).value()).fold(0.1, f64::max);
        let axes = Axes {
            title: "Solutions of random inputs",
            x: ("real solutions (mirrored ones counted)", -1.0..17.0, plain),
            y: ("share of inputs", 0.0..most * 1.15, percent),
        };
        let mut chart = axes.on(area)?;
        for number in numbers() {
            let share = multiplicity.with_solutions(number);
            if share.hits == 0 {
                continue;
            }
            let x = number as f64;
            chart.draw_series([Rectangle::new([(x - 0.7, 0.0), (x + 0.7, share.value())], BLUE.filled())])?;
            let place = (x - 0.65, share.value() + most * 0.055);
            let label = format!("{number}: {}", share.percent());
            chart.draw_series([Text::new(label, place, ("sans-serif", TEXT - 2))])?;
        }
        Ok(())
    })
}
