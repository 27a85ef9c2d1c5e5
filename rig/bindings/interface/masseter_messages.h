/* The messages between the rig and a controller. Generated: masseter interface c
 * Times are ns of CLOCK_MONOTONIC, 0 where nothing happened yet. Lengths are in m, poses in the base frame. */
#ifndef MASSETER_MESSAGES_H
#define MASSETER_MESSAGES_H

#include <assert.h>
#include <stddef.h>
#include <stdint.h>

#define MASSETER_LAYOUT_VERSION 15u
/* masseter_event.axis when no axis is concerned. */
#define MASSETER_NO_AXIS 4294967295u
/* masseter_reading.drive_state of a drive not heard of yet, or lost. */
#define MASSETER_NO_DRIVE_STATE 0u

enum masseter_drive_request {
    /* No voltage: the drive is free. */
    MASSETER_DRIVE_REQUEST_OFF = 0,
    /* Operation enabled, following the targets. */
    MASSETER_DRIVE_REQUEST_ENABLE = 1,
    /* Stop along the quick-stop ramp, then switch on disabled. */
    MASSETER_DRIVE_REQUEST_QUICK_STOP = 2,
};

enum masseter_drive_state {
    /* Initialising. */
    MASSETER_DRIVE_STATE_NOT_READY_TO_SWITCH_ON = 1,
    /* No voltage allowed. */
    MASSETER_DRIVE_STATE_SWITCH_ON_DISABLED = 2,
    /* Voltage may be applied. */
    MASSETER_DRIVE_STATE_READY_TO_SWITCH_ON = 3,
    /* Voltage applied, no force. */
    MASSETER_DRIVE_STATE_SWITCHED_ON = 4,
    /* Following targets. */
    MASSETER_DRIVE_STATE_OPERATION_ENABLED = 5,
    /* Braking along the quick-stop ramp. */
    MASSETER_DRIVE_STATE_QUICK_STOP_ACTIVE = 6,
    /* Reacting to a fault. */
    MASSETER_DRIVE_STATE_FAULT_REACTION_ACTIVE = 7,
    /* In fault, free of force. */
    MASSETER_DRIVE_STATE_FAULT = 8,
};

enum masseter_controller_state {
    /* No steady readings yet; drives off. */
    MASSETER_CONTROLLER_STATE_WAIT_READINGS = 0,
    /* Bringing all drives to operation enabled, holding where they are. */
    MASSETER_CONTROLLER_STATE_ENABLING = 1,
    /* Easing from the measured pose to the first pose of the motion. */
    MASSETER_CONTROLLER_STATE_EASING = 2,
    /* Playing the motion. */
    MASSETER_CONTROLLER_STATE_RUNNING = 3,
    /* Holding the last pose. */
    MASSETER_CONTROLLER_STATE_HOLDING = 4,
    /* Switching the drives off. */
    MASSETER_CONTROLLER_STATE_DISABLING = 5,
    /* Done: drives off. */
    MASSETER_CONTROLLER_STATE_FINISHED = 6,
    /* Stopped by a fault: quick stop requested, nothing moves again. */
    MASSETER_CONTROLLER_STATE_SAFE_STOP = 7,
};

enum masseter_source {
    /* The controller. */
    MASSETER_SOURCE_CONTROLLER = 1,
    /* The plant: CAN master. */
    MASSETER_SOURCE_MASTER = 2,
    /* The plant: a message of a drive to the master. */
    MASSETER_SOURCE_DRIVE = 3,
    /* A simulated wire, or the faults of a real one. */
    MASSETER_SOURCE_WIRE = 5,
    /* The scenario: its faults and stimuli. */
    MASSETER_SOURCE_SCENARIO = 6,
};

enum masseter_event_kind {
    /* A state machine moved; from and to name the states. */
    MASSETER_EVENT_KIND_TRANSITION = 0,
    /* Something is wrong; cause, value and limit explain it. */
    MASSETER_EVENT_KIND_FAULT = 1,
    /* An observation without a reaction. */
    MASSETER_EVENT_KIND_NOTICE = 2,
};

