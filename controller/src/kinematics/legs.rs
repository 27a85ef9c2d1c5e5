//! The three legs and the three sides of the platform, in their cyclic order.

use masseter_model::geometry::LEGS;

/// One value for each leg or side. `array::map` and `from_fn` do the same, but are not unrolled here, and
/// then pass everything through memory: a quarter of a warm solve's time.
#[inline]
pub(super) fn each<T>(value: impl Fn(usize) -> T) -> [T; LEGS] {
    [value(0), value(1), value(2)]
}

/// The leg at the far end of the side that starts at this one.
#[inline]
pub(super) fn next(leg: usize) -> usize {
    (leg + 1) % LEGS
}
