//! Messages by their cycle, in constant memory.
//!
//! The recorder drains topic after topic, so messages of one cycle lie some tens of cycles apart.

/// Cycles kept; more than a subscriber's queue holds of any topic.
const KEPT: usize = 1 << 13;

/// The latest values by cycle.
#[derive(Debug, Clone)]
pub(super) struct ByCycle<T> {
    /// Empty before the first value: where nothing waits, no memory is used.
    slots: Vec<Option<(u64, T)>>,
}

impl<T> Default for ByCycle<T> {
    fn default() -> Self {
        Self { slots: Vec::new() }
    }
}

impl<T: Copy> ByCycle<T> {
    pub(super) fn insert(&mut self, cycle: u64, value: T) {
        self.slots.resize(KEPT, None);
        self.slots[cycle as usize % KEPT] = Some((cycle, value));
    }

    pub(super) fn get(&self, cycle: u64) -> Option<&T> {
        let (held, value) = self.slots.get(cycle as usize % KEPT)?.as_ref()?;
        (*held == cycle).then_some(value)
    }

    /// Takes the value out.
    pub(super) fn take(&mut self, cycle: u64) -> Option<T> {
        let value = *self.get(cycle)?;
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
        assert_eq!(values.get(5), Some(&'a'));
        assert_eq!(values.get(5 + KEPT as u64), None);
        assert_eq!(values.take(5), Some('a'));
        assert_eq!(values.get(5), None);
    }
}
