//! How carefully an axis is moved, and who may stop it.

use masseter_scenario::Scenario;

/// What the person at the machine wants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wish {
    /// To go on.
    Move,
    /// To halt for the moment.
    Halt,
    /// To end.
    Stop,
}

/// Asked at every look, with the line's time, ns.
pub type Operator<'a> = dyn FnMut(u64) -> Wish + 'a;

/// How carefully an axis is moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Caution {
    /// Speed (6081h), m/s.
    pub speed_m_s: f64,
    /// Acceleration and deceleration (6083h, 6084h), m/s².
    pub acceleration_m_s2: f64,
    /// Force limit (6072h), N.
    pub force_n: f64,
    /// Motion of an axis that shall stand, m.
    pub still_m: f64,
}

impl Caution {
    /// Share of the velocity and of the acceleration limit that is used by default.
    const SPEED: f64 = 0.05;
    /// Share of the force limit.
    const FORCE: f64 = 0.2;
    /// Motion of an axis that shall stand, m.
    const STILL_M: f64 = 1e-4;

    /// The usual caution for an axis: 5 % of its velocity, 20 % of its force.
    pub fn usual(scenario: &Scenario, axis: usize) -> Self {
        let drive = scenario.drives.of_axis(axis);
        Self {
            speed_m_s: Self::SPEED * drive.max_velocity_m_s,
            acceleration_m_s2: Self::SPEED * drive.quick_stop_deceleration_m_s2,
            force_n: Self::FORCE * drive.max_force_n,
            still_m: Self::STILL_M,
        }
    }
}