enum masseter_cause {
    /* In the course of the sequence. */
    MASSETER_CAUSE_SEQUENCE = 0,
    /* Asked for from outside (signal). */
    MASSETER_CAUSE_STOP_REQUESTED = 1,
    /* No fresh reading for too long (cycles). */
    MASSETER_CAUSE_STALE_READING = 2,
    /* A drive is in fault or fell out of operation (drive condition). */
    MASSETER_CAUSE_DRIVE_FAULT = 3,
    /* Forward kinematics gave no acceptable pose (residual, m). */
    MASSETER_CAUSE_FORWARD_KINEMATICS = 4,
    /* An axis outside its stroke (m). */
    MASSETER_CAUSE_STROKE_LIMIT = 5,
    /* An axis asked to go faster than its drive may (m/s). */
    MASSETER_CAUSE_VELOCITY_LIMIT = 6,
    /* The desired pose has no joint coordinates. */
    MASSETER_CAUSE_INVERSE_KINEMATICS = 7,
    /* A reading answers a command that this controller never sent (cycle). */
    MASSETER_CAUSE_FOREIGN_COMMAND = 8,
    /* The drives did not reach operation enabled, or at the end off, in time (cycles). */
    MASSETER_CAUSE_ENABLE_TIMEOUT = 9,
    /* Incisal point too far from where it should be (m). */
    MASSETER_CAUSE_TRACKING_LOST = 10,
    /* No fresh command for too long (cycles). */
    MASSETER_CAUSE_COMMAND_LOST = 11,
    /* A drive's heartbeat is overdue (ms). */
    MASSETER_CAUSE_HEARTBEAT_LOST = 12,
    /* An emergency message of a drive (EMCY code; the limit is the error register, object 1001). */
    MASSETER_CAUSE_EMERGENCY = 15,
    /* Process data of a drive missing (cycles). */
    MASSETER_CAUSE_PROCESS_DATA_LOST = 16,
    /* The bus refused a frame. */
    MASSETER_CAUSE_BUS_REFUSED = 18,
    /* A value in a message is not a finite number or no known code, or the message has another version. */
    MASSETER_CAUSE_BAD_MESSAGE = 19,
    /* A drive did not boot in time (ms). */
    MASSETER_CAUSE_BOOT_TIMEOUT = 20,
    /* The CAN master refuses to move anything; an event of its own has the reason. */
    MASSETER_CAUSE_MASTER_FAULT = 23,
    /* A bounded buffer had no room (items lost). */
    MASSETER_CAUSE_OVERFLOW = 24,
    /* A node is another device than configured (value of the identity object). */
    MASSETER_CAUSE_WRONG_IDENTITY = 25,
    /* A node's PDOs are not those that the master exchanges (value of the object). */
    MASSETER_CAUSE_WRONG_PDO = 26,
    /* A node does not show a value that it was configured with (value of the object). */
    MASSETER_CAUSE_NOT_ACCEPTED = 27,
    /* A node refused to have an object read or written (SDO abort code). */
    MASSETER_CAUSE_SDO_ABORTED = 28,
    /* A node did not answer an SDO request (ms). */
    MASSETER_CAUSE_SDO_TIMEOUT = 29,
    /* Two nodes have one id: they answer SDO requests or SYNCs more than once, again and again. */
    MASSETER_CAUSE_DUPLICATE_NODE = 30,
    /* A node booted without a request. */
    MASSETER_CAUSE_NODE_RESTARTED = 31,
    /* A drive is in fault and a fault reset does not help (EMCY code, object 603F; the limit is the statusword). */
    MASSETER_CAUSE_FAULT_AT_START = 32,
    /* A node left the NMT state operational by itself (reported NMT state; the limit is the code of operational). */
    MASSETER_CAUSE_NODE_STOPPED = 33,
    /* A bus or a node works again after a fault. */
    MASSETER_CAUSE_RECOVERED = 34,
    /* A frame does not have the length of its object (bytes). */
    MASSETER_CAUSE_WRONG_LENGTH = 35,
    /* A node that is not configured is on the bus. */
    MASSETER_CAUSE_UNKNOWN_NODE = 36,
    /* Another node sends SYNC or NMT, or has the master's id: its heartbeats would keep the drives going without this one. */
    MASSETER_CAUSE_SECOND_MASTER = 37,
    /* A drive has voltage in spite of a quick stop (statusword, object 6041). */
    MASSETER_CAUSE_STILL_POWERED = 38,
    /* A drive counts its software limits from elsewhere than its positions (home offset, object 607C). */
    MASSETER_CAUSE_HOME_OFFSET = 39,
    /* A CAN controller became error active again (transmit error counter). */
    MASSETER_CAUSE_ERROR_ACTIVE = 40,
    /* A CAN controller became error passive (transmit error counter). */
    MASSETER_CAUSE_ERROR_PASSIVE = 41,
    /* A CAN controller went off the bus (transmit error counter). */
    MASSETER_CAUSE_BUS_OFF = 42,
    /* A fault of the scenario began to act (number in its list, from 1). */
    MASSETER_CAUSE_FAULT_INJECTED = 43,
    /* A fault of the scenario is over (number in its list, from 1; number of activations). */
    MASSETER_CAUSE_FAULT_ENDED = 44,
    /* An axis asked to change its velocity faster than it may (m/s²). */
    MASSETER_CAUSE_ACCELERATION_LIMIT = 45,
    /* A drive is not where its targets should have taken it (m). */
    MASSETER_CAUSE_FOLLOWING_ERROR = 46,
    /* Platform turned too far from where it should be (rad). */
    MASSETER_CAUSE_ORIENTATION_LOST = 48,
    /* The pose law failed (0), or gave a pose with a bad coordinate (m), or with a bad quaternion (its length; the limit is 1). */
    MASSETER_CAUSE_LAW_FAILED = 49,
    /* A parameter of the controller was set (new value; the limit is the value before). The object is its place. */
    MASSETER_CAUSE_PARAMETER_SET = 50,
    /* A stimulus of the scenario began (number in its list, from 1). */
    MASSETER_CAUSE_STIMULUS_BEGAN = 51,
    /* A stimulus of the scenario is over (number in its list, from 1). */
    MASSETER_CAUSE_STIMULUS_ENDED = 52,
    /* An object of a drive is not as its profile says (value; the limit is the expected one). */
    MASSETER_CAUSE_WRONG_OBJECT = 53,
    /* A drive counts accelerations in another unit than its profile says (60AAh; the limit is the expected one). */
    MASSETER_CAUSE_WRONG_UNIT = 54,
    /* A drive is in fault at the start, and no reset is allowed (EMCY code, object 603F; the limit is the statusword). */
    MASSETER_CAUSE_FAULT_FOUND = 55,
    /* A fault found at the start was reset (EMCY code, object 603F; the limit is the statusword). */
    MASSETER_CAUSE_FAULT_RESET = 56,
    /* The drives wait for one that is not ready to switch on (statusword; the limit is its EMCY code). */
    MASSETER_CAUSE_WAITS_FOR_DRIVE = 57,
    /* A drive did not become ready to switch on in time (statusword; the limit is its EMCY code). */
    MASSETER_CAUSE_NOT_READY = 58,
    /* A drive was not enabled in time with the others (statusword; the limit is its EMCY code). */
    MASSETER_CAUSE_NOT_ENABLED = 59,
    /* The jaw is too far from the first pose of the motion (m). */
    MASSETER_CAUSE_START_TOO_FAR = 60,
    /* Food between the teeth broke (force before, N; the limit is its strength). The object is the first of its teeth. */
    MASSETER_CAUSE_FOOD_BROKE = 61,
    /* An axis of the mechanism ran into an end stop (m/s). */
    MASSETER_CAUSE_END_STOP_HIT = 62,
    /* A drive acknowledged a value and shows another one (value that it shows; the limit is the one written). */
    MASSETER_CAUSE_NOT_KEPT = 63,
    /* The bite force exceeds the limit of the force control (N). */
    MASSETER_CAUSE_FORCE_LIMIT = 64,
    /* The motion waited too long for lost or late commands and readings (s). */
    MASSETER_CAUSE_MOTION_LATE = 65,
    /* A bite shows another stiffness than stated (N/m; the limit is the stated one). */
    MASSETER_CAUSE_WRONG_STIFFNESS = 66,
};

