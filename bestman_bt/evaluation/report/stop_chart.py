"""Charts of a black box: set-points against measurements, around the moment of the stop."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.black_box import BlackBox, PartTrace

BEFORE = 5.0
"""Seconds drawn before the stop."""
WIDTH, HEIGHT = 360, 90
MOST_POINTS = 400
MOST_CURVES = 24
STILL = 0.003
"""Range within which a curve counts as constant, rad or m."""
SLOW = 0.02
"""The same for speeds, m/s and rad/s."""
PAIRS = (
    ("set position ", "measured position ", "rad"),
    ("set vx", "measured vx", "m/s"),
    ("set vy", "measured vy", "m/s"),
    ("set wz", "measured wz", "rad/s"),
    ("set width", "measured width", "m"),
)
"""Prefixes of the columns of set-points and of measurements, and their unit."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StopCurve:
    """SVG paths of WIDTH × HEIGHT, ``set`` and ``measured``; ``held``: spans (x, width) limited by the gate.

    ``low``, ``high``: ends of the axis. ``off``: the largest difference.
    """

    name: str
    unit: str
    set: str
    measured: str
    low: float
    high: float
    off: float
    held: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class StopChart:
    """One black box. ``stop_x``: position of the stop; ``still``: parts that did not move; ``gate``: its reasons."""

    file: str
    stopped_at: float
    reason: str
    before: float
    after: float
    stop_x: float
    curves: tuple[StopCurve, ...]
    still: tuple[str, ...]
    gate: tuple[str, ...]


def stop_chart(file: str, box: BlackBox) -> StopChart:
    """Draw the chart of a black box: velocities of the parts around the stop."""
    times = [part.times for part in box.parts.values() if len(part.times)]
    first = max(box.stopped_at - BEFORE, min((float(one[0]) for one in times), default=box.stopped_at))
    last = max((float(one[-1]) for one in times), default=box.stopped_at)
    last = max(last, box.stopped_at, first + 1e-3)
    curves, still = [], []
    for name, part in box.parts.items():
        for curve in _curves(name, part, first, last):
            if isinstance(curve, StopCurve):
                curves.append(curve)
            else:
                still.append(curve)
    gate = dict.fromkeys(
        f"{name}: {text}" for name, part in box.parts.items() for time, text in part.reasons if text and time >= first
    )
    stop_x = _x(np.array([box.stopped_at]), first, last)[0]
    before, after = box.stopped_at - first, last - box.stopped_at
    curves = curves[:MOST_CURVES]
    return StopChart(
        file, box.stopped_at, box.reason, before, after, float(stop_x), tuple(curves), tuple(still), tuple(gate)[:10]
    )


def _curves(name: str, part: PartTrace, first: float, last: float) -> Iterator[StopCurve | str]:
    """Yield the curves of moving joints, and the names of the others."""
    shown = part.times >= first
    times = part.times[shown]
    held = tuple(_held(part, first, last))
    for column in part.columns:
        pair = next((pair for pair in PAIRS if column.startswith(pair[0])), None)
        if pair is None:
            continue
        what = column.removeprefix(pair[0]) or column.removeprefix("set ")
        other = pair[1] + column.removeprefix(pair[0])
        if other not in part.columns or not len(times):
            continue
        asked = part.of(column)[shown].astype(float)
        did = part.of(other)[shown].astype(float)
        values = np.concatenate([asked, did])
        values = values[np.isfinite(values)]
        title = what if what.startswith(name) else f"{name} {what}"
        if not len(values) or float(np.ptp(values)) < (SLOW if pair[2].endswith("/s") else STILL):
            yield title
            continue
        low, high = float(values.min()), float(values.max())
        off = float(np.nanmax(np.abs(asked - did)))
        set_path, measured = (_path(times, curve, (first, last), (low, high)) for curve in (asked, did))
        yield StopCurve(title, pair[2], set_path, measured, low, high, off, held)


def _held(part: PartTrace, first: float, last: float) -> Iterator[tuple[float, float]]:
    """Yield the intervals in which the gate limited set-points."""
    ends = [*(time for time, _ in part.reasons[1:]), last]
    for (time, text), end in zip(part.reasons, ends, strict=False):
        if text and end > first:
            left, right = _x(np.array([max(time, first), end]), first, last)
            yield round(float(left), 1), round(max(float(right - left), 1.0), 1)


def _x(times: Array, first: float, last: float) -> Array:
    place: Array = (times - first) / (last - first) * WIDTH
    return place


def _path(times: Array, values: Array, span: tuple[float, float], room: tuple[float, float]) -> str:
    if len(times) > MOST_POINTS:
        taken = np.linspace(0, len(times) - 1, MOST_POINTS).astype(int)
        times, values = times[taken], values[taken]
    known = np.isfinite(values)
    x = _x(times[known], *span)
    y = HEIGHT - 4 - (values[known] - room[0]) / (room[1] - room[0]) * (HEIGHT - 8)
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
