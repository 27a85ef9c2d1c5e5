//! The cyclic modes: targets of position and torque that take effect at SYNC, within the limits.

use super::axis::Axis;
use super::clamped::clamped_both_ways;
use super::demand::Approach;
use super::dictionary::{Objects, names};
use super::mode::Mode;
use super::parameters::Parameters;
use super::servo::ServoLimits;

/// Which cyclic targets are new at a SYNC.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct NewTargets {
    pub(super) position: bool,
    pub(super) torque: bool,
}

impl Axis {
    /// The cyclic modes: the targets that were buffered take effect, and one that the velocity limit put off is
    /// approached further.
    pub(super) fn synchronise(&mut self, now_ns: u64, new: NewTargets, objects: &Objects) {
        if !self.is_enabled() {
            return;
        }
        match self.mode {
            Mode::CyclicPosition if new.position || self.is_cut && self.demand.is_interpolated() => {
                self.head_for(now_ns, objects.get(names::TARGET_POSITION));
            }
            Mode::CyclicTorque if new.torque => self.push(objects.get(names::TARGET_TORQUE)),
            _ => {}
        }
    }

    /// Follows a target within the software position limit and the velocity limit.
    fn head_for(&mut self, now_ns: u64, target_increments: i32) {
        let within = self.within_limits(now_ns, target_increments);
        let Parameters { velocity_limit_m_s: limit_m_s, period_s, .. } = self.parameters;
        let approach = Approach { target_m: self.metres(within), period_s, limit_m_s };
        let is_too_fast = self.demand.head_for(now_ns, self.measured_m(), approach);
        self.is_cut = is_too_fast || within != target_increments;
    }

    fn push(&mut self, torque_permille: i16) {
        let asked_n = f64::from(torque_permille) / 1000.0 * self.drive.rated_force_n;
        let (force_n, is_cut) = clamped_both_ways(asked_n, self.parameters.force_limit_n);
        self.is_cut = is_cut;
        self.demand.push(force_n);
    }

    /// Under a force the axis may be no faster than it could still stop before the software limits, at the
    /// profile deceleration (6084).
    pub(super) fn servo_limits(&self) -> ServoLimits {
        let Parameters { velocity_limit_m_s, force_limit_n, position_limits, profile, .. } = self.parameters;
        let mut free_velocity_m_s = [-velocity_limit_m_s, velocity_limit_m_s];
        if self.mode == Mode::CyclicTorque {
            let [lowest_m, highest_m] = position_limits.map(|end| self.metres(end));
            let at_m = self.measured_m();
            let braking_m_s = |way_m: f64| (2.0 * profile.deceleration_m_s2 * way_m.max(0.0)).sqrt();
            free_velocity_m_s = [
                -braking_m_s(at_m - lowest_m).min(velocity_limit_m_s),
                braking_m_s(highest_m - at_m).min(velocity_limit_m_s),
            ];
        }
        ServoLimits { force_n: force_limit_n, velocity_m_s: velocity_limit_m_s, free_velocity_m_s }
    }
}
