"""The map of an FMU: which value of the rig each of its variables is, in which unit, and how it starts."""

import difflib
import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple

from masseter._native import MasseterError
from masseter.controller import Parameter, Signal


class FmuError(MasseterError):
    """An FMU cannot be the controller, or fails."""


class MapError(FmuError):
    """The map does not fit the FMU or the rig. Its text lists every problem."""


class Quantity(Enum):
    """What a value of the rig is, with the units that a map may name and how many of each are one SI unit."""

    LENGTH = {"m": 1.0, "cm": 1e2, "mm": 1e3, "um": 1e6}
    ANGLE = {"rad": 1.0, "deg": 180.0 / math.pi}
    TIME = {"s": 1.0, "ms": 1e3}
    NUMBER = {"": 1.0, "1": 1.0}
    #: An integer, or whether something holds.
    COUNT = {"": 1.0}


class Part(NamedTuple):
    """A part of a pose."""

    name: str
    quantity: Quantity


POSITION = [Part(name, Quantity.LENGTH) for name in ("x", "y", "z")]
QUATERNION = [Part(name, Quantity.NUMBER) for name in ("qw", "qx", "qy", "qz")]
#: Axis times angle.
ROTATION_VECTOR = [Part(name, Quantity.ANGLE) for name in ("rx", "ry", "rz")]
PARTS = [*POSITION, *QUATERNION, *ROTATION_VECTOR]

#: What an input may be.
GIVEN = {
    "cycle": Quantity.COUNT,
    "state": Quantity.COUNT,
    "estimated.valid": Quantity.COUNT,
    "period": Quantity.TIME,
    "motion.time": Quantity.TIME,
    **{f"{pose}.{part.name}": part.quantity for pose in ("desired", "estimated", "ahead") for part in PARTS},
}
#: What an output may be, beside signals.
TAKEN = {f"pose.{part.name}": part.quantity for part in PARTS}
SIGNAL = "signal."

FLOATS = {"Real", "Float64", "Float32"}
TEXT = "String"


@dataclass(frozen=True)
class Variable:
    """A variable of the FMU."""

    name: str
    reference: int
    #: The type as the names of FMI's functions have it, such as Real or Float64.
    type: str
    unit: str
    about: str
    causality: str
    variability: str
    is_scalar: bool

    @property
    def may_change(self) -> bool:
        """Whether it can be set while the FMU steps."""
        return self.causality == "input" or self.variability == "tunable"


def variables(description: Any) -> dict[str, Variable]:
    """The variables of a model description, as FMPy reads it."""
    integer = "Integer" if description.fmiVersion == "2.0" else "Int64"

    def variable(found: Any) -> Variable:
        declared = found.declaredType
        return Variable(
            name=found.name,
            reference=found.valueReference,
            type=integer if found.type == "Enumeration" else found.type,
            unit=found.unit or (declared.unit if declared else None) or "",
            about=found.description or "",
            causality=found.causality or "local",
            variability=found.variability or "",
            is_scalar=not found.dimensions,
        )

    return {found.name: variable(found) for found in description.modelVariables}


@dataclass(frozen=True)
class Link:
    """A variable of the FMU and its value in the rig."""

    variable: Variable
    value: str
    #: How many of the FMU's unit are one SI unit.
    per_si: float = 1.0


@dataclass(frozen=True)
class Map:
    """What a map file says, checked against the FMU."""

    #: Length of a step of the FMU; the cycle where none is given.
    step_s: float | None
    inputs: list[Link]
    #: Of the pose and of signals.
    outputs: list[Link]
    constants: list[tuple[Variable, Any]]
    #: Values that the scenario, --set or the operator gives.
    from_scenario: list[tuple[Variable, Parameter]]
    signals: list[Signal]

    @property
    def parameters(self) -> list[Parameter]:
        return [parameter for _, parameter in self.from_scenario]


