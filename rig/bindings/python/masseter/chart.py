"""A run as a piece of a notebook: verdict, what did not pass, and three charts. The whole report is report.html in the run folder."""

from collections.abc import Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

from masseter.messages import ControllerState
from masseter.recording import Run

Array = NDArray[np.float64]

#: Points that a chart has at most: two for each pixel.
_MOST_POINTS = 800
_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM = 420, 150, 48, 8, 22, 22
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")


def page(verdict: str, reason: str, not_passed: Sequence[tuple[str, str, str]], run: Run) -> str:
    """The verdict with its reason, a row for each check that did not pass, and the charts of the motion."""
    rows = "".join("<tr>" + "".join(f"<td>{escape(text)}</td>" for text in row) + "</tr>" for row in not_passed)
    charts = "".join(_charts(run))
    return f"<div><b>{escape(verdict)}</b> {escape(reason)}<table>{rows}</table>{charts}</div>"


def _charts(run: Run) -> list[str]:
    state = run.state[run.state["controller_state"] == ControllerState.RUNNING]
    _, of_state, of_truth = np.intersect1d(state["cycle"], run.truth["cycle"], return_indices=True)
    if not of_state.size:
        return []
    state, truth = state[of_state], run.truth[of_truth]
    time_s = (state["cycle"] - state["cycle"][0]) / run.scenario["rate_hz"]
    error_mm = 1e3 * np.linalg.norm(truth["position_m"] - state["desired_position_m"], axis=1)
    targets = run.command[np.isin(run.command["cycle"], state["cycle"])]
    axes = [1e3 * (targets["target_m"][:, axis] - targets["target_m"][0, axis]) for axis in range(6)]
    places = [1e3 * (truth["position_m"][:, axis] - truth["position_m"][0, axis]) for axis in range(3)]
    return [
        _chart("Distance of the platform from its desired place, mm", time_s, [error_mm], [""]),
        _chart("Platform from its place at the start, mm", time_s, places, ["x", "y", "z"]),
        _chart("Targets from the start, mm", time_s[: len(targets)], axes, ["d1", "d2", "d3", "l1", "l2", "l3"]),
    ]


def _chart(title: str, time_s: Array, lines: Sequence[Array], names: Sequence[str]) -> str:
    low, high = min(float(line.min()) for line in lines), max(float(line.max()) for line in lines)
    high = high if high > low else low + 1
    across = (_WIDTH - _LEFT - _RIGHT) / max(float(time_s[-1] - time_s[0]), 1e-9)
    up = (_HEIGHT - _TOP - _BOTTOM) / (high - low)
    drawn = "".join(_line(time_s, line, across, up, low, colour) for line, colour in zip(lines, _COLOURS, strict=False))
    legend = "".join(
        f'<tspan fill="{colour}" dx="6">{name}</tspan>' for name, colour in zip(names, _COLOURS, strict=False)
    )
    labels = (
        f'<text x="{_LEFT}" y="13">{escape(title)}{legend}</text>'
        f'<text x="{_LEFT - 4}" y="{_TOP + 8}" text-anchor="end">{high:.3g}</text>'
        f'<text x="{_LEFT - 4}" y="{_HEIGHT - _BOTTOM}" text-anchor="end">{low:.3g}</text>'
        f'<text x="{_LEFT}" y="{_HEIGHT - 6}">{time_s[0]:.2f} s</text>'
        f'<text x="{_WIDTH - _RIGHT}" y="{_HEIGHT - 6}" text-anchor="end">{time_s[-1]:.2f} s</text>'
    )
    frame = f'<path d="M{_LEFT} {_TOP}V{_HEIGHT - _BOTTOM}H{_WIDTH - _RIGHT}" fill="none" stroke="gray"/>'
    style = 'font-family="sans-serif" font-size="11" fill="currentColor"'
    return f'<svg width="{_WIDTH}" height="{_HEIGHT}" role="img" aria-label="{escape(title)}" {style}>{frame}{labels}{drawn}</svg>'


def _line(time_s: Array, values: Array, across: float, up: float, low: float, colour: str) -> str:
    """The line with the smallest and largest value of each interval, so that no peak is left out."""
    size = -(-len(values) // (_MOST_POINTS // 2))
    starts = np.arange(0, len(values), size)
    ends = np.minimum(starts + size, len(values))
    extremes = [
        starts + [int(extreme(values[start:end])) for start, end in zip(starts, ends, strict=True)]
        for extreme in (np.argmin, np.argmax)
    ]
    chosen = np.unique(np.concatenate(extremes))
    x = _LEFT + across * (time_s[chosen] - time_s[0])
    y = _HEIGHT - _BOTTOM - up * (values[chosen] - low)
    points = " ".join(f"{at_x:.1f},{at_y:.1f}" for at_x, at_y in zip(x, y, strict=True))
    return f'<polyline points="{points}" fill="none" stroke="{colour}"/>'
