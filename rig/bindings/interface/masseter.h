/* A controller in C for a Masseter rig. Link with libmasseter_c (cargo build --release -p masseter-c).
 *
 * Two ways. A pose controller gives a law: the rig's own controller does sequence, kinematics and every check, and asks the
 * law for a pose in each cycle.
 *
 *     masseter_session *session;
 *     if (masseter_attach(NULL, &session) || masseter_run(session, my_law, &my_data) < 0)
 *         fprintf(stderr, "%s\n", masseter_error());
 *
 * A controller of the drives does everything itself: masseter_attach, masseter_start, then in each cycle masseter_wait and
 * masseter_publish, at last masseter_finish or masseter_fail.
 *
 * Functions return a masseter_result, or what their comment says. A session belongs to the thread that attached. No function
 * changes signal handlers. Units and frames are those of masseter_messages.h. docs/interface.md has life cycle and timing. */
#ifndef MASSETER_H
#define MASSETER_H

#include "masseter_messages.h"

#ifdef __cplusplus
extern "C" {
#endif

enum masseter_result {
    /* masseter_error has the message. */
    MASSETER_ERROR = -1,
    MASSETER_OK = 0,
    /* masseter_wait: no cycle has begun within the time. */
    MASSETER_TIMED_OUT = 1,
    /* masseter_run: a fault ended the motion; the rig's verdict has the cause. */
    MASSETER_SAFE_STOP = 2,
};

typedef struct masseter_session masseter_session;

/* A cycle that has begun. */
typedef struct masseter_cycle {
    /* From 1; skipped cycles leave a gap. */
    uint64_t cycle;
    /* When the reading was received, ns; simulated time in lockstep. */
    uint64_t now_ns;
    /* 0 where no new reading came in time. */
    uint32_t has_reading;
    uint32_t unused;
} masseter_cycle;

/* A pose of the platform. */
typedef struct masseter_pose {
    /* In the base frame, m. */
    double position_m[3];
    /* Unit quaternion. */
    double quaternion_wxyz[4];
} masseter_pose;

/* What a pose law needs of a cycle. */
typedef struct masseter_demand {
    /* From 1; skipped cycles leave a gap. */
    uint64_t cycle;
    /* Time from one cycle to the next, s. */
    double period_s;
    /* How far the motion has come at the sample, s; negative before it begins. */
    double motion_time_s;
    /* MASSETER_CONTROLLER_STATE_EASING, _RUNNING or _HOLDING. */
    uint32_t controller_state;
    /* 0 in a cycle without a fresh, complete reading. */
    uint32_t has_estimate;
    /* The desired pose at the sample. */
    masseter_pose desired;
    /* The pose at the sample by forward kinematics; zeros without an estimate. */
    masseter_pose estimated;
    /* The desired pose when this cycle's command is reached. */
    masseter_pose ahead;
    /* The declared parameters, by their places. */
    const double *parameters;
    /* The declared signals, by their places; the law writes them. */
    double *signals;
    /* The desired twist at the sample, the mean of the period around it: m/s, then rad/s, base axes. */
    double desired_twist[6];
    /* Measured positions d1 d2 d3 l1 l2 l3, m; zeros without an estimate. */
    double position_m[6];
    /* Forces of the drives since the sample before, N; zeros without an estimate. */
    double force_n[6];
    /* 0 where the scenario has no load cell. */
    uint32_t has_load_cell;
    /* 0 where the scenario has no force estimated, and before the first estimate. */
    uint32_t has_external;
    /* Bite force that the load cell showed last, N; 0 without one. */
    double load_cell_n;
    /* Estimated wrench on the platform: N, then N m about its origin, base axes; zeros without an estimate. */
    double external_wrench[6];
    /* Uncertainty of the bite force in it, two standard deviations, N. */
    double external_uncertainty_n;
} masseter_demand;

/* The times of the scenario that a controller of the drives keeps to. */
typedef struct masseter_times {
    /* From one cycle to the next, s. */
    double period_s;
    /* From a sample until the drives reach the targets that answer it, s. */
    double lead_s;
    /* Of the way to the first pose, s. */
    double ease_s;
    /* Of the motion, s. */
    double duration_s;
    /* From full speed to rest, at a stop, s. */
    double stop_ramp_s;
    /* At rest after the motion, s. */
    double hold_s;
    /* Longest time without a complete reading, s. */
    double silence_s;
} masseter_times;

/* The scenario's motion, or the way to it, at a time. Twist and acceleration are differences over a period on either side. */
typedef struct masseter_motion {
    masseter_pose pose;
    /* Of the platform's origin, m/s, then angular, rad/s; base axes. */
    double twist[6];
    /* The same, m/s^2 and rad/s^2. */
    double acceleration[6];
    /* How far the motion has come, s: for state.motion_time_s. Negative on the way to it. */
    double motion_time_s;
} masseter_motion;

static_assert(sizeof(masseter_cycle) == 24, "size of masseter_cycle");
static_assert(sizeof(masseter_pose) == 56, "size of masseter_pose");
static_assert(sizeof(masseter_demand) == 432, "size of masseter_demand");
static_assert(sizeof(masseter_times) == 56, "size of masseter_times");
static_assert(sizeof(masseter_motion) == 160, "size of masseter_motion");
static_assert(offsetof(masseter_demand, desired) == 32, "offset of desired");
static_assert(offsetof(masseter_demand, ahead) == 144, "offset of ahead");
static_assert(offsetof(masseter_demand, load_cell_n) == 368, "offset of load_cell_n");

/* Writes the pose to ask for, which holds `ahead` before the call. Another result than 0 leads to a safe stop. In real time
 * it must not block. */
typedef int (*masseter_law)(const masseter_demand *demand, masseter_pose *pose, void *user);

/* The message of the last error in this thread; it lasts until the next error. Never null. */
const char *masseter_error(void);

/* Attaches to the rig of this name; null: to that of MASSETER_RIG, which the rig sets for what it starts, or to the only rig
 * that takes a controller. */
int masseter_attach(const char *rig, masseter_session **session);

/* Time from one cycle to the next, ns; 0 without a session. */
uint64_t masseter_period_ns(const masseter_session *session);

/* Declares a number that the controller publishes in each cycle, before masseter_start or masseter_run: up to 64, with a name
 * in lower case, a unit and a description (null for none). Recorded, drawn in the report. Returns its place, from 0, or
 * MASSETER_ERROR. */
int masseter_declare_signal(masseter_session *session, const char *name, const char *unit, const char *about);

/* Declares a number that the user sets, also while the controller runs, between least and most. The scenario may give another
 * value at the start. Returns its place, from 0, or MASSETER_ERROR. */
int masseter_declare_parameter(masseter_session *session, const char *name, const char *unit, const char *about,
                               double value, double least, double most);

/* Declares, before masseter_start, that the controller plays a motion of its own, not the scenario's: the jaw is then
 * judged by the desired poses of the state, and a requirement of the scenario must judge the true jaw. Returns MASSETER_OK or
 * MASSETER_ERROR. */
int masseter_declare_own_motion(masseter_session *session);

/* The value of a parameter in this cycle, by its place. Not a number before the start, and for another place. */
double masseter_parameter(const masseter_session *session, int parameter);

/* Gives a signal its value, which goes out with this cycle's command and stays until it is given another. */
int masseter_set_signal(masseter_session *session, int signal, double value);

/* The scenario and its robot, from masseter_attach to the end. These functions are mathematics: they wait for nothing, and a
 * cycle may call them as often as it likes. The first call before masseter_start takes some milliseconds. An output must not
 * overlap an input. */

/* The whole scenario as TOML, every default filled in; null with an error. It lasts as long as the session. */
const char *masseter_scenario(masseter_session *session);

/* The times of the scenario. */
int masseter_times_of(masseter_session *session, masseter_times *times);

/* The scenario's motion at a time after its beginning, s; at rest before 0 and after its duration. */
int masseter_motion_at(masseter_session *session, double time_s, masseter_motion *motion);

/* The way from a pose to the first pose of the motion at a time after its beginning, s: from rest to rest within ease_s. */
int masseter_easing_at(masseter_session *session, const masseter_pose *from, double time_s, masseter_motion *motion);

/* The pose of positions d1 d2 d3 l1 l2 l3, m. The pose before saves time, and settles an ambiguous input. */
int masseter_forward_kinematics(masseter_session *session, const double position_m[6], masseter_pose *pose);

/* The positions d1 d2 d3 l1 l2 l3 at a pose, m, also beyond the strokes. */
int masseter_inverse_kinematics(masseter_session *session, const masseter_pose *pose, double position_m[6]);

/* The rates of the axes by the twist at a pose: a row for each axis; m/s per m/s, then m/s per rad/s. */
int masseter_jacobian(masseter_session *session, const masseter_pose *pose, double jacobian[6][6]);

/* The forces of the axes (N) for a twist and an acceleration, as in masseter_motion. The wrench acts on the platform: N, then N m
 * about its origin, base axes; null for none. Masses and friction are those that the scenario's controller assumes. */
int masseter_inverse_dynamics(masseter_session *session, const masseter_pose *pose, const double twist[6],
                              const double acceleration[6], const double wrench[6], double force_n[6]);

/* Runs the rig's own controller with this law until the motion is over, and frees the session. Returns MASSETER_OK,
 * MASSETER_SAFE_STOP or MASSETER_ERROR. */
int masseter_run(masseter_session *session, masseter_law law, void *user);

/* Opens the ports, reports ready, and waits for the start of the run. In real time the calling thread gets the scenario's core and
 * priority, and keeps both. */
int masseter_start(masseter_session *session);

/* Ends the current cycle and waits for the next: for ever if timeout_ns is negative; 0 only looks. In lockstep the plant
 * goes on meanwhile, and not before. Returns MASSETER_OK, MASSETER_TIMED_OUT or MASSETER_ERROR. */
int masseter_wait(masseter_session *session, int64_t timeout_ns, masseter_cycle *cycle, masseter_reading *reading);

/* Publishes this cycle's command, and what the controller made of the reading. Once a cycle. command->cycle is that of
 * masseter_wait; any other is an error, and nothing is sent. The session numbers and stamps both messages, and enters the
 * cycle's times into the state. The rig judges the jaw by the scenario's motion, not by the desired pose of the state. */
int masseter_publish(masseter_session *session, const masseter_command *command, const masseter_state *state);

/* Publishes an event. */
int masseter_publish_event(masseter_session *session, const masseter_event *event);

/* 1 once the rig wants an orderly end, or is gone: bring the motion to rest, switch the drives off, then finish. The session
   publishes the event stop_requested itself. */
int masseter_is_stop_requested(const masseter_session *session);

/* Ends the work in order, and frees the session. is_safe_stop: a fault ended the motion. */
int masseter_finish(masseter_session *session, int is_safe_stop);

/* Ends the work because the program cannot go on, and frees the session. The plant's master stops the drives. */
int masseter_fail(masseter_session *session, const char *reason);

#ifdef __cplusplus
}
#endif

#endif
