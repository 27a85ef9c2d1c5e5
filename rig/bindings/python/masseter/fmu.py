"""An FMU (FMI 2.0 or 3.0, co-simulation) as controller of the rig: `masseter run --controller fmu:law.fmu --map map.toml`.

The rig starts this module as a program: python3 -m masseter.fmu law.fmu [map.toml]. It needs FMPy: pip install "masseter[fmi]".

The first step of the FMU begins at the time 0, in the first cycle in which the rig asks for a pose. In each cycle the inputs are
those of the sample, and the FMU steps from the sample to the next one, where the drives take the target. The outputs are the
pose of the same cycle.
"""

import ctypes
import faulthandler
import math
import subprocess
import sys
import tempfile
import zipfile
from collections import deque
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from masseter import _native
from masseter.controller import control
from masseter.fmu_map import FLOATS, PARTS, QUATERNION, ROTATION_VECTOR, SIGNAL, FmuError, Link, Variable, read_map, variables

USAGE = "usage: python3 -m masseter.fmu LAW.fmu [MAP.toml]   (as: masseter run --controller fmu:LAW.fmu --map MAP.toml)"
INSTALL = 'an FMU needs FMPy, which this Python does not have: pip install "masseter[fmi]"'
#: Statuses of FMI.
WARNING, DISCARD = 1, 2
STATUSES = ["ok", "warning", "discard", "error", "fatal", "pending"]
#: Messages of the FMU that are kept for an error.
KEPT_MESSAGES = 20
#: A difference of steps and cycles, as a share, that is rounding.
NANOSECOND_S = 1e-9
#: A quaternion of another length is no rotation.
LENGTH_ERROR = 1e-3


