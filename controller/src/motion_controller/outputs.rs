//! The messages of the controller: command, state, and the events of its sequence.

use masseter_shared::geometry::{AXES, Actuators, Joints};
use masseter_shared::messages::codes::{Cause, ControllerState, DriveRequest, EventKind, Source};
use masseter_shared::messages::{Command, Event, State, pose_fields};

use masseter_shared::control::Tick;

use super::{Estimate, MotionController};
use crate::kinematics::Solution;
use crate::safety::Fault;
use crate::sequence::Trigger;

impl MotionController {
    /// The event of a change of state.
    pub(super) fn event(
        &self,
        from: ControllerState,
        trigger: Trigger,
        fault: Option<Fault>,
        tick: Tick,
    ) -> Event {
        let mut event = Event {
            time_ns: tick.now_ns,
            cycle: tick.cycle,
            from: from.code(),
            to: self.state.code(),
            ..Event::new(Source::Controller, EventKind::Transition, Cause::Sequence)
        };
        if trigger == Trigger::StopRequested {
            event.cause = Cause::StopRequested.code();
        }
        if let Some(fault) = fault {
            event.kind = EventKind::Fault.code();
            fault.explain(&mut event);
        }
        event
    }

    /// What to ask of the drives in the present state.
    fn request(&self) -> DriveRequest {
        match self.state {
            ControllerState::Enabling
            | ControllerState::Easing
            | ControllerState::Running
            | ControllerState::Holding => DriveRequest::Enable,
            ControllerState::SafeStop => DriveRequest::QuickStop,
            ControllerState::WaitReadings | ControllerState::Disabling | ControllerState::Finished => {
                DriveRequest::Off
            }
        }
    }

    /// This cycle's command. Before the first reading the targets are zero and the request is `Off`, so that no drive
    /// follows them.
    pub(super) fn command(&self) -> Command {
        Command {
            cycle: self.last_cycle,
            reading_cycle: self.estimate.map_or(0, |estimate| estimate.reading_cycle),
            target_m: self.target.map_or([0.0; AXES], Actuators::to_axes),
            request: self.request().code(),
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
        if let Some(wanted) = &self.wanted {
            (state.desired_position_m, state.desired_quaternion_wxyz) = pose_fields(wanted);
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
