//! Joins messages of different topics by their cycle, in constant memory.
//!
//! The recorder drains topic after topic, so messages of one cycle lie some tens of cycles apart.

/// Cycles kept; far more than lie between two drains at any rate.
const KEPT: usize = 1 << 15;

/// The latest values by cycle.
#[derive(Debug)]
pub(super) struct ByCycle<T> {
    slots: Vec<Option<(u64, T)>>,
}

impl<T: Copy> Default for ByCycle<T> {
    fn default() -> Self {
        Self { slots: vec![None; KEPT] }
    }
}

impl<T: Copy> ByCycle<T> {
    pub(super) fn insert(&mut self, cycle: u64, value: T) {
        self.slots[cycle as usize % KEPT] = Some((cycle, value));
    }

    pub(super) fn get(&self, cycle: u64) -> Option<T> {
        self.slots[cycle as usize % KEPT].filter(|(held, _)| *held == cycle).map(|(_, value)| value)
    }

    /// Takes the value out, so that it is joined once.
    pub(super) fn take(&mut self, cycle: u64) -> Option<T> {
        let value = self.get(cycle)?;
        self.slots[cycle as usize % KEPT] = None;
        Some(value)
    }
}

/// Joins two messages of a cycle when the second of them comes, whichever that is.
#[derive(Debug)]
pub(super) struct Join<A, B> {
    lefts: ByCycle<A>,
    rights: ByCycle<B>,
}

impl<A: Copy, B: Copy> Default for Join<A, B> {
    fn default() -> Self {
        Self { lefts: ByCycle::default(), rights: ByCycle::default() }
    }
}

impl<A: Copy, B: Copy> Join<A, B> {
    /// Both, if the other one is here already.
    pub(super) fn left(&mut self, cycle: u64, left: A) -> Option<(A, B)> {
        let right = self.rights.take(cycle);
        if right.is_none() {
            self.lefts.insert(cycle, left);
        }
        Some((left, right?))
    }

    /// As [`Self::left`], from the other side.
    pub(super) fn right(&mut self, cycle: u64, right: B) -> Option<(A, B)> {
        let left = self.lefts.take(cycle);
        if left.is_none() {
            self.rights.insert(cycle, right);
        }
        Some((left?, right))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_messages_of_a_cycle_are_joined_once_in_either_order() {
        let mut join = Join::default();
        assert_eq!((join.left(1, 'a'), join.right(2, 'B')), (None, None));
        assert_eq!((join.right(1, 'A'), join.left(2, 'b')), (Some(('a', 'A')), Some(('b', 'B'))));
        assert_eq!((join.right(1, 'A'), join.left(2, 'b')), (None, None));
    }

    #[test]
    fn values_are_found_by_their_own_cycle_only() {
        let mut values = ByCycle::default();
        values.insert(5, 'a');
        assert_eq!(values.get(5), Some('a'));
        assert_eq!(values.get(5 + KEPT as u64), None);
        assert_eq!(values.take(5), Some('a'));
        assert_eq!(values.get(5), None);
    }
}
