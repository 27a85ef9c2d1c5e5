//! Values over time in memory of a fixed size: the longer the run, the wider the stretches of time that share one value.

/// A curve: seconds since the beginning, and values.
pub type Curve = Vec<(f64, f64)>;

/// Stretches kept at most.
const MOST: usize = 1024;
/// Width of the first stretches, ns.
const FIRST_WIDTH_NS: u64 = 10_000_000;

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
    /// Highest value of each stretch.
    pub(super) fn highest(&self, index: usize) -> Curve {
        let points = self.iter().map(|(at_s, stretch)| (at_s, stretch.highest[index]));
        points.filter(|(_, value)| value.is_finite()).collect()
    }

    /// Lowest and highest value of each stretch, as one curve that touches both.
    pub(super) fn band(&self, index: usize) -> Curve {
        let ends = |(at_s, stretch): (f64, &Extremes<N>)| {
            [(at_s, stretch.lowest[index]), (at_s, stretch.highest[index])]
        };
        self.iter().flat_map(ends).filter(|(_, value)| value.is_finite()).collect()
    }
}

/// Smallest and largest of `N` values.
#[derive(Debug, Clone, Copy)]
pub(super) struct Extremes<const N: usize> {
    pub lowest: [f64; N],
    pub highest: [f64; N],
}

impl<const N: usize> Default for Extremes<N> {
    fn default() -> Self {
        Self { lowest: [f64::INFINITY; N], highest: [f64::NEG_INFINITY; N] }
    }
}

impl<const N: usize> Extremes<N> {
    pub(super) fn take(&mut self, index: usize, value: f64) {
        self.lowest[index] = self.lowest[index].min(value);
        self.highest[index] = self.highest[index].max(value);
    }
}

impl<const N: usize> Merge for Extremes<N> {
    fn merge(&mut self, next: &Self) {
        for index in 0..N {
            self.lowest[index] = self.lowest[index].min(next.lowest[index]);
            self.highest[index] = self.highest[index].max(next.highest[index]);
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
    fn a_long_run_keeps_its_extremes_in_wider_stretches() {
        let mut series = Series::<Extremes<1>>::default();
        for millisecond in 0..100_000u64 {
            let value = if millisecond == 54_321 { 99.0 } else { (millisecond % 7) as f64 };
            series.at(millisecond * 1_000_000).take(0, value);
        }
        assert!(series.iter().count() <= MOST);
        let (at_s, _) = series.iter().find(|(_, stretch)| stretch.highest[0] > 98.0).unwrap();
        assert!((at_s - 54.321).abs() <= series.width_s());
        assert!(series.iter().all(|(_, stretch)| stretch.lowest[0] < 1.0));
    }

    #[test]
    fn nothing_is_lost_from_a_sum() {
        let mut series = Series::<u64>::default();
        (0..50_000u64).for_each(|millisecond| *series.at(millisecond * 1_000_000) += 3);
        assert_eq!(series.iter().map(|(_, sum)| sum).sum::<u64>(), 150_000);
    }
}
