"""What a run has left: arrays of its messages, its figures and its circumstances."""

import json
import tomllib
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from masseter import _native, messages

if TYPE_CHECKING:
    import pandas
    import polars

Messages = NDArray[np.void]

_LAYOUTS = {
    layout.TOPIC: layout
    for layout in (
        messages.Reading,
        messages.Command,
        messages.State,
        messages.Event,
        messages.Truth,
        messages.Contact,
    )
}


@dataclass(frozen=True)
class Run:
    """A run. Arrays have one row a message and one field a value, whose name ends with its unit."""

    folder: Path
    reading: Messages
    command: Messages
    state: Messages
    event: Messages
    truth: Messages
    #: Forces on the teeth of the emulated jaw; empty without `[teeth]` and food.
    contact: Messages
    #: A field for each signal that the controller declared.
    signal: Messages
    #: A field for each parameter, with a row at the start and one for each change.
    parameter: Messages
    #: Whether the whole recording could be read.
    is_whole: bool
    scenario: dict[str, Any]
    manifest: dict[str, Any]
    #: Verdict and figures; empty for a run that was never judged.
    summary: dict[str, Any]

    def columns(self, topic: str) -> dict[str, NDArray[Any]]:
        """The values of a topic by column; a value of several numbers has a column each, such as position_m_0."""
        rows: Messages = getattr(self, topic)
        columns: dict[str, NDArray[Any]] = {}
        for name in rows.dtype.names or ():
            values = rows[name]
            if values.ndim == 1:
                columns[name] = values
            else:
                columns |= {f"{name}_{index}": values[:, index] for index in range(values.shape[1])}
        return columns

    def to_polars(self, topic: str) -> "polars.DataFrame":
        """A topic as a table of Polars."""
        import polars

        return polars.DataFrame(self.columns(topic))

    def to_pandas(self, topic: str) -> "pandas.DataFrame":
        """A topic as a table of pandas."""
        import pandas

        return pandas.DataFrame(self.columns(topic))


def load(run: str | PathLike[str]) -> Run:
    """The run of this folder, of the recording.mcap in it, or of a link to either.

    Raises MasseterError where there is no run, or the recording cannot be read.
    """
    found, topics, is_whole = _native.read_run(run)
    folder = Path(found)
    manifest = json.loads((folder / "manifest.json").read_text())
    declared = manifest.get("declared", {})
    layouts = {name: np.dtype(layout) for name, layout in _LAYOUTS.items()}
    layouts |= {topic: _named(declared.get(f"{topic}s", [])) for topic in ("signal", "parameter")}
    arrays = {name: np.frombuffer(data, dtype=layouts[name]) for name, data in topics.items()}
    return Run(
        folder=folder,
        is_whole=is_whole,
        scenario=tomllib.loads((folder / "scenario.toml").read_text()),
        manifest=manifest,
        summary=read_summary(folder),
        **arrays,
    )


def _named(declared: list[dict[str, Any]]) -> np.dtype[Any]:
    """The layout of a message with a field for each declared name."""
    before = ["seq", "published_ns", "version", "cycle"]
    names = [named["name"] for named in declared]
    # The number of values, a length of CDR, takes eight bytes with what aligns the first of them.
    offsets = [8 * place for place in range(len(before))] + [8 * (len(before) + 1 + place) for place in range(len(names))]
    return np.dtype(
        {
            "names": before + names,
            "formats": [np.uint64] * len(before) + [np.float64] * len(names),
            "offsets": offsets,
            "itemsize": 8 * (len(before) + 1 + len(names)),
        }
    )


def read_summary(folder: Path) -> dict[str, Any]:
    """Verdict and figures of the run in this folder; empty if it was never judged."""
    path = folder / "summary.json"
    if not path.is_file():
        return {}
    summary: dict[str, Any] = json.loads(path.read_text())
    return summary
