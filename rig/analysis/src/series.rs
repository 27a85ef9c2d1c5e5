//! Values over time in memory of a fixed size: the longer the run, the wider the stretches of time that share their lowest
//! and highest value.

/// A point of a curve: seconds since the beginning, and a value.
type Point = (f64, f64);

/// A curve in the order of time.
pub type Curve = Vec<Point>;

/// Stretches kept at most.
const MOST: usize = 4096;
/// Width of the first stretches, ns.
const FIRST_WIDTH_NS: u64 = 1_000_000;

/// Values within a stretch of time.
pub(super) trait Merge: Clone + Default {
    /// Joins it with the values of the next stretch.
    fn merge(&mut self, next: &Self);
}

/// Stretches of equal width from a common beginning.
#[derive(Debug, Clone)]
pub(super) struct Series<T> {
    width_ns: u64,
    stretches: Vec<T>,
}

impl<T> Default for Series<T> {
    fn default() -> Self {
        Self { width_ns: FIRST_WIDTH_NS, stretches: Vec::new() }
    }
}

impl<T: Merge> Series<T> {
    /// Whose first stretches have this width, ns.
    pub(super) fn of_width(width_ns: u64) -> Self {
        Self { width_ns, stretches: Vec::new() }
    }

    /// The stretch that holds this time since the beginning.
    pub(super) fn at(&mut self, since_ns: u64) -> &mut T {
        while since_ns / self.width_ns >= MOST as u64 {
            self.join_pairs();
        }
        let place = (since_ns / self.width_ns) as usize;
        if place >= self.stretches.len() {
            self.stretches.resize(place + 1, T::default());
        }
        &mut self.stretches[place]
    }

    fn join_pairs(&mut self) {
        let joined = self.stretches.chunks(2).map(|pair| {
            let mut joined = pair[0].clone();
            pair.iter().skip(1).for_each(|next| joined.merge(next));
            joined
        });
        self.stretches = joined.collect();
        self.width_ns *= 2;
    }

    /// Width of a stretch, s.
    pub(super) fn width_s(&self) -> f64 {
        self.width_ns as f64 / 1e9
    }

    /// Middle of each stretch, s since the beginning, and its values.
    pub(super) fn iter(&self) -> impl Iterator<Item = (f64, &T)> {
        let width_s = self.width_s();
        self.stretches
            .iter()
            .enumerate()
            .map(move |(place, stretch)| ((place as f64 + 0.5) * width_s, stretch))
    }
}

impl<const N: usize> Series<Extremes<N>> {
    /// Takes one of the values of a time since the beginning; what is no finite number is left out.
    pub(super) fn take(&mut self, since_ns: u64, index: usize, value: f64) {
        if value.is_finite() {
            let point = (since_ns as f64 / 1e9, value);
            self.at(since_ns).take(index, Span { lowest: point, highest: point });
        }
    }

    /// Highest value of each stretch.
    pub(super) fn highest(&self, index: usize) -> Curve {
        self.spans(index).map(|span| span.highest).collect()
    }

    /// Lowest and highest value of each stretch, each at its own time. So a curve that only rises or only falls within
    /// its stretches is drawn as it is.
    pub(super) fn band(&self, index: usize) -> Curve {
        let mut band = Curve::new();
        for Span { lowest, highest } in self.spans(index) {
            let is_rising = lowest.0 <= highest.0;
            band.extend(if is_rising { [lowest, highest] } else { [highest, lowest] });
        }
        band.dedup();
        band
    }

    fn spans(&self, index: usize) -> impl Iterator<Item = Span> {
        self.stretches.iter().filter_map(move |stretch| stretch.0[index])
    }
}

/// The points with the smallest and the largest value.
#[derive(Debug, Clone, Copy)]
struct Span {
    lowest: Point,
    highest: Point,
}

/// Smallest and largest of each of `N` values; none before the first.
#[derive(Debug, Clone)]
pub(super) struct Extremes<const N: usize>([Option<Span>; N]);

impl<const N: usize> Default for Extremes<N> {
    fn default() -> Self {
        Self([None; N])
    }
}

impl<const N: usize> Extremes<N> {
    fn take(&mut self, index: usize, next: Span) {
        let span = self.0[index].get_or_insert(next);
        if next.lowest.1 < span.lowest.1 {
            span.lowest = next.lowest;
        }
        if next.highest.1 > span.highest.1 {
            span.highest = next.highest;
        }
    }
}

impl<const N: usize> Merge for Extremes<N> {
    fn merge(&mut self, next: &Self) {
        for (index, span) in next.0.iter().enumerate() {
            if let Some(span) = span {
                self.take(index, *span);
            }
        }
    }
}

/// A sum.
impl Merge for u64 {
    fn merge(&mut self, next: &Self) {
        *self += next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_run_keeps_its_extremes_at_their_times() {
        let mut series = Series::<Extremes<1>>::default();
        for millisecond in 0..100_000u64 {
            let value = if millisecond == 54_321 { 99.0 } else { (millisecond % 7) as f64 };
            series.take(millisecond * 1_000_000, 0, value);
        }
        let band = series.band(0);
        assert!(band.len() <= 2 * MOST && band.is_sorted_by(|a, b| a.0 < b.0));
        assert_eq!(band.iter().filter(|(_, value)| *value > 98.0).collect::<Vec<_>>(), [&(54.321, 99.0)]);
        assert!(series.highest(0).iter().all(|(_, value)| *value >= 6.0));
        assert_eq!(series.stretches.len(), band.iter().filter(|(_, value)| *value < 0.5).count());
    }

    /// Chewing, with flanks that fall through many stretches of time.
    #[test]
    fn every_point_of_a_curve_is_a_point_of_its_signal() {
        let signal = |at_s: f64| 20.0 * (std::f64::consts::TAU * at_s / 0.7).cos();
        let mut series = Series::<Extremes<1>>::default();
        for millisecond in 0..60_000u64 {
            series.take(millisecond * 1_000_000, 0, signal(millisecond as f64 / 1e3));
        }
        let band = series.band(0);
        assert!(series.width_ns > 4 * FIRST_WIDTH_NS, "each stretch holds many values");
        for (at_s, value) in &band {
            assert!((value - signal(*at_s)).abs() < 1e-9, "{value} at {at_s} s");
        }
        // No line between two points leaves the signal further than one across a turn of it does.
        for ends in band.windows(2) {
            let [(from_s, from), (to_s, to)] = [ends[0], ends[1]];
            let off = (from.midpoint(to) - signal(from_s.midpoint(to_s))).abs();
            assert!(off < 2.5, "{off} between {from_s} s and {to_s} s");
        }
        let turns = band.iter().filter(|(_, value)| value.abs() > 19.99).count();
        assert!(turns >= 2 * 85, "{turns} turns");
    }

    #[test]
    fn a_curve_of_one_value_is_a_straight_line_and_no_number_is_left_out() {
        let mut series = Series::<Extremes<1>>::default();
        for (microsecond, value) in [(0, 1.0), (1, f64::NAN), (2, f64::INFINITY), (3, 1.0), (1000, 1.0)] {
            series.take(microsecond * 1000, 0, value);
        }
        assert_eq!(series.band(0), [(0.0, 1.0), (0.001, 1.0)]);
    }

    #[test]
    fn nothing_is_lost_from_a_sum() {
        let mut series = Series::<u64>::default();
        (0..50_000u64).for_each(|millisecond| *series.at(millisecond * 1_000_000) += 3);
        assert_eq!(series.iter().map(|(_, sum)| sum).sum::<u64>(), 150_000);
    }
}