enum masseter_no_pose {
    /* A coordinate is no finite number. */
    MASSETER_NO_POSE_NOT_FINITE = 1,
    /* A leg has no length; the event names its axis. */
    MASSETER_NO_POSE_NO_LENGTH = 2,
    /* No pose fits the positions. */
    MASSETER_NO_POSE_UNASSEMBLABLE = 3,
    /* Only poses with a folded mechanism fit the positions. */
    MASSETER_NO_POSE_WRONG_ASSEMBLY = 4,
    /* Several poses fit the positions, and the last pose does not decide between them. */
    MASSETER_NO_POSE_AMBIGUOUS = 5,
    /* Several poses fit the positions, and rounding hides their difference. */
    MASSETER_NO_POSE_UNDECIDED = 6,
    /* The pose is singular, or an iteration came to none. */
    MASSETER_NO_POSE_NOT_FOUND = 7,
};

#define MASSETER_READING_TOPIC "reading"
#define MASSETER_READING_TYPE_NAME "masseter/Reading/a9068e5a70343ba1"

/* Positions, forces and states of the drives, once a cycle. */
typedef struct masseter_reading {
    /* Number of this message on its topic, from 1. */
    uint64_t seq;
    /* When it was published, ns. */
    uint64_t published_ns;
    /* Version of the sender's layouts. */
    uint64_t version;
    /* Cycle of the plant, from 1. */
    uint64_t cycle;
    /* Cycle of the last command received when the sample was taken; 0 before the first. */
    uint64_t answers_cycle;
    /* When SYNC made the drives sample, ns. */
    uint64_t sampled_ns;
    /* When the last process data of the six drives had arrived, ns. */
    uint64_t complete_ns;
    /* When the command named by answers_cycle was received, ns. */
    uint64_t command_received_ns;
    /* When the last process data of that command had left onto the wire, ns. */
    uint64_t command_sent_ns;
    /* Deadline of the master's cycle, ns. */
    uint64_t due_ns;
    /* When the master woke for it, ns. */
    uint64_t woke_ns;
    /* Deadlines skipped since start because an earlier cycle overran. */
    uint64_t skipped_cycles;
    /* Time for which the machine stalled while the process waited, since start, ns. */
    uint64_t stalled_ns;
    /* Time that the process spun, without the stalls, since start, ns. */
    uint64_t spun_ns;
    /* Time that the process worked, since start, ns. */
    uint64_t worked_ns;
    /* Part of it in stretches too long for the work alone, ns. */
    uint64_t overlong_ns;
    /* Encoder positions d₁ d₂ d₃ l₁ l₂ l₃, m. */
    double position_m[6];
    /* Actuator forces as the drives report them, positive towards increasing position, N. An emulated drive reports the mean since the last SYNC. */
    double force_n[6];
    /* Bite force that the load cell shows at SYNC, N; 0 without a load cell. */
    double load_cell_n;
    /* Drive states, DriveState, or NO_DRIVE_STATE. */
    uint32_t drive_state[6];
    /* Axes whose process data arrived this cycle, bit i for axis i. */
    uint32_t fresh_axes;
    /* 1 once the master refuses to move anything, with the cause in an event. */
    uint32_t master_fault;
} masseter_reading;

