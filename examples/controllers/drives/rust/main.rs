//! A controller of the drives: it follows the scenario's motion by inverse kinematics.

use masseter_controller::robot_model::{MotionPoint, RobotModel, RobotModelError};
use masseter_model::geometry::Pose;
use masseter_runtime::control::{Outcome, Session, Waited};
use masseter_runtime::lifecycle::attach::attach;
use masseter_runtime::messages::codes::{ControllerState as S, DriveRequest as R, DriveState as D};
use masseter_runtime::messages::{Command, Reading, State, pose_fields};

const ALL_AXES: u32 = 0x3f; // of Reading::fresh_axes
const SAFE_STOP_S: f64 = 0.3; // for the drives to brake

struct Follower {
    robot: RobotModel,
    reading: Reading,
    desired: MotionPoint,
    estimated: Pose,
    start: Pose, // before the way to the motion
    state: S,
    time_s: f64, // the time in the state passes slower at a stop
    speed: f64,
    silent_s: f64,
    target_m: [f64; 6],
}

impl Follower {
    fn next_state(&self, is_complete: bool, is_stopping: bool) -> S {
        let (times, after) = (self.robot.times(), |time_s: f64| self.time_s >= time_s);
        let all_drives = |states: &[D]| self.reading.drive_state.iter().all(|drive| states.iter().any(|s| s.code() == *drive));
        let is_enabled = all_drives(&[D::OperationEnabled]);
        let is_free = all_drives(&[D::SwitchOnDisabled, D::ReadyToSwitchOn, D::Fault]);
        let [ease, run, hold] = [times.ease_s, times.duration_s, times.hold_s].map(after);
        let is_over = [is_complete, is_enabled, ease, run, hold, is_free][self.state.code().min(5) as usize];
        let is_moving = matches!(self.state, S::Easing | S::Running | S::Holding);
        let is_lost = self.silent_s > times.silence_s || (is_moving && !is_enabled);
        match self.state {
            S::Finished | S::SafeStop => self.state,
            _ if self.reading.master_fault != 0 || is_lost => S::SafeStop,
            S::WaitReadings | S::Enabling if is_stopping => S::Disabling,
            _ if self.speed == 0.0 => S::Holding,
            state => S::ALL[state.code() as usize + usize::from(is_over)],
        }
    }

    fn step(&mut self, cycle: u64, reading: Option<Reading>, is_stopping: bool) -> Result<(Command, State), RobotModelError> {
        let (times, before) = (*self.robot.times(), self.state);
        let is_complete = reading.is_some_and(|reading| reading.fresh_axes == ALL_AXES);
        self.reading = reading.unwrap_or(self.reading);
        self.silent_s = if is_complete || before == S::WaitReadings { 0.0 } else { self.silent_s + times.period_s };
        let is_braking = is_stopping && matches!(before, S::Easing | S::Running);
        self.speed = if is_braking { (self.speed - times.period_s / times.stop_ramp_s).max(0.0) } else { self.speed };
        self.time_s += self.speed * times.period_s;
        self.estimated = if is_complete { self.robot.forward(self.reading.position_m)? } else { self.estimated };
        self.start = if before == S::WaitReadings { self.estimated } else { self.start };
        self.state = self.next_state(is_complete, is_stopping);
        (self.time_s, self.speed) = if self.state == before { (self.time_s, self.speed) } else { (0.0, 1.0) };
        let eased = |time_s| self.robot.easing(&self.start, if self.state == S::Easing { time_s } else { 0.0 });
        let motion = |time_s| if self.state == S::Running { self.robot.motion(time_s) } else { eased(time_s) };
        if matches!(self.state, S::Enabling | S::Easing | S::Running) {
            self.target_m = self.robot.inverse(&motion(self.time_s + self.speed * times.lead_s)?.pose)?;
            self.desired = motion(self.time_s)?;
        }
        let on = if matches!(self.state, S::Enabling | S::Easing | S::Running | S::Holding) { R::Enable } else { R::Off };
        let request = if self.state == S::SafeStop { R::QuickStop } else { on }.code();
        let (reading_cycle, controller_state, target_m) = (self.reading.cycle, self.state.code(), self.target_m);
        let command = Command { cycle, reading_cycle, target_m, request, controller_state, ..Command::default() };
        let mut state = State { cycle, reading_cycle, controller_state, ..State::default() };
        state.motion_time_s = self.desired.motion_time_s;
        (state.desired_position_m, state.desired_quaternion_wxyz) = pose_fields(&self.desired.pose);
        (state.estimated_position_m, state.estimated_quaternion_wxyz) = pose_fields(&self.estimated);
        Ok((command, state))
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let context = attach(None)?;
    let robot = RobotModel::new(&context.scenario)?;
    let desired = robot.motion(0.0)?;
    let (start, reading, state, time_s, speed) = (desired.pose, Reading::default(), S::WaitReadings, 0.0, 1.0);
    let (estimated, silent_s, target_m) = (start, 0.0, [0.0; 6]);
    let mut follower = Follower { robot, reading, desired, estimated, start, state, time_s, speed, silent_s, target_m };
    let mut session = Session::start(context, Default::default())?;
    while follower.state != S::Finished && (follower.state != S::SafeStop || follower.time_s < SAFE_STOP_S) {
        let Waited::Cycle { tick, reading } = session.wait(None)? else { continue };
        let (command, state) = follower.step(tick.cycle, reading, session.is_stop_requested())?;
        session.publish(&command, &state)?;
    }
    let outcome = if follower.state == S::Finished { Outcome::Finished } else { Outcome::SafeStop };
    Ok(session.finish(outcome)?)
}
