"""Runs of the rig, started from Python."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, Literal

from masseter import _native, chart
from masseter.controller import Law, Parameter, Signal, check_declaration, control
from masseter.recording import Run, load, read_summary

#: Time for a rig to stop safely and judge its run, s.
_END_S = 5.0
#: Interval of looking whether the rig takes the controller, s.
_POLL_S = 0.01


@dataclass(frozen=True, repr=False)
class Result:
    """How a run ended. Its text is the verdict and each check that did not pass."""

    #: PASS, FAIL, UNTESTED, SAFE STOP and so on, as on the screen.
    verdict: str
    exit_code: int
    folder: Path
    #: The content of summary.json.
    summary: dict[str, Any]
    #: What the rig wrote to standard error.
    messages: str
    #: Removes a folder that nobody asked to keep, with the last reference to the result.
    _temporary: "tempfile.TemporaryDirectory[str] | None" = field(default=None, compare=False)

    def __str__(self) -> str:
        failed = [f"  {word}: {name}: {finding}" for word, name, finding in self._not_passed()]
        return "\n".join([f"{self.verdict}: {self.summary['verdict']['reason']}", *failed])

    def __repr__(self) -> str:
        return f"<masseter.Result {self.verdict}, {self.folder}>"

    def _repr_html_(self) -> str:
        return chart.page(self.verdict, self.summary["verdict"]["reason"], self._not_passed(), self.load())

    def _not_passed(self) -> list[tuple[str, str, str]]:
        checks = self.summary["verdict"].get("checks", [])
        words = {"failed": "FAIL", "untested": "UNTESTED"}
        return [(words[at["result"]], at["name"], at["finding"]) for at in checks if at["result"] in words]

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
    *,
    set: Mapping[str, Any] | None = None,
    seed: int | None = None,
    duration: float | None = None,
    keep: str | PathLike[str] | None = None,
    arguments: Sequence[str] = (),
    signals: Sequence[Signal] = (),
    parameters: Sequence[Parameter] = (),
    own_motion: bool = False,
) -> Result:
    """Plays a scenario and judges it.

    controller: a pose law in Python, "motion" or "hold", or the path of a program. A pose law runs in lockstep under the clock
    "virtual" too: the bytes are the same. In simulated clocks the law runs on the caller's thread, where breakpoints act; a
    debugger that is there before the run lifts the rig's limit on the wait for an answer.

    set: values of the scenario by their keys, such as {"motion.amplitude_mm": 6}. seed, duration (s): as the options of
    'masseter run'. keep: the run folder, which must not exist; by default the folder is removed with the result. arguments: more
    of 'masseter run'. signals, parameters, own_motion: what a pose law declares ('control').

    Raises MasseterError with the message of the rig where no run was made; what the law raises is raised again. The command is
    that of the variable MASSETER, or masseter on the PATH.
    """
    check_declaration(signals, parameters)
    temporary = tempfile.TemporaryDirectory(prefix="masseter-") if keep is None else None
    folder = Path(temporary.name) / "run" if temporary else Path(keep or "")
    law = controller if callable(controller) else None
    name = f"python-{uuid.uuid4().hex[:12]}"
    chosen = ["external", "--name", name] if law else [os.fspath(controller)]  # type: ignore[arg-type]
    command = [_command(), "run", *([os.fspath(scenario)] if scenario is not None else [])]
    command += ["--clock", "lockstep" if law and clock == "virtual" else clock]
    command += ["--out", str(folder), "--quiet", "--controller", *chosen]
    command += ["--seed", str(seed)] if seed is not None else []
    command += ["--duration", str(duration)] if duration is not None else []
    for key, value in (set or {}).items():
        command += ["--set", f"{key}={value if isinstance(value, str) else json.dumps(value)}"]
    command += ["--patience", "none"] if law and clock != "rt" and _is_debugged() else []
    command += arguments
    # A terminal's Ctrl-C is for this process, which then asks the rig to end.
    rig = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    output = _Output(rig)
    try:
        if law:
            _control(rig, lambda: control(law, name, signals, parameters, own_motion=own_motion))
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
    return Result(summary["verdict"]["word"], rig.returncode, folder, summary, output.error, temporary)


def _is_debugged() -> bool:
    # A debugger has a function of tracing, or from Python 3.12 on a tool of monitoring.
    monitoring = getattr(sys, "monitoring", None)
    return sys.gettrace() is not None or (monitoring is not None and monitoring.get_tool(monitoring.DEBUGGER_ID) is not None)


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
