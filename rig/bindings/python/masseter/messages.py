"""The messages between the rig and a controller. Generated: masseter interface python

Times are ns of CLOCK_MONOTONIC, 0 where nothing happened yet. Lengths are in m, poses in the base frame.
numpy.dtype(Reading) is the NumPy type of a message.
"""

import ctypes
import enum

LAYOUT_VERSION = 15
#: Event.axis when no axis is concerned.
NO_AXIS = 4294967295
#: Reading.drive_state of a drive not heard of yet, or lost.
NO_DRIVE_STATE = 0


def _check(layout: type[ctypes.Structure], size: int, offsets: list[int]) -> None:
    found = [getattr(layout, field[0]).offset for field in layout._fields_]
    if ctypes.sizeof(layout) != size or found != offsets:
        raise ImportError(f"{layout.__name__} has another layout on this machine: {found}, expected {offsets}")


class DriveRequest(enum.IntEnum):
    #: No voltage: the drive is free.
    OFF = 0
    #: Operation enabled, following the targets.
    ENABLE = 1
    #: Stop along the quick-stop ramp, then switch on disabled.
    QUICK_STOP = 2


class DriveState(enum.IntEnum):
    #: Initialising.
    NOT_READY_TO_SWITCH_ON = 1
    #: No voltage allowed.
    SWITCH_ON_DISABLED = 2
    #: Voltage may be applied.
    READY_TO_SWITCH_ON = 3
    #: Voltage applied, no force.
    SWITCHED_ON = 4
    #: Following targets.
    OPERATION_ENABLED = 5
    #: Braking along the quick-stop ramp.
    QUICK_STOP_ACTIVE = 6
    #: Reacting to a fault.
    FAULT_REACTION_ACTIVE = 7
    #: In fault, free of force.
    FAULT = 8


class ControllerState(enum.IntEnum):
    #: No steady readings yet; drives off.
    WAIT_READINGS = 0
    #: Bringing all drives to operation enabled, holding where they are.
    ENABLING = 1
    #: Easing from the measured pose to the first pose of the motion.
    EASING = 2
    #: Playing the motion.
    RUNNING = 3
    #: Holding the last pose.
    HOLDING = 4
    #: Switching the drives off.
    DISABLING = 5
    #: Done: drives off.
    FINISHED = 6
    #: Stopped by a fault: quick stop requested, nothing moves again.
    SAFE_STOP = 7


class Source(enum.IntEnum):
    #: The controller.
    CONTROLLER = 1
    #: The plant: CAN master.
    MASTER = 2
    #: The plant: a message of a drive to the master.
    DRIVE = 3
    #: A simulated wire, or the faults of a real one.
    WIRE = 5
    #: The scenario: its faults and stimuli.
    SCENARIO = 6


class EventKind(enum.IntEnum):
    #: A state machine moved; from and to name the states.
    TRANSITION = 0
    #: Something is wrong; cause, value and limit explain it.
    FAULT = 1
    #: An observation without a reaction.
    NOTICE = 2