static_assert(sizeof(masseter_reading) == 264, "size of masseter_reading");
static_assert(offsetof(masseter_reading, seq) == 0, "offset of seq");
static_assert(offsetof(masseter_reading, published_ns) == 8, "offset of published_ns");
static_assert(offsetof(masseter_reading, version) == 16, "offset of version");
static_assert(offsetof(masseter_reading, cycle) == 24, "offset of cycle");
static_assert(offsetof(masseter_reading, answers_cycle) == 32, "offset of answers_cycle");
static_assert(offsetof(masseter_reading, sampled_ns) == 40, "offset of sampled_ns");
static_assert(offsetof(masseter_reading, complete_ns) == 48, "offset of complete_ns");
static_assert(offsetof(masseter_reading, command_received_ns) == 56, "offset of command_received_ns");
static_assert(offsetof(masseter_reading, command_sent_ns) == 64, "offset of command_sent_ns");
static_assert(offsetof(masseter_reading, due_ns) == 72, "offset of due_ns");
static_assert(offsetof(masseter_reading, woke_ns) == 80, "offset of woke_ns");
static_assert(offsetof(masseter_reading, skipped_cycles) == 88, "offset of skipped_cycles");
static_assert(offsetof(masseter_reading, stalled_ns) == 96, "offset of stalled_ns");
static_assert(offsetof(masseter_reading, spun_ns) == 104, "offset of spun_ns");
static_assert(offsetof(masseter_reading, worked_ns) == 112, "offset of worked_ns");
static_assert(offsetof(masseter_reading, overlong_ns) == 120, "offset of overlong_ns");
static_assert(offsetof(masseter_reading, position_m) == 128, "offset of position_m");
static_assert(offsetof(masseter_reading, force_n) == 176, "offset of force_n");
static_assert(offsetof(masseter_reading, load_cell_n) == 224, "offset of load_cell_n");
static_assert(offsetof(masseter_reading, drive_state) == 232, "offset of drive_state");
static_assert(offsetof(masseter_reading, fresh_axes) == 256, "offset of fresh_axes");
static_assert(offsetof(masseter_reading, master_fault) == 260, "offset of master_fault");

