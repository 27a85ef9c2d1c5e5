"""Runs of the rig, started from Python."""

import os
import shutil
import subprocess
import tempfile
import threading
import time
import uuid
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Literal

from masseter import _native
from masseter.controller import Law, Parameter, Signal, check_declaration, control
from masseter.recording import Run, load, read_summary

#: Time for a rig to stop safely and judge its run, s.
_END_S = 5.0
#: Interval of looking whether the rig takes the controller, s.
_POLL_S = 0.01


@dataclass(frozen=True)
class Result:
    """How a run ended."""

    #: PASS, FAIL, UNTESTED, SAFE STOP and so on, as on the screen.
    verdict: str
    exit_code: int
    folder: Path
    #: The content of summary.json.
    summary: dict[str, Any]
    #: What the rig wrote to standard error.
    messages: str

    @property
    def passed(self) -> bool:
        """Whether every check has passed."""
        return self.exit_code == 0

    @property
    def figures(self) -> dict[str, Any]:
        """Every figure of the run."""
        figures: dict[str, Any] = self.summary["figures"]
        return figures

    @property
    def warnings(self) -> list[str]:
        """What the plan of the run warns of; no warning decides anything."""
        warnings: list[str] = self.summary["verdict"].get("warnings", [])
        return warnings

    def load(self) -> Run:
        """The messages of the run."""
        return load(self.folder)


def run(
    scenario: str | PathLike[str] | None = None,
    controller: Law | str | PathLike[str] = "motion",
    clock: Literal["virtual", "lockstep", "rt"] = "lockstep",
    out: str | PathLike[str] | None = None,
    arguments: Sequence[str] = (),
    signals: Sequence[Signal] = (),
    parameters: Sequence[Parameter] = (),
) -> Result:
    """Plays a scenario and judges it.

    controller: a pose law in Python, "motion" or "hold", or the path of a program. A pose law runs in lockstep under the clock
    "virtual" too: the bytes are the same. out: the run folder, which must not exist; a temporary folder by default. arguments:
    more of 'masseter run', such as ["--duration", "2"]. signals, parameters: what a pose law declares.

    Raises MasseterError with the message of the rig where no run was made; what the law raises is raised again. The command is
    that of the variable MASSETER, or masseter on the PATH.
    """
    check_declaration(signals, parameters)
    folder = Path(out) if out is not None else Path(tempfile.mkdtemp(prefix="masseter-")) / "run"
    law = controller if callable(controller) else None
    name = f"python-{uuid.uuid4().hex[:12]}"
    chosen = ["external", "--name", name] if law else [os.fspath(controller)]  # type: ignore[arg-type]
    command = [_command(), "run", *([os.fspath(scenario)] if scenario is not None else [])]
    command += ["--clock", clock, "--out", str(folder), "--quiet", "--controller", *chosen, *arguments]
    # A terminal's Ctrl-C is for this process, which then asks the rig to end.
    rig = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    output = _Output(rig)
    try:
        if law:
            _control(rig, lambda: control(law, name, signals, parameters))
        output.join()
    except BaseException as error:
        # After an exception of the law the rig ends by itself; a rig without a controller would wait for ever.
        output.join(0.0 if isinstance(error, KeyboardInterrupt) else _END_S)
        rig.terminate()
        raise
    finally:
        output.join()
    summary = read_summary(folder)
    if not summary:
        raise _native.MasseterError(output.error.strip() or f"the rig ended with exit code {rig.returncode}")
    return Result(summary["verdict"]["word"], rig.returncode, folder, summary, output.error)


def _command() -> str:
    command = os.environ.get("MASSETER") or shutil.which("masseter")
    if command is None:
        raise _native.MasseterError(
            "the command masseter is not on the PATH: install it (cargo install --path .), or set MASSETER to it"
        )
    return command


class _Output(threading.Thread):
    """Reads both streams while the controller works, so that the rig never waits for a reader."""

    def __init__(self, rig: "subprocess.Popen[str]") -> None:
        super().__init__(daemon=True)
        self._rig = rig
        self.error = ""
        self.start()

    def run(self) -> None:
        _, self.error = self._rig.communicate()


def _control(rig: "subprocess.Popen[str]", control: Callable[[], bool]) -> None:
    """Controls the rig once it takes a controller; returns if it ends before."""
    while rig.poll() is None:
        try:
            control()
            return
        except _native.NoRigError:
            time.sleep(_POLL_S)
