#!@FOLDER@/.venv/bin/python
"""A controller of the drives: it follows the scenario's motion by inverse kinematics."""

import masseter
from masseter.messages import Command, ControllerState, DriveRequest, DriveState, Reading, State

S = ControllerState
MOVING = {S.EASING, S.RUNNING, S.HOLDING}
FREE = {DriveState.SWITCH_ON_DISABLED, DriveState.READY_TO_SWITCH_ON, DriveState.FAULT}
ALL_AXES = 0x3F  # of Reading.fresh_axes
SAFE_STOP_S = 0.3  # for the drives to brake


class Follower:
    def __init__(self, session: masseter.Session) -> None:
        self.session, self.robot, self.times = session, session.robot, session.robot.times
        self.reading, self.state, self.target_m = Reading(), S.WAIT_READINGS, [0.0] * 6
        self.desired = self.robot.motion(0.0)
        self.estimated = self.start = self.desired.pose  # now, and before the way to the motion
        self.time_s, self.speed, self.silent_s = 0.0, 1.0, 0.0  # the time in the state passes slower at a stop

    def next_state(self, is_complete: bool, is_stopping: bool) -> ControllerState:
        drives, times = set(self.reading.drive_state), self.times
        is_enabled = drives == {DriveState.OPERATION_ENABLED}
        is_over = {
            S.WAIT_READINGS: is_complete,
            S.ENABLING: is_enabled,
            S.EASING: self.time_s >= times.ease_s,
            S.RUNNING: self.time_s >= times.duration_s,
            S.HOLDING: self.time_s >= times.hold_s,
            S.DISABLING: drives <= FREE,
        }
        is_failing = self.reading.master_fault or self.silent_s > times.silence_s
        if self.state in is_over and (is_failing or (self.state in MOVING and not is_enabled)):
            return S.SAFE_STOP
        if is_stopping and self.state in (S.WAIT_READINGS, S.ENABLING):
            return S.DISABLING
        if self.speed == 0.0:
            return S.HOLDING
        return S(self.state + 1) if is_over.get(self.state, False) else self.state

    def motion(self, time_s: float) -> masseter.Motion:
        if self.state == S.RUNNING:
            return self.robot.motion(time_s)
        return self.robot.easing(self.start, time_s if self.state == S.EASING else 0.0)

    def step(self, cycle: masseter.Cycle) -> None:
        is_complete = cycle.reading is not None and cycle.reading.fresh_axes == ALL_AXES
        before, is_stopping, period_s = self.state, self.session.is_stop_requested, self.times.period_s
        self.reading = cycle.reading or self.reading
        self.silent_s = 0.0 if is_complete or before == S.WAIT_READINGS else self.silent_s + period_s
        if is_stopping and before in (S.EASING, S.RUNNING):
            self.speed = max(self.speed - period_s / self.times.stop_ramp_s, 0.0)
        self.time_s += self.speed * period_s
        if is_complete:
            self.estimated = self.robot.forward_kinematics(self.reading.position_m)
        self.start = self.estimated if before == S.WAIT_READINGS else self.start
        self.state = self.next_state(is_complete, is_stopping)
        if self.state != before:
            self.time_s, self.speed = 0.0, 1.0
        if self.state in (S.ENABLING, S.EASING, S.RUNNING):
            self.desired = self.motion(self.time_s)
            ahead = self.motion(self.time_s + self.speed * self.times.lead_s)
            self.target_m = self.robot.inverse_kinematics(ahead.pose)
        self.publish(cycle.number)

    def publish(self, cycle: int) -> None:
        request = DriveRequest.ENABLE if self.state in MOVING | {S.ENABLING} else DriveRequest.OFF
        request = DriveRequest.QUICK_STOP if self.state == S.SAFE_STOP else request
        both = {"cycle": cycle, "reading_cycle": self.reading.cycle, "controller_state": self.state}
        command, state = Command(request=request, **both), State(motion_time_s=self.desired.motion_time_s, **both)
        command.target_m[:] = self.target_m
        state.desired_position_m[:] = self.desired.pose.position_m
        state.desired_quaternion_wxyz[:] = self.desired.pose.quaternion_wxyz
        state.estimated_position_m[:] = self.estimated.position_m
        state.estimated_quaternion_wxyz[:] = self.estimated.quaternion_wxyz
        self.session.publish(command, state)


if __name__ == "__main__":
    with masseter.Session() as session:
        follower = Follower(session)
        while follower.state != S.FINISHED and (follower.state != S.SAFE_STOP or follower.time_s < SAFE_STOP_S):
            follower.step(session.wait())
        session.finish(is_safe_stop=follower.state == S.SAFE_STOP)
