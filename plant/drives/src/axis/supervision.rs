//! Monitors of the following error (6065h, 6066h) and of an axis that runs away. They only judge; the reaction is the axis' matter.

use super::motion::Motion;

/// Supervision of the following error.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct FollowingErrorMonitor {
    /// Since when the error has been outside its window, ns.
    outside_since_ns: Option<u64>,
    /// Whether the drive is in fault because of it: statusword bit 13 of the position modes.
    pub(super) is_fault: bool,
}

impl FollowingErrorMonitor {
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

/// Steps in which an axis gets faster ahead of its demand until that is a fault. A jump of the encoder makes one.
const RUNAWAY_STEPS: u32 = 3;

/// Supervision of an axis in operation. After lost targets and steps of targets a healthy axis lags, catches up and
/// overshoots, but does not get faster and faster ahead of its demand.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct RunawayMonitor {
    /// Steps in a row in which the axis got faster ahead of its demand.
    steps: u32,
}

impl RunawayMonitor {
    /// Judges a step from the velocity before; whether the axis has run ahead for too many steps. `limits`: way (m) and
    /// velocity (m/s) ahead of the demand.
    pub(super) fn exceeds(
        &mut self,
        before_m_s: f64,
        motion: Motion,
        demanded: Motion,
        limits: [f64; 2],
    ) -> bool {
        let [most_m, most_m_s] = limits;
        let apart_m_s = motion.velocity_m_s - demanded.velocity_m_s;
        let side = apart_m_s.signum();
        let runs_ahead = apart_m_s.abs() > most_m_s
            && (motion.position_m - demanded.position_m) * side > most_m
            && (motion.velocity_m_s - before_m_s) * side > 0.0;
        self.steps = if runs_ahead { self.steps + 1 } else { 0 };
        self.steps >= RUNAWAY_STEPS
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
        assert!(!monitor.is_fault, "another fault");
        monitor.is_fault = true;
        assert!(monitor.is_fault);
        monitor.restart(true);
        assert!(monitor.is_fault);
        monitor.restart(false);
        assert!(!monitor.is_fault);
    }

    const DEMANDED: Motion = Motion { position_m: 0.0, velocity_m_s: 0.1 };

    /// Whether steps with these positions and velocities exceed, each with the velocity before.
    fn runs_away(steps: [(f64, f64); 3]) -> bool {
        let (mut monitor, mut before_m_s) = (RunawayMonitor::default(), 0.1);
        steps.into_iter().any(|(position_m, velocity_m_s)| {
            let before_m_s = std::mem::replace(&mut before_m_s, velocity_m_s);
            monitor.exceeds(before_m_s, Motion { position_m, velocity_m_s }, DEMANDED, [3e-4, 0.1])
        })
    }

    #[test]
    fn an_axis_runs_away_that_gets_faster_for_three_steps_ahead_of_its_demand() {
        assert!(runs_away([(4e-4, 0.21), (5e-4, 0.3), (6e-4, 0.4)]));
        assert!(runs_away([(-4e-4, -0.01), (-5e-4, -0.1), (-6e-4, -0.2)]), "backwards");
        for (steps, why) in [
            ([(2e-4, 0.21), (5e-4, 0.3), (6e-4, 0.4)], "not ahead at first"),
            ([(4e-4, 0.19), (5e-4, 0.3), (6e-4, 0.4)], "not fast at first"),
            ([(4e-4, 0.4), (5e-4, 0.3), (6e-4, 0.25)], "it gets slower: overshoot"),
            ([(-6e-4, 0.21), (-5e-4, 0.3), (-4e-4, 0.4)], "behind: it catches up"),
        ] {
            assert!(!runs_away(steps), "{why}");
        }
    }
}
