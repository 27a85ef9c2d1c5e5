//! Natural cubic splines through vectors: twice continuously differentiable, curvature 0 at the ends.

use nalgebra::SVector;

/// A curve in N coordinates over time.
#[derive(Debug, Clone)]
pub(super) struct Spline<const N: usize> {
    time_s: Vec<f64>,
    values: Vec<SVector<f64, N>>,
    /// Second derivatives at the knots.
    curvatures: Vec<SVector<f64, N>>,
}

impl<const N: usize> Spline<N> {
    /// Through at least two values at strictly increasing times.
    pub(super) fn through(time_s: Vec<f64>, values: Vec<SVector<f64, N>>) -> Self {
        assert!(time_s.len() >= 2 && time_s.len() == values.len(), "a curve needs two knots");
        let curvatures = curvatures(&time_s, &values);
        Self { time_s, values, curvatures }
    }

    /// The value at a time; held beyond the ends. Finds its span in O(log n), allocates nothing.
    pub(super) fn at(&self, t_s: f64) -> SVector<f64, N> {
        let last = self.time_s.len() - 1;
        let t_s = t_s.clamp(self.time_s[0], self.time_s[last]);
        let right = self.time_s.partition_point(|&knot| knot <= t_s).clamp(1, last);
        let left = right - 1;
        let span = self.time_s[right] - self.time_s[left];
        let b = (t_s - self.time_s[left]) / span;
        let a = 1.0 - b;
        let bend = |x: f64| (x * x * x - x) * span * span / 6.0;
        self.values[left] * a
            + self.values[right] * b
            + self.curvatures[left] * bend(a)
            + self.curvatures[right] * bend(b)
    }
}

/// Elimination in the tridiagonal system that equal slopes on both sides of each knot make.
fn curvatures<const N: usize>(time_s: &[f64], values: &[SVector<f64, N>]) -> Vec<SVector<f64, N>> {
    let knots = time_s.len();
    let span = |left: usize| time_s[left + 1] - time_s[left];
    let slope = |left: usize| (values[left + 1] - values[left]) / span(left);
    let mut upper = vec![0.0; knots];
    let mut solution = vec![SVector::zeros(); knots];
    for knot in 1..knots - 1 {
        let (before, after) = (span(knot - 1), span(knot));
        let pivot = 2.0 * (before + after) - before * upper[knot - 1];
        upper[knot] = after / pivot;
        solution[knot] = ((slope(knot) - slope(knot - 1)) * 6.0 - solution[knot - 1] * before) / pivot;
    }
    for knot in (1..knots - 1).rev() {
        let next = solution[knot + 1];
        solution[knot] -= next * upper[knot];
    }
    solution
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector1;

    use super::*;

    fn sine(knots: u32) -> Spline<1> {
        // Unevenly spaced, over one full period, at whose ends the sine has no curvature.
        let time_s: Vec<f64> = (0..=knots)
            .map(|k| {
                let x = f64::from(k) / f64::from(knots);
                std::f64::consts::TAU * (x + 0.05 * (std::f64::consts::TAU * x).sin())
            })
            .collect();
        let values = time_s.iter().map(|t| Vector1::new(t.sin())).collect();
        Spline::through(time_s, values)
    }

    #[test]
    fn a_sine_is_followed_with_fourth_order() {
        let worst = |knots| {
            let spline = sine(knots);
            let error = |k: u32| {
                let t = f64::from(k) / 1000.0 * std::f64::consts::TAU;
                (spline.at(t)[0] - t.sin()).abs()
            };
            (0..=1000).map(error).fold(0.0, f64::max)
        };
        assert!(worst(20) < 5e-4);
        assert!(worst(40) < worst(20) / 12.0);
    }

    #[test]
    fn values_at_the_knots_are_kept_and_held_beyond_the_ends() {
        let spline = Spline::through(vec![0.0, 1.0, 3.0], [1.0, -2.0, 5.0].map(Vector1::new).to_vec());
        for (t, value) in [(-1.0, 1.0), (0.0, 1.0), (1.0, -2.0), (3.0, 5.0), (4.0, 5.0)] {
            assert!((spline.at(t)[0] - value).abs() < 1e-12);
        }
    }
}
