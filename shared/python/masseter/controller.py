"""A controller in Python, in a run that somebody else has started."""

from collections.abc import Callable
from types import TracebackType
from typing import NamedTuple, Self

from masseter import _native
from masseter.messages import Command, Event, Reading, State

Law = Callable[[_native.Demand], _native.Pose]


def control(law: Law, rig: str | None = None) -> bool:
    """Attaches to a rig and controls it with a pose law until the motion is over.

    The rig: the named one, or that of MASSETER_RIG, or the only one that takes a controller. Returns True when the motion was
    finished, False after a safe stop. An exception of the law stops the rig safely, and is raised again.
    """
    return _native.control(law, rig)


class Cycle(NamedTuple):
    """A cycle that has begun."""

    #: From 1; skipped cycles leave a gap.
    number: int
    #: When the reading was received, ns; simulated time in lockstep.
    now_ns: int
    #: None where no new reading came in time.
    reading: Reading | None


class Session:
    """The part of a controller of the drives in a run. It belongs to the thread that made it, and holds the interpreter
    while it waits.

        with masseter.Session() as session:
            while not session.is_stop_requested:
                cycle = session.wait()
                ...
                session.publish(command, state)
            session.finish()

    An exception within the block ends the run with its message.
    """

    def __init__(self, rig: str | None = None) -> None:
        self._native = _native.Session(rig)
        self._is_over = False

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

    @property
    def is_stop_requested(self) -> bool:
        """Whether the rig wants an orderly end: bring the motion to rest, switch the drives off, then finish."""
        return self._native.is_stop_requested

    def wait(self, timeout_s: float | None = None) -> Cycle | None:
        """Ends the current cycle and waits for the next; None if it has not begun within the time."""
        begun = self._native.wait(timeout_s)
        if begun is None:
            return None
        number, now_ns, reading = begun
        return Cycle(number, now_ns, None if reading is None else Reading.from_buffer_copy(reading))

    def publish(self, command: Command, state: State) -> None:
        """Publishes this cycle's command, and what the controller made of the reading. Once a cycle."""
        self._native.publish(bytes(command), bytes(state))

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
