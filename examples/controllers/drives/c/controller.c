/* A controller of the drives: it follows the scenario's motion by inverse kinematics. */
#include <masseter.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#define S(name) MASSETER_CONTROLLER_STATE_##name
#define R(name) MASSETER_DRIVE_REQUEST_##name
#define D(name) (1u << MASSETER_DRIVE_STATE_##name)
#define ALL_AXES 0x3fu  /* of reading.fresh_axes */
#define SAFE_STOP_S 0.3 /* for the drives to brake */

typedef struct follower {
    masseter_session *session;
    masseter_times times;
    masseter_reading reading;
    masseter_motion desired;
    masseter_pose estimated, start; /* now, and before the way to the motion */
    uint32_t state;
    double time_s, speed, silent_s, target_m[6]; /* the time in the state passes slower at a stop */
} follower;

static bool all_drives(const follower *f, uint32_t states) {
    bool all = true;
    for (int axis = 0; axis < 6; axis++)
        all = all && (states >> f->reading.drive_state[axis] & 1u);
    return all;
}

static uint32_t next_state(const follower *f, bool is_complete, bool is_stopping) {
    const bool is_enabled = all_drives(f, D(OPERATION_ENABLED)), is_moving = f->state >= S(EASING) && f->state <= S(HOLDING);
    const bool is_free = all_drives(f, D(SWITCH_ON_DISABLED) | D(READY_TO_SWITCH_ON) | D(FAULT));
    const bool is_over[] = {is_complete, is_enabled, f->time_s >= f->times.ease_s, f->time_s >= f->times.duration_s,
                            f->time_s >= f->times.hold_s, is_free, false, false};
    if (f->state < S(FINISHED) && (f->reading.master_fault || f->silent_s > f->times.silence_s || (is_moving && !is_enabled)))
        return S(SAFE_STOP);
    if (is_stopping && f->state < S(EASING))
        return S(DISABLING);
    return f->speed == 0.0 ? S(HOLDING) : f->state + is_over[f->state];
}

static int motion_at(follower *f, double time_s, masseter_motion *motion) {
    return f->state == S(RUNNING) ? masseter_motion_at(f->session, time_s, motion)
                                  : masseter_easing_at(f->session, &f->start, f->state == S(EASING) ? time_s : 0.0, motion);
}

static bool step(follower *f, uint64_t cycle, bool is_complete) {
    const bool is_stopping = masseter_is_stop_requested(f->session);
    const uint32_t before = f->state;
    f->silent_s = is_complete || before == S(WAIT_READINGS) ? 0.0 : f->silent_s + f->times.period_s;
    if (is_stopping && (before == S(EASING) || before == S(RUNNING)))
        f->speed = fmax(f->speed - f->times.period_s / f->times.stop_ramp_s, 0.0);
    f->time_s += f->speed * f->times.period_s;
    bool fails = is_complete && masseter_forward_kinematics(f->session, f->reading.position_m, &f->estimated);
    f->start = before == S(WAIT_READINGS) ? f->estimated : f->start;
    f->state = next_state(f, is_complete, is_stopping);
    if (f->state != before)
        f->time_s = 0.0, f->speed = 1.0;
    masseter_motion ahead;
    if (f->state >= S(ENABLING) && f->state <= S(RUNNING))
        fails = fails || motion_at(f, f->time_s, &f->desired) || motion_at(f, f->time_s + f->speed * f->times.lead_s, &ahead) ||
                masseter_inverse_kinematics(f->session, &ahead.pose, f->target_m);
    const bool is_on = f->state >= S(ENABLING) && f->state <= S(HOLDING);
    masseter_command command = {.cycle = cycle, .reading_cycle = f->reading.cycle, .controller_state = f->state};
    masseter_state state = {.cycle = cycle, .reading_cycle = f->reading.cycle, .controller_state = f->state};
    command.request = f->state == S(SAFE_STOP) ? R(QUICK_STOP) : is_on ? R(ENABLE) : R(OFF);
    memcpy(command.target_m, f->target_m, sizeof f->target_m);
    state.motion_time_s = f->desired.motion_time_s;
    memcpy(state.desired_position_m, &f->desired.pose, sizeof(masseter_pose)); /* and the quaternion */
    memcpy(state.estimated_position_m, &f->estimated, sizeof(masseter_pose));
    return fails || masseter_publish(f->session, &command, &state);
}

int main(void) {
    follower f = {.speed = 1.0};
    masseter_cycle cycle;
    masseter_reading reading;
    bool works = !masseter_attach(NULL, &f.session) && !masseter_times_of(f.session, &f.times) &&
                 !masseter_motion_at(f.session, 0.0, &f.desired) && !masseter_start(f.session);
    f.estimated = f.start = f.desired.pose;
    while (works && f.state != S(FINISHED) && (f.state != S(SAFE_STOP) || f.time_s < SAFE_STOP_S)) {
        works = !masseter_wait(f.session, -1, &cycle, &reading);
        f.reading = works && cycle.has_reading ? reading : f.reading;
        works = works && !step(&f, cycle.cycle, cycle.has_reading && reading.fresh_axes == ALL_AXES);
    }
    if (works && !masseter_finish(f.session, f.state == S(SAFE_STOP)))
        return 0;
    return fprintf(stderr, "my_controller: %s\n", masseter_error()), 1; /* the rig stops the drives */
}