class Fmu:
    """An FMU as pose law."""

    def __init__(self, path: Path, map_path: Path) -> None:
        self._path = path
        self._description = _read_description(path)
        self._map = read_map(map_path, variables(self._description))
        self._log: deque[str] = deque(maxlen=KEPT_MESSAGES)
        self._instance: Any = None
        self._steps_per_cycle = 1
        #: Steps a second.
        self._rate = 1.0
        self._steps = 0
        self._first_cycle: int | None = None
        self._given = {parameter.name: parameter.value for parameter in self._map.parameters}
        self._estimated: _native.Pose | None = None

    def play(self, folder: Path) -> None:
        """Controls a rig until the motion is over, with the FMU unpacked into this folder."""
        try:
            control(
                self._law,
                signals=self._map.signals,
                parameters=self._map.parameters,
                prepare=lambda period_s, values: self._prepare(folder, period_s, values),
            )
            self._end()
        finally:
            if any(message.startswith("warning") for message in self._log):
                _say("\n".join(["warnings of the FMU:", *self._log]))

    def _prepare(self, folder: Path, period_s: float, values: dict[str, float]) -> None:
        """Loads and initialises the FMU."""
        import fmpy

        self._divide(period_s)
        self._given |= {name: value for name, value in values.items() if name in self._given}
        try:
            fmpy.extract(self._path, folder)
            self._instance = fmpy.instantiate_fmu(
                str(folder), self._description, fmi_type="CoSimulation", debug_logging=True, logger=self._take_message
            )
        except Exception as error:
            raise self._failed(f"it cannot be loaded: {error}") from error
        is_fmi2 = self._description.fmiVersion == "2.0"
        if is_fmi2:
            self._call("setupExperiment", startTime=0.0)
        for variable, value in self._map.constants:
            self._set([variable], [value])
        for variable, parameter in self._map.from_scenario:
            self._set([variable], [self._given[parameter.name]])
        self._call("enterInitializationMode", **({} if is_fmi2 else {"startTime": 0.0}))
        self._call("exitInitializationMode")

    def _divide(self, period_s: float) -> None:
        fixed = self._description.coSimulation.fixedInternalStepSize
        step_s = self._map.step_s or fixed or period_s
        steps = round(period_s / step_s)
        if steps < 1 or abs(steps * step_s - period_s) > NANOSECOND_S:
            nearest = period_s / max(1, steps)
            raise FmuError(
                f"a step of {1e3 * step_s:g} ms does not divide the cycle of {1e3 * period_s:g} ms: "
                f"set step_ms = {1e3 * nearest:.12g} in the map, or rate_hz in the scenario"
            )
        if fixed and round(step_s / fixed, 6) % 1:
            raise FmuError(f"step_ms = {1e3 * step_s:g}: the FMU steps by {1e3 * fixed:g} ms: give a multiple of it")
        self._steps_per_cycle = steps
        self._rate = steps * round(1 / period_s)

    def _law(self, demand: _native.Demand) -> _native.Pose:
        if self._first_cycle is None:
            self._first_cycle = demand.cycle
        self._estimated = demand.estimated or self._estimated or demand.desired
        due = (demand.cycle - self._first_cycle) * self._steps_per_cycle
        # Cycles that were skipped have the inputs before them.
        self._step(due - self._steps)
        self._take_parameters(demand)
        self._give(demand)
        self._step(self._steps_per_cycle)
        return self._pose(demand)

    def _step(self, steps: int) -> None:
        for _ in range(steps):
            # The quotient is the nearest number to the decimal time, so that events of the FMU meet their cycle.
            result = self._call("doStep", self._steps / self._rate, 1 / self._rate)
            self._steps += 1
            if result is not None and result[1]:
                raise self._failed(f"it asked for the end of the simulation at {self._now()}")
            if result is not None and result[2]:
                raise self._failed(f"it ended a step early at {self._now()}, which the rig cannot wait for")

    def _take_parameters(self, demand: _native.Demand) -> None:
        for variable, parameter in self._map.from_scenario:
            value = demand.parameters[parameter.name]
            if value == self._given[parameter.name]:
                continue
            if not variable.may_change:
                raise self._failed(f"'{variable.name}' is {variable.variability}: set '{parameter.name}' before the run")
            self._given[parameter.name] = value
            self._set([variable], [value])

    def _give(self, demand: _native.Demand) -> None:
        given = {
            "cycle": demand.cycle,
            "state": demand.controller_state,
            "estimated.valid": demand.estimated is not None,
            "period": demand.period_s,
            "motion.time": demand.motion_time_s,
        }
        poses = {"desired": demand.desired, "estimated": self._estimated, "ahead": demand.ahead}
        for name, pose in poses.items():
            if pose is not None and any(link.value.startswith(name) for link in self._map.inputs):
                given |= {f"{name}.{part}": value for part, value in _parts(pose).items()}
        for links in _by_type(self._map.inputs):
            self._set([link.variable for link in links], [given[link.value] * link.per_si for link in links])

    def _pose(self, demand: _native.Demand) -> _native.Pose:
        parts = _parts(demand.ahead)
        for links in _by_type(self._map.outputs):
            values = self._call(f"get{links[0].variable.type}", [link.variable.reference for link in links])
            for link, value in zip(links, values, strict=True):
                if link.value.startswith(SIGNAL):
                    demand.signals[link.value.removeprefix(SIGNAL)] = float(value)
                elif not math.isfinite(value):
                    raise self._failed(f"its output '{link.variable.name}' is {value} at {self._now()}")
                else:
                    parts[link.value.removeprefix("pose.")] = value / link.per_si
        position = (parts["x"], parts["y"], parts["z"])
        if any(link.value == "pose.rx" for link in self._map.outputs):
            return _native.Pose(position, _quaternion([parts[part.name] for part in ROTATION_VECTOR]))
        w, x, y, z = (parts[part.name] for part in QUATERNION)
        length = math.hypot(w, x, y, z)
        if abs(length - 1) > LENGTH_ERROR:
            raise self._failed(f"its quaternion has the length {length:g} at {self._now()}: give one of length 1")
        return _native.Pose(position, (w, x, y, z))

    def _set(self, of: list[Variable], values: list[Any]) -> None:
        type_ = of[0].type
        typed = values if type_ == "String" else [float(value) if type_ in FLOATS else int(value) for value in values]
        self._call(f"set{type_}", [variable.reference for variable in of], typed)

    def _call(self, function: str, *arguments: Any, **named: Any) -> Any:
        import fmpy.fmi1

        try:
            return getattr(self._instance, function)(*arguments, **named)
        except fmpy.fmi1.FMICallException as error:
            status = STATUSES[error.status] if error.status in range(len(STATUSES)) else str(error.status)
            advice = "; try a smaller step_ms in the map" if function == "doStep" and error.status == DISCARD else ""
            raise self._failed(f"{error.function} returned '{status}' at {self._now()}{advice}") from error

    def _end(self) -> None:
        if self._instance is not None:
            self._call("terminate")
            self._instance.freeInstance()

    def _now(self) -> str:
        return f"{self._steps / self._rate:g} s of the FMU"

    def _take_message(self, *arguments: Any) -> None:
        *_, status, category, message = arguments
        text = [part.decode("utf-8", "replace").strip() if part else "" for part in (category, message)]
        self._log.append(f"{STATUSES[status] if status in range(len(STATUSES)) else status}: {': '.join(filter(None, text))}")

    def _failed(self, reason: str) -> FmuError:
        log = [f"  {message}" for message in self._log]
        self._log.clear()
        return FmuError("\n".join([f"{self._path}: {reason}", *(["its log:", *log] if log else [])]))


