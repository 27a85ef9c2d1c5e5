//! Values by cycle and over time, in memory of a fixed size.
//!
//! The recorder drains topic after topic, so messages of one cycle lie some tens of cycles apart. The longer a run, the wider
//! the stretches of time that share their lowest and highest value.

use std::collections::{BTreeMap, VecDeque};

/// Cycles kept at most; more than a subscriber's queue holds of any topic.
const MOST_CYCLES: usize = 1 << 13;

/// The latest values by cycle.
#[derive(Debug, Clone)]
pub(super) struct ByCycle<T>(BTreeMap<u64, T>);

impl<T> Default for ByCycle<T> {
    fn default() -> Self {
        Self(BTreeMap::new())
    }
}

impl<T> ByCycle<T> {
    /// Keeps a value. Beyond [`MOST_CYCLES`] the oldest one goes.
    pub(super) fn insert(&mut self, cycle: u64, value: T) {
        self.0.insert(cycle, value);
        if self.0.len() > MOST_CYCLES {
            self.0.pop_first();
        }
    }

    pub(super) fn get(&self, cycle: u64) -> Option<&T> {
        self.0.get(&cycle)
    }

    /// Takes the value out.
    pub(super) fn remove(&mut self, cycle: u64) -> Option<T> {
        self.0.remove(&cycle)
    }
}

/// A point of a curve: seconds since the beginning, and a value.
type Point = (f64, f64);

/// A curve in the order of time.
pub type Curve = Vec<Point>;

/// Stretches kept at most.
const MOST_STRETCHES: usize = 4096;
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
        while since_ns / self.width_ns >= MOST_STRETCHES as u64 {
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
        let stretches = self.stretches.iter().enumerate();
        stretches.map(move |(place, stretch)| ((place as f64 + 0.5) * width_s, stretch))
    }
}

impl<const N: usize> Series<Extremes<N>> {
    /// Takes one of the values of a time since the beginning; NaN and infinite values are left out.
    pub(super) fn add(&mut self, since_ns: u64, index: usize, value: f64) {
        if value.is_finite() {
            let point = (since_ns as f64 / 1e9, value);
            self.at(since_ns).add(index, Span { lowest: point, highest: point });
        }
    }

    /// Takes the values of a time that stand at `first` and behind.
    pub(super) fn add_all(&mut self, since_ns: u64, first: usize, values: &[f64]) {
        (first..).zip(values).for_each(|(index, value)| self.add(since_ns, index, *value));
    }

    /// Whether the stretch of a time since the beginning has this value.
    pub(super) fn has_value(&self, index: usize, since_ns: u64) -> bool {
        let stretch = self.stretches.get((since_ns / self.width_ns) as usize);
        stretch.is_some_and(|stretch| stretch.0[index].is_some())
    }

    /// The bands at `first` and behind.
    pub(super) fn bands<const M: usize>(&self, first: usize) -> [Curve; M] {
        std::array::from_fn(|place| self.band(first + place))
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
    fn add(&mut self, index: usize, next: Span) {
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
                self.add(index, *span);
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

/// Time that a mean covers, ns.
const WINDOW_NS: u64 = 20_000_000;

/// Smooths `N` values that come together.
#[derive(Debug, Clone, Default)]
pub(super) struct Smoothing<const N: usize> {
    held: VecDeque<(u64, [f64; N])>,
}

impl<const N: usize> Smoothing<N> {
    /// Takes the next values and their time; returns a mean and its time once the window is full.
    pub(super) fn add(&mut self, time_ns: u64, values: [f64; N]) -> Option<(u64, [f64; N])> {
        self.held.push_back((time_ns, values));
        let mut is_full = false;
        while self.held.front()?.0 + WINDOW_NS <= time_ns {
            self.held.pop_front();
            is_full = true;
        }
        let (first_ns, _) = self.held.front()?;
        let count = self.held.len() as f64;
        let mean = |place: usize| self.held.iter().map(|(_, values)| values[place]).sum::<f64>() / count;
        is_full.then(|| (first_ns.midpoint(time_ns), std::array::from_fn(mean)))
    }
}

#[cfg(test)]
mod tests;