#define MASSETER_COMMAND_TOPIC "command"
#define MASSETER_COMMAND_TYPE_NAME "masseter/Command/58429641477964f3"

/* Targets and request for the drives, once a cycle. */
typedef struct masseter_command {
    /* Number of this message on its topic, from 1. */
    uint64_t seq;
    /* When it was published, ns. */
    uint64_t published_ns;
    /* Version of the sender's layouts. */
    uint64_t version;
    /* Cycle of the controller, from 1. */
    uint64_t cycle;
    /* Cycle of the reading it was computed from; 0 when there was none. */
    uint64_t reading_cycle;
    /* Desired positions d₁ d₂ d₃ l₁ l₂ l₃, m. */
    double target_m[6];
    /* Forces that the drives add to those of their position control, positive towards increasing position, N; 0 without feed-forward. */
    double force_offset_n[6];
    /* Requested drive state, a DriveRequest. */
    uint32_t request;
    /* State of the controller, a ControllerState. */
    uint32_t controller_state;
} masseter_command;

static_assert(sizeof(masseter_command) == 144, "size of masseter_command");
static_assert(offsetof(masseter_command, seq) == 0, "offset of seq");
static_assert(offsetof(masseter_command, published_ns) == 8, "offset of published_ns");
static_assert(offsetof(masseter_command, version) == 16, "offset of version");
static_assert(offsetof(masseter_command, cycle) == 24, "offset of cycle");
static_assert(offsetof(masseter_command, reading_cycle) == 32, "offset of reading_cycle");
static_assert(offsetof(masseter_command, target_m) == 40, "offset of target_m");
static_assert(offsetof(masseter_command, force_offset_n) == 88, "offset of force_offset_n");
static_assert(offsetof(masseter_command, request) == 136, "offset of request");
static_assert(offsetof(masseter_command, controller_state) == 140, "offset of controller_state");

#define MASSETER_STATE_TOPIC "state"
#define MASSETER_STATE_TYPE_NAME "masseter/State/1880bb659a4ccdc7"