def _by_type(links: list[Link]) -> list[list[Link]]:
    """The links whose variables one call reads or sets."""
    types = dict.fromkeys(link.variable.type for link in links)
    return [[link for link in links if link.variable.type == type_] for type_ in types]


def _parts(pose: _native.Pose) -> dict[str, float]:
    """The parts of a pose by their names, SI."""
    w, x, y, z = pose.quaternion_wxyz
    length = math.hypot(x, y, z)
    # The shorter way round.
    angle = 2 * math.atan2(math.copysign(length, w), abs(w))
    turn = [part * angle / length if length else 0.0 for part in (x, y, z)]
    values = (*pose.position_m, w, x, y, z, *turn)
    return {part.name: value for part, value in zip(PARTS, values, strict=True)}


def _quaternion(turn: list[float]) -> tuple[float, float, float, float]:
    angle = math.hypot(*turn)
    share = math.sin(angle / 2) / angle if angle else 0.5
    x, y, z = (share * part for part in turn)
    return (math.cos(angle / 2), x, y, z)


def _read_description(path: Path) -> Any:
    """The model description of an FMU that this machine can run. What FMPy objects to beside that is a warning."""
    try:
        import fmpy
        import fmpy.validation
    except ImportError as error:
        raise FmuError(f"{INSTALL} ({error})") from error
    try:
        with zipfile.ZipFile(path) as file:
            version = ElementTree.fromstring(file.read("modelDescription.xml")).get("fmiVersion", "")
    except (OSError, zipfile.BadZipFile, KeyError, ElementTree.ParseError) as error:
        raise FmuError(f"{path} is no FMU: {error}") from error
    if version != "2.0" and not version.startswith("3.0"):
        raise FmuError(f"{path} is of FMI '{version}': export it for FMI 2.0 or 3.0")
    for problem in fmpy.validation.validate_fmu(str(path)):
        _say(f"warning: {path}: {' '.join(problem.split())}")
    try:
        description = fmpy.read_model_description(str(path), validate=False)
    except Exception as error:
        raise FmuError(f"{path} has no readable model description: {error}") from error
    if description.coSimulation is None:
        raise FmuError(f"{path} is for model exchange alone: export it for co-simulation")
    _check_binary(path, description)
    return description


def _check_binary(path: Path, description: Any) -> None:
    import fmpy

    platform = fmpy.platform if description.fmiVersion == "2.0" else fmpy.platform_tuple
    binary = f"binaries/{platform}/{description.coSimulation.modelIdentifier}{fmpy.sharedLibraryExtension}"
    with zipfile.ZipFile(path) as file:
        names = file.namelist()
    if binary in names:
        return
    others = sorted({name.split("/")[1] for name in names if name.startswith("binaries/") and name.count("/") > 1})
    has_sources = any(name.startswith("sources/") and name.endswith(".c") for name in names)
    compile_it = f"; or compile its sources: fmpy compile {path}" if has_sources else ""
    raise FmuError(
        f"{path} has no {binary}, but binaries for {', '.join(others) or 'no platform'}: export it for {platform}{compile_it}"
    )


class UnpackedFolder:
    """A folder that goes with this process, however the process ends.

    A shell in a session of its own waits for that end, as the rig may kill the whole process group. It also says where an end
    came from within the FMU.
    """

    _CLEAN = """\
read -r ending
rm -rf -- "$0"
[ "$ending" = orderly ] || echo "masseter: the process of $1 was killed, or crashed in a call of the FMU, which then stands above;
masseter: for a debugger: masseter run --controller external, and then gdb --args python3 -m masseter.fmu $1 $2" >&2
"""

    def __init__(self, *files: Path) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="masseter-fmu-"))
        command = ["sh", "-c", self._CLEAN, str(self.path), *map(str, files)]
        self._cleaner = subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True)

    def close(self) -> None:
        self._cleaner.communicate(b"orderly\n")


def _say(text: str) -> None:
    print(f"masseter: {text}", file=sys.stderr, flush=True)


def main(arguments: list[str]) -> int:
    if len(arguments) not in (1, 2):
        print(USAGE, file=sys.stderr)
        return 2
    path = Path(arguments[0])
    map_path = Path(arguments[1]) if len(arguments) == 2 else path.with_suffix(".toml")
    # It names the call of the FMU that crashes.
    faulthandler.enable()
    try:
        fmu = Fmu(path, map_path)
        folder = UnpackedFolder(path, map_path)
        try:
            fmu.play(folder.path)
        finally:
            folder.close()
    except _native.MasseterError as error:
        _say(str(error))
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