def read_map(path: Path, known: Mapping[str, Variable]) -> Map:
    """Reads a map file. Raises MapError with every problem."""
    try:
        content = tomllib.loads(path.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise MapError(f"the map {path} cannot be read: {error}") from error
    reader = _Reader(known)
    read = reader.map(content)
    if reader.problems:
        raise MapError("\n".join([f"the map {path} does not fit:", *(f"  {problem}" for problem in reader.problems)]))
    return read


class _Reader:
    def __init__(self, known: Mapping[str, Variable]) -> None:
        self._known = known
        self.problems: list[str] = []

    def map(self, content: dict[str, Any]) -> Map:
        keys = ("step_ms", "inputs", "outputs", "start")
        for key in content:
            if key not in keys:
                self._unknown(f"the key '{key}'", key, keys)
        step_ms = content.get("step_ms")
        if step_ms is not None and not (_is_number(step_ms) and 0 < step_ms < math.inf):
            self._problem(f"step_ms = {step_ms!r}: give a number of milliseconds above 0")
            step_ms = None
        inputs = self._links(content, "inputs", "input", GIVEN)
        outputs = self._links(content, "outputs", "output", TAKEN)
        self._check_pose([link.value for link in outputs])
        constants, from_scenario = self._start(content)
        return Map(
            step_s=None if step_ms is None else step_ms / 1e3,
            inputs=inputs,
            outputs=outputs,
            constants=constants,
            from_scenario=from_scenario,
            signals=[
                Signal(link.value.removeprefix(SIGNAL), link.variable.unit, link.variable.about)
                for link in outputs
                if link.value.startswith(SIGNAL)
            ],
        )

    def _links(self, content: dict[str, Any], table: str, causality: str, values: Mapping[str, Quantity]) -> list[Link]:
        links = []
        for name, entry in self._table(content, table):
            entry = {"value": entry} if isinstance(entry, str) else entry
            variable = self._variable(table, name)
            if variable and variable.causality != causality:
                self._problem(f"{table}: '{name}' is no {causality} of the FMU, but {variable.causality}")
                continue
            if not isinstance(entry, dict) or not isinstance(entry.get("value"), str) or set(entry) - {"value", "unit"}:
                self._problem(f'{table}: \'{name}\': write a value of the rig, or {{ value = "…", unit = "…" }}')
                continue
            if link := self._link(table, name, variable, entry, values):
                links.append(link)
        return links

    def _link(
        self, table: str, name: str, variable: Variable | None, entry: dict[str, Any], values: Mapping[str, Quantity]
    ) -> Link | None:
        value = entry["value"]
        if table == "outputs" and value.startswith(SIGNAL):
            if "unit" in entry:
                self._problem(f"outputs: '{name}': a signal has the unit of the FMU's variable: leave 'unit' away")
            return Link(variable, value) if variable else None
        quantity = values.get(value)
        if quantity is None:
            self._unknown(f"{table}: '{name}': the value '{value}'", value, values)
            return None
        if variable is None:
            return None
        if variable.type not in FLOATS and quantity is not Quantity.COUNT:
            self._problem(f"{table}: '{name}' is of type {variable.type}: '{value}' needs a number with decimals")
        per_si = self._per_si(f"{table}: '{name}'", variable, entry.get("unit"), quantity)
        return None if per_si is None else Link(variable, value, per_si)

    def _per_si(self, place: str, variable: Variable, given: Any, quantity: Quantity) -> float | None:
        choice = ", ".join(unit for unit in quantity.value if unit)
        unit = variable.unit if given is None else given
        if given is not None and variable.unit and given != variable.unit:
            self._problem(f"{place}: the map says '{given}', the FMU '{variable.unit}': mend the one that is wrong")
        elif not unit and "" not in quantity.value:
            self._problem(f'{place}: the FMU states no unit: give one, such as unit = "m" ({choice})')
        elif unit not in quantity.value:
            self._problem(f"{place}: '{unit}' is no unit of this value: use {choice or 'none'}")
        else:
            return float(quantity.value[unit])
        return None

    def _check_pose(self, values: list[str]) -> None:
        for value in sorted({value for value in values if values.count(value) > 1}):
            self._problem(f"outputs: '{value}' has more than one output: leave all but one away")
        given = set(values) & set(TAKEN)
        if not given and not self.problems:
            self._problem(f"outputs: none is part of the pose: give at least one of {', '.join(TAKEN)}")
        turns = [{f"pose.{part.name}" for part in parts} for parts in (QUATERNION, ROTATION_VECTOR)]
        if any(given & turn and not turn <= given for turn in turns) or all(given & turn for turn in turns):
            names = " or ".join(", ".join(f"pose.{part.name}" for part in parts) for parts in (QUATERNION, ROTATION_VECTOR))
            self._problem(f"outputs: the rotation needs all of {names}, or nothing")

    def _start(self, content: dict[str, Any]) -> tuple[list[tuple[Variable, Any]], list[tuple[Variable, Parameter]]]:
        constants: list[tuple[Variable, Any]] = []
        from_scenario: list[tuple[Variable, Parameter]] = []
        for name, entry in self._table(content, "start"):
            variable = self._variable("start", name)
            if variable is None:
                continue
            if variable.variability == "constant" or variable.causality in ("independent", "calculatedParameter"):
                self._problem(f"start: '{name}' cannot be set: it is {variable.variability} {variable.causality}".rstrip())
            elif isinstance(entry, dict):
                if parameter := self._parameter(name, variable, entry):
                    from_scenario.append((variable, parameter))
            elif not _is_value(entry, variable.type):
                self._problem(f"start: '{name}' = {entry!r}: the FMU's variable is of type {variable.type}")
            else:
                constants.append((variable, entry))
        return constants, from_scenario

    def _parameter(self, name: str, variable: Variable, entry: dict[str, Any]) -> Parameter | None:
        of_scenario: Any = entry.get("parameter")
        value: Any = entry.get("value")
        limits: Any = entry.get("range")
        is_range = isinstance(limits, list) and len(limits) == 2 and all(map(_is_number, limits))
        if not isinstance(of_scenario, str) or not _is_number(value) or not is_range or len(entry) > 3:
            self._problem(f'start: \'{name}\': write a value, or {{ parameter = "NAME", value = 1.0, range = [0.0, 2.0] }}')
            return None
        if variable.type not in FLOATS:
            self._problem(f"start: '{name}' is of type {variable.type}: a parameter of the scenario has decimals")
            return None
        least, most = map(float, limits)
        return Parameter(of_scenario, float(value), (least, most), variable.unit, variable.about)

    def _table(self, content: dict[str, Any], name: str) -> Iterable[tuple[str, Any]]:
        table = content.get(name, {})
        if not isinstance(table, dict):
            self._problem(f"'{name}' is no table: write [{name}]")
            return []
        return table.items()

    def _variable(self, table: str, name: str) -> Variable | None:
        variable = self._known.get(name)
        if variable is None:
            self._unknown(f"{table}: the variable '{name}'", name, self._known)
        elif not variable.is_scalar:
            self._problem(f"{table}: '{name}' is an array: give the FMU a scalar for each element")
            return None
        elif variable.type in ("Binary", "Clock") or (variable.type == TEXT and table != "start"):
            self._problem(f"{table}: '{name}' is of type {variable.type}, which no value of the rig has")
            return None
        return variable

    def _unknown(self, what: str, name: str, known: Iterable[str]) -> None:
        nearest = difflib.get_close_matches(name, known := list(known), n=3)
        self._problem(f"{what} is unknown: {'nearest' if nearest else 'known'} is {', '.join(nearest or known[:12]) or 'none'}")

    def _problem(self, text: str) -> None:
        self.problems.append(text)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_value(value: Any, type_: str) -> bool:
    """Whether a value of TOML is one of an FMI type."""
    if type_ == "Boolean":
        return isinstance(value, bool)
    if type_ == TEXT:
        return isinstance(value, str)
    return _is_number(value) and (type_ in FLOATS or isinstance(value, int))
