"""Values over time with a bound: what is older gets coarser, what is recent stays whole."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Hashable, Iterator
from typing import Generic, TypeVar

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
        """Add a value; times that run back are taken for the last one."""
        self._times.append(max(time, self._times[-1]) if self._times else time)
        self._values.append(value)
        if len(self._times) > self._limit:
            half = self._limit // 2
            del self._times[1:half:2], self._values[1:half:2]

    def at(self, time: float) -> tuple[float, T] | None:
        """The last value at ``time`` or before, with its own time."""
        index = bisect_right(self._times, time) - 1
        return (self._times[index], self._values[index]) if index >= 0 else None

    @property
    def last(self) -> tuple[float, T] | None:
        """The newest value, with its time."""
        return (self._times[-1], self._values[-1]) if self._times else None


class Freshness(Generic[K]):
    """Which keys changed after a version: touching a key moves it to the end, so asking costs what it answers."""

    def __init__(self) -> None:
        self._versions: dict[K, int] = {}

    def touch(self, key: K, version: int) -> None:
        """Note that ``key`` changed; versions never run back."""
        self._versions.pop(key, None)
        self._versions[key] = version

    def since(self, version: int) -> list[K]:
        """The keys that changed after ``version``, the newest first."""
        changed = []
        for key, touched in reversed(self._versions.items()):
            if touched <= version:
                break
            changed.append(key)
        return changed
