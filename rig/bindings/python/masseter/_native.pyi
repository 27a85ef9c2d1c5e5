from os import PathLike

from collections.abc import Callable, Mapping

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
) -> bool: ...
def check_declaration(signals: list[_Signal], parameters: list[_Parameter]) -> None: ...
def read_run(path: str | PathLike[str]) -> tuple[str | PathLike[str], dict[str, bytes], bool]: ...

class Snapshot:
    """An instant of an episode of masseter.Env."""

class Env:
    def __new__(
        cls,
        scenario: str | PathLike[str] | None,
        set: list[str],
        action: str,
        observe: list[str],
        reward: tuple[str, float] | None,
        requirement: str | None,
        cycles_per_step: int,
    ) -> Env: ...
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
    def __new__(
        cls,
        scenario: str | PathLike[str] | None,
        set: list[str],
        action: str,
        observe: list[str],
        reward: tuple[str, float] | None,
        requirement: str | None,
        cycles_per_step: int,
        number: int,
        threads: int,
    ) -> VectorEnv: ...
    def reset(self, seed: int) -> bytes: ...
    def step(
        self, actions: bytes, numbers: int
    ) -> tuple[bytes, bytes, list[bool], list[bool], list[list[str]]]: ...
