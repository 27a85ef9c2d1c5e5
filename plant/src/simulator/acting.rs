//! The faults that act on one part of the plant at an instant: a list that never allocates, one for each part.
//! [`injection`](super::injection) decides when faults begin and end.

use std::fmt::Debug;

use arrayvec::ArrayVec;

/// More kinds than any part has.
const MOST: usize = 16;

/// The kinds of faults that act on a part, each with its size, and whether it has really changed something.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct Acting<K> {
    acts: ArrayVec<Act<K>, MOST>,
}

#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Act<K> {
    kind: K,
    size: f64,
    has_struck: bool,
}

impl<K: Copy + Eq + Debug> Acting<K> {
    /// None acts.
    pub(crate) const fn new() -> Self {
        Self { acts: ArrayVec::new_const() }
    }

    /// Whether none acts.
    #[inline]
    pub(crate) fn is_empty(&self) -> bool {
        self.acts.is_empty()
    }

    /// A fault begins. One of its kind that acts already is replaced.
    ///
    /// # Panics
    /// For more kinds than a part has.
    pub(crate) fn begin(&mut self, kind: K, size: f64) {
        self.end(kind);
        assert!(
            !self.acts.is_full(),
            "no room for {kind:?}: every kind acts once, and no part has {MOST} kinds"
        );
        self.acts.push(Act { kind, size, has_struck: false });
    }

    /// A fault ends.
    pub(crate) fn end(&mut self, kind: K) {
        self.acts.retain(|act| act.kind != kind);
    }

    /// The size of the fault of that kind, 0 where the kind has none; none while no such fault acts.
    #[inline]
    pub(crate) fn size(&self, kind: K) -> Option<f64> {
        self.acts.iter().find(|act| act.kind == kind).map(|act| act.size)
    }

    /// Whether a fault of that kind acts.
    #[inline]
    pub(crate) fn has(&self, kind: K) -> bool {
        self.size(kind).is_some()
    }

    /// A fault of that kind has changed something.
    pub(crate) fn strike(&mut self, kind: K) {
        self.acts.iter_mut().filter(|act| act.kind == kind).for_each(|act| act.has_struck = true);
    }

    /// Whether the fault of that kind has changed something since it began.
    pub(crate) fn has_struck(&self, kind: K) -> bool {
        self.acts.iter().any(|act| act.kind == kind && act.has_struck)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    enum Kind {
        Scale,
        Sto,
    }

    #[test]
    fn a_fault_acts_between_its_begin_and_its_end_and_strikes_when_its_part_says_so() {
        let mut acting = Acting::new();
        assert!(acting.is_empty() && !acting.has(Kind::Sto));
        acting.begin(Kind::Scale, 1.5);
        acting.begin(Kind::Sto, 0.0);
        assert_eq!((acting.size(Kind::Scale), acting.size(Kind::Sto)), (Some(1.5), Some(0.0)));
        acting.strike(Kind::Sto);
        assert!(acting.has_struck(Kind::Sto) && !acting.has_struck(Kind::Scale));
        acting.end(Kind::Sto);
        acting.strike(Kind::Sto);
        assert!(!acting.has(Kind::Sto) && !acting.has_struck(Kind::Sto));
        acting.begin(Kind::Scale, 2.0);
        assert_eq!(acting.size(Kind::Scale), Some(2.0));
    }
}
