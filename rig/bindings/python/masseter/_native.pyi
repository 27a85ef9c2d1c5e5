from os import PathLike

from collections.abc import Callable, Mapping, Sequence

from masseter.env import EnvArguments

_Signal = tuple[str, str, str]
_Parameter = tuple[str, str, str, float, tuple[float, float]]

__version__: str

class MasseterError(Exception): ...
class NoRigError(MasseterError): ...

class Mechanism:
    def __new__(cls, scenario: str | PathLike[str] | None = None) -> Mechanism: ...
    def forward(self, positions: bytes) -> bytes: ...
    def inverse(self, poses: bytes) -> bytes: ...

class Pose:
    """A pose of the platform: position in the base frame, m, and unit quaternion w x y z."""

    def __new__(
        cls,
        position_m: tuple[float, float, float] | list[float],
        quaternion_wxyz: tuple[float, float, float, float] | list[float],
    ) -> Pose: ...
    @property
    def position_m(self) -> tuple[float, float, float]: ...
    @property
    def quaternion_wxyz(self) -> tuple[float, float, float, float]: ...

class ExternalForce:
    """The estimated external force on the platform, in base axes."""

    @property
    def force_n(self) -> list[float]:
        """Force, N."""
    @property
    def moment_nm(self) -> list[float]:
        """Moment about the platform's origin, N m."""
    @property
    def uncertainty_n(self) -> float:
        """Uncertainty of the bite force, two standard deviations, N."""

class Motion:
    """The scenario's motion, or the way to it, at a time. Twist and acceleration are differences over a period on either side."""

    @property
    def pose(self) -> Pose: ...
    @property
    def twist(self) -> list[float]:
        """Of the platform's origin, m/s, then angular, rad/s; base axes."""
    @property
    def acceleration(self) -> list[float]:
        """The same, m/s² and rad/s²."""
    @property
    def motion_time_s(self) -> float:
        """How far the motion has come, s: for State.motion_time_s. Negative on the way to it."""

class Times:
    """The times of a scenario that a controller of the drives keeps to."""

    @property
    def period_s(self) -> float:
        """From one cycle to the next, s."""
    @property
    def lead_s(self) -> float:
        """From a sample until the drives reach the targets that answer it, s."""
    @property
    def ease_s(self) -> float:
        """Of the way to the first pose, s."""
    @property
    def duration_s(self) -> float:
        """Of the motion, s."""
    @property
    def stop_ramp_s(self) -> float:
        """From full speed to rest, at a stop, s."""
    @property
    def hold_s(self) -> float:
        """At rest after the motion, s."""
    @property
    def silence_s(self) -> float:
        """Longest time without a complete reading, s."""

class RobotModel:
    """The robot of a scenario file, or of the default scenario: times, motion, kinematics, inverse dynamics.

    Six numbers are those of the axes d1 d2 d3 l1 l2 l3, or a twist: velocity of the platform's origin, m/s, then angular
    velocity, rad/s, in base axes. What has no answer raises MasseterError.
    """

    def __new__(cls, scenario: str | PathLike[str] | None = None) -> RobotModel: ...
    @property
    def times(self) -> Times: ...
    def motion(self, time_s: float) -> Motion:
        """The scenario's motion at a time after its beginning, s; at rest before 0 and after its duration."""
    def easing(self, from_: Pose, time_s: float) -> Motion:
        """The way from a pose to the motion's first pose at a time, s: from rest to rest within times.ease_s."""
    def forward_kinematics(self, position_m: Sequence[float]) -> Pose:
        """The pose of six positions, m. The pose before saves time, and settles an ambiguous input."""
    def inverse_kinematics(self, pose: Pose) -> list[float]:
        """The positions at a pose, m, also beyond the strokes."""
    def jacobian(self, pose: Pose) -> list[list[float]]:
        """The rates of the axes by the twist: a row for each axis; m/s per m/s, then m/s per rad/s."""
    def inverse_dynamics(
        self, pose: Pose, twist: Sequence[float], acceleration: Sequence[float], wrench: Sequence[float] = ...
    ) -> list[float]:
        """The forces of the axes, N, for a twist and an acceleration against a wrench on the platform.

        The wrench is in N, then N m about the platform's origin, base axes. Masses and friction are those that the
        scenario's controller assumes.
        """

