//! Joins messages of different topics by their cycle, in constant memory.
//!
//! The logger drains topic after topic, so messages of one cycle lie some tens of cycles apart.

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

#[cfg(test)]
mod tests {
    use super::*;

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
