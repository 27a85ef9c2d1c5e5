//! From a law's requested pose to targets of the six axes within their limits.

use masseter_model::geometry::{AXES, Actuators, Conditioning, Jacobian, Joints, Mechanism, Pose};

use crate::safety::{self, Fault};
use crate::sequencer::{Estimate, Sequencer};

/// Cycles between two condition numbers, which change slowly and take a microsecond each.
const CYCLES_OF_A_CONDITION: u64 = 10;

/// The targets of the axes with their limits.
#[derive(Debug, Clone)]
pub(crate) struct Targets {
    pub(crate) mechanism: Mechanism,
    pub(crate) velocity_limit_m_s: [f64; AXES],
    /// The largest way of an axis by the trim.
    trim_reach_m: f64,
    /// The last requested pose of the law.
    asked: Option<Pose>,
    /// The last targets; none before the drives are enabled.
    pub(crate) actuators: Option<Actuators>,
    condition: f64,
    next_condition_cycle: u64,
}

impl Targets {
    pub(crate) fn new(scenario: &masseter_scenario::Scenario, mechanism: Mechanism) -> Self {
        let config = &scenario.controller;
        Self {
            velocity_limit_m_s: std::array::from_fn(|axis| scenario.drives.of_axis(axis).max_velocity_m_s),
            trim_reach_m: config.trim_limit_m + config.trim_limit_rad * mechanism.platform_arm_m(),
            mechanism,
            asked: None,
            actuators: None,
            condition: 0.0,
            next_condition_cycle: 0,
        }
    }

    /// Sets the targets for the requested pose, reached within a period (s).
    pub(crate) fn ask_for(&mut self, asked: &Pose, period_s: f64) -> Result<(), Fault> {
        safety::check_asked(asked)?;
        self.asked = Some(*asked);
        let joints = self.mechanism.inverse(asked)?;
        // A motion that uses its strokes to the end leaves no room for the trim.
        let before = self.actuators.unwrap_or(joints.actuators);
        let target = self.mechanism.strokes().clamp(&joints.actuators, &before, self.trim_reach_m)?;
        safety::check_velocity(&target, &before, &self.velocity_limit_m_s, period_s)?;
        self.actuators = Some(target);
        Ok(())
    }

    /// The condition number at the present pose: computed every ten cycles, held in between.
    pub(crate) fn condition(&mut self, sequencer: &Sequencer, estimate: &Estimate) -> f64 {
        if sequencer.cycle >= self.next_condition_cycle {
            let joints = Joints { actuators: estimate.measured, theta_rad: estimate.solution.theta_rad };
            let jacobian = Jacobian::new(&self.mechanism, &estimate.solution.pose, &joints);
            self.condition = Conditioning::new(&jacobian).number();
            self.next_condition_cycle = sequencer.cycle + CYCLES_OF_A_CONDITION;
        }
        self.condition
    }

    /// Brings the code and data of a cycle into the caches, and changes nothing.
    pub(crate) fn warm_up(&self, sequencer: &Sequencer) {
        if let Some(estimate) = &sequencer.estimate {
            let solution = sequencer.tracker.clone().update(&estimate.measured);
            let joints = self.mechanism.inverse(&self.asked.unwrap_or(estimate.solution.pose));
            let _ = std::hint::black_box((solution, joints));
        }
    }
}
