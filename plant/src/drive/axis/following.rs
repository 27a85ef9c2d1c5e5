//! Supervision of the following error: its window (6065h) and its time out (6066h).
//!
//! The monitor only judges; the reaction is the axis' matter.

/// Memory of the supervision.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct FollowingErrorMonitor {
    /// Since when the error has been outside its window, ns.
    outside_since_ns: Option<u64>,
    /// Whether the drive is in fault because of it: statusword bit 13 of the position modes.
    is_fault: bool,
}

impl FollowingErrorMonitor {
    /// Statusword bit 13: whether the drive is in fault because of the following error.
    pub(super) fn is_fault(self) -> bool {
        self.is_fault
    }

    /// The following error has put the drive into fault.
    pub(super) fn fail(&mut self) {
        self.is_fault = true;
    }

    /// Judges an error (m); whether it has been outside the window for longer than the time out.
    pub(super) fn exceeds(&mut self, now_ns: u64, error_m: f64, window_m: f64, timeout_ns: u64) -> bool {
        if error_m.abs() <= window_m {
            self.outside_since_ns = None;
            return false;
        }
        now_ns - *self.outside_since_ns.get_or_insert(now_ns) > timeout_ns
    }

    /// Supervision begins anew in another power state; the fault lasts as long as the drive is in fault.
    pub(super) fn restart(&mut self, is_in_fault: bool) {
        *self = Self { outside_since_ns: None, is_fault: self.is_fault && is_in_fault };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_following_error_counts_beyond_window_and_time_out() {
        for error_m in [0.011, -0.011] {
            let mut monitor = FollowingErrorMonitor::default();
            let mut exceeds = |now_ns, error_m| monitor.exceeds(now_ns, error_m, 0.01, 20);
            assert!(!exceeds(1000, 0.01) && !exceeds(2000, -0.01), "at the edge of the window");
            assert!(!exceeds(3000, error_m) && !exceeds(3020, error_m));
            assert!(exceeds(3021, error_m) && exceeds(3022, error_m));
            assert!(!exceeds(3023, 0.0));
            assert!(!exceeds(3024, error_m) && !exceeds(3044, error_m) && exceeds(3045, error_m), "anew");
            monitor.restart(false);
            assert!(!monitor.exceeds(3046, error_m, 0.01, 20), "anew");
        }
    }

    #[test]
    fn a_following_error_that_is_a_fault_is_one_as_long_as_the_drive_is_in_fault() {
        let mut monitor = FollowingErrorMonitor::default();
        monitor.restart(true);
        assert!(!monitor.is_fault(), "another fault");
        monitor.fail();
        assert!(monitor.is_fault());
        monitor.restart(true);
        assert!(monitor.is_fault());
        monitor.restart(false);
        assert!(!monitor.is_fault());
    }
}
