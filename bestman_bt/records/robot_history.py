"""The base pose and the joints of the robot over time."""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from itertools import chain
from typing import Any, Generic, TypeVar

from bestman_bt.records.events import RobotEvent, ScanEvent

# Values over time with a bound: what is older gets coarser, what is recent stays whole.


T = TypeVar("T")
K = TypeVar("K", bound=Hashable)


class Samples(Generic[T]):
    """At most ``limit`` values, each with its time; beyond that every second one of the older half is dropped."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._times: list[float] = []
        self._values: list[T] = []

    def __len__(self) -> int:
        return len(self._times)

    def __iter__(self) -> Iterator[tuple[float, T]]:
        return zip(self._times, self._values, strict=True)

    def add(self, time: float, value: T) -> None:
        """Add a value; decreasing times are replaced by the last one."""
        self._times.append(max(time, self._times[-1]) if self._times else time)
        self._values.append(value)
        if len(self._times) > self._limit:
            half = self._limit // 2
            del self._times[1:half:2], self._values[1:half:2]

    def at(self, time: float) -> tuple[float, T] | None:
        """Return the last value at ``time`` or before, with its own time."""
        index = bisect_right(self._times, time) - 1
        return (self._times[index], self._values[index]) if index >= 0 else None

    @property
    def last(self) -> tuple[float, T] | None:
        """The newest value, with its time."""
        return (self._times[-1], self._values[-1]) if self._times else None


class Freshness(Generic[K]):
    """Keys in the order of their last change, so that a query of recent changes is cheap."""

    def __init__(self) -> None:
        self._versions: dict[K, int] = {}

    def touch(self, key: K, version: int) -> None:
        """Note that ``key`` changed; versions never run back."""
        self._versions.pop(key, None)
        self._versions[key] = version

    def since(self, version: int) -> list[K]:
        """Return the keys that changed after ``version``, the newest first."""
        changed = []
        for key, touched in reversed(self._versions.items()):
            if touched <= version:
                break
            changed.append(key)
        return changed


MAX_SAMPLES = 36_000
"""An hour at 10 a second; what is older gets coarser."""
MAX_SCANS = 1_800
MAX_POINTS = 2_000
"""Points of one scan that are kept."""
SERIES_POINTS = 1_500
"""Points of one joint's curve."""
PLAIN = ("base", "believed_std", "held", "diagnostics", "speed")
JOINT_VALUES = ("joints", "velocities", "efforts")


@dataclass(frozen=True)
class _Sample:
    """``names`` is shared by all samples with the same joints."""

    plain: dict[str, Any]
    names: dict[str, tuple[str, ...]]
    values: dict[str, array[float]]

    def document(self) -> dict[str, Any]:
        joints = {
            field: dict(zip(self.names[field], (round(value, 5) for value in values), strict=True))
            for field, values in self.values.items()
        }
        return {**self.plain, **joints}


class RobotHistory:
    """``version`` and ``scan_version``: of the newest sample."""

    def __init__(self) -> None:
        self.version = 0
        self.scan_version = 0
        self._samples: Samples[_Sample] = Samples(MAX_SAMPLES)
        self._scans: Samples[tuple[tuple[float, float, float], array[float]]] = Samples(MAX_SCANS)
        self._names: dict[str, tuple[str, ...]] = {}

    def take(self, event: RobotEvent, version: int) -> None:
        """Add a sample."""
        values, names = {}, {}
        for field in JOINT_VALUES:
            told: dict[str, float] | None = getattr(event, field)
            if told:
                mine = tuple(told)
                if self._names.get(field) != mine:
                    self._names[field] = mine
                names[field] = self._names[field]
                values[field] = array("f", told.values())
        plain = {field: getattr(event, field) for field in PLAIN if getattr(event, field) is not None}
        self._samples.add(event.time, _Sample(plain, names, values))
        self.version = version

    def take_scan(self, event: ScanEvent, version: int) -> None:
        """Add a scan."""
        stride = -(-len(event.points) // MAX_POINTS) or 1
        self._scans.add(event.time, (event.base, array("f", chain.from_iterable(event.points[::stride]))))
        self.scan_version = version

    def at(self, time: float) -> dict[str, Any] | None:
        """Return the newest sample at ``time`` or before, in the page's format."""
        found = self._samples.at(time)
        return None if found is None else {"time": found[0], **found[1].document()}

    def scan_at(self, time: float) -> dict[str, Any] | None:
        """Return the newest scan at ``time`` or before."""
        found = self._scans.at(time)
        if found is None:
            return None
        base, flat = found[1]
        values = [round(value, 3) for value in flat]
        return {
            "time": found[0],
            "base": base,
            "points": [list(pair) for pair in zip(values[::2], values[1::2], strict=True)],
        }

    def joint_names(self) -> list[str]:
        """Return the joints of the newest sample."""
        return list(self._names.get("joints", ()))

    def series(self, joints: list[str]) -> dict[str, list[list[float]]]:
        """joint → [[time, position], …], at most ``SERIES_POINTS`` each."""
        stride = -(-len(self._samples) // SERIES_POINTS) or 1
        curves: dict[str, list[list[float]]] = {name: [] for name in joints}
        for index, (time, sample) in enumerate(self._samples):
            if index % stride and index != len(self._samples) - 1:
                continue
            positions = dict(zip(sample.names.get("joints", ()), sample.values.get("joints", ()), strict=True))
            for name, curve in curves.items():
                if name in positions:
                    curve.append([round(time, 3), round(positions[name], 5)])
        return curves

    def driven(self, time: float) -> list[list[float]]:
        """Return the driven path of the base up to ``time``: [[x, y], …] metres, at most ``SERIES_POINTS``."""
        upto = [list(sample.plain["base"][:2]) for stamp, sample in self._samples if stamp <= time]
        return upto[:: -(-len(upto) // SERIES_POINTS) or 1]
