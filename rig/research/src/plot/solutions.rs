//! How many solutions random inputs have.

use masseter_charts::palette::BLUE;
use masseter_charts::{Axis, Bar, Error, Scale, bars, chart};
use masseter_controller::kinematics::MOST_SOLUTIONS;

use crate::multiplicity::Multiplicity;

pub(super) fn svg(multiplicity: &Multiplicity) -> Result<String, Error> {
    masseter_charts::svg((760, 420), |area| {
        let bar = |solutions: usize| {
            let (share, x) = (multiplicity.with_solutions(solutions), solutions as f64);
            let text = vec![format!("{solutions}: {share}")];
            Bar { sides: [x - 0.7, x + 0.7], height: 100.0 * share.value(), colour: BLUE, text }
        };
        let shown = (0..=MOST_SOLUTIONS).step_by(2).map(bar).filter(|bar| bar.height > 0.0);
        let shown: Vec<_> = shown.collect();
        let most = shown.iter().map(|bar| bar.height).fold(10.0, f64::max);
        let x = Axis::new("real solutions (mirrored ones counted)", Scale::Linear, [-1.0, 17.0]);
        let y = Axis::new("share of inputs, %", Scale::Linear, [0.0, most * 1.15]);
        bars(&mut chart(area, "Solutions of random inputs", x, y)?, &shown)
    })
}