/* The controller's state and its estimate, once a cycle. All float64 fields but `motion_time_s` have 31 significant bits. */
typedef struct masseter_state {
    /* Number of this message on its topic, from 1. */
    uint64_t seq;
    /* When it was published, ns. */
    uint64_t published_ns;
    /* Version of the sender's layouts. */
    uint64_t version;
    /* Cycle of the controller, from 1. */
    uint64_t cycle;
    /* Cycle of the reading it was computed from; 0 when there was none. */
    uint64_t reading_cycle;
    /* When that reading was sampled, ns. */
    uint64_t sampled_ns;
    /* Deadline of the cycle, ns. */
    uint64_t due_ns;
    /* When the loop woke for it, ns. */
    uint64_t woke_ns;
    /* When the reading had been received, ns. */
    uint64_t received_ns;
    /* When the forward kinematics was done, ns. */
    uint64_t solved_ns;
    /* When the command was ready to be published, ns. */
    uint64_t commanded_ns;
    /* Deadlines skipped since start because an earlier cycle overran. */
    uint64_t skipped_cycles;
    /* Time for which the machine stalled while the process waited, since start, ns. */
    uint64_t stalled_ns;
    /* Time that the process spun, without the stalls, since start, ns. */
    uint64_t spun_ns;
    /* Time that the process worked, since start, ns. */
    uint64_t worked_ns;
    /* Part of it in stretches too long for the work alone, ns. */
    uint64_t overlong_ns;
    /* How far the motion had come at the sample, s: of a recorded one, the time since the recording's first row. It passes more slowly while the motion gathers speed and while it comes to rest. Negative before the motion begins. */
    double motion_time_s;
    /* Desired pose at the sample: position in the base frame, m. */
    double desired_position_m[3];
    /* Desired pose at the sample: unit quaternion w x y z. */
    double desired_quaternion_wxyz[4];
    /* Estimated pose by forward kinematics: position in the base frame, m. */
    double estimated_position_m[3];
    /* Estimated pose by forward kinematics: unit quaternion w x y z. */
    double estimated_quaternion_wxyz[4];
    /* θ₁ θ₂ θ₃, rad. */
    double leg_angle_rad[3];
    /* Largest difference of a platform side from its length, m. */
    double residual_m;
    /* Condition number of the actuators' Jacobian, angular columns scaled by the platform's side A₁A₂. The motion controller computes one every ten cycles and repeats it; 0 where none is computed. */
    double condition;
    /* Iterations of the forward kinematics. */
    uint32_t iterations;
    /* State of the controller, a ControllerState. */
    uint32_t controller_state;
} masseter_state;

static_assert(sizeof(masseter_state) == 296, "size of masseter_state");
static_assert(offsetof(masseter_state, seq) == 0, "offset of seq");
static_assert(offsetof(masseter_state, published_ns) == 8, "offset of published_ns");
static_assert(offsetof(masseter_state, version) == 16, "offset of version");
static_assert(offsetof(masseter_state, cycle) == 24, "offset of cycle");
static_assert(offsetof(masseter_state, reading_cycle) == 32, "offset of reading_cycle");
static_assert(offsetof(masseter_state, sampled_ns) == 40, "offset of sampled_ns");
static_assert(offsetof(masseter_state, due_ns) == 48, "offset of due_ns");
static_assert(offsetof(masseter_state, woke_ns) == 56, "offset of woke_ns");
static_assert(offsetof(masseter_state, received_ns) == 64, "offset of received_ns");
static_assert(offsetof(masseter_state, solved_ns) == 72, "offset of solved_ns");
static_assert(offsetof(masseter_state, commanded_ns) == 80, "offset of commanded_ns");
static_assert(offsetof(masseter_state, skipped_cycles) == 88, "offset of skipped_cycles");
static_assert(offsetof(masseter_state, stalled_ns) == 96, "offset of stalled_ns");
static_assert(offsetof(masseter_state, spun_ns) == 104, "offset of spun_ns");
static_assert(offsetof(masseter_state, worked_ns) == 112, "offset of worked_ns");
static_assert(offsetof(masseter_state, overlong_ns) == 120, "offset of overlong_ns");
static_assert(offsetof(masseter_state, motion_time_s) == 128, "offset of motion_time_s");
static_assert(offsetof(masseter_state, desired_position_m) == 136, "offset of desired_position_m");
static_assert(offsetof(masseter_state, desired_quaternion_wxyz) == 160, "offset of desired_quaternion_wxyz");
static_assert(offsetof(masseter_state, estimated_position_m) == 192, "offset of estimated_position_m");
static_assert(offsetof(masseter_state, estimated_quaternion_wxyz) == 216, "offset of estimated_quaternion_wxyz");
static_assert(offsetof(masseter_state, leg_angle_rad) == 248, "offset of leg_angle_rad");
static_assert(offsetof(masseter_state, residual_m) == 272, "offset of residual_m");
static_assert(offsetof(masseter_state, condition) == 280, "offset of condition");
static_assert(offsetof(masseter_state, iterations) == 288, "offset of iterations");
static_assert(offsetof(masseter_state, controller_state) == 292, "offset of controller_state");

