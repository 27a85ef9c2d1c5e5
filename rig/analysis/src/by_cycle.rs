//! Messages by their cycle, in constant memory.
//!
//! The recorder drains topic after topic, so messages of one cycle lie some tens of cycles apart.

/// Cycles kept at most; more than a subscriber's queue holds of any topic.
const MOST: usize = 1 << 13;
/// Places at first. As long as every value is taken out soon, no more are needed.
const FEWEST: usize = 1 << 6;

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
    /// Keeps a value. While its place holds another cycle, the number of places doubles, up to [`MOST`]. Beyond, the value
    /// replaces that of the other cycle.
    pub(super) fn insert(&mut self, cycle: u64, value: T) {
        if self.slots.is_empty() {
            self.slots = vec![None; FEWEST];
        }
        let held_by_another =
            |slots: &[Option<(u64, T)>]| slots[place(cycle, slots)].is_some_and(|(held, _)| held != cycle);
        while self.slots.len() < MOST && held_by_another(&self.slots) {
            let mut slots = vec![None; 2 * self.slots.len()];
            for kept in self.slots.iter().flatten() {
                let place = place(kept.0, &slots);
                slots[place] = Some(*kept);
            }
            self.slots = slots;
        }
        let place = place(cycle, &self.slots);
        self.slots[place] = Some((cycle, value));
    }

    pub(super) fn get(&self, cycle: u64) -> Option<&T> {
        let (held, value) = self.slots.get(place(cycle, &self.slots))?.as_ref()?;
        (*held == cycle).then_some(value)
    }

    /// Takes the value out.
    pub(super) fn take(&mut self, cycle: u64) -> Option<T> {
        let value = *self.get(cycle)?;
        let place = place(cycle, &self.slots);
        self.slots[place] = None;
        Some(value)
    }
}

/// The number of places is 0 or a power of two.
fn place<T>(cycle: u64, slots: &[T]) -> usize {
    cycle as usize & slots.len().wrapping_sub(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_found_by_their_own_cycle_only() {
        let mut values = ByCycle::default();
        values.insert(5, 'a');
        assert_eq!(values.get(5), Some(&'a'));
        assert_eq!(values.get(5 + FEWEST as u64), None);
        assert_eq!(values.take(5), Some('a'));
        assert_eq!(values.get(5), None);
    }

    #[test]
    fn as_many_cycles_as_a_queue_holds_are_kept_and_no_more() {
        let mut values = ByCycle::default();
        for cycle in 0..=MOST as u64 {
            values.insert(cycle, cycle);
        }
        assert_eq!(values.get(0), None);
        assert!((1..=MOST as u64).all(|cycle| values.take(cycle) == Some(cycle)));
    }

    #[test]
    fn values_that_stay_and_older_ones_that_come_late_are_kept() {
        let mut values = ByCycle::default();
        values.insert(10_064, 'b');
        values.insert(10_000, 'a');
        values.insert(10_000, 'c');
        for cycle in 10_065..10_500 {
            values.insert(cycle, '-');
        }
        assert_eq!((values.take(10_064), values.take(10_000)), (Some('b'), Some('c')));
    }

    #[test]
    fn values_that_are_taken_out_soon_need_few_places() {
        let mut values = ByCycle::default();
        for cycle in 20..10_000 {
            values.insert(cycle, cycle);
            assert_eq!(values.take(cycle - 19), (cycle >= 39).then_some(cycle - 19));
        }
        assert_eq!(values.slots.len(), FEWEST);
    }
}
