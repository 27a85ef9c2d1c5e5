// A controller of the drives: it follows the scenario's motion by inverse kinematics.
#include <algorithm>
#include <cstring>
#include <iostream>
#include <masseter.hpp>

#define S(name) MASSETER_CONTROLLER_STATE_##name
#define R(name) MASSETER_DRIVE_REQUEST_##name
#define D(name) (1u << MASSETER_DRIVE_STATE_##name)
constexpr std::uint32_t all_axes = 0x3f; // of reading.fresh_axes
constexpr double safe_stop_s = 0.3;      // for the drives to brake

struct Follower {
    masseter::Session &session;
    masseter_times times = session.times();
    masseter_reading reading{};
    masseter_motion desired = session.motion(0.0);
    masseter_pose estimated = desired.pose, start = estimated; // now, and before the way to the motion
    std::uint32_t state = S(WAIT_READINGS);
    double time_s = 0.0, speed = 1.0, silent_s = 0.0; // the time in the state passes slower at a stop
    masseter::Six target_m{};

    bool all_drives(std::uint32_t states) const {
        return std::all_of(std::begin(reading.drive_state), std::end(reading.drive_state),
                           [=](std::uint32_t drive) { return states >> drive & 1u; });
    }

    std::uint32_t next_state(bool is_complete, bool is_stopping) const {
        const bool is_enabled = all_drives(D(OPERATION_ENABLED)), is_moving = state >= S(EASING) && state <= S(HOLDING);
        const bool is_free = all_drives(D(SWITCH_ON_DISABLED) | D(READY_TO_SWITCH_ON) | D(FAULT));
        const bool is_over[] = {is_complete, is_enabled, time_s >= times.ease_s, time_s >= times.duration_s,
                                time_s >= times.hold_s, is_free, false, false};
        if (state < S(FINISHED) && (reading.master_fault || silent_s > times.silence_s || (is_moving && !is_enabled)))
            return S(SAFE_STOP);
        if (is_stopping && state < S(EASING))
            return S(DISABLING);
        return speed == 0.0 ? std::uint32_t{S(HOLDING)} : state + is_over[state];
    }

    masseter_motion motion(double at_s) const {
        return state == S(RUNNING) ? session.motion(at_s) : session.easing(start, state == S(EASING) ? at_s : 0.0);
    }

    void step(const masseter::Cycle &cycle) {
        const bool is_complete = cycle.reading && cycle.reading->fresh_axes == all_axes;
        const bool is_stopping = session.is_stop_requested();
        const std::uint32_t before = state;
        reading = cycle.reading.value_or(reading);
        silent_s = is_complete || before == S(WAIT_READINGS) ? 0.0 : silent_s + times.period_s;
        if (is_stopping && (before == S(EASING) || before == S(RUNNING)))
            speed = std::max(speed - times.period_s / times.stop_ramp_s, 0.0);
        time_s += speed * times.period_s;
        if (is_complete)
            estimated = session.forward_kinematics(reading.position_m);
        start = before == S(WAIT_READINGS) ? estimated : start;
        state = next_state(is_complete, is_stopping);
        if (state != before)
            time_s = 0.0, speed = 1.0;
        if (state >= S(ENABLING) && state <= S(RUNNING)) {
            desired = motion(time_s);
            target_m = session.inverse_kinematics(motion(time_s + speed * times.lead_s).pose);
        }
        masseter_command command{};
        masseter_state report{};
        command.cycle = report.cycle = cycle.number;
        command.reading_cycle = report.reading_cycle = reading.cycle;
        command.controller_state = report.controller_state = state;
        const bool is_on = state >= S(ENABLING) && state <= S(HOLDING);
        command.request = state == S(SAFE_STOP) ? R(QUICK_STOP) : is_on ? R(ENABLE) : R(OFF);
        std::copy(target_m.begin(), target_m.end(), command.target_m);
        report.motion_time_s = desired.motion_time_s;
        std::memcpy(report.desired_position_m, &desired.pose, sizeof(masseter_pose)); // and the quaternion
        std::memcpy(report.estimated_position_m, &estimated, sizeof(masseter_pose));
        session.publish(command, report);
    }
};

int main() {
    try {
        masseter::Session session;
        Follower follower{session};
        for (session.start(); follower.state != S(FINISHED) && (follower.state != S(SAFE_STOP) || follower.time_s < safe_stop_s);)
            follower.step(*session.wait());
        session.finish(follower.state == S(SAFE_STOP) ? masseter::Outcome::safe_stop : masseter::Outcome::finished);
        return 0;
    } catch (const std::exception &error) {
        std::cerr << "my_controller: " << error.what() << '\n';
        return 1;
    }
}
