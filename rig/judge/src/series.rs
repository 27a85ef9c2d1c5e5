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
pub(super) struct Stretches<T> {
    width_ns: u64,
    values: Vec<T>,
}

impl<T> Default for Stretches<T> {
    fn default() -> Self {
        Self::of_width(FIRST_WIDTH_NS)
    }
}

impl<T> Stretches<T> {
    /// Whose first stretches have this width, ns.
    pub(super) fn of_width(width_ns: u64) -> Self {
        Self { width_ns, values: Vec::new() }
    }
}

impl<T: Merge> Stretches<T> {
    /// The stretch that holds this time since the beginning.
    pub(super) fn at(&mut self, since_ns: u64) -> &mut T {
        while since_ns / self.width_ns >= MOST_STRETCHES as u64 {
            self.join_pairs();
        }
        let place = (since_ns / self.width_ns) as usize;
        if place >= self.values.len() {
            self.values.resize(place + 1, T::default());
        }
        &mut self.values[place]
    }

    fn join_pairs(&mut self) {
        let joined = self.values.chunks(2).map(|pair| {
            let mut joined = pair[0].clone();
            pair.iter().skip(1).for_each(|next| joined.merge(next));
            joined
        });
        self.values = joined.collect();
        self.width_ns *= 2;
    }

    /// Width of a stretch, s.
    pub(super) fn width_s(&self) -> f64 {
        self.width_ns as f64 / 1e9
    }

    /// Middle of each stretch, s since the beginning, and its values.
    pub(super) fn iter(&self) -> impl Iterator<Item = (f64, &T)> {
        let width_s = self.width_s();
        let stretches = self.values.iter().enumerate();
        stretches.map(move |(place, stretch)| ((place as f64 + 0.5) * width_s, stretch))
    }
}

/// The points with the smallest and the largest value.
#[derive(Debug, Clone, Copy)]
struct Span {
    lowest: Point,
    highest: Point,
}

impl Merge for Option<Span> {
    fn merge(&mut self, next: &Self) {
        let Some(next) = next else { return };
        let span = self.get_or_insert(*next);
        if next.lowest.1 < span.lowest.1 {
            span.lowest = next.lowest;
        }
        if next.highest.1 > span.highest.1 {
            span.highest = next.highest;
        }
    }
}

/// A value over time, as the lowest and the highest of each stretch.
#[derive(Debug, Clone, Default)]
pub struct Band(Stretches<Option<Span>>);

impl Band {
    /// Whose first stretches have this width, ns.
    pub(super) fn of_width(width_ns: u64) -> Self {
        Self(Stretches::of_width(width_ns))
    }

    /// Takes the value of a time since the beginning; NaN and infinite values are left out.
    pub(super) fn add(&mut self, since_ns: u64, value: f64) {
        if value.is_finite() {
            let point = (since_ns as f64 / 1e9, value);
            self.0.at(since_ns).merge(&Some(Span { lowest: point, highest: point }));
        }
    }

    /// Takes the values of a time, each into its band.
    pub(super) fn add_all(bands: &mut [Self], since_ns: u64, values: &[f64]) {
        bands.iter_mut().zip(values).for_each(|(band, value)| band.add(since_ns, *value));
    }

    /// Whether the stretch of a time since the beginning has a value.
    pub(super) fn has_value(&self, since_ns: u64) -> bool {
        let stretch = self.0.values.get((since_ns / self.0.width_ns) as usize);
        stretch.is_some_and(Option::is_some)
    }

    /// Highest value of each stretch.
    pub fn highest(&self) -> Curve {
        self.spans().map(|span| span.highest).collect()
    }

    /// Lowest and highest value of each stretch, each at its own time. So a curve that only rises or only falls within
    /// its stretches is drawn as it is.
    pub fn curve(&self) -> Curve {
        let mut curve = Curve::new();
        for Span { lowest, highest } in self.spans() {
            let is_rising = lowest.0 <= highest.0;
            curve.extend(if is_rising { [lowest, highest] } else { [highest, lowest] });
        }
        curve.dedup();
        curve
    }

    fn spans(&self) -> impl Iterator<Item = Span> {
        self.0.values.iter().copied().flatten()
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