#define MASSETER_EVENT_TOPIC "event"
#define MASSETER_EVENT_TYPE_NAME "masseter/Event/21ee579a9f2571a6"

/* A single occurrence: a change of state, a fault, an alarm. */
typedef struct masseter_event {
    /* Number of this message on its topic, from 1. */
    uint64_t seq;
    /* When it was published, ns. */
    uint64_t published_ns;
    /* Version of the sender's layouts. */
    uint64_t version;
    /* When, ns. */
    uint64_t time_ns;
    /* Cycle of the process that reports it. */
    uint64_t cycle;
    /* Reporter, a Source. */
    uint32_t source;
    /* Kind, an EventKind. */
    uint32_t kind;
    /* Cause, a Cause. */
    uint32_t cause;
    /* Axis concerned, from 0; NO_AXIS when none is. */
    uint32_t axis;
    /* Object dictionary entry concerned, index · 256 + sub-index, or a COB-ID; of the controller a NoPose; 0 when there is none. */
    uint32_t object;
    /* Node id concerned; 0 when none is. */
    uint16_t node;
    /* Index of the bus concerned, from 0, where node or the cause is about one. */
    uint16_t bus;
    /* State before, as a code of the source's state type. */
    uint32_t from;
    /* State after. */
    uint32_t to;
    /* The value that explains it, in the cause's unit. */
    double value;
    /* The limit it is held against, in the same unit. */
    double limit;
} masseter_event;

static_assert(sizeof(masseter_event) == 88, "size of masseter_event");
static_assert(offsetof(masseter_event, seq) == 0, "offset of seq");
static_assert(offsetof(masseter_event, published_ns) == 8, "offset of published_ns");
static_assert(offsetof(masseter_event, version) == 16, "offset of version");
static_assert(offsetof(masseter_event, time_ns) == 24, "offset of time_ns");
static_assert(offsetof(masseter_event, cycle) == 32, "offset of cycle");
static_assert(offsetof(masseter_event, source) == 40, "offset of source");
static_assert(offsetof(masseter_event, kind) == 44, "offset of kind");
static_assert(offsetof(masseter_event, cause) == 48, "offset of cause");
static_assert(offsetof(masseter_event, axis) == 52, "offset of axis");
static_assert(offsetof(masseter_event, object) == 56, "offset of object");
static_assert(offsetof(masseter_event, node) == 60, "offset of node");
static_assert(offsetof(masseter_event, bus) == 62, "offset of bus");
static_assert(offsetof(masseter_event, from) == 64, "offset of from");
static_assert(offsetof(masseter_event, to) == 68, "offset of to");
static_assert(offsetof(masseter_event, value) == 72, "offset of value");
static_assert(offsetof(masseter_event, limit) == 80, "offset of limit");

#define MASSETER_TRUTH_TOPIC "truth"
#define MASSETER_TRUTH_TYPE_NAME "masseter/Truth/aaa6b46fe5150f32"

/* The true state of the mechanism, once a cycle; the controller never reads it. All float64 fields have 31 significant bits. */
typedef struct masseter_truth {
    /* Number of this message on its topic, from 1. */
    uint64_t seq;
    /* When it was published, ns. */
    uint64_t published_ns;
    /* Version of the sender's layouts. */
    uint64_t version;
    /* Cycle of the plant, from 1. */
    uint64_t cycle;
    /* The instant it describes: that of the reading's sample, ns. */
    uint64_t sampled_ns;
    /* Platform origin in the base frame, m. */
    double position_m[3];
    /* Platform orientation, unit quaternion w x y z. */
    double quaternion_wxyz[4];
    /* Joint positions d₁ d₂ d₃ l₁ l₂ l₃, m. */
    double joint_m[6];
    /* Joint velocities, m/s. */
    double joint_m_s[6];
    /* Actuator forces, N: means over the cycle before the sample. */
    double force_n[6];
    /* Actuator forces at the sample, N. */
    double force_sample_n[6];
    /* Vertical force of food and upper teeth on the lower jaw, positive downwards, N: mean over the cycle before the sample. */
    double bite_force_n;
    /* Bite force at the sample, N. */
    double bite_force_sample_n;
    /* Work on the bodies since the start, J: of the drives, of friction in slides, legs, and hinges with balls, of teeth and food, of everything else (pushes, payload, end stops). */
    double work_j[6];
    /* Energy of the bodies' motion, J. */
    double kinetic_j;
    /* Energy of their height above that of the start, J. */
    double potential_j;
} masseter_truth;