class Cause(enum.IntEnum):
    #: In the course of the sequence.
    SEQUENCE = 0
    #: Asked for from outside (signal).
    STOP_REQUESTED = 1
    #: No fresh reading for too long (cycles).
    STALE_READING = 2
    #: A drive is in fault or fell out of operation (drive condition).
    DRIVE_FAULT = 3
    #: Forward kinematics gave no acceptable pose (residual, m).
    FORWARD_KINEMATICS = 4
    #: An axis outside its stroke (m).
    STROKE_LIMIT = 5
    #: An axis asked to go faster than its drive may (m/s).
    VELOCITY_LIMIT = 6
    #: The desired pose has no joint coordinates.
    INVERSE_KINEMATICS = 7
    #: A reading answers a command that this controller never sent (cycle).
    FOREIGN_COMMAND = 8
    #: The drives did not reach operation enabled, or at the end off, in time (cycles).
    ENABLE_TIMEOUT = 9
    #: Incisal point too far from where it should be (m).
    TRACKING_LOST = 10
    #: No fresh command for too long (cycles).
    COMMAND_LOST = 11
    #: A drive's heartbeat is overdue (ms).
    HEARTBEAT_LOST = 12
    #: An emergency message of a drive (EMCY code; the limit is the error register, object 1001).
    EMERGENCY = 15
    #: Process data of a drive missing (cycles).
    PROCESS_DATA_LOST = 16
    #: The bus refused a frame.
    BUS_REFUSED = 18
    #: A value in a message is not a finite number or no known code, or the message has another version.
    BAD_MESSAGE = 19
    #: A drive did not boot in time (ms).
    BOOT_TIMEOUT = 20
    #: The CAN master refuses to move anything; an event of its own has the reason.
    MASTER_FAULT = 23
    #: A bounded buffer had no room (items lost).
    OVERFLOW = 24
    #: A node is another device than configured (value of the identity object).
    WRONG_IDENTITY = 25
    #: A node's PDOs are not those that the master exchanges (value of the object).
    WRONG_PDO = 26
    #: A node does not show a value that it was configured with (value of the object).
    NOT_ACCEPTED = 27
    #: A node refused to have an object read or written (SDO abort code).
    SDO_ABORTED = 28
    #: A node did not answer an SDO request (ms).
    SDO_TIMEOUT = 29
    #: Two nodes have one id: they answer SDO requests or SYNCs more than once, again and again.
    DUPLICATE_NODE = 30
    #: A node booted without a request.
    NODE_RESTARTED = 31
    #: A drive is in fault and a fault reset does not help (EMCY code, object 603F; the limit is the statusword).
    FAULT_AT_START = 32
    #: A node left the NMT state operational by itself (reported NMT state; the limit is the code of operational).
    NODE_STOPPED = 33
    #: A bus or a node works again after a fault.
    RECOVERED = 34
    #: A frame does not have the length of its object (bytes).
    WRONG_LENGTH = 35
    #: A node that is not configured is on the bus.
    UNKNOWN_NODE = 36
    #: Another node sends SYNC or NMT, or has the master's id: its heartbeats would keep the drives going without this one.
    SECOND_MASTER = 37
    #: A drive has voltage in spite of a quick stop (statusword, object 6041).
    STILL_POWERED = 38
    #: A drive counts its software limits from elsewhere than its positions (home offset, object 607C).
    HOME_OFFSET = 39
    #: A CAN controller became error active again (transmit error counter).
    ERROR_ACTIVE = 40
    #: A CAN controller became error passive (transmit error counter).
    ERROR_PASSIVE = 41
    #: A CAN controller went off the bus (transmit error counter).
    BUS_OFF = 42
    #: A fault of the scenario began to act (number in its list, from 1).
    FAULT_INJECTED = 43
    #: A fault of the scenario is over (number in its list, from 1; number of activations).
    FAULT_ENDED = 44
    #: An axis asked to change its velocity faster than it may (m/s²).
    ACCELERATION_LIMIT = 45
    #: A drive is not where its targets should have taken it (m).
    FOLLOWING_ERROR = 46
    #: Platform turned too far from where it should be (rad).
    ORIENTATION_LOST = 48
    #: The pose law failed (0), or gave a pose with a bad coordinate (m), or with a bad quaternion (its length; the limit is 1).
    LAW_FAILED = 49
    #: A parameter of the controller was set (new value; the limit is the value before). The object is its place.
    PARAMETER_SET = 50
    #: A stimulus of the scenario began (number in its list, from 1).
    STIMULUS_BEGAN = 51
    #: A stimulus of the scenario is over (number in its list, from 1).
    STIMULUS_ENDED = 52
    #: An object of a drive is not as its profile says (value; the limit is the expected one).
    WRONG_OBJECT = 53
    #: A drive counts accelerations in another unit than its profile says (60AAh; the limit is the expected one).
    WRONG_UNIT = 54
    #: A drive is in fault at the start, and no reset is allowed (EMCY code, object 603F; the limit is the statusword).
    FAULT_FOUND = 55
    #: A fault found at the start was reset (EMCY code, object 603F; the limit is the statusword).
    FAULT_RESET = 56
    #: The drives wait for one that is not ready to switch on (statusword; the limit is its EMCY code).
    WAITS_FOR_DRIVE = 57
    #: A drive did not become ready to switch on in time (statusword; the limit is its EMCY code).
    NOT_READY = 58
    #: A drive was not enabled in time with the others (statusword; the limit is its EMCY code).
    NOT_ENABLED = 59
    #: The jaw is too far from the first pose of the motion (m).
    START_TOO_FAR = 60
    #: Food between the teeth broke (force before, N; the limit is its strength). The object is the first of its teeth.
    FOOD_BROKE = 61
    #: An axis of the mechanism ran into an end stop (m/s).
    END_STOP_HIT = 62
    #: A drive acknowledged a value and shows another one (value that it shows; the limit is the one written).
    NOT_KEPT = 63
    #: The bite force exceeds the limit of the force control (N).
    FORCE_LIMIT = 64
    #: The motion waited too long for lost or late commands and readings (s).
    MOTION_LATE = 65
    #: A bite shows another stiffness than stated (N/m; the limit is the stated one).
    WRONG_STIFFNESS = 66


