//! The holding brake in time: it opens and closes late, or there is none.
//!
//! While a brake opens, the motor holds the axis already; while it closes, the motor has no current any more.

/// The brake.
#[derive(Debug, Clone, Copy)]
#[expect(clippy::struct_field_names, reason = "each name ends with its unit")]
pub(super) struct Brake {
    opening_ns: u64,
    /// None without a brake.
    closing_ns: Option<u64>,
    /// When the brake is open, once it was asked to open.
    open_at_ns: u64,
    /// When the brake is closed, once it was asked to close.
    closed_at_ns: Option<u64>,
}

impl Brake {
    /// A brake that has been closed for long; none without a time to close.
    pub(super) fn new(opening_ns: u64, closing_ns: Option<u64>) -> Self {
        Self { opening_ns, closing_ns, open_at_ns: 0, closed_at_ns: Some(0) }
    }

    /// Begins to open, unless it is open.
    pub(super) fn open(&mut self, now_ns: u64) {
        if self.closed_at_ns.is_some() {
            self.open_at_ns = now_ns + self.opening_ns;
        }
    }

    /// The earliest time from `now_ns` on at which the axis may move.
    pub(super) fn free_from_ns(&self, now_ns: u64) -> u64 {
        now_ns.max(self.open_at_ns)
    }

    /// Whether it holds in a step in which it is to be closed, or not.
    pub(super) fn holds(&mut self, now_ns: u64, is_to_close: bool) -> bool {
        if !is_to_close {
            self.closed_at_ns = None;
            return false;
        }
        let Some(closing_ns) = self.closing_ns else { return false };
        now_ns >= *self.closed_at_ns.get_or_insert(now_ns + closing_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_closes_and_opens_after_its_times() {
        let mut brake = Brake::new(200, Some(1000));
        assert!(brake.holds(0, true), "closed since long ago");
        brake.open(50);
        assert_eq!([0, 249, 300].map(|now_ns| brake.free_from_ns(now_ns)), [250, 250, 300]);
        assert!(!brake.holds(300, false));
        assert!(!brake.holds(400, true) && !brake.holds(1399, true) && brake.holds(1400, true));
    }

    #[test]
    fn without_a_brake_nothing_holds() {
        assert!(!Brake::new(0, None).holds(0, true));
    }

    #[test]
    fn by_default_it_acts_at_once() {
        let mut brake = Brake::new(0, Some(0));
        brake.open(7);
        assert_eq!(brake.free_from_ns(7), 7);
        assert!(!brake.holds(8, false) && brake.holds(9, true));
    }
}