static_assert(sizeof(masseter_truth) == 368, "size of masseter_truth");
static_assert(offsetof(masseter_truth, seq) == 0, "offset of seq");
static_assert(offsetof(masseter_truth, published_ns) == 8, "offset of published_ns");
static_assert(offsetof(masseter_truth, version) == 16, "offset of version");
static_assert(offsetof(masseter_truth, cycle) == 24, "offset of cycle");
static_assert(offsetof(masseter_truth, sampled_ns) == 32, "offset of sampled_ns");
static_assert(offsetof(masseter_truth, position_m) == 40, "offset of position_m");
static_assert(offsetof(masseter_truth, quaternion_wxyz) == 64, "offset of quaternion_wxyz");
static_assert(offsetof(masseter_truth, joint_m) == 96, "offset of joint_m");
static_assert(offsetof(masseter_truth, joint_m_s) == 144, "offset of joint_m_s");
static_assert(offsetof(masseter_truth, force_n) == 192, "offset of force_n");
static_assert(offsetof(masseter_truth, force_sample_n) == 240, "offset of force_sample_n");
static_assert(offsetof(masseter_truth, bite_force_n) == 288, "offset of bite_force_n");
static_assert(offsetof(masseter_truth, bite_force_sample_n) == 296, "offset of bite_force_sample_n");
static_assert(offsetof(masseter_truth, work_j) == 304, "offset of work_j");
static_assert(offsetof(masseter_truth, kinetic_j) == 352, "offset of kinetic_j");
static_assert(offsetof(masseter_truth, potential_j) == 360, "offset of potential_j");

#define MASSETER_CONTACT_TOPIC "contact"
#define MASSETER_CONTACT_TYPE_NAME "masseter/Contact/aa4988fe35a2196c"

/* The forces between the jaws, once a cycle; without teeth and food, there is no such message. The controller never reads it. All float64 fields have 31 significant bits. */
typedef struct masseter_contact {
    /* Number of this message on its topic, from 1. */
    uint64_t seq;
    /* When it was published, ns. */
    uint64_t published_ns;
    /* Version of the sender's layouts. */
    uint64_t version;
    /* Cycle of the plant, from 1. */
    uint64_t cycle;
    /* End of the time that it describes: the instant of the reading's sample, ns. */
    uint64_t sampled_ns;
    /* FDI numbers of the lower teeth, 0 where there are no more. */
    uint32_t tooth[16];
    /* Force of antagonist and food on each lower tooth, x y z in base axes, mean over the cycle, N. */
    double force_n[48];
    /* Where the force acts on the tooth, x y z in the platform frame, m. */
    double place_m[48];
} masseter_contact;

static_assert(sizeof(masseter_contact) == 872, "size of masseter_contact");
static_assert(offsetof(masseter_contact, seq) == 0, "offset of seq");
static_assert(offsetof(masseter_contact, published_ns) == 8, "offset of published_ns");
static_assert(offsetof(masseter_contact, version) == 16, "offset of version");
static_assert(offsetof(masseter_contact, cycle) == 24, "offset of cycle");
static_assert(offsetof(masseter_contact, sampled_ns) == 32, "offset of sampled_ns");
static_assert(offsetof(masseter_contact, tooth) == 40, "offset of tooth");
static_assert(offsetof(masseter_contact, force_n) == 104, "offset of force_n");
static_assert(offsetof(masseter_contact, place_m) == 488, "offset of place_m");

#endif