class NoPose(enum.IntEnum):
    #: A coordinate is no finite number.
    NOT_FINITE = 1
    #: A leg has no length; the event names its axis.
    NO_LENGTH = 2
    #: No pose fits the positions.
    UNASSEMBLABLE = 3
    #: Only poses with a folded mechanism fit the positions.
    WRONG_ASSEMBLY = 4
    #: Several poses fit the positions, and the last pose does not decide between them.
    AMBIGUOUS = 5
    #: Several poses fit the positions, and rounding hides their difference.
    UNDECIDED = 6
    #: The pose is singular, or an iteration came to none.
    NOT_FOUND = 7


class Reading(ctypes.Structure):
    """Positions, forces and states of the drives, once a cycle."""

    TOPIC = "reading"
    _fields_ = [
        # Number of this message on its topic, from 1.
        ("seq", ctypes.c_uint64),
        # When it was published, ns.
        ("published_ns", ctypes.c_uint64),
        # Version of the sender's layouts.
        ("version", ctypes.c_uint64),
        # Cycle of the plant, from 1.
        ("cycle", ctypes.c_uint64),
        # Cycle of the last command received when the sample was taken; 0 before the first.
        ("answers_cycle", ctypes.c_uint64),
        # When SYNC made the drives sample, ns.
        ("sampled_ns", ctypes.c_uint64),
        # When the last process data of the six drives had arrived, ns.
        ("complete_ns", ctypes.c_uint64),
        # When the command named by answers_cycle was received, ns.
        ("command_received_ns", ctypes.c_uint64),
        # When the last process data of that command had left onto the wire, ns.
        ("command_sent_ns", ctypes.c_uint64),
        # Deadline of the master's cycle, ns.
        ("due_ns", ctypes.c_uint64),
        # When the master woke for it, ns.
        ("woke_ns", ctypes.c_uint64),
        # Deadlines skipped since start because an earlier cycle overran.
        ("skipped_cycles", ctypes.c_uint64),
        # Time for which the machine stalled while the process waited, since start, ns.
        ("stalled_ns", ctypes.c_uint64),
        # Time that the process spun, without the stalls, since start, ns.
        ("spun_ns", ctypes.c_uint64),
        # Time that the process worked, since start, ns.
        ("worked_ns", ctypes.c_uint64),
        # Part of it in stretches too long for the work alone, ns.
        ("overlong_ns", ctypes.c_uint64),
        # Encoder positions d₁ d₂ d₃ l₁ l₂ l₃, m.
        ("position_m", ctypes.c_double * 6),
        # Actuator forces as the drives report them, positive towards increasing position, N. An emulated drive reports the mean since the last SYNC.
        ("force_n", ctypes.c_double * 6),
        # Bite force that the load cell shows at SYNC, N; 0 without a load cell.
        ("load_cell_n", ctypes.c_double),
        # Drive states, DriveState, or NO_DRIVE_STATE.
        ("drive_state", ctypes.c_uint32 * 6),
        # Axes whose process data arrived this cycle, bit i for axis i.
        ("fresh_axes", ctypes.c_uint32),
        # 1 once the master refuses to move anything, with the cause in an event.
        ("master_fault", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name() -> str:
        return "masseter/Reading/a9068e5a70343ba1"


_check(Reading, 264, [0, 8, 16, 24, 32, 40, 48, 56, 64, 72, 80, 88, 96, 104, 112, 120, 128, 176, 224, 232, 256, 260])


class Command(ctypes.Structure):
    """Targets and request for the drives, once a cycle."""

    TOPIC = "command"
    _fields_ = [
        # Number of this message on its topic, from 1.
        ("seq", ctypes.c_uint64),
        # When it was published, ns.
        ("published_ns", ctypes.c_uint64),
        # Version of the sender's layouts.
        ("version", ctypes.c_uint64),
        # Cycle of the controller, from 1.
        ("cycle", ctypes.c_uint64),
        # Cycle of the reading it was computed from; 0 when there was none.
        ("reading_cycle", ctypes.c_uint64),
        # Desired positions d₁ d₂ d₃ l₁ l₂ l₃, m.
        ("target_m", ctypes.c_double * 6),
        # Forces that the drives add to those of their position control, positive towards increasing position, N; 0 without feed-forward.
        ("force_offset_n", ctypes.c_double * 6),
        # Requested drive state, a DriveRequest.
        ("request", ctypes.c_uint32),
        # State of the controller, a ControllerState.
        ("controller_state", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name() -> str:
        return "masseter/Command/58429641477964f3"


_check(Command, 144, [0, 8, 16, 24, 32, 40, 88, 136, 140])


class State(ctypes.Structure):
    """The controller's state and its estimate, once a cycle. All float64 fields but `motion_time_s` have 31 significant bits."""

    TOPIC = "state"
    _fields_ = [
        # Number of this message on its topic, from 1.
        ("seq", ctypes.c_uint64),
        # When it was published, ns.
        ("published_ns", ctypes.c_uint64),
        # Version of the sender's layouts.
        ("version", ctypes.c_uint64),
        # Cycle of the controller, from 1.
        ("cycle", ctypes.c_uint64),
        # Cycle of the reading it was computed from; 0 when there was none.
        ("reading_cycle", ctypes.c_uint64),
        # When that reading was sampled, ns.
        ("sampled_ns", ctypes.c_uint64),
        # Deadline of the cycle, ns.
        ("due_ns", ctypes.c_uint64),
        # When the loop woke for it, ns.
        ("woke_ns", ctypes.c_uint64),
        # When the reading had been received, ns.
        ("received_ns", ctypes.c_uint64),
        # When the forward kinematics was done, ns.
        ("solved_ns", ctypes.c_uint64),
        # When the command was ready to be published, ns.
        ("commanded_ns", ctypes.c_uint64),
        # Deadlines skipped since start because an earlier cycle overran.
        ("skipped_cycles", ctypes.c_uint64),
        # Time for which the machine stalled while the process waited, since start, ns.
        ("stalled_ns", ctypes.c_uint64),
        # Time that the process spun, without the stalls, since start, ns.
        ("spun_ns", ctypes.c_uint64),
        # Time that the process worked, since start, ns.
        ("worked_ns", ctypes.c_uint64),
        # Part of it in stretches too long for the work alone, ns.
        ("overlong_ns", ctypes.c_uint64),
        # How far the motion had come at the sample, s: of a recorded one, the time since the recording's first row. It passes more slowly while the motion gathers speed and while it comes to rest. Negative before the motion begins.
        ("motion_time_s", ctypes.c_double),
        # Desired pose at the sample: position in the base frame, m.
        ("desired_position_m", ctypes.c_double * 3),
        # Desired pose at the sample: unit quaternion w x y z.
        ("desired_quaternion_wxyz", ctypes.c_double * 4),
        # Estimated pose by forward kinematics: position in the base frame, m.
        ("estimated_position_m", ctypes.c_double * 3),
        # Estimated pose by forward kinematics: unit quaternion w x y z.
        ("estimated_quaternion_wxyz", ctypes.c_double * 4),
        # θ₁ θ₂ θ₃, rad.
        ("leg_angle_rad", ctypes.c_double * 3),
        # Largest difference of a platform side from its length, m.
        ("residual_m", ctypes.c_double),
        # Condition number of the actuators' Jacobian, angular columns scaled by the platform's side A₁A₂. The motion controller computes one every ten cycles and repeats it; 0 where none is computed.
        ("condition", ctypes.c_double),
        # Iterations of the forward kinematics.
        ("iterations", ctypes.c_uint32),
        # State of the controller, a ControllerState.
        ("controller_state", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name() -> str:
        return "masseter/State/1880bb659a4ccdc7"


_check(State, 296, [0, 8, 16, 24, 32, 40, 48, 56, 64, 72, 80, 88, 96, 104, 112, 120, 128, 136, 160, 192, 216, 248, 272, 280, 288, 292])


class Event(ctypes.Structure):
    """A single occurrence: a change of state, a fault, an alarm."""

    TOPIC = "event"
    _fields_ = [
        # Number of this message on its topic, from 1.
        ("seq", ctypes.c_uint64),
        # When it was published, ns.
        ("published_ns", ctypes.c_uint64),
        # Version of the sender's layouts.
        ("version", ctypes.c_uint64),
        # When, ns.
        ("time_ns", ctypes.c_uint64),
        # Cycle of the process that reports it.
        ("cycle", ctypes.c_uint64),
        # Reporter, a Source.
        ("source", ctypes.c_uint32),
        # Kind, an EventKind.
        ("kind", ctypes.c_uint32),
        # Cause, a Cause.
        ("cause", ctypes.c_uint32),
        # Axis concerned, from 0; NO_AXIS when none is.
        ("axis", ctypes.c_uint32),
        # Object dictionary entry concerned, index · 256 + sub-index, or a COB-ID; of the controller a NoPose; 0 when there is none.
        ("object", ctypes.c_uint32),
        # Node id concerned; 0 when none is.
        ("node", ctypes.c_uint16),
        # Index of the bus concerned, from 0, where node or the cause is about one.
        ("bus", ctypes.c_uint16),
        # State before, as a code of the source's state type.
        ("from", ctypes.c_uint32),
        # State after.
        ("to", ctypes.c_uint32),
        # The value that explains it, in the cause's unit.
        ("value", ctypes.c_double),
        # The limit it is held against, in the same unit.
        ("limit", ctypes.c_double),
    ]

    @staticmethod
    def type_name() -> str:
        return "masseter/Event/21ee579a9f2571a6"


_check(Event, 88, [0, 8, 16, 24, 32, 40, 44, 48, 52, 56, 60, 62, 64, 68, 72, 80])


class Truth(ctypes.Structure):
    """The true state of the mechanism, once a cycle; the controller never reads it. All float64 fields have 31 significant bits."""

    TOPIC = "truth"
    _fields_ = [
        # Number of this message on its topic, from 1.
        ("seq", ctypes.c_uint64),
        # When it was published, ns.
        ("published_ns", ctypes.c_uint64),
        # Version of the sender's layouts.
        ("version", ctypes.c_uint64),
        # Cycle of the plant, from 1.
        ("cycle", ctypes.c_uint64),
        # The instant it describes: that of the reading's sample, ns.
        ("sampled_ns", ctypes.c_uint64),
        # Platform origin in the base frame, m.
        ("position_m", ctypes.c_double * 3),
        # Platform orientation, unit quaternion w x y z.
        ("quaternion_wxyz", ctypes.c_double * 4),
        # Joint positions d₁ d₂ d₃ l₁ l₂ l₃, m.
        ("joint_m", ctypes.c_double * 6),
        # Joint velocities, m/s.
        ("joint_m_s", ctypes.c_double * 6),
        # Actuator forces, N: means over the cycle before the sample.
        ("force_n", ctypes.c_double * 6),
        # Actuator forces at the sample, N.
        ("force_sample_n", ctypes.c_double * 6),
        # Vertical force of food and upper teeth on the lower jaw, positive downwards, N: mean over the cycle before the sample.
        ("bite_force_n", ctypes.c_double),
        # Bite force at the sample, N.
        ("bite_force_sample_n", ctypes.c_double),
        # Work on the bodies since the start, J: of the drives, of friction in slides, legs, and hinges with balls, of teeth and food, of everything else (pushes, payload, end stops).
        ("work_j", ctypes.c_double * 6),
        # Energy of the bodies' motion, J.
        ("kinetic_j", ctypes.c_double),
        # Energy of their height above that of the start, J.
        ("potential_j", ctypes.c_double),
    ]

    @staticmethod
    def type_name() -> str:
        return "masseter/Truth/aaa6b46fe5150f32"


_check(Truth, 368, [0, 8, 16, 24, 32, 40, 64, 96, 144, 192, 240, 288, 296, 304, 352, 360])


class Contact(ctypes.Structure):
    """The forces between the jaws, once a cycle; without teeth and food, there is no such message. The controller never reads it. All float64 fields have 31 significant bits."""

    TOPIC = "contact"
    _fields_ = [
        # Number of this message on its topic, from 1.
        ("seq", ctypes.c_uint64),
        # When it was published, ns.
        ("published_ns", ctypes.c_uint64),
        # Version of the sender's layouts.
        ("version", ctypes.c_uint64),
        # Cycle of the plant, from 1.
        ("cycle", ctypes.c_uint64),
        # End of the time that it describes: the instant of the reading's sample, ns.
        ("sampled_ns", ctypes.c_uint64),
        # FDI numbers of the lower teeth, 0 where there are no more.
        ("tooth", ctypes.c_uint32 * 16),
        # Force of antagonist and food on each lower tooth, x y z in base axes, mean over the cycle, N.
        ("force_n", ctypes.c_double * 48),
        # Where the force acts on the tooth, x y z in the platform frame, m.
        ("place_m", ctypes.c_double * 48),
    ]

    @staticmethod
    def type_name() -> str:
        return "masseter/Contact/aa4988fe35a2196c"


_check(Contact, 872, [0, 8, 16, 24, 32, 40, 104, 488])
