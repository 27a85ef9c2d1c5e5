//! The messages of every cycle: command and state.

use masseter_shared::geometry::{AXES, Actuators, Joints};
use masseter_shared::messages::{Command, State, pose_fields};

use super::{Estimate, MotionController};
use crate::kinematics::Solution;
use crate::sequence::request;

impl MotionController {
    /// This cycle's command. Before the first reading the targets are zero and the request is `Off`, so that no drive
    /// follows them.
    pub(super) fn command(&self) -> Command {
        Command {
            cycle: self.last_cycle,
            reading_cycle: self.estimate.map_or(0, |estimate| estimate.reading_cycle),
            target_m: self.target.map_or([0.0; AXES], Actuators::to_axes),
            request: request(self.state).code(),
            controller_state: self.state.code(),
            ..Command::default()
        }
    }

    /// Conditioning at a solution. Only reported, so it is computed after the command has gone out.
    fn condition(&self, measured: &Actuators, solution: &Solution) -> f64 {
        let joints = Joints { actuators: *measured, theta_rad: solution.theta_rad };
        self.mechanism.condition(&solution.pose, &joints)
    }

    /// What this cycle made of the reading, without time stamps.
    pub(super) fn state_message(&self) -> State {
        let mut state = State {
            cycle: self.last_cycle,
            motion_time_s: self.playback.motion_time_ahead_s(-self.sample_age_s()),
            controller_state: self.state.code(),
            ..Default::default()
        };
        if let Some(desired) = &self.desired {
            (state.desired_position_m, state.desired_quaternion_wxyz) = pose_fields(desired);
        }
        if let Some(estimate) = &self.estimate {
            let Estimate { reading_cycle, sampled_ns, measured, solution } = estimate;
            (state.reading_cycle, state.sampled_ns) = (*reading_cycle, *sampled_ns);
            (state.estimated_position_m, state.estimated_quaternion_wxyz) = pose_fields(&solution.pose);
            state.leg_angle_rad = solution.theta_rad;
            (state.residual_m, state.iterations) = (solution.residual_m, solution.iterations);
            state.condition = self.condition(measured, solution);
        }
        state
    }
}
