"""A controller in Python, in a run that somebody else has started."""

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import TracebackType
from typing import Any, NamedTuple, Self

from masseter import _native
from masseter.messages import Command, Event, Reading, State

Law = Callable[[_native.Demand], _native.Pose]


@dataclass(frozen=True)
class Signal:
    """A number that a controller publishes in each cycle: recorded, and drawn in the report."""

    #: In lower case, such as "grip_force".
    name: str
    #: Such as "mm"; empty for none.
    unit: str = ""
    about: str = ""


@dataclass(frozen=True)
class Parameter:
    """A number that the user of a controller sets: in the scenario, with --set, or while the controller runs."""

    #: In lower case, such as "gain".
    name: str
    #: At the start, where the scenario does not give another one.
    value: float
    #: Smallest and largest value.
    range: tuple[float, float]
    unit: str = ""
    about: str = ""


def _signals(signals: Sequence[Signal]) -> list[tuple[str, str, str]]:
    return [(signal.name, signal.unit, signal.about) for signal in signals]


def _parameters(parameters: Sequence[Parameter]) -> list[tuple[str, str, str, float, tuple[float, float]]]:
    return [(known.name, known.unit, known.about, known.value, known.range) for known in parameters]


def check_declaration(signals: Sequence[Signal], parameters: Sequence[Parameter]) -> None:
    """Raises MasseterError for names that no recording can have, and values beyond their range."""
    _native.check_declaration(_signals(signals), _parameters(parameters))


def control(
    law: Law,
    rig: str | None = None,
    signals: Sequence[Signal] = (),
    parameters: Sequence[Parameter] = (),
    prepare: Callable[[float, dict[str, float]], None] | None = None,
    *,
    own_motion: bool = False,
) -> bool:
    """Attaches to a rig and controls it with a pose law until the motion is over.

    The rig: the named one, or that of MASSETER_RIG, or the only one that takes a controller. Returns True when the motion was
    finished, False after a safe stop. An exception of the law stops the rig safely, and is raised again. The law reads
    demand.parameters and fills demand.signals, both by their names.

    prepare: called once the rig has taken the controller, before the run starts, with the period (s) and the values that the
    scenario gives parameters. Slow work belongs there.

    own_motion: the law leads the jaw off the scenario's motion on purpose. A requirement must then judge the true jaw.
    """
    return _native.control(law, rig, _signals(signals), _parameters(parameters), prepare, own_motion)


class Cycle(NamedTuple):
    """A cycle that has begun."""

    #: From 1; skipped cycles leave a gap.
    number: int
    #: When the reading was received, ns; simulated time in lockstep.
    now_ns: int
    #: None where no new reading came in time.
    reading: Reading | None


class Session:
    """The part of a controller of the drives in a run. It belongs to the thread that made it; other threads run while it
    waits.

        with masseter.Session() as session:
            while not session.is_stop_requested:
                cycle = session.wait()
                ...
                session.publish(command, state)
            session.finish()

    An exception within the block ends the run with its message. The rig judges the jaw by the scenario's motion; own_motion
    declares another one, of which the desired poses of the state tell.
    """

    def __init__(
        self,
        rig: str | None = None,
        signals: Sequence[Signal] = (),
        parameters: Sequence[Parameter] = (),
        *,
        own_motion: bool = False,
    ) -> None:
        self._native = _native.Session(rig, _signals(signals), _parameters(parameters), own_motion)
        #: Motion, kinematics and dynamics of the scenario.
        self.robot = self._native.robot()
        self._is_over = False
        self._parameters = [parameter.name for parameter in parameters]
        #: The signals that go out with each command; a value stays until it is replaced.
        self.signals = {signal.name: 0.0 for signal in signals}
        self._signals = list(self.signals)

    def __enter__(self) -> Self:
        self._native.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not self._is_over:
            self.fail(f"{kind.__name__}: {error}" if kind else "the session was left before its end")

    @property
    def period_s(self) -> float:
        """Time from one cycle to the next, s."""
        return self._native.period_s

    @cached_property
    def scenario(self) -> dict[str, Any]:
        """The whole scenario, every default filled in. The first access takes milliseconds."""
        return tomllib.loads(self._native.scenario())

    @property
    def is_stop_requested(self) -> bool:
        """Whether the rig wants an orderly end: bring the motion to rest, switch the drives off, then finish."""
        return self._native.is_stop_requested

    @property
    def parameters(self) -> dict[str, float]:
        """The parameters in this cycle."""
        return dict(zip(self._parameters, self._native.parameters(), strict=True))

    def wait(self, timeout_s: float | None = None) -> Cycle | None:
        """Ends the current cycle and waits for the next; None if it has not begun within the time.

        Other threads run meanwhile, except with a time of 0, which only looks.
        """
        begun = self._native.wait(timeout_s)
        if begun is None:
            return None
        number, now_ns, reading = begun
        return Cycle(number, now_ns, None if reading is None else Reading.from_buffer_copy(reading))

    def publish(self, command: Command, state: State) -> None:
        """Publishes this cycle's command, what the controller made of the reading, and the signals. Once a cycle.

        The command names the cycle that wait returned. Any other raises MasseterError, and is not sent.
        """
        values = [self.signals[name] for name in self._signals]
        if len(self.signals) > len(values):
            raise _native.MasseterError(f"signals that are not declared: {sorted(set(self.signals) - set(self._signals))}")
        self._native.publish(bytes(command), bytes(state), values)

    def publish_event(self, event: Event) -> None:
        """Publishes an event."""
        self._native.publish_event(bytes(event))

    def finish(self, is_safe_stop: bool = False) -> None:
        """Ends the work in order; after a fault, with is_safe_stop."""
        self._is_over = True
        self._native.finish(is_safe_stop)

    def fail(self, reason: str) -> None:
        """Ends the work because the program cannot go on."""
        self._is_over = True
        self._native.fail(reason)