class Demand:
    """What a pose law needs of a cycle."""

    @property
    def cycle(self) -> int:
        """Number of the cycle, from 1; skipped cycles leave a gap."""
    @property
    def period_s(self) -> float:
        """Time from one cycle to the next, s."""
    @property
    def motion_time_s(self) -> float:
        """How far the motion has come at the sample, s; negative before it begins."""
    @property
    def controller_state(self) -> int:
        """messages.ControllerState: EASING, RUNNING or HOLDING."""
    @property
    def desired(self) -> Pose:
        """The desired pose at the sample."""
    @property
    def estimated(self) -> Pose | None:
        """The pose at the sample by forward kinematics; None in a cycle without a fresh, complete reading."""
    @property
    def ahead(self) -> Pose:
        """The desired pose when this cycle's command is reached."""
    @property
    def desired_twist(self) -> list[float]:
        """The desired twist at the sample, the mean of the period around it: m/s, then rad/s, base axes."""
    @property
    def position_m(self) -> list[float] | None:
        """Measured positions d1 d2 d3 l1 l2 l3, m; None without an estimate."""
    @property
    def force_n(self) -> list[float] | None:
        """Forces of the drives since the sample before, N; None without an estimate."""
    @property
    def load_cell_n(self) -> float | None:
        """Bite force that the load cell showed last, N; None where the scenario has no load cell."""
    @property
    def external(self) -> ExternalForce | None:
        """The external force on the platform; None unless the scenario has it estimated, and before the first estimate."""
    @property
    def parameters(self) -> Mapping[str, float]:
        """The parameters in this cycle, by their names. The law cannot change them."""
    @property
    def signals(self) -> dict[str, float]:
        """The declared signals, for the law to fill; a value stays until it is replaced."""

class Session:
    def __new__(
        cls, rig: str | None, signals: list[_Signal], parameters: list[_Parameter], has_own_motion: bool
    ) -> Session: ...
    def start(self) -> None: ...
    @property
    def period_s(self) -> float: ...
    def scenario(self) -> str: ...
    def robot(self) -> RobotModel: ...
    @property
    def is_stop_requested(self) -> bool: ...
    def wait(self, timeout_s: float | None) -> tuple[int, int, bytes | None] | None: ...
    def parameters(self) -> list[float]: ...
    def publish(self, command: bytes, state: bytes, signals: list[float]) -> None: ...
    def publish_event(self, event: bytes) -> None: ...
    def finish(self, is_safe_stop: bool) -> None: ...
    def fail(self, reason: str) -> None: ...

def control(
    law: Callable[[Demand], Pose],
    rig: str | None,
    signals: list[_Signal],
    parameters: list[_Parameter],
    prepare: Callable[[float, dict[str, float]], None] | None,
    has_own_motion: bool,
) -> bool: ...
def check_declaration(signals: list[_Signal], parameters: list[_Parameter]) -> None: ...
def read_run(path: str | PathLike[str]) -> tuple[str | PathLike[str], dict[str, bytes], bool]: ...

class Snapshot:
    """An instant of an episode of masseter.Env."""

class Env:
    def __new__(cls, arguments: EnvArguments) -> Env: ...
    @property
    def bounds(self) -> tuple[list[float], list[float]]: ...
    @property
    def period_s(self) -> float: ...
    @property
    def seed(self) -> int: ...
    @property
    def over(self) -> str | None: ...
    def reset(self, seed: int | None, set: list[str]) -> bytes: ...
    def step(self, action: bytes) -> tuple[bytes, float, bool, bool, list[str]]: ...
    def observed(self) -> bytes: ...
    def demand(self) -> Demand | None: ...
    def snapshot(self) -> Snapshot: ...
    def restore(self, snapshot: Snapshot) -> None: ...

class VectorEnv:
    def __new__(cls, arguments: EnvArguments, number: int, threads: int) -> VectorEnv: ...
    def reset(self, seed: int) -> bytes: ...
    def step(
        self, actions: bytes, numbers: int
    ) -> tuple[bytes, bytes, list[bool], list[bool], list[list[str]]]: ...
